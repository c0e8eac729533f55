r"""Displacements inside the section: speckle tracking, elastography's B-mode, or MR tagging.

A file has a frame a time: points ``x_mm, y_mm`` where they were before the cylinder pressed, in the outlines'
coordinates, and by how much they have moved since. Errors of tracking are alike over some millimetres, so that points
are taken together in cells of a few millimetres; a cell's mean moves as the tissue at the points' middle does.

An image is laid into the section by hand, or by its outline: it may lie :math:`s` beside where it is said to, and be
turned by :math:`\theta` about its middle :math:`c`. To first order a reading at :math:`X` then is

.. math:: u(X) + \nabla u\,(s + \theta\, e_z \times (X - c)) - \theta\, e_z \times u,

with the gradient of a thin-plate spline through what is predicted of the frame; between cells of 6 mm it is off by a
third of itself, which is an error of each place alone (`gradient_error`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from legfem.channels.image import CELL_MM, cell_means, cells_of, displaced_image, gradient_error, tissue_points
from legfem.channels.kind import (
    ChannelAccuracy,
    ChannelKind,
    Channels,
    Frames,
    FramesFile,
    Impossible,
    Read,
    ReadingsAtSite,
)
from legfem.channels.site import Site
from legfem.common.units import FloatArray

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_TRACKING = ChannelAccuracy(reading=0.3, gain=0.02, slow=0.1, lag=0.1, shift=2.0, turn=3.0, apart=4.0)
"""Of a cell; what is slow is tracking's drift from frame to frame. The image is laid into the section by hand."""
INSIDE = ChannelKind(
    "section_displacement",
    "mm",
    "displacement of points inside the section since before the cylinder pressed",
    _TRACKING,
    0.006,
)
_MOST_CELLS = 20
_OUTSIDE_MM = 1.0
_TOO_FAR, _TOO_FAR_MM = 1.3, 3.0
_AT_REST_MM, _RESTING_MM = 2.0, 0.5
"""By how much points may have moved where the cylinder has by less than this."""


class SectionDisplacements(FramesFile):
    """Displacements in both directions of the outlines' coordinates, in cells; a place is x, y (mm) and 0 or 1."""

    kinds: ClassVar = (INSIDE,)
    entry = INSIDE.name
    columns = ("x_mm", "y_mm", "ux_mm", "uy_mm")

    def read(self, seen: "Seen") -> Channels:
        """Return the displacements at the places where somebody looked."""
        places = seen.places(INSIDE.name)
        if not len(places):
            return {}
        values, rates = seen.moves(places[:, :2])
        rows, way = np.arange(len(places)), places[:, 2].astype(int)
        return {
            name: (float(value), rate)
            for name, value, rate in zip(
                INSIDE.courses(len(places)), values[rows, way], rates[:, rows, way].T, strict=True
            )
        }

    def check(self, kind: ChannelKind, recorded: ReadingsAtSite) -> Impossible | None:
        """Refuse displacements that are too large, against the travel, or not counted from first touch."""
        pressed = np.isfinite(recorded.depth)
        depth, values, places = recorded.depth[pressed], recorded.values[pressed], recorded.places[pressed]
        deepest, largest = float(depth.max(initial=0.0)), float(np.abs(values).max(initial=0.0))
        if largest > _TOO_FAR * deepest + _TOO_FAR_MM:
            return Impossible(
                f"points move by up to {largest:.3g} mm where the cylinder moves by {deepest:.3g} mm",
                "check the unit of ux_mm and uy_mm",
            )
        at_rest = values[depth < _RESTING_MM]
        moved = float(np.sqrt(2 * np.mean(at_rest**2))) if len(at_rest) else 0.0
        if moved > _AT_REST_MM:
            return Impossible(
                f"points have moved by {moved:.2g} mm before the cylinder touches",
                "count displacements from a frame before it presses",
            )
        along = values * recorded.site.direction[places[:, 2].astype(int)]
        deep = depth > 0.5 * deepest
        total = float(np.mean(along[deep])) if deep.any() else 0.0
        if total < -0.05 * deepest:
            return Impossible(
                f"points move by {-total:.2g} mm against the cylinder's travel in the mean",
                "check the directions of ux_mm and uy_mm: they are those of the outlines' coordinates",
            )
        return None

    def arrows(self, places: FloatArray, site: Site) -> tuple[FloatArray, FloatArray]:
        """Return the points, and the directions of the outlines' coordinates."""
        return places[:, :2], np.eye(2)[places[:, 2].astype(int)]

    def apart(self, places: FloatArray) -> FloatArray:
        """Return the distance of readings of one direction; those of different ones err by themselves."""
        between = np.linalg.norm(places[:, None, :2] - places[None, :, :2], axis=-1)
        return np.where(np.equal.outer(places[:, 2], places[:, 2]), between, np.inf)

    def shared(
        self,
        places: FloatArray,
        time: FloatArray,
        frame: NDArray[np.int_],
        values: FloatArray,
        accuracy: ChannelAccuracy,
    ) -> dict[str, FloatArray]:
        """Return what a shift of the image in either direction does, and a turn about its middle."""
        at, way = places[:, :2], places[:, 2].astype(int)
        found = displaced_image(at, values, 2 * frame + way, accuracy)
        for number in np.unique(frame):
            for k, sign in ((0, 1.0), (1, -1.0)):
                mine, others = (np.flatnonzero((frame == number) & (way == one)) for one in (k, 1 - k))
                # e_z x u is (-uy, ux).
                found["turn"][mine] += sign * np.deg2rad(accuracy.turn) * _beside(at[mine], at[others], values[others])
        return found

    def shared_is_off(self, places: FloatArray) -> float:
        """Return by how much the gradient is off that the image's place is weighed with."""
        return gradient_error(places[:, :2])

    def of_frames(self, frames: Sequence[Frames], site: Site) -> Sequence[Sequence[Read]]:
        """Return the cells' mean displacements, of points that lie in tissue."""
        inside = tissue_points(frames, site, _OUTSIDE_MM)
        points = [one.columns[kept, :2] for one, kept in zip(frames, inside, strict=True)]
        cells = cells_of(points, site.touch, _MOST_CELLS)
        places = tuple((round(float(x), 3), round(float(y), 3), float(way)) for x, y in cells.middles for way in (0, 1))
        return [
            [_means(one.time[kept], own, one.columns[kept, 2:], places)]
            for one, kept, own in zip(frames, inside, cells.of_trial, strict=True)
        ]

    def place(self, kind: ChannelKind, site: Site) -> FloatArray:
        """Return a point under the cylinder, within the tissue."""
        return np.asarray(site.deepest + 2 * CELL_MM * site.direction)


def _means(time: FloatArray, cell: NDArray[np.int_], moved: FloatArray, places: tuple[tuple[float, ...], ...]) -> Read:
    times, cells, means = cell_means(time, cell, moved)
    course = np.column_stack([2 * cells, 2 * cells + 1]).ravel()
    return Read(INSIDE.name, np.repeat(times, 2), means.ravel(), course, places)


def _beside(at: FloatArray, places: FloatArray, values: FloatArray) -> FloatArray:
    """Return the values (n,) of the places that are nearest to points (n, 2); 0 without any."""
    if not len(places):
        return np.zeros(len(at))
    return np.asarray(values[np.linalg.norm(at[:, None] - places[None], axis=-1).argmin(axis=1)])
