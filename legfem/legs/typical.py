"""Limbs that nobody outlined, of usual proportions: by their girth and the fat's thickness; and drawn calves."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from legfem.common.errors import AboveZero, Checked, InputError
from legfem.common.resources import resource
from legfem.common.units import FloatArray
from legfem.geometry.contours import check_section
from legfem.geometry.section import CALF, LIMBS, LegSection, closed_lengths, outward_normals


@dataclass(frozen=True)
class TypicalBone:
    """A round bone."""

    radius_mm: float
    at: tuple[float, float]
    """Its middle, over the mean radius of the skin."""


@dataclass(frozen=True)
class TypicalLimb:
    """What a limb is like where it is usually pressed, towards its middle; +y is its front."""

    direction_deg: float
    """Of travel, from +x."""
    pressed: str
    """That in words."""
    force_sd: float
    """Standard deviation over the force, of the shape that a limb has in place of this one."""
    aspect: float = 1.0
    """Width over depth of the oval."""
    bones: Mapping[str, TypicalBone] = field(default_factory=dict)
    is_pad: bool = False
    """Whether there is no muscle: it is pressed from below, and what is stated as fat reaches to the bones."""
    calf: Mapping[str, Any] | None = None
    """Of a limb that is a `Calf`, what it has other than a usual one."""


TYPICAL_LIMBS = resource("typical_limbs", dict[str, TypicalLimb])


def typical_section(limb: str, girth_mm: float, fat_mm: float, fascia_thickness_mm: float) -> LegSection:
    """Return the section of one of `TYPICAL_LIMBS`, with the fat (mm) where it is pressed; of a pad, to the bone.

    Raises
    ------
    InputError
        If the numbers give contours that cross.
    """
    usual = TYPICAL_LIMBS[limb]
    if usual.calf is not None:
        return calf_section(Calf.with_fat_behind(girth_mm, fat_mm, fascia_thickness_mm, **usual.calf))
    skin, radius = skin_of(girth_mm, oval(AROUND, usual.aspect, 0.0, 0.0))
    bones = {}
    for name, bone in usual.bones.items():
        at = radius * bone.at[0], skin[:, 1].min() + fat_mm + bone.radius_mm if usual.is_pad else radius * bone.at[1]
        bones[name] = bone_outline(bone.radius_mm, at, 0.0, 1, 0.0)
    fascia = skin if usual.is_pad else skin - fat_mm * outward_normals(skin)
    section = LegSection(skin, fascia, bones, fascia_thickness_mm)
    check_section(section, limb)
    return section


AROUND = 2 * np.pi * np.arange(240) / 240
"""Angles of a drawn skin's points, from +x."""


def skin_of(girth_mm: float, shape: FloatArray) -> tuple[FloatArray, float]:
    """Return a skin's contour (240, 2), mm, of a shape and a girth, and its mean radius."""
    outline = shape[:, None] * np.column_stack([np.cos(AROUND), np.sin(AROUND)])
    radius = girth_mm / float(closed_lengths(outline))
    return radius * outline, radius


MOST_OVER_SHIN_MM = 6.0
"""Fat of a typical calf over the tibia's face, however fat it is behind."""


WIDEST_TIBIA = 0.25
"""Radius of a typical tibia over the skin's mean radius, where that is little: a slim calf has slim bones."""


@dataclass(frozen=True)
class Calf(Checked):
    """Shape of one calf.

    Parameters
    ----------
    girth_mm : float
        Perimeter of the skin.
    fat_mm : float
        Mean thickness between skin and fascia.
    fascia_thickness_mm : float
        Of the fascia.
    aspect : float
        Width over depth of the oval.
    bulge : float
        How much farther the back reaches than the front, relative to the mean radius.
    asymmetry : float
        The same between the two sides.
    fat_variation : float
        Relative: the fat is this much thicker at the back and thinner over the tibia.
    tibia_mm, fibula_mm : tuple[float, float]
        Mean radii.
    side : {1, -1}
        On which side of the y axis the fibula lies.
    """

    girth_mm: AboveZero[float]
    fat_mm: AboveZero[float]
    fascia_thickness_mm: AboveZero[float]
    aspect: AboveZero[float] = 1.04
    bulge: float = 0.05
    asymmetry: float = 0.02
    fat_variation: float = 0.15
    tibia_mm: AboveZero[float] = 12.0
    fibula_mm: AboveZero[float] = 6.0
    side: int = 1

    def __post_init__(self) -> None:
        """Check the lengths and that the fascia is thinner than the fat."""
        super().__post_init__()
        if self.fascia_thickness_mm >= self.fat_mm:
            raise InputError("Calf", "fascia_thickness_mm", "is not below fat_mm", "give a thinner fascia")

    @classmethod
    def with_fat_behind(cls, girth_mm: float, fat_mm: float, fascia_thickness_mm: float, **other: Any) -> "Calf":
        """A calf of usual ``other`` proportions, given the thickness of its fat (mm) at the middle of the back."""
        usual = cls(girth_mm, fat_mm, fascia_thickness_mm, **other)
        usual = replace(usual, tibia_mm=min(usual.tibia_mm, WIDEST_TIBIA * girth_mm / (2 * np.pi)))
        behind = float(usual.relative_fat(np.array(-np.pi / 2)))
        over_shin = (1 - usual.fat_variation) / behind * fat_mm
        if over_shin > MOST_OVER_SHIN_MM:
            # 1 - v over the shin and 1 + v cos(0.5) behind have the ratio of the two thicknesses.
            ratio, lean = MOST_OVER_SHIN_MM / fat_mm, (behind - 1) / usual.fat_variation
            usual = replace(usual, fat_variation=(1 - ratio) / (1 + ratio * lean))
        return replace(usual, fat_mm=fat_mm / float(usual.relative_fat(np.array(-np.pi / 2))))

    def relative_fat(self, angle: FloatArray) -> FloatArray:
        """Thickness of the fat over its mean at angles (...) from +x: most at the back, least over the tibia's face."""
        over_tibia = np.cos(angle - (np.pi / 2 + 0.5 * self.side))
        return np.asarray(1 - self.fat_variation * over_tibia)


def calf_section(calf: Calf) -> LegSection:
    """Return the contours of a calf.

    Raises
    ------
    InputError
        If the numbers give contours that cross.
    """
    skin, radius = skin_of(calf.girth_mm, oval(AROUND, calf.aspect, calf.bulge, calf.asymmetry))
    fascia = skin - (calf.fat_mm * calf.relative_fat(AROUND))[:, None] * outward_normals(skin)
    tibia = bone_outline(calf.tibia_mm, (-0.20 * calf.side * radius, 0.46 * radius), 0.16, 3, 0.4 * calf.side)
    fibula = bone_outline(calf.fibula_mm, (0.42 * calf.side * radius, 0.20 * radius), 0.10, 2, 0.9)
    section = LegSection(skin, fascia, dict(zip(LIMBS[CALF], (tibia, fibula), strict=True)), calf.fascia_thickness_mm)
    check_section(section, "Calf")
    return section


def oval(angle: FloatArray, aspect: float, bulge: float, asymmetry: float) -> FloatArray:
    """Return how far a calf's skin reaches at an angle from +x, over its radius; see `Calf`."""
    a, b = np.sqrt(aspect), 1 / np.sqrt(aspect)
    ellipse = 1 / np.sqrt((np.cos(angle) / a) ** 2 + (np.sin(angle) / b) ** 2)
    bulged = -bulge * np.sin(angle) + asymmetry * np.cos(angle)
    return ellipse * (1 + bulged - 0.012 * np.cos(3 * (angle - np.pi / 2)))


def bone_outline(radius: float, centre: tuple[float, float], lobe: float, lobes: int, turn: float) -> FloatArray:
    """Return a bone's outline with rounded corners, one at the angle ``turn``; (60, 2), mm."""
    angle = 2 * np.pi * np.arange(60) / 60
    reach = radius * (1 + lobe * np.cos(lobes * (angle - turn)) / lobes)
    return np.asarray(centre) + reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
