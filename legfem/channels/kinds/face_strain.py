r"""Strains of a specimen's free face, by digital image correlation of points that a camera tracks on it.

A file has a frame a time: points ``x_mm, y_mm`` where they were before the test, x across as the camera sees the
specimen and y along its axis from the middle of its height, and by how much they have moved since. At a height
:math:`h`, as a share of half the specimen's, every frame has

.. math:: u_x = a - \omega y + \varepsilon_x(h)\, x, \qquad u_y = b + \omega x + \bar\varepsilon_y(h)\, y,

fitted by least squares with strains that are straight between `HEIGHTS`: the strain across, which on a round side is
that of its circumference, and the mean strain along from the middle to that height. What moves or turns as a whole,
camera, specimen or rig, is in :math:`a, b, \omega` and says nothing, so that it doesn't matter which plate moves. An
image that is laid a little beside the middle, or turned, errs in opposite ways above and below, left and right: what is
left of that is of second order.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from legfem.channels.kind import ChannelAccuracy, ChannelKind, Channels, Face, Frames, FramesFile, Impossible, Read
from legfem.common.errors import InputError
from legfem.common.units import FloatArray

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_CAMERA = ChannelAccuracy(reading=0.002, gain=0.03, slow=0.002, lag=0.1, each=0.03)
"""Points to a twentieth of a pixel, of which some hundred lie along the specimen; the scale, which changes as the side
bulges towards the camera; and by place a body that isn't quite round or level."""
FACE_STRAIN = ChannelKind(
    "face_strain",
    "-",
    "strain of the specimen's free face",
    _CAMERA,
    models=frozenset({"specimen"}),
    detail="across and along, by points that were tracked on it",
)
HEIGHTS = (0.0, 0.25, 0.5, 0.75)
"""Shares of half the height at which strains are read: farther out the side meets the plates, or grips shade it."""
ACROSS, ALONG = 0, 1
PLACES = tuple((height, float(ACROSS)) for height in HEIGHTS) + tuple((height, float(ALONG)) for height in HEIGHTS[1:])
"""Height and direction of every reading; along, the strain from the middle on is one up to the first height."""
_SHORT_OF = 0.05
"""How near points must reach to a height that is read, above the middle and below, over half the height."""
_OUTSIDE = 1.05
"""Share of half the height or width beyond which a point lies outside the face."""
_MOST_OUTSIDE = 0.1
"""Largest share of points that may lie outside."""
_LEAST_POINTS = 8
_TRAVEL = 0.05, 4.0
"""Bounds of the face's strains over the strain that the travel says."""
_AT_REST = 0.05
"""Share of the travel's strain below which the specimen rests."""
_STANDING = 0.3
"""Largest strain of the face at rest, over the travel's strain."""


def _shares(heights: FloatArray, knots: Sequence[float]) -> FloatArray:
    """Return how much of every knot's value is in what lies at heights (n,), (n, knots)."""
    return np.column_stack([np.interp(heights, knots, one) for one in np.eye(len(knots))])


_SAMPLED = (np.arange(18) + 0.5) * HEIGHTS[-1] / 18
_TO_ACROSS = np.linalg.pinv(_shares(_SAMPLED, HEIGHTS))
_TO_ALONG = np.linalg.pinv(_SAMPLED[:, None] * _shares(_SAMPLED, HEIGHTS[1:]))
"""From a model's side to what the least squares make of points that lie evenly on it."""


def homogeneous(across: Any, along: Any) -> dict[str, Any]:
    """Return the courses of a face that is strained alike everywhere."""
    names = FACE_STRAIN.courses(len(PLACES))
    return {name: (across, along)[int(way)] for name, (_, way) in zip(names, PLACES, strict=True)}


class FaceStrains(FramesFile[Sequence[Face]]):
    """Strains at `PLACES`; a place is a height over half the specimen's, and 0 across or 1 along."""

    kinds: ClassVar = (FACE_STRAIN,)
    entry = FACE_STRAIN.name
    columns = ("x_mm", "y_mm", "ux_mm", "uy_mm")
    coordinates = 1

    def read(self, seen: "Seen") -> Channels:
        """Return the strains of a round specimen's side, which has a mirror at height 0."""
        if seen.model.specimen is None or not seen.model.specimen.side:
            return {}
        radius, half = map(float, seen.model.places.max(axis=0))
        moved = seen.on_side(half * _SAMPLED)
        strains = np.hstack([moved[..., 0] / radius @ _TO_ACROSS.T, moved[..., 1] / half @ _TO_ALONG.T])
        return FACE_STRAIN.by_course(strains[0], strains[1:])

    def of_frames(self, frames: Sequence[Frames], site: Sequence[Face]) -> Sequence[Sequence[Read]]:
        """Return the strains in every frame, as far out as its points reach."""
        return [[_read(one, face)] for one, face in zip(frames, site, strict=True)]


def _read(frames: Frames, face: Face) -> Read:
    x, y = frames.columns[:, :2].T
    refused = partial(InputError, "frames", "x_mm, y_mm")
    outside = np.abs(y) > _OUTSIDE * face.half_height
    if face.half_width is not None:
        outside |= np.abs(x) > _OUTSIDE * face.half_width
    if outside.mean() > _MOST_OUTSIDE:
        remedy = "count x from the axis and y from the middle of the height, in mm, where points were before the test"
        raise refused(f"{outside.sum()} of {len(outside)} points lie outside the specimen's face", remedy)
    found = [
        (time, place, value)
        for time in np.unique(frames.time)
        for place, value in _strains(frames.columns[(frames.time == time) & ~outside], face.half_height)
    ]
    if not found:
        reach = f"reach from the middle to {HEIGHTS[1]:g} of half the height, above and below"
        remedy = "track points all over the face, and count y from the middle of the height"
        raise refused(f"no frame has {_LEAST_POINTS} points that {reach}", remedy)
    times, places, values = map(np.array, zip(*found, strict=True))
    return Read(FACE_STRAIN.name, times, values, places.astype(int), PLACES)


def _strains(points: FloatArray, half: float) -> Iterator[tuple[int, float]]:
    """Yield number and value of every place's strain in a frame of points x, y, ux, uy (n, 4), mm."""
    heights = points[:, 1] / half
    reach = min(float(heights.max(initial=0.0)), float(-heights.min(initial=0.0))) + _SHORT_OF
    knots = [one for one in HEIGHTS if one <= reach]
    x, y, across, along = points[np.abs(heights) <= knots[-1] + _SHORT_OF].T
    if len(knots) < 2 or len(x) < _LEAST_POINTS:
        return
    away, none = np.abs(y) / half, np.zeros(len(x))
    of_across, of_along = x[:, None] * _shares(away, knots), y[:, None] * _shares(away, knots[1:])
    moved = np.column_stack([np.ones(len(x)), none, -y]), np.column_stack([none, np.ones(len(x)), x])
    design = np.block([[moved[0], of_across, 0 * of_along], [moved[1], 0 * of_across, of_along]])
    solved, _, rank, _ = np.linalg.lstsq(design, np.concatenate([across, along]))
    if rank == design.shape[1]:
        places = (*range(len(knots)), *range(len(HEIGHTS), len(HEIGHTS) + len(knots) - 1))
        yield from zip(places, solved[3:].tolist(), strict=True)


def not_of_the_face(values: FloatArray, places: FloatArray, travelled: FloatArray) -> Impossible | None:
    """Return why strains (k,) at places (k, 2) can't be a face's; None where they can.

    Parameters
    ----------
    values, places
        As read.
    travelled
        (k,): the strain along that the travel says, NaN outside the first loading.
    """
    depth = np.abs(travelled)
    deep = depth > 0.5 * np.nanmax(depth, initial=0.0)
    if not deep.any():
        return Impossible("no frame lies within the loading", "count time_s on the recording's clock")
    said, farthest = float(np.mean(travelled[deep])), deep & (places[:, 1] == ALONG)
    farthest &= places[:, 0] == places[farthest, 0].max(initial=0.0)
    size = float(np.sqrt(np.mean(values[deep] ** 2))) / abs(said)
    if not _TRAVEL[0] < size < _TRAVEL[1]:
        remedy = "check the unit of ux_mm and uy_mm, and the specimen's size along the axis"
        return Impossible(f"the face is strained by {size:.2g} times what the travel says", remedy)
    if farthest.any() and float(np.mean(values[farthest])) / said < -_TRAVEL[0]:
        remedy = "check that y_mm lies along the axis, and that uy_mm counts the way it does"
        return Impossible("the face is strained along the other way than by the travel", remedy)
    rest = depth < _AT_REST * abs(said)
    stood = float(np.sqrt(np.mean(values[rest] ** 2))) / abs(said) if rest.any() else 0.0
    if stood > _STANDING:
        problem = f"the face is strained by {stood:.2g} of what the travel comes to before it begins"
        return Impossible(problem, "count displacements from a frame before the test")
    return None
