"""Legs in 3D made of a few numbers that a reader can judge."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.interpolate import CubicHermiteSpline
from shapely import Polygon

from legfem.common.input_files import parse_toml
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, check_shape, shape_of_contours
from legfem.geometry.section import outward_normals
from legfem.geometry.section_from_outlines import Clearances, nested_outlines
from legfem.imaging.outlines import smoothed
from legfem.legs.typical import bone_outline, oval

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(gt=0, lt=1)]

_ROOM = Clearances(bone_to_fascia=1.5, fascia_to_skin=2.0, fascia_bridge=25.0, corner=8.0)
_LEVEL_SPACING = 5.0


class ParametricLeg(BaseModel):
    """Numbers of one leg; lengths in mm."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    sex: Literal["female", "male"]
    age_years: Positive
    weight_kg: Positive
    height_m: Positive
    girth_mm: Positive
    """Largest perimeter of the skin."""
    girth_below_mm: Positive
    """At the segment's lower end."""
    girth_above_mm: Positive
    """At its upper end."""
    length_mm: Positive = 140.0
    """Of the segment; z = 0 is its lower end."""
    peak: Share = 0.57
    """Where the largest girth is, as a share of the length."""
    fat_mm: Positive
    """Mean thickness of the fat at the largest girth, the shin left out."""
    fat_variation: NotNegative = 0.3
    """How much thicker it is behind, on the medial side, and thinner opposite; relative."""
    fat_gradient: float = 0.15
    """Relative change of the fat's thickness from the lower to the upper end."""
    shin_fat_mm: Positive = 3.0
    """Thickness of the fat over the tibia's medial face."""
    shin_hollow: NotNegative = 0.03
    """Depth of the skin's hollow there, relative to the mean radius; about 0.02 is flat."""
    crest: NotNegative = 0.05
    """How much farther the skin reaches over the tibia's crest, relative to the mean radius."""
    aspect: Positive = 0.95
    """Width over depth of the oval."""
    bulge: float = 0.05
    """How much farther the back reaches than the front, relative to the mean radius."""
    asymmetry: float = 0.02
    """The same between the two sides."""
    tibia_mm: Positive = 12.5
    """Mean radius at the largest girth."""
    fibula_mm: Positive = 6.2
    bone_taper: NotNegative = 0.2
    """Relative growth of the tibia's radius over the segment, upwards."""
    fibula_side: Literal[1, -1] = -1
    """-1 puts the fibula on the side of -x: a right leg seen from above with the back at +y."""


def parametric_leg(leg: ParametricLeg, n_points: int = 180) -> LegShape:
    """Return the shape of a parametric leg; levels every 5 mm or less.

    Raises
    ------
    InputError
        If the numbers give parts that do not nest.
    """
    count = int(np.ceil(leg.length_mm / _LEVEL_SPACING)) + 1
    levels = np.linspace(0.0, leg.length_mm, count)
    contours: dict[str, list[FloatArray]] = {}
    for level, around in zip(levels, _girths(leg, levels), strict=True):
        for part, outline in _section(leg, level / leg.length_mm, around).items():
            contours.setdefault(part, []).append(outline)
    shape = smoothed(shape_of_contours(levels, contours, n_points), around=6.0, along=15.0)
    check_shape(shape, "ParametricLeg", clearance=0.5)
    return shape


def read_legs(path: Path) -> dict[str, ParametricLeg]:
    """Read the ``[legs.NAME]`` of a TOML file.

    Raises
    ------
    InputError
        If the file can't be read, or a key is unknown, missing or has an impossible value.
    """
    return parse_toml(path, _LegsFile, "legs in 3D").legs


class _LegsFile(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    legs: dict[str, ParametricLeg]


def _girths(leg: ParametricLeg, levels: FloatArray) -> FloatArray:
    """Return the skin's perimeter at every level; flat at the largest."""
    peak = leg.peak * leg.length_mm
    below = 1.7 * (leg.girth_mm - leg.girth_below_mm) / peak
    above = 1.7 * (leg.girth_above_mm - leg.girth_mm) / (leg.length_mm - peak)
    curve = CubicHermiteSpline(
        [0.0, peak, leg.length_mm], [leg.girth_below_mm, leg.girth_mm, leg.girth_above_mm], [below, 0.0, above]
    )
    return np.asarray(curve(levels))


def _section(leg: ParametricLeg, share: float, girth: float, points: int = 360) -> dict[str, FloatArray]:
    """Return the outlines at a share of the length, with the fibula on the side of -x."""
    angle = 2 * np.pi * np.arange(points) / points
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    crest, shin, behind = -0.5 * np.pi, -0.5 * np.pi + 0.6, 0.5 * np.pi - 0.6
    # The calf's oval has its back at -y.
    reach = oval(angle + np.pi, leg.aspect, leg.bulge, -leg.asymmetry)
    reach += leg.crest * np.exp(-((_apart(angle, crest) / 0.45) ** 2))
    reach -= leg.shin_hollow * np.exp(-((_apart(angle, shin) / 0.38) ** 2))
    outline = reach[:, None] * unit
    radius = girth / float(Polygon(outline).length)
    skin = radius * outline
    usual = leg.fat_mm * (1 + leg.fat_gradient * (share - leg.peak))
    fat = usual * (1 + leg.fat_variation * np.cos(angle - behind))
    thin = np.exp(-((_apart(angle, shin) / 0.5) ** 4))
    fat = (1 - thin) * fat + thin * np.minimum(leg.shin_fat_mm, fat)
    hull = skin - fat[:, None] * outward_normals(skin)

    def inside(direction: float, depth: float) -> tuple[float, float]:
        towards = np.array([np.cos(direction), np.sin(direction)])
        edge = np.interp(np.mod(direction, 2 * np.pi), angle, np.linalg.norm(hull, axis=1))
        x, y = (edge - depth) * towards
        return float(x), float(y)

    grown = 1 + leg.bone_taper * (share - leg.peak)
    tibia, fibula = leg.tibia_mm * grown, leg.fibula_mm * (1 + 0.3 * (grown - 1))
    # A corner of the tibia is its crest; a flat face is towards the shin.
    parts = {
        SKIN: skin,
        "muscle_hull": hull,
        "tibia": bone_outline(tibia, inside(crest + 0.2, 1.25 * tibia + 1.5), 0.3, 3, crest - 0.1),
        "fibula": bone_outline(fibula, inside(np.pi + 0.35, fibula + 14.0), 0.12, 3, 0.4),
    }
    nested = nested_outlines({k: Polygon(xy) for k, xy in parts.items()}, 0.0, "ParametricLeg", _ROOM)
    side = np.array([-leg.fibula_side, 1.0])
    return {
        HULL if part == "muscle_hull" else part: np.asarray(polygon.exterior.coords)[:-1] * side
        for part, polygon in nested.items()
    }


def _apart(angle: FloatArray, direction: float) -> FloatArray:
    return np.asarray(np.mod(angle - direction + np.pi, 2 * np.pi) - np.pi)


def horizontal_curvature(shape: LegShape, part: str = SKIN) -> FloatArray:
    """Return the curvature of a part's contours in their own planes.

    By central differences of fourth order over five points: smooth noisy contours before.

    Returns
    -------
    ndarray
        (n_levels, n_points), 1/mm; positive where the contour is convex.
    """
    xy = shape.contours[part]
    one, two = ((np.roll(xy, -k, axis=1), np.roll(xy, k, axis=1)) for k in (1, 2))  # after and before
    first = (8 * (one[0] - one[1]) - (two[0] - two[1])) / 12
    second = (16 * (one[0] + one[1]) - (two[0] + two[1]) - 30 * xy) / 12
    turning = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return np.asarray(turning / np.linalg.norm(first, axis=2) ** 3)
