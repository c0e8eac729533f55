"""What a lab states of a leg, which isn't quite the leg that was pressed, and all its errors drawn together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from types import MappingProxyType

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import MUSCLE, LegSection, minimal_fat_thickness, outward_normals
from legfem.legs.subject import LegAccuracy, Subject
from studies.making.recording import LabErrors

AIM_MM, DIRECTION_DEG, FACTOR = 2.0, 3.0, 1.5
STATED_ACCURACY = LegAccuracy(contour_sd=0.5, aim_sd=2.0, direction_sd=3.0)
"""What such a lab says of itself, however far off it is."""
LEAST_FAT_MM = 1.5
_WAVES = (1, 2, 3, 4, 5, 6, 7, 8)
_ATTEMPTS = 50


@dataclass(frozen=True)
class Misstated:
    """Sizes of what is stated wrongly.

    Parameters
    ----------
    contour
        Root mean square by which skin and fascia are off, along their normals; bones are moved by
        as much (mm).
    aim, direction
        Greatest error of the cylinder's line (mm, degrees), drawn evenly.
    factor
        Greatest one on the stiffness of fat and fascia, drawn evenly in its logarithm.
    """

    contour: float = 0.0
    aim: float = 0.0
    direction: float = 0.0
    factor: float = 1.0


def misstated(subject: Subject, sizes: Misstated, generator: np.random.Generator) -> Subject:
    """Return the leg as it is stated where the given one is the true leg."""
    indenter = subject.indenter
    across = np.array([-indenter.direction[1], indenter.direction[0]])
    aim = indenter.aim + sizes.aim * generator.uniform(-1, 1) * across
    turned = indenter.direction_deg + sizes.direction * generator.uniform(-1, 1)
    tissues = dict(subject.tissues)
    for name in (one for one in ("superficial", "fascia") if one in tissues):
        factor = sizes.factor ** generator.uniform(-1, 1)
        stiffness = tissues[name].C10
        assert stiffness is not None
        tissues[name] = replace(tissues[name], C10=factor * stiffness)
    return replace(
        subject,
        section=outlines_off(subject.section, sizes.contour, generator),
        indenter=Indenter(indenter.radius, indenter.length, aim, turned),
        tissues=MappingProxyType(tissues),
        accuracy=STATED_ACCURACY,
    )


def outlines_off(section: LegSection, size: float, generator: np.random.Generator) -> LegSection:
    """Return a section whose outlines are off by smooth random functions of the polar angle.

    Parameters
    ----------
    section
        The leg.
    size
        Root mean square along the normal (mm).
    generator
        Drawn again until the fat is 1.5 mm thick at least.
    """
    if size == 0:
        return section
    for _ in range(_ATTEMPTS):
        parts = {name: _off(section.contour(name), size, generator) for name in section.layers}
        for bone in section.bones:
            parts[bone] = section.contour(bone) + size * generator.normal(size=2)
        moved = replace(LegSection.of_parts(parts, section.fascia_thickness), support=section.support)
        inside = all(moved.polygon("fascia").buffer(-2.0).contains(moved.polygon(bone)) for bone in section.bones)
        apart = all(
            moved.polygon(one).distance(moved.polygon(other)) > 1.0 for one, other in combinations(moved.bones, 2)
        )
        if inside and apart and (MUSCLE in moved.lacks or minimal_fat_thickness(moved) > LEAST_FAT_MM):
            return moved
    raise ValueError(f"no outlines off by {size:g} mm leave {LEAST_FAT_MM:g} mm of fat")


def _off(contour: FloatArray, size: float, generator: np.random.Generator) -> FloatArray:
    centre = contour.mean(axis=0)
    angle = np.arctan2(contour[:, 1] - centre[1], contour[:, 0] - centre[0])
    off = sum(generator.normal() * np.cos(k * angle + generator.uniform(0, 2 * np.pi)) / (1 + k / 4) for k in _WAVES)
    off = np.asarray(off)
    return np.asarray(contour + (size * off / np.sqrt(np.mean(off**2)))[:, None] * outward_normals(contour))


GAINS, CONTOURS_MM, AIR_MM = (0.003, 0.03), (0.3, 1.0), 4.0


def drawn_errors(generator: np.random.Generator) -> LabErrors:
    """Return errors of a lab's recordings."""
    return LabErrors(
        gain_sd=float(np.exp(generator.uniform(*np.log(GAINS)))),
        air=AIR_MM,
        heavy=bool(generator.random() < 0.5),
        same_travel=bool(generator.random() < 0.5),
    )


def drawn_misstatement(generator: np.random.Generator) -> Misstated:
    """Return errors of what a lab states of a leg."""
    contour = float(generator.uniform(*CONTOURS_MM))
    return Misstated(contour, AIM_MM, DIRECTION_DEG, FACTOR)
