"""The skin beside the cylinder: by how much it stands above where it was at first touch.

A scanner or cameras give points: a frame a time, ``x_mm, y_mm`` of the skin in the outlines' coordinates, tracked or
not. Along the line of travel, and at an offset to its left, the skin stands where a parabola through the points within
a few millimetres has it; its rise is how far that has moved against the travel since the first frame, which is taken
before the cylinder presses. So what is off in the registration of both systems cancels but for the skin's slope. Line
and travel are the stated ones: a cylinder that is tilted doesn't turn the image, in which the lines would graze a skin
that is steep there already.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from legfem.channels import Sight
from legfem.channels import kind as base
from legfem.channels.laid import Laid
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site
from legfem.geometry.section import across, first_crossing

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_CAMERAS = base.ChannelAccuracy(reading=0.2, bias=0.2, gain=0.01, slow=0.2, lag=0.05, shift=1.0, turn=1.0)
"""Points are laid into the section by marks or by its outline: 1 mm aside is 0.4 mm of the rise at 18 mm of travel."""
_OFFSETS_MM = (25.0, 40.0, -25.0, -40.0)
"""Distances to the left of the travel at which the skin's rise is told; negative ones lie to the right."""
_NEAR_MM = 4.0
"""Distance from an offset within which a parabola is fitted to points."""
_PRESSED = 0.03
"""Share of the largest force from which on a first frame shows a leg that is pressed."""


def _rise(offset: float) -> base.ChannelKind:
    side, distance = "left" if offset > 0 else "right", abs(offset)
    words = f"rise of the skin {distance:g} mm to the {side} of the line of travel since first touch"
    return base.ChannelKind(f"skin_rise_{side}_{distance:g}", "mm", words, _CAMERAS, 0.012, image="image of the skin")


RISES = {offset: _rise(offset) for offset in _OFFSETS_MM}
"""By the offset to the left of the travel, mm."""


class SkinRises(base.FramesFile[Site]):
    """Rises of the skin beside the cylinder, against the travel."""

    kinds: ClassVar = tuple(RISES.values())
    entry = "skin_profile"
    columns = ("x_mm", "y_mm")

    def laid(self, seen: "Seen", images: Sequence[Laid]) -> Sequence[base.Channels]:
        """Return the rises that images show, shifted, and turned about the axis of the cylinder at first touch.

        None of a line that doesn't meet the skin.
        """
        skin, count = seen.profile, len(RISES)
        ways = np.repeat([image.turned(skin.direction) for image in images], count, axis=0)
        origins = np.repeat([image.truly(skin.origin, skin.origin) for image in images], count, axis=0)
        values, rates = skin.rises(origins + np.tile([*RISES], len(images))[:, None] * across(ways), ways)
        each = [(k, kind.name) for k, kind in enumerate([*RISES.values()] * len(images)) if np.isfinite(values[k])]
        return [
            {name: (float(values[k]), rates[:, k]) for k, name in each if k // count == number}
            for number in range(len(images))
        ]

    def plans(self, site: Site) -> Sequence[base.ChannelPlan]:
        """Return the rises next to the cylinder."""
        asks = "photograph the skin 25 mm to either side of the cylinder at {at}"
        near = Sight(RISES[25.0].name), Sight(RISES[-25.0].name)
        return [base.ChannelPlan(asks, near, "two cameras with a scale, or a scanner", frames=True)]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse a skin that moves farther than the cylinder."""
        depth, error = float(np.nanmax(recorded.depth)), 3 * (recorded.accuracy.reading + recorded.accuracy.bias)
        most = float(recorded.values[np.argmax(np.abs(recorded.values))])
        if abs(most) <= depth + error:
            return None
        problem = f"the skin rises by {most:.3g} mm where the cylinder moves by {depth:.3g} mm"
        return base.Impossible(problem, "check its unit; it is counted from first touch")

    def place(self, kind: base.ChannelKind, site: Site) -> FloatArray:
        """Return the point of the skin."""
        offset = next(offset for offset, one in RISES.items() if one == kind)
        origin = site.touch + offset * across(site.direction)
        skin = site.section.polygon("skin").exterior
        return np.asarray(origin + first_crossing(skin, origin, site.direction) * site.direction)

    def of_frames(self, frames: Sequence[base.Frames], site: Site) -> Sequence[Sequence[base.Read]]:
        """Return the rises at the offsets where all frames of a trial have the skin."""
        return [self._of_trial(one, site) for one in frames]

    @staticmethod
    def _of_trial(frames: base.Frames, site: Site) -> Sequence[base.Read]:
        times, frame = np.unique(frames.time, return_inverse=True)
        if len(times) < 2:
            remedy = "give the points of one frame a time, two times at least"
            raise InputError("frames", "time_s", f"{len(times)} frame", remedy)
        refuse_pressed(frames, "rises are counted from it")
        found = []
        for offset, kind in RISES.items():
            along = np.array([_skin_at(frames.columns[frame == k], offset, site) for k in range(len(times))])
            if np.isfinite(along).all():
                found.append(base.Read(kind.name, times[1:], along[0] - along[1:]))
        if not found:
            offsets = ", ".join(f"{value:+g}" for value in sorted(RISES))
            problem = f"no frame after the first has the skin at any of {offsets} mm beside the line of travel"
            remedy = "give points in the outlines' coordinates, a few mm apart"
            raise InputError("frames", "x_mm, y_mm", problem, remedy)
        return found


def _skin_at(points: FloatArray, offset: float, site: Site) -> float:
    """Return where along the travel (mm) points (n, 2) have the skin at an offset; NaN where they haven't."""
    aim, middle = np.asarray(site.indenter.aim), np.asarray(site.section.polygon("skin").centroid.coords[0])
    along, left = (points - aim) @ site.direction, (points - aim) @ across(site.direction)
    near = (np.abs(left - offset) <= _NEAR_MM) & (along < (middle - aim) @ site.direction)
    at = left[near] - offset
    if len(at) < 2 or at.min() > 0 or at.max() < 0 or np.ptp(at) == 0:
        return float("nan")
    # The skin is curved: by 0.1 mm over a few millimetres.
    return float(Polynomial.fit(at, along[near], min(2, len(at) - 1))(0.0))


def refuse_pressed(frames: base.Frames, why: str) -> None:
    """Refuse a first frame that shows a leg that is pressed already.

    Raises
    ------
    InputError
        If it does.
    """
    first, force = float(frames.time.min()), frames.trial_force - frames.trial_force[0]
    at = float(np.interp(first, frames.trial_time, force))
    if abs(at) > _PRESSED * np.abs(force).max():
        problem = f"the first frame, at {first:g} s, shows a leg pressed with {at:.2g} N already"
        raise InputError("frames", "time_s", problem, f"begin with a frame from before the cylinder presses: {why}")
