"""What the model doesn't know of a leg's shape and placement.

Outlines come from images, the aim from a mark on the skin. Each such unknown has a standard deviation with a source;
its effect comes from derivatives by errors of the mesh's shape or the cylinder's way (`errors_of_geometry`), or a sum
of them.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from legfem.experiments.plane_strain import LateralPlacement
from legfem.geometry.section import LAYERS
from legfem.inverse.accuracy import GEOMETRY_DOF, Accuracy, Cause, ShapeError
from legfem.legs.subject import TYPICAL_ACCURACY, LegAccuracy, Subject
from legfem.meshing.section import MeshMotion

type Motions = dict[str, MeshMotion | LateralPlacement]

CONTOUR_SD_MM = 0.5
"""Of a segmented outline (MRI of 1 mm pixels: inter-observer distances of 0.3 to 0.8 mm)."""
CONTOUR_ARC_MM = 20.0
"""Of skin over which its error is correlated."""
AIM_SD_MM = 2.0
"""A mark's place on the skin."""
DIRECTION_SD_DEG = 3.0
RIG_SD_MM_PER_N = 0.02
"""What a rig yields that nobody pressed a block on: small frames and load cells yield 0.005 to 0.06 mm/N."""
_HATS = (-40.0, -20.0, 0.0, 20.0, 40.0)
_BONES_WAYS = {"along the travel": 0.0, "across the travel": 90.0}
"""Degrees from the travel. Each bone's outline is drawn by itself: what turns and shifts them across shows in the
lateral force and in the skin beside the cylinder, where their depth alone doesn't."""
_CAUSE = Cause("outlines", GEOMETRY_DOF)


@dataclass(frozen=True)
class ShapeAccuracy(Accuracy):
    """How well a leg is known.

    Parameters
    ----------
    contour_sd
        Of its outlines (mm); 0 where they are exact.
    aim_sd
        Of the cylinder's line of travel (mm).
    direction_sd
        Of its direction (degrees).
    rig_sd
        Of what the rig yields (mm/N).
    bones, layers
        Names of those whose outlines may be off.
    """

    contour_sd: float = CONTOUR_SD_MM
    aim_sd: float = AIM_SD_MM
    direction_sd: float = DIRECTION_SD_DEG
    contact_sd: float | None = None
    rig_sd: float = RIG_SD_MM_PER_N
    bones: tuple[str, ...] = field(kw_only=True)
    layers: tuple[str, ...] = LAYERS

    @property
    def shape_errors(self) -> tuple[ShapeError, ...]:
        """How aim, direction and outlines may be off, the outlines' along their arc by modes."""
        found = []
        if self.aim_sd > 0:
            found.append(ShapeError("aim", {"aim": self.aim_sd / AIM_SD_MM}, Cause("aim", GEOMETRY_DOF)))
        if self.direction_sd > 0:
            turned = {"direction": self.direction_sd / DIRECTION_SD_DEG}
            found.append(ShapeError("direction", turned, Cause("direction", GEOMETRY_DOF)))
        if self.contour_sd > 0:
            found += _outlines_off(self.bones, self.layers, self.contour_sd / CONTOUR_SD_MM)
        return tuple(found)


def _outlines_off(bones: Sequence[str], layers: Sequence[str], factor: float) -> Iterator[ShapeError]:
    """Yield how the bones and the modes of the outlines' errors are off, correlated along their arcs."""
    for bone in bones:
        for way in _BONES_WAYS:
            yield ShapeError(f"{bone} {way}", {f"{bone} {way}": factor}, _CAUSE)
    apart = np.subtract.outer(_HATS, _HATS)
    values, modes = np.linalg.eigh(np.exp(-0.5 * (apart / CONTOUR_ARC_MM) ** 2))
    for part in layers:
        for k, j in enumerate(np.argsort(-values)):
            if values[j] > 1e-3:
                weights = factor * math.sqrt(values[j]) * modes[:, j]
                hats = {_hat(part, arc): float(weight) for arc, weight in zip(_HATS, weights, strict=True)}
                yield ShapeError(f"outline of the {part}, mode {k + 1}", hats, _CAUSE)


def _hat(part: str, arc: float) -> str:
    return f"outline of the {part} at {arc:+.0f} mm"


DRAWN = LegAccuracy(0.2, 0.5, 0.5, 0.05)
"""Of a leg that was drawn and simulated: as far as another code rounds the same polygons, and takes
the same constants for laws of its own."""


def accuracy_of_shape(subject: Subject) -> ShapeAccuracy:
    """Return how well a leg's outlines, aim, direction and what is assumed are known: as stated, else as is usual.

    A leg that was drawn is known but for rounding, a typical limb only roughly, unless the folder says otherwise.
    """
    given = subject.accuracy
    if subject.typical_shape and not given.stated:
        given = replace(TYPICAL_ACCURACY, contact_sd=given.contact_sd, rig_sd=given.rig_sd)
    if subject.origin != "measured" and not given.stated:
        given = replace(DRAWN, contact_sd=given.contact_sd, rig_sd=given.rig_sd)
    stated = {name: sd for name, sd in asdict(given).items() if sd is not None}
    return ShapeAccuracy(**stated, bones=tuple(subject.section.bones), layers=subject.section.layers)


def errors_of_geometry(bones: Iterable[str], layers: Iterable[str] = LAYERS) -> Motions:
    """Return errors of outlines of layers and bones, aim and direction by name, by which forces are differentiated."""
    found: Motions = {_hat(outline, arc): MeshMotion(outline, arc) for outline in layers for arc in _HATS}
    found |= {f"{bone} {way}": MeshMotion(bone, turned=turned) for bone in bones for way, turned in _BONES_WAYS.items()}
    aside = {"aim": LateralPlacement(offset_mm=AIM_SD_MM), "direction": LateralPlacement(tilt_deg=DIRECTION_SD_DEG)}
    return found | aside
