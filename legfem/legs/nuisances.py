r"""What the model doesn't know of a leg, and how it would change the readings.

Outlines come from images, the aim from a mark on the skin, the stiffness of fat and fascia from
others' measurements. Each such unknown has a standard deviation with a source; its effect is the
relative change of the force by one, from a solution with the mesh or the cylinder moved, or from
the exact derivative by a material's number.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray
from legfem.inverse.body_models import Displaced
from legfem.inverse.library import NuisanceChanges
from legfem.inverse.linearised import Cause, NuisanceEffect
from legfem.inverse.mechanism import Stiffness
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Prior
from legfem.legs.subject import TYPICAL_ACCURACY, MeasuredEffect, Subject

if TYPE_CHECKING:
    from legfem.inverse.correction import TabulatedCorrection

CONTOUR_SD_MM = 0.5
"""Of a segmented outline (MRI of 1 mm pixels: inter-observer distances of 0.3 to 0.8 mm)."""
CONTOUR_ARC_MM = 20.0
"""Of skin over which its error is correlated."""
AIM_SD_MM = 2.0
"""A mark's place on the skin."""
DIRECTION_SD_DEG = 3.0
MATERIAL_LOG_SD: Mapping[str, float] = {
    "superficial.C10": 0.2,
    "fascia.C10": 0.25,
    "deep.D1": 0.25,
    "superficial.D1": 0.25,
}
"""Of the logarithms of what is assumed: a factor of 1.5 to 1.65 at two standard deviations. What is
further off is called a mechanism."""
OUTLINES: tuple[Literal["skin", "fascia"], ...] = ("skin", "fascia")
GEOMETRY_DOF = 3.0
"""Degrees of freedom of the accuracy of outlines, aim and direction, stated or usual: known to some
40 %, as inter-observer distances of 0.3 to 0.8 mm are (JCGM 100:2008, G.4.2)."""
SIZE_LOG_SD = 0.01
"""Of the logarithm of a specimen's or an indenter's size, by calipers on what gives way."""
SIZE = "size."
"""What full names of sizes begin with."""
MATERIAL_DOF = 8.0
"""Of how far what is assumed of a person's tissues is off: known to 25 %."""
_HATS = (-40.0, -20.0, 0.0, 20.0, 40.0)
_BONES: tuple[Literal["tibia", "fibula"], ...] = ("tibia", "fibula")
_BONES_WAYS = {"along the travel": 0.0, "across the travel": 90.0}
"""Degrees from the travel. Each bone's outline is drawn by itself: what turns and shifts them across shows in the
lateral force and in the skin beside the cylinder, where their depth alone doesn't."""
_A_SIZE = "stated size: "
_WORDS = {
    "superficial.C10": "stiffness of the fat",
    "fascia.C10": "stiffness of the fascia",
    "deep.D1": "compressibility of the deep tissue",
    "superficial.D1": "compressibility of the fat",
}


@dataclass(frozen=True)
class Accuracy:
    """How well a leg is known.

    Parameters
    ----------
    contour_sd
        Of its outlines (mm); 0 where they are exact.
    aim_sd
        Of the cylinder's line of travel (mm).
    direction_sd
        Of its direction (degrees).
    assumed_sd
        Relative, of stiffness of fat and fascia and of compressibility; the usual of each without
        it.
    size_sd
        Relative, of a specimen's sizes.
    measured
        Stiffnesses (MPa) of the person by other means, by full name: ``deep.C10``,
        ``superficial.C10``.
    effects
        How strong effects are that the model may leave out, by other means.
    """

    contour_sd: float = CONTOUR_SD_MM
    aim_sd: float = AIM_SD_MM
    direction_sd: float = DIRECTION_SD_DEG
    assumed_sd: float | None = None
    size_sd: float = SIZE_LOG_SD
    measured: Mapping[str, Prior] = field(default_factory=dict)
    effects: tuple[MeasuredEffect, ...] = ()

    def log_sd(self, material: str) -> float:
        """Return the standard deviation of an assumed number's logarithm."""
        if material.startswith(SIZE):
            return self.size_sd
        if (known := self.measured.get(material)) is not None:
            return known.sd if known.scale == "log" else known.sd / known.centre
        return MATERIAL_LOG_SD[material] if self.assumed_sd is None else self.assumed_sd


DRAWN = Accuracy(0.2, 0.5, 0.5, 0.05)
"""Of a leg that was drawn and simulated: as far as another code rounds the same polygons, and takes
the same constants for laws of its own."""


def accuracy_of_shape(subject: Subject) -> Accuracy:
    """Return how well a leg's outlines, aim, direction and what is assumed are known: as stated, else as is usual.

    A leg that was drawn is known but for rounding, a typical calf only roughly, unless the folder says otherwise.
    """
    given = TYPICAL_ACCURACY if subject.typical_shape and not subject.accuracy.stated else subject.accuracy
    usual = Accuracy() if subject.origin == "measured" or given.stated else DRAWN
    return Accuracy(
        usual.contour_sd if given.contour_sd is None else given.contour_sd,
        usual.aim_sd if given.aim_sd is None else given.aim_sd,
        usual.direction_sd if given.direction_sd is None else given.direction_sd,
        usual.assumed_sd if given.assumed_sd is None else given.assumed_sd,
    )


def word_of(name: str) -> str:
    """Return what an assumed number is called."""
    size = name.removeprefix(SIZE)
    return _WORDS[name] if size == name else f"{_A_SIZE}{size.replace('_', ' ')}"


_OUTLINES = Cause("outlines", GEOMETRY_DOF)


def displaced_geometries() -> list[Displaced]:
    """Return the geometries whose forces tell of outlines, aim and direction."""
    from legfem.experiments.plane_strain import LateralPlacement
    from legfem.meshing.section import MeshMotion

    found = [
        Displaced(f"outline of the {outline} at {arc:+.0f} mm", MeshMotion(outline, arc))
        for outline in OUTLINES
        for arc in _HATS
    ]
    found += [
        Displaced(f"{bone} {way}", MeshMotion(bone, turned=turned), near=False)
        for bone in _BONES
        for way, turned in _BONES_WAYS.items()
    ]
    found.append(Displaced("aim", placement=LateralPlacement(offset_mm=AIM_SD_MM)))
    found.append(Displaced("direction", placement=LateralPlacement(tilt_deg=DIRECTION_SD_DEG)))
    return found


def nuisance_effects(
    changes: NuisanceChanges,
    observed: Observations,
    prediction: FloatArray,
    accuracy: Accuracy,
    ends: "TabulatedCorrection | None" = None,
    stiffness: Stiffness = (1e-3, 0.0),
) -> list[NuisanceEffect]:
    """Return what one standard deviation of each thing that isn't known exactly does to the readings.

    Parameters
    ----------
    changes
        Of the body's elastic courses.
    observed
        The recordings.
    prediction
        (N,): by the model.
    accuracy
        Of what is known of the body.
    ends
        The correction for the cylinder's ends, whose errors count where it is applied.
    stiffness
        C10 and C20, MPa: of the correction.
    """
    d, force = observed.displacement, prediction[: len(observed.force)]

    def along(of: NuisanceChanges) -> dict[str, FloatArray]:
        rows = {**of.geometric, **of.material}
        stacked = np.reshape(list(rows.values()), (len(rows), len(of.grid)))
        every = CubicSpline(of.grid, stacked, axis=1)(np.maximum(d, of.grid[0]))
        return dict(zip(rows, every, strict=True))

    of_force = along(changes)

    @cache
    def of_course(course: str) -> dict[str, FloatArray]:
        return along(changes.channels[course])

    def effect(name: str) -> FloatArray:
        by_channel: list[FloatArray] = [force * of_force[name]]
        for one in observed.channels:
            by_channel.append(one.read(lambda course: of_course(course)[name]))
        return np.concatenate(by_channel)

    found: list[NuisanceEffect] = []
    for name in changes.material:
        if (sd := accuracy.log_sd(name)) > 0:
            word = word_of(name)
            degrees = GEOMETRY_DOF if name.startswith(SIZE) else MATERIAL_DOF
            found.append(NuisanceEffect(word, sd * effect(name), Cause(word, degrees)))
    scale = {
        "aim": (accuracy.aim_sd / AIM_SD_MM, Cause("aim", GEOMETRY_DOF)),
        "direction": (accuracy.direction_sd / DIRECTION_SD_DEG, Cause("direction", GEOMETRY_DOF)),
        **{f"{bone} {way}": (accuracy.contour_sd / CONTOUR_SD_MM, _OUTLINES) for bone in _BONES for way in _BONES_WAYS},
    }
    for name, (factor, cause) in scale.items():
        if name in changes.geometric and factor > 0:
            found.append(NuisanceEffect(name, factor * effect(name), cause))
    for part in OUTLINES:
        rows = [effect(n) for n in changes.geometric if n.startswith(f"outline of the {part}")]
        if rows and accuracy.contour_sd > 0:
            found += _outline(part, rows, accuracy.contour_sd)
    if ends is not None:
        factor_now = ends.factor(d, *(np.asarray(v) for v in stiffness))
        for mode_name, mode in ends.errors.items():
            relative = np.interp(d, ends.displacement, mode) / factor_now
            relative = np.concatenate(
                [relative, *(one.weights @ (one.follows_force * relative) for one in observed.channels)]
            )
            name = f"3D correction: {mode_name}"
            found.append(NuisanceEffect(name, prediction * relative, Cause(name)))
    return found


def _outline(part: str, effects: Sequence[FloatArray], sd: float) -> list[NuisanceEffect]:
    """Return the modes of an outline's error, correlated along its arc."""
    apart = np.subtract.outer(_HATS, _HATS)
    covariance = np.exp(-0.5 * (apart / CONTOUR_ARC_MM) ** 2)
    values, modes = np.linalg.eigh(covariance)
    rows = np.array(effects) * (sd / CONTOUR_SD_MM)
    return [
        NuisanceEffect(f"outline of the {part}, mode {k + 1}", math.sqrt(values[j]) * modes[:, j] @ rows, _OUTLINES)
        for k, j in enumerate(np.argsort(-values))
        if values[j] > 1e-3
    ]
