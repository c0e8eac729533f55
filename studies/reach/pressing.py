"""Pressing drawn legs, each kept as soon as it is done."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.progress import Progress
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.solve.newton import RELAXED
from legfem.solve.path import ForceCurve
from studies.reach.drawn_leg import DrawnLeg, drawn_leg

MODULES = ("studies.reach.pressing",)
FROM_MM = 1.0
"""Where curves are compared from: below, forces are small and the contact's first nodes close."""
FINER_STEPS = 40


@dataclass(frozen=True)
class ReachTask:
    """One leg to press."""

    number: int
    seed: int
    compare: bool
    """Whether the curve is compared with one of finer steps."""


@dataclass(frozen=True)
class Reached:
    """How far a leg could be pressed."""

    leg: DrawnLeg | None
    """None for one that can't be meshed."""
    complete: bool
    reached_mm: float
    reason: str
    attempts: int
    jumps: int
    """Steps at which the body crept to another equilibrium."""
    steps: int
    factorisations: int
    seconds: float
    """Of a processor."""
    between: float | None = None
    """Greatest difference of the curve from that of finer steps, relative to the latter."""
    at_steps: float | None = None
    """The same at the curve's own steps, where the spline has no part in it."""


def press_drawn(context: None, task: ReachTask) -> Reached:
    """Press one leg to its depth."""
    begun = time.process_time()
    leg, test = drawn_leg(task.number, task.seed)
    try:
        solved = test.solve({}, leg.depth_mm)
    except InputError as error:
        return Reached(None, False, 0.0, str(error), 0, 0, 0, 0, time.process_time() - begun)
    report = solved.report
    between = at_steps = None
    if task.compare and report.complete and not report.earlier_attempts:
        finer = _finer_curve(test, leg.depth_mm)
        if finer is not None:
            between, at_steps = differences(solved.curve, finer)
    return Reached(
        leg,
        report.complete,
        report.reached,
        report.reason,
        1 + len(report.earlier_attempts),
        sum(step.accepted and step.reason == RELAXED for step in report.steps),
        sum(step.accepted for step in report.steps),
        report.factorisations,
        time.process_time() - begun,
        between,
        at_steps,
    )


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


def press_all(tasks: list[ReachTask], out: Path, jobs: int, progress: Progress) -> list[tuple[ReachTask, Reached]]:
    """Press the legs that aren't kept yet; return all."""
    store = Store(out / "kept", Reached, "reach", MODULES)
    left = [task for task in tasks if store.get(task) is None]
    progress.stage(f"legs ({len(tasks) - len(left)} known)", len(left))
    with Workers(press_drawn, None, jobs) as workers:
        for task, outcome in workers.run(left):
            store.put(task, outcome)
            end = "reached" if outcome.complete else f"{outcome.reached_mm:.1f} mm"
            progress.advance(f"leg {task.number}: {end} ({outcome.seconds:.0f} s)")
    found = [(task, store.get(task)) for task in tasks]
    return [(task, outcome) for task, outcome in found if outcome is not None]
