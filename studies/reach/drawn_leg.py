"""Random legs: any size, shape and stiffness that a leg in plane strain may be given with."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainIndentation, Tissues
from legfem.geometry.contours import check_section
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection, depth_to_bone
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from studies.legs.calf import bone_outline, outward_normals, oval

RADIUS_MM, LENGTH_MM, DEEPEST_MM, SHARE = 15.0, 50.0, 30.0, 0.8
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


def drawn_leg(number: int, seed: int) -> tuple[DrawnLeg, PlaneStrainIndentation]:
    """Draw a leg with its test: girth 250-450 mm, fat 1-25 mm, C10 0.05-10 kPa and so on.

    Stiffness and the fascia's thickness are uniform in their logarithms, all else evenly. A third
    of the legs are neo-Hookean. Where no bones fit the hull, all is drawn again.
    """
    generator = np.random.default_rng([seed, number])

    def even(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    def logarithmic(low: float, high: float) -> float:
        return math.exp(even(math.log(low), math.log(high)))

    for _ in range(_TRIES):
        girth, fat, fascia = even(250, 450), even(1, 25), logarithmic(0.2, 1.5)
        C10, outer = logarithmic(0.05, 10), (logarithmic(0.5, 20), logarithmic(10, 1e4))
        C20 = C10 * even(0, 4) if generator.random() > 1 / 3 else 0.0
        D1, outer_D1, direction = even(5, 60), even(5, 60), even(0, 360)
        section = _section(generator, girth, fat, fascia)
        if section is None:
            continue
        centre = section.skin.mean(axis=0) + generator.normal(0.0, 4.0, 2)
        indenter = Indenter(RADIUS_MM, LENGTH_MM, centre, direction)
        to_bone = depth_to_bone(section, centre, indenter.direction)
        leg = DrawnLeg(
            number,
            seed,
            girth,
            fat,
            fascia,
            C10,
            C20,
            *outer,
            D1,
            outer_D1,
            direction,
            min(DEEPEST_MM, SHARE * to_bone),
        )
        return leg, PlaneStrainIndentation(section, indenter, _tissues(leg))
    raise InputError("--seed", f"{seed}", f"leg {number} can't be drawn", "give another seed")


def _tissues(leg: DrawnLeg) -> Tissues:
    D2 = leg.D1_per_MPa if leg.C20_kPa > 0 else math.inf
    return Tissues(
        deep=ReducedPolynomial(C10=1e-3 * leg.C10_kPa, D1=leg.D1_per_MPa, C20=1e-3 * leg.C20_kPa, D2=D2),
        superficial=NeoHookean(1e-3 * leg.fat_kPa, leg.outer_D1_per_MPa),
        fascia=NeoHookean(1e-3 * leg.fascia_kPa, leg.outer_D1_per_MPa),
    )


def _section(generator: np.random.Generator, girth: float, fat: float, fascia: float) -> LegSection | None:
    """Return contours drawn, or None where they cross."""

    def even(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    angle = 2 * np.pi * np.arange(240) / 240
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = oval(angle, even(0.85, 1.15), even(0.0, 0.08), even(-0.04, 0.04))
    outline = reach[:, None] * unit
    skin = outline * girth / np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1).sum()
    uneven = even(0.0, 0.4) * np.cos(angle - even(0, 2 * np.pi))
    hull = skin - (fat * (1 + uneven))[:, None] * outward_normals(skin)
    room = float(np.linalg.norm(hull - hull.mean(axis=0), axis=1).min())
    middle = hull.mean(axis=0)

    def bone(share: float, lobe: float, lobes: int, way: float, far: float) -> FloatArray:
        towards = np.array([np.cos(way), np.sin(way)])
        x, y = middle + far * room * towards
        return bone_outline(share * room, (float(x), float(y)), lobe, lobes, even(0, 2 * np.pi))

    front = np.pi / 2 + even(-0.5, 0.5)
    tibia = bone(even(0.22, 0.34), even(0.0, 0.3), 3, front, even(0.2, 0.55))
    side = 1 if generator.random() < 0.5 else -1
    fibula = bone(even(0.1, 0.17), 0.1, 2, front + side * even(1.2, 2.0), even(0.4, 0.7))
    section = LegSection(skin, hull, tibia, fibula, fascia)
    try:
        check_section(section, "drawn leg")
    except InputError:
        return None
    return section
