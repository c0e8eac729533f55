"""Limbs that are no calf: shapes, stiffness and a lab's errors drawn, pressed by another code, and identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

import numpy as np

from legfem.common.documents import markdown_table
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import check_section
from legfem.geometry.section import LegSection, across, depth_to_bone, fat_thickness, girth
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.settings import SearchRequest
from legfem.legs.identification import fit_leg
from legfem.legs.subject import TYPICAL_ACCURACY
from legfem.legs.typical import TYPICAL_LIMBS, typical_section
from studies.cases.machine import Kind
from studies.cases.outcomes import Interval, Rate
from studies.cases.reach import bone_within, drawn_layers
from studies.making.plane_leg import OtherCase
from studies.making.pressed_legs import stated_leg, true_force
from studies.making.recording import loading, record
from studies.making.stated import drawn_errors, drawn_misstatement, misstated

type Ends = tuple[float, float]
"""Between which something is drawn evenly."""


@dataclass(frozen=True)
class Limb:
    """What a limb's numbers are drawn from; its bones by their radius and distance over the room, and their angle.

    Without fat it is a pad alone; without bones it lies on a plate that faces the cylinder.
    """

    girth_mm: Ends
    fat_mm: Ends
    bones: Mapping[str, tuple[Ends, Ends, Ends]] = field(default_factory=dict)
    c10_kPa: Ends = (0.4, 4.0)
    """Evenly in its logarithm."""
    travel: Ends = (0, 360)
    aspect: Ends = (0.85, 1.15)
    """Width over depth."""
    tape: str = ""
    """The typical limb that a lab takes, with the girth and the fat's thickness alone; else it has outlines."""


LIMBS = {
    "thigh": Limb((420, 620), (6, 25), {"femur": ((0.15, 0.22), (0.0, 0.25), (-90, 270))}),
    "forearm": Limb(
        (200, 280),
        (2.5, 8),
        {"radius": ((0.13, 0.18), (0.4, 0.55), (155, 205)), "ulna": ((0.13, 0.18), (0.4, 0.55), (-25, 25))},
    ),
    "residual limb": Limb(
        (260, 380),
        (4, 14),
        {"tibia": ((0.2, 0.3), (0.2, 0.4), (70, 110)), "fibula": ((0.1, 0.16), (0.45, 0.65), (-25, 25))},
    ),
    "heel pad": Limb((190, 250), (0, 0), {"calcaneus": ((0.45, 0.55), (0.05, 0.2), (60, 120))}, (1.0, 10.0), (65, 115)),
    "soft end": Limb((220, 340), (4, 12)),
    "upper arm": Limb((240, 380), (3, 12), {"humerus": ((0.19, 0.28), (0.0, 0.25), (-90, 270))}),
}
PEOPLE = {
    "thigh": Limb(
        (420, 620), (6, 25), {"femur": ((0.18, 0.26), (0.12, 0.4), (50, 130))}, travel=(255, 285), aspect=(0.95, 1.15)
    ),
    "forearm": replace(LIMBS["forearm"], travel=(255, 285), aspect=(1.15, 1.4)),
    "upper arm": replace(
        LIMBS["upper arm"], bones={"humerus": ((0.24, 0.34), (0.0, 0.25), (-90, 270))}, travel=(255, 285)
    ),
    "residual limb": replace(LIMBS["residual limb"], travel=(75, 105)),
    "heel pad": replace(LIMBS["heel pad"], travel=(75, 105)),
}
"""Limbs that a tape is laid around: shaped, and their bones as deep, as people's are (MULTIS)."""
LIMBS |= {f"{name} by tape": replace(limb, tape=name) for name, limb in PEOPLE.items()}
TAPE_SHARE, FAT_MM = 0.012, 0.8
"""Standard deviations of a girth by tape, over it, and of the fat's thickness by ultrasound."""
DEEPEST_MM, LEAST_MM, OF_WAY = 12.0, 4.0, 0.5
"""Greatest and least depth, and greatest share of the way to the bone."""
FASCIA_MM, FAT_KPA, RATE_MM_PER_S, TRIALS = (0.4, 1.0), 2.0, 0.5, 3


@dataclass(frozen=True)
class Plant:
    """What is planted; its shape and errors are drawn with the same seed."""

    limb: str
    number: int
    seed: int


@dataclass(frozen=True)
class FoundLimb:
    """What was found of one limb."""

    plant: Plant
    c10_kPa: float
    found: Interval
    fits: bool
    depth_mm: float


def plants(number: int, seed: int) -> list[Plant]:
    """Return as many plants of each limb."""
    return [Plant(limb, k, seed) for k in range(number) for limb in LIMBS]


def _section(limb: Limb, travel: FloatArray, generator: np.random.Generator) -> LegSection:
    even = generator.uniform
    skin, hull = drawn_layers(generator, even(*limb.girth_mm), even(*limb.fat_mm), limb.aspect)
    bones = dict[str, FloatArray]()
    for name, (size, far, way) in limb.bones.items():
        at = np.radians(even(*way)), even(*far)
        bones[name] = bone_within(hull, even(*size), even(0.0, 0.3), 3, *at, even(0, 2 * np.pi))
    fascia = even(*FASCIA_MM) if limb.fat_mm[1] else 0.0
    section = LegSection.of_parts({"skin": skin, "fascia": hull, **bones}, fascia)
    if bones:
        return section
    middle = hull.mean(axis=0)
    face = middle + 0.9 * float(((skin - middle) @ travel).max()) * travel
    return replace(section, support=np.array([face, face + across(travel)]))


def identified(folder: Path, plant: Plant) -> FoundLimb:
    """Draw a limb that can be pressed, record it by another code, and identify it from what a lab states of it."""
    limb, generator = LIMBS[plant.limb], np.random.default_rng([plant.seed, plant.number, *plant.limb.encode()])
    for _ in count():
        direction = generator.uniform(*limb.travel)
        travel = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
        section = _section(limb, travel, generator)
        usual = stated_leg(plant.limb, section, section.skin.mean(axis=0), direction, FAT_KPA)
        try:
            check_section(section, "drawn limb")
            drawn = misstated(usual, drawn_misstatement(generator), generator)
        except (InputError, ValueError):
            continue
        way = depth_to_bone(section, usual.indenter.aim, usual.indenter.direction)
        if (depth := min(DEEPEST_MM, OF_WAY * way)) >= LEAST_MM:
            break
    c10 = float(np.exp(generator.uniform(*np.log(limb.c10_kPa))))
    curve = true_force(replace(usual, tissues=drawn.tissues), OtherCase(c10), depth, LEAST_MM)
    course = loading(curve, curve.depth, RATE_MM_PER_S)
    trials = record([course] * TRIALS, drawn_errors(generator), generator)
    stated = replace(drawn, tissues=usual.tissues, recordings=tuple(trials))
    if limb.tape:
        fat = fat_thickness(section, usual.indenter.aim, usual.indenter.direction) + generator.normal(0, FAT_MM)
        section = typical_section(
            limb.tape, girth(section) * generator.normal(1, TAPE_SHARE), max(fat, 2.0), section.fascia_thickness
        )
        middle = replace(stated.indenter, aim=np.zeros(2), direction_deg=TYPICAL_LIMBS[limb.tape].direction_deg)
        stated = replace(stated, section=section, indenter=middle, typical_shape=limb.tape, accuracy=TYPICAL_ACCURACY)
    kept = SearchRequest(out=folder / "solves" / f"{plant.limb}-{plant.number}")
    (fit,) = fit_leg(stated, ("neo-hookean",), kept)
    return FoundLimb(plant, c10, Interval.of(fit.estimates[DEEP_C10]), fit.goodness.fits, curve.depth)


def page(found: Sequence[FoundLimb]) -> str:
    """Return how many of each limb were held."""
    rows = []
    for limb in LIMBS:
        if own := [one for one in found if one.plant.limb == limb]:
            off = [one.found.value / one.c10_kPa - 1 for one in own]
            held = Rate(sum(one.found.covers(one.c10_kPa) for one in own), len(own))
            width = np.median([one.found.high / one.found.low for one in own])
            most = f"{100 * np.median(np.abs(off)):.0f} (at most {100 * max(map(abs, off)):.0f})"
            rows.append([limb, str(held), most, f"{width:.2f}", f"{sum(one.fits for one in own)}/{len(own)}"])
    head = ["limb", "95 % interval holds C10", "off by (%), median", "high over low end, median", "law said to fit"]
    return f"{markdown_table(head, rows)}\nSimulated data.\n"


def _line(plant: Plant, one: FoundLimb) -> str:
    return f"{plant.limb} {plant.number}: C10 {one.c10_kPa:.3g}, found {one.found.ends(one.c10_kPa)} kPa"


KIND = Kind("limbs that are no calf, so many of each", 20, plants, identified, FoundLimb, _line, page)
