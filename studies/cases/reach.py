"""Random legs, drawn and pressed, each kept as soon as it is done."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.documents import markdown_table
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainIndentation, Tissues
from legfem.geometry.contours import check_section
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection, depth_to_bone, outward_normals
from legfem.legs.typical import AROUND, bone_outline, oval, skin_of
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.solve.newton import RELAXED
from legfem.solve.path import ForceCurve
from studies.cases.machine import Kind
from studies.cases.outcomes import Rate
from studies.counting import Work, counted

LENGTH_MM, RADII_MM = 50.0, (7.5, 20.0)
"""Of the cylinder."""
DEEPEST_MM, SHARE = 30.0, 0.8
_TRIES = 400


@dataclass(frozen=True)
class DrawnLeg:
    """The numbers of one leg that a reader can judge; its shape is drawn with the same seed."""

    number: int
    seed: int
    girth_mm: float
    fat_mm: float
    """Mean thickness."""
    fascia_mm: float
    C10_kPa: float
    C20_kPa: float
    fat_kPa: float
    fascia_kPa: float
    D1_per_MPa: float
    outer_D1_per_MPa: float
    """Of fat and fascia."""
    direction_deg: float
    depth_mm: float
    radius_mm: float
    """Of the cylinder."""


def drawn_leg(number: int, seed: int) -> tuple[DrawnLeg, PlaneStrainIndentation]:
    """Draw a leg with its test: girth 250-450 mm, fat 1-25 mm, C10 0.05-10 kPa and so on.

    Stiffness and the fascia's thickness are uniform in their logarithms, all else evenly. A third
    of the legs are neo-Hookean. Where no bones fit the hull, all is drawn again.
    """
    generator = np.random.default_rng([seed, number])
    even = generator.uniform

    def logarithmic(low: float, high: float) -> float:
        return math.exp(even(math.log(low), math.log(high)))

    for _ in range(_TRIES):
        girth, fat, fascia = even(250, 450), even(1, 25), logarithmic(0.2, 1.5)
        C10, outer = logarithmic(0.05, 10), (logarithmic(0.5, 20), logarithmic(10, 1e4))
        C20 = C10 * even(0, 4) if generator.random() > 1 / 3 else 0.0
        D1, outer_D1, direction = even(5, 60), even(5, 60), even(0, 360)
        try:
            section = _section(generator, girth, fat, fascia)
        except InputError:
            continue
        centre = section.skin.mean(axis=0) + generator.normal(0.0, 4.0, 2)
        indenter = Indenter(even(*RADII_MM), LENGTH_MM, centre, direction)
        depth = min(DEEPEST_MM, SHARE * depth_to_bone(section, centre, indenter.direction))
        stiffness = C10, C20, *outer, D1, outer_D1
        leg = DrawnLeg(number, seed, girth, fat, fascia, *stiffness, direction, depth, indenter.radius)
        return leg, PlaneStrainIndentation(section, indenter, _tissues(leg))
    raise InputError("--seed", f"{seed}", f"leg {number} can't be drawn", "give another seed")


def _tissues(leg: DrawnLeg) -> Tissues:
    D2 = leg.D1_per_MPa if leg.C20_kPa > 0 else math.inf
    return Tissues(
        deep=ReducedPolynomial(C10=1e-3 * leg.C10_kPa, D1=leg.D1_per_MPa, C20=1e-3 * leg.C20_kPa, D2=D2),
        superficial=NeoHookean(1e-3 * leg.fat_kPa, leg.outer_D1_per_MPa),
        fascia=NeoHookean(1e-3 * leg.fascia_kPa, leg.outer_D1_per_MPa),
    )


def drawn_layers(
    generator: np.random.Generator, girth: float, fat: float, aspect: tuple[float, float] = (0.85, 1.15)
) -> tuple[FloatArray, FloatArray]:
    """Return outlines of skin and fascia of a drawn shape; girth and mean fat in mm, width over depth drawn evenly."""
    even = generator.uniform
    skin, _ = skin_of(girth, oval(AROUND, even(*aspect), even(0.0, 0.08), even(-0.04, 0.04)))
    uneven = even(0.0, 0.4) * np.cos(AROUND - even(0, 2 * np.pi))
    return skin, skin - (fat * (1 + uneven))[:, None] * outward_normals(skin)


def bone_within(
    hull: FloatArray, share: float, lobe: float, lobes: int, way: float, far: float, turn: float
) -> FloatArray:
    """Return a bone's outline at an angle within a hull; its radius and distance are shares of the room in there."""
    middle = hull.mean(axis=0)
    room = float(np.linalg.norm(hull - middle, axis=1).min())
    x, y = middle + far * room * np.array([np.cos(way), np.sin(way)])
    return bone_outline(share * room, (float(x), float(y)), lobe, lobes, turn)


def _section(generator: np.random.Generator, girth: float, fat: float, fascia: float) -> LegSection:
    """Return contours drawn; raise InputError where they cross."""
    even = generator.uniform
    skin, hull = drawn_layers(generator, girth, fat)
    front = np.pi / 2 + even(-0.5, 0.5)
    shape = even(0.22, 0.34), even(0.0, 0.3), 3
    tibia = bone_within(hull, *shape, front, even(0.2, 0.55), even(0, 2 * np.pi))
    side = 1 if generator.random() < 0.5 else -1
    shape = even(0.1, 0.17), 0.1, 2
    fibula = bone_within(hull, *shape, front + side * even(1.2, 2.0), even(0.4, 0.7), even(0, 2 * np.pi))
    section = LegSection(skin, hull, {"tibia": tibia, "fibula": fibula}, fascia)
    check_section(section, "drawn leg")
    return section


COUNTED = "factorisations", "iterations", "residuals"
NO_WORK = Work(dict.fromkeys(COUNTED, 0), 0.0, {})
FROM_MM = 1.0
"""Where curves are compared from: below, forces are small and the contact's first nodes close."""
FINER_STEPS, EVERY = 40, 10
"""Finer steps to the depth, and of how many legs one is pressed by them, too."""


@dataclass(frozen=True)
class ReachTask:
    """One leg to press."""

    number: int
    seed: int


@dataclass(frozen=True)
class Reached:
    """How far a leg could be pressed."""

    leg: DrawnLeg
    complete: bool
    reached_mm: float
    reason: str
    attempts: int
    jumps: int
    """Steps at which the body crept to another equilibrium."""
    steps: int
    work: Work = NO_WORK
    between: float | None = None
    """Greatest difference of the curve from that of finer steps, relative to the latter."""
    at_steps: float | None = None
    """The same at the curve's own steps, where the spline has no part in it."""


def press_drawn(folder: Path, task: ReachTask) -> Reached:
    """Press one leg to its depth."""
    leg, test = drawn_leg(task.number, task.seed)
    try:
        solved, work = counted(lambda: test.solve({}, leg.depth_mm))
    except InputError as error:
        return Reached(leg, False, 0.0, str(error), 0, 0, 0)
    report = solved.report
    between = at_steps = None
    compared = task.number % EVERY == 0 and report.complete and not report.earlier_attempts
    if compared and (finer := _finer_curve(test, leg.depth_mm)):
        between, at_steps = differences(solved.curve, finer)
    gone = [step for step in report.steps if step.converged]
    jumps, attempts = sum(step.reason == RELAXED for step in gone), 1 + len(report.earlier_attempts)
    ended = report.complete, report.reached, report.reason, attempts, jumps, len(gone)
    return Reached(leg, *ended, work, between, at_steps)


def differences(curve: ForceCurve, finer: ForceCurve) -> tuple[float, float]:
    """Return the greatest relative difference at the finer steps, and at the curve's own."""

    def greatest(at: np.ndarray) -> float:
        at = at[at >= min(FROM_MM, 0.5 * curve.depth)]
        return float(np.abs(curve(at) / finer(at) - 1).max())

    return greatest(finer.displacement), greatest(curve.displacement)


def _finer_curve(test: PlaneStrainIndentation, depth: float) -> ForceCurve | None:
    """Return the curve of steps of a fortieth of the depth at most; None where one fails."""
    usual = test.settings.steps
    steps = replace(usual, largest=min(0.4, depth / FINER_STEPS), curve_tolerance=math.inf)
    finer = replace(test, settings=replace(test.settings, steps=steps, defences=False))
    solved = finer.solve({}, depth)
    return solved.curve if solved.report.complete else None


def tasks(number: int, seed: int) -> list[ReachTask]:
    """Return legs to press, every tenth with finer steps too."""
    return [ReachTask(k, seed) for k in range(number)]


def _line(task: ReachTask, outcome: Reached) -> str:
    end = "reached" if outcome.complete else f"{outcome.reached_mm:.1f} mm"
    return f"leg {task.number}: {end} ({outcome.work.seconds:.0f} s)"


WITHIN = 0.003


def page(outcomes: Sequence[Reached]) -> str:
    """Return what was reached, what not and why, and how good the curves are."""
    between = [outcome.between for outcome in outcomes if outcome.between is not None]
    at_steps = [outcome.at_steps for outcome in outcomes if outcome.at_steps is not None]
    reached = [outcome for outcome in outcomes if outcome.complete]
    rows = [
        ["reached their depth", str(Rate(len(reached), len(outcomes)))],
        ["of them at the first attempt", f"{sum(o.attempts == 1 for o in reached)}"],
        ["of them with a jump to another equilibrium", f"{sum(o.jumps > 0 for o in reached)}"],
        [
            "curve within 0.3 % of finer steps, of those compared",
            f"{Rate(sum(e <= WITHIN for e in between), len(between))}",
        ],
        ["greatest difference", _percent(between)],
        ["greatest difference at the curve's own steps", _percent(at_steps)],
    ]
    text = markdown_table(["simulated legs", ""], rows) + "\n" + _work_table(outcomes)
    stopped = [
        [str(o.leg.number), f"{o.reached_mm:.2f}", _described(o.leg), o.reason] for o in outcomes if not o.complete
    ]
    heads = ["leg that stops short", "at (mm)", "what it is", "why"]
    return text + ("\n" + markdown_table(heads, stopped) if stopped else "")


def _work_table(outcomes: Sequence[Reached]) -> str:
    each = [{"steps": one.steps, **one.work.counts, "seconds": one.work.seconds} for one in outcomes]
    rows = [
        [name, *(f"{np.quantile([one[name] for one in each], share):.3g}" for share in (0.5, 0.9, 1.0))]
        for name in ("steps", *COUNTED, "seconds")
    ]
    return markdown_table(["of a leg", "median", "90 % have at most", "most"], rows)


def _percent(errors: Sequence[float]) -> str:
    return f"{100 * max(errors):.2f} %" if errors else "none compared"


def _described(leg: DrawnLeg) -> str:
    return (
        f"{leg.depth_mm:.1f} mm asked for, C10 {leg.C10_kPa:.2g}, C20 {leg.C20_kPa:.2g}, "
        f"fat {leg.fat_kPa:.2g}, fascia {leg.fascia_kPa:.2g} kPa of {leg.fascia_mm:.2g} mm"
    )


KIND = Kind(
    "random legs pressed to 30 mm, or to 80 % of the way to the bone", 200, tasks, press_drawn, Reached, _line, page
)
