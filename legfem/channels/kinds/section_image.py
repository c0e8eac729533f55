r"""Images of the section: displacements inside it (speckle tracking, elastography's B-mode, MR tagging), and strains.

A file of displacements has a frame a time: points ``x_mm, y_mm`` where they were before the cylinder pressed, in the
outlines' coordinates, and by how much they have moved since. Errors of tracking are alike over some millimetres, so
that points are taken together in cells of a few millimetres; a cell's mean moves as the tissue at the points' middle
does.

A file of strains along the travel, as strain elastography shows them, has the same points, and the strain there since,
below zero where the tissue is shortened. An estimator fits a line to displacements along the beam over a window of
length w, so that a reading at :math:`X` is

.. math:: \frac{e \cdot (u(X + w e / 2) - u(X - w e / 2))}{w}

with the travel's direction :math:`e`. The image may lie beside where it is said to: `legfem.channels.laid`.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray

from legfem.channels import Sight
from legfem.channels import kind as base
from legfem.channels.laid import Laid
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site
from legfem.geometry.section import across, first_crossing

if TYPE_CHECKING:
    from legfem.channels.seen import Seen


CELL_MM = 6.0
"""Points are taken together in cells of this size, or of more where there would be too many."""
_LEAST_EXTENT_MM = 1.0
"""Of several points: images of a section are some centimetres wide."""


def _in_tissue(points: FloatArray, site: Site, beyond: float) -> NDArray[np.bool_]:
    """Return which of points (n, 2) lie in soft tissue, or up to some mm beyond it (within, if these are below 0)."""
    section = site.section
    tissue = section.polygon("skin").buffer(beyond)
    for bone in section.bones:
        tissue = tissue.difference(section.polygon(bone).buffer(max(-beyond, 0.0)))
    return np.asarray(shapely.contains_xy(tissue, points[:, 0], points[:, 1]))


_PLANNED_DEPTHS_MM = (5.0, 12.0, 19.0, 26.0)
"""Depths of planned cells' middles below the skin."""
_PLANNED_LEFT_MM = (-12.0, 0.0, 12.0)
"""Distances of planned cells' middles to the left of the travel."""
_PLANNED_INSIDE_MM = 3.0
"""Distance of planned cells from every tissue's outer bound and from bone: outlines that are off, and images that lie
elsewhere, show them too."""


def planned_cells(site: Site) -> list[tuple[float, float]]:
    """Return the middles x, y of cells beneath the cylinder, mm, of those that lie in soft tissue."""
    skin, way = site.section.polygon("skin").exterior, site.direction
    middles = []
    for left in _PLANNED_LEFT_MM:
        start = site.touch + left * across(way)
        middles += [start + (first_crossing(skin, start, way) + depth) * way for depth in _PLANNED_DEPTHS_MM]
    inside = _in_tissue(np.array(middles), site, -_PLANNED_INSIDE_MM)
    return [(round(float(x), 3), round(float(y), 3)) for (x, y), kept in zip(middles, inside, strict=True) if kept]


class _InCells(base.FramesFile[Site], ABC):
    """What an image shows, as means of the points in cells of the section; a place begins with x and y (mm)."""

    coordinates = 2
    beyond: ClassVar[float]
    """Distance from the tissue to which a point may lie outside it, mm; below zero, that to which it lies inside."""
    most: ClassVar[int]
    """Greatest number of cells unless the file's entry has one."""
    ways: ClassVar[tuple[tuple[float, ...], ...]]
    """What follows x and y in a place, for each column of readings."""
    asks: ClassVar[str]
    needs: ClassVar[str]

    @abstractmethod
    def laid(self, seen: "Seen", images: Sequence[Laid]) -> Sequence[base.Channels]:
        """Return what images show in the cells."""

    def plans(self, site: Site) -> Sequence[base.ChannelPlan]:
        """Return the readings of cells beneath the cylinder."""
        places = tuple((*middle, *way) for middle in planned_cells(site) for way in self.ways)
        needed = f"{self.needs}, and where the image lies in the outlines"
        return [base.ChannelPlan(self.asks, (Sight(self.entry, places),), needed, frames=True)]

    def of_frames(self, frames: Sequence[base.Frames], site: Site) -> Sequence[Sequence[base.Read]]:
        """Return the means of the points that lie in tissue, by cells of all trials together."""
        inside = [_in_tissue(one.columns[:, :2], site, self.beyond) for one in frames]
        kept, every = sum(int(one.sum()) for one in inside), sum(len(one.columns) for one in frames)
        if 2 * kept < every:
            remedy = "give the points in the outlines' coordinates, where they were before the cylinder pressed"
            raise InputError("frames", "x_mm, y_mm", f"{kept} of {every} points lie in soft tissue", remedy)
        rows = [one.columns[here] for one, here in zip(frames, inside, strict=True)]
        if 0 < np.ptp(np.concatenate(rows)[:, :2], axis=0).max() < _LEAST_EXTENT_MM:
            raise InputError("frames", "x_mm, y_mm", "all points lie within a millimetre", "give mm, not m")
        middles, cells = _cells_of(np.concatenate(rows)[:, :2], site.touch, frames[0].cells or self.most)
        of_trial = np.split(cells, np.cumsum([len(one) for one in rows])[:-1])
        ways = len(self.ways)
        places = tuple((round(float(x), 3), round(float(y), 3), *way) for x, y in middles for way in self.ways)
        found = []
        for one, here, row, cell in zip(frames, inside, rows, of_trial, strict=True):
            keys, at, count = np.unique(
                np.column_stack([one.time[here], cell]), axis=0, return_inverse=True, return_counts=True
            )
            means = np.column_stack([np.bincount(at.ravel(), column) / count for column in row[:, 2:].T])
            course = (ways * keys[:, 1:].astype(int) + np.arange(ways)).ravel()
            found.append([base.Read(self.entry, np.repeat(keys[:, 0], ways), means.ravel(), course, places)])
        return found

    def place(self, kind: base.ChannelKind, site: Site) -> FloatArray:
        """Return a point under the cylinder, within the tissue."""
        return np.asarray(site.deepest + 2 * CELL_MM * site.direction)


def _cells_of(points: FloatArray, origin: FloatArray, most: int) -> tuple[FloatArray, NDArray[np.int_]]:
    """Return the means (k, 2) of points (n, 2) in each of at most ``most`` cells, mm, and the points' cells (n,)."""
    size = CELL_MM
    while True:
        known, cell = np.unique(np.floor((points - origin) / size).astype(int), axis=0, return_inverse=True)
        if len(known) <= most:
            break
        size *= 1.15
    cell = cell.ravel()
    return np.array([points[cell == k].mean(axis=0) for k in range(len(known))]), cell


_TRACKING = base.ChannelAccuracy(reading=0.3, gain=0.02, slow=0.1, lag=0.1, shift=2.0, turn=3.0, apart=4.0)
"""Accuracy of a cell; the slow error is tracking's drift. The image is laid into the section by hand."""
INSIDE = base.ChannelKind(
    "section_displacement",
    "mm",
    "displacement of points inside the section since before the cylinder pressed",
    _TRACKING,
    0.006,
    image="image of displacements",
)
_TOO_FAR = 1.3
"""Largest movement of a point over the cylinder's, besides `_TOO_FAR_MM`."""
_TOO_FAR_MM = 3.0
"""What a point may move more than that."""
_AT_REST_MM = 2.0
"""Largest movement of points before the cylinder touches."""
_RESTING_MM = 0.5
"""Depth of the cylinder below which the tissue counts as unloaded."""


class SectionDisplacements(_InCells):
    """Displacements in both directions of the outlines' coordinates, in cells; a place is x, y (mm) and 0 or 1."""

    kinds: ClassVar = (INSIDE,)
    entry = INSIDE.name
    columns = ("x_mm", "y_mm", "ux_mm", "uy_mm")
    beyond, most, ways = 1.0, 20, ((0.0,), (1.0,))
    asks = "take ultrasound images of the section before the test and at {at}, and track how the tissue moves"
    needs = "an ultrasound probe, software that tracks speckle"

    def laid(self, seen: "Seen", images: Sequence[Laid]) -> Sequence[base.Channels]:
        """Return the displacements that images show there."""
        places = seen.places(INSIDE.name)
        if not len(places):
            return []
        at = places[:, :2]
        values, rates = seen.moves(np.stack([image.truly(at, at.mean(axis=0)) for image in images]))
        rows, way = np.arange(len(places)), places[:, 2].astype(int)
        return [
            INSIDE.by_course(image.shown(values[k])[rows, way], image.shown(rates[:, k])[:, rows, way])
            for k, image in enumerate(images)
        ]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse displacements that are too large, against the travel, or not counted from first touch."""
        pressed = np.isfinite(recorded.depth)
        depth, values, places = recorded.depth[pressed], recorded.values[pressed], recorded.places[pressed]
        deepest, largest = float(depth.max(initial=0.0)), float(np.abs(values).max(initial=0.0))
        if largest > _TOO_FAR * deepest + _TOO_FAR_MM:
            problem = f"points move by up to {largest:.3g} mm where the cylinder moves by {deepest:.3g} mm"
            return base.Impossible(problem, "check the unit of ux_mm and uy_mm")
        at_rest = values[depth < _RESTING_MM]
        moved = float(np.sqrt(2 * np.mean(at_rest**2))) if len(at_rest) else 0.0
        if moved > _AT_REST_MM:
            problem = f"points have moved by {moved:.2g} mm before the cylinder touches"
            return base.Impossible(problem, "count displacements from a frame before it presses")
        along = values * recorded.site.direction[places[:, 2].astype(int)]
        deep = depth > 0.5 * deepest
        total = float(np.mean(along[deep])) if deep.any() else 0.0
        if total < -0.05 * deepest:
            remedy = "check the directions of ux_mm and uy_mm: they are those of the outlines' coordinates"
            return base.Impossible(f"points move by {-total:.2g} mm against the cylinder's travel in the mean", remedy)
        return None

    def arrows(self, places: FloatArray, site: Site) -> tuple[FloatArray, FloatArray]:
        """Return the points, and the directions of the outlines' coordinates."""
        return places[:, :2], np.eye(2)[places[:, 2].astype(int)]


STRAIN = base.ChannelKind(
    "section_strain",
    "-",
    "strain along the travel inside the section",
    base.ChannelAccuracy(reading=0.02, gain=0.05, slow=0.005, lag=0.1, shift=2.0, turn=3.0, apart=4.0),
    0.0005,
    image="image of strain",
    detail="since before the cylinder pressed",
)
"""Accuracies of a cell, by what quasi-static elastography reports of phantoms: a few per cent of strain."""
WINDOW_MM = 3.0
"""Over which an estimator fits its line."""
_LARGEST = 0.9
_STRAIN_AT_REST = 0.1
"""What strains may be where the cylinder has moved by less than this."""


class SectionStrains(_InCells):
    """Strains along the travel, in cells; a place is x, y, mm."""

    kinds: ClassVar = (STRAIN,)
    entry = STRAIN.name
    columns = ("x_mm", "y_mm", "strain")
    beyond, most, ways = -WINDOW_MM, 30, ((),)
    asks = "image the strain of the section at {at} by strain elastography"
    needs = "ultrasound with strain elastography"

    def laid(self, seen: "Seen", images: Sequence[Laid]) -> Sequence[base.Channels]:
        """Return the strains that images show there, along a beam that is turned with each."""
        places = seen.places(STRAIN.name)
        if not len(places):
            return []
        way, middle = seen.model.system.direction, places.mean(axis=0)
        ends = np.stack([places + 0.5 * WINDOW_MM * way, places - 0.5 * WINDOW_MM * way])
        values, rates = seen.moves(np.stack([image.truly(ends, middle) for image in images]))
        strains, rising = ((of[..., 0, :, :] - of[..., 1, :, :]) / WINDOW_MM for of in (values, rates))
        return [
            STRAIN.by_course(image.shown(strains[k]) @ way, image.shown(rising[:, k]) @ way)
            for k, image in enumerate(images)
        ]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse strains in per cent, of the other sign, or not counted from first touch."""
        pressed = np.isfinite(recorded.depth)
        depth, values = recorded.depth[pressed], recorded.values[pressed]
        largest = float(np.abs(values).max(initial=0.0))
        if largest > _LARGEST:
            return base.Impossible(f"it is up to {largest:.3g}", "give strain as a share of length, not in per cent")
        at_rest = values[depth < _RESTING_MM]
        stood = float(np.sqrt(np.mean(at_rest**2))) if len(at_rest) else 0.0
        if stood > _STRAIN_AT_REST:
            remedy = "count strains from a frame before it presses, summed from frame to frame"
            return base.Impossible(f"the tissue is strained by {stood:.2g} before the cylinder touches", remedy)
        deep = depth > 0.5 * depth.max(initial=0.0)
        if deep.any() and float(np.mean(values[deep])) > max(0.02, 2 * recorded.accuracy.reading):
            problem = f"the tissue is stretched along the travel, by {np.mean(values[deep]):.2g} in the mean"
            return base.Impossible(problem, "give a shortening as a strain below zero")
        return None
