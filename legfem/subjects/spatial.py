"""The shape in 3D of the leg that a subject's folder describes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
from legfem.geometry.section import BONES, LegSection
from legfem.geometry.shape_motion import rigidly_moved
from legfem.subjects.loading import SUBJECTS
from legfem.subjects.placement import Placement, placed
from legfem.subjects.sites import subject_entry
from legfem.subjects.subject import Subject

LENGTH = 120.0
"""Of the leg that is modelled (mm), as that of the tabulated correction's idealised legs."""
_LEVELS = 5
_BEYOND = 10.0
"""Past the ends (mm) a scan is read, so that they are smooth, and square to a tilted cylinder."""
_SHORT = 1.0
"""mm that a scan may lack before it is said."""


@dataclass(frozen=True, eq=False)
class SpatialLeg:
    """A segment of a leg, the middle of the cylinder's axis at z = 0, its axis along z.

    Parameters
    ----------
    shape
        In the coordinates of the subject's section.
    source
        What the shape was taken from, in words.
    extruded
        Whether one section stands for the whole length, which is an assumption.
    """

    shape: LegShape
    source: str
    extruded: bool

    def trimmed(self, held: float, share: float) -> SpatialLeg:
        """Return the leg with a share of what lies beyond the middle ``held`` (mm) cut away."""
        half = 0.5 * held
        low, high = self.shape.levels[0], self.shape.levels[-1]
        z = np.linspace(low + share * (-half - low), high - share * (high - half), len(self.shape.levels))
        return replace(self, shape=self.shape.at_levels(z))


def spatial_leg(subject: Subject) -> SpatialLeg:
    """Return the leg in 3D about a subject's cylinder.

    It is taken from the scan, the stacked contours or the surfaces that the section was cut from.
    Where contours of one level are all there is, they are extruded.

    Raises
    ------
    InputError
        If what it is taken from doesn't hold the cylinder's whole length, or can't be read.
    """
    toml = SUBJECTS.opened(subject.directory)
    given = subject_entry(toml, subject.site).given
    length = given.section.length_mm or LENGTH
    held = subject.indenter.extent
    if length <= held:
        raise InputError(
            toml,
            "section.length_mm",
            f"{length:g} mm is no longer than the cylinder",
            f"give more than {held:g} mm, twice that or more",
        )
    place = placed(subject.directory, toml, given)
    if place.source is None:
        words = f"the measured section, extruded over {length:g} mm (assumed)"
        return SpatialLeg(_extruded(subject.section, length), words, True)
    shape = _about(place, 0.5 * length)
    low, high = (float(shape.levels[k]) for k in (0, -1))
    half = 0.5 * held
    if low > -half or high < half:
        raise InputError(
            place.source.name,
            "levels",
            f"reach from {low:.4g} to {high:.4g} mm about the cylinder's middle, which takes {held:g} mm",
            "scan a longer part of the leg, or press elsewhere",
        )
    words = f"{Path(place.source.name).name}, {low:.4g} to {high:+.4g} mm about the cylinder"
    if high - low < length - _SHORT:
        words += f" (all there is of {length:g} mm)"
    return SpatialLeg(shape, words, False)


def _extruded(section: LegSection, length: float) -> LegShape:
    names = {SKIN: "skin", HULL: "fascia", **{bone: bone for bone in BONES}}
    contours = {part: [section.contour(name)] * _LEVELS for part, name in names.items()}
    return shape_of_contours(np.linspace(-length / 2, length / 2, _LEVELS), contours)


def _about(place: Placement, half: float) -> LegShape:
    """Return the shape in the coordinates of the plane, up to ``half`` (mm) on either side."""
    plane, source = place.plane, place.source
    assert plane is not None and source is not None
    normal, tilt = plane.normal, float(np.hypot(plane.normal[0], plane.normal[1]))
    # How far the plane itself goes up and down over the leg.
    reach = (half + _BEYOND) * float(normal[2])
    outline = place.section.skin
    corners = outline[:, :1] * plane.axes[0] + outline[:, 1:] * plane.axes[1]
    above = (corners + (normal @ plane.point) * normal)[:, 2]
    shape = source.shape_between(float(above.min()) - reach, float(above.max()) + reach)
    shift = -float(normal @ plane.point)
    if tilt < 1e-9:
        moved = LegShape(shape.levels + shift, shape.contours)
    else:
        moved = rigidly_moved(shape, np.vstack([plane.axes, normal]), np.array([0.0, 0.0, shift]))
    low, high = max(-half, moved.levels[0]), min(half, moved.levels[-1])
    if low >= high:
        return moved
    inside = moved.levels[(moved.levels > low + 0.1) & (moved.levels < high - 0.1)]
    return moved.at_levels(np.concatenate([[low], inside, [high]]))
