"""A typical calf's section of a few numbers that a reader can judge: girth, fat, and proportions."""

from dataclasses import dataclass, replace

import numpy as np

from legfem.common.errors import InputError, check_positive
from legfem.common.units import FloatArray
from legfem.geometry.contours import check_section
from legfem.geometry.curve import closed_lengths, outward_normals
from legfem.geometry.section import LegSection, girth

MOST_OVER_SHIN_MM = 6.0
"""Fat of a typical calf over the tibia's face, however fat it is behind."""


@dataclass(frozen=True)
class Calf:
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

    girth_mm: float
    fat_mm: float
    fascia_thickness_mm: float
    aspect: float = 1.04
    bulge: float = 0.05
    asymmetry: float = 0.02
    fat_variation: float = 0.15
    tibia_mm: float = 12.0
    fibula_mm: float = 6.0
    side: int = 1

    def __post_init__(self) -> None:
        """Check the lengths and that the fascia is thinner than the fat."""
        check_positive(self, "girth_mm", "fat_mm", "fascia_thickness_mm", "aspect", "tibia_mm", "fibula_mm")
        if self.fascia_thickness_mm >= self.fat_mm:
            raise InputError("Calf", "fascia_thickness_mm", "is not below fat_mm", "give a thinner fascia")

    @classmethod
    def with_fat_behind(cls, girth_mm: float, fat_mm: float, fascia_thickness_mm: float) -> "Calf":
        """A calf of usual proportions, given the thickness of its fat (mm) at the middle of the back."""
        usual = cls(girth_mm, fat_mm, fascia_thickness_mm)
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


def calf_section(calf: Calf, points: int = 240) -> LegSection:
    """Return the contours of a calf.

    Raises
    ------
    InputError
        If the numbers give contours that cross.
    """
    angle = 2 * np.pi * np.arange(points) / points
    shape = oval(angle, calf.aspect, calf.bulge, calf.asymmetry)
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    outline = shape[:, None] * unit
    radius = calf.girth_mm / float(closed_lengths(outline))
    skin = radius * outline
    fascia = skin - (calf.fat_mm * calf.relative_fat(angle))[:, None] * outward_normals(skin)
    tibia = bone_outline(calf.tibia_mm, (-0.20 * calf.side * radius, 0.46 * radius), 0.16, 3, 0.4 * calf.side)
    fibula = bone_outline(calf.fibula_mm, (0.42 * calf.side * radius, 0.20 * radius), 0.10, 2, 0.9)
    section = LegSection(skin, fascia, tibia, fibula, calf.fascia_thickness_mm)
    check_section(section, "Calf")
    if abs(girth(section) / calf.girth_mm - 1) > 1e-3:
        raise InputError("Calf", "girth_mm", "is not met", "use more points on the contour")
    return section


def oval(angle: FloatArray, aspect: float, bulge: float, asymmetry: float) -> FloatArray:
    """Return how far a calf's skin reaches at an angle from +x, over its radius; see `Calf`."""
    a, b = np.sqrt(aspect), 1 / np.sqrt(aspect)
    ellipse = 1 / np.sqrt((np.cos(angle) / a) ** 2 + (np.sin(angle) / b) ** 2)
    bulged = -bulge * np.sin(angle) + asymmetry * np.cos(angle)
    flattened = -0.012 * np.cos(3 * (angle - np.pi / 2))
    return ellipse * (1 + bulged + flattened)


def bone_outline(radius: float, centre: tuple[float, float], lobe: float, lobes: int, turn: float) -> FloatArray:
    """Return a bone's outline with rounded corners, one at the angle ``turn``; (60, 2), mm."""
    angle = 2 * np.pi * np.arange(60) / 60
    reach = radius * (1 + lobe * np.cos(lobes * (angle - turn)) / lobes)
    return np.asarray(centre) + reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
