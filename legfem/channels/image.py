"""Images of the section: which of their points lie in tissue, cells of points, and gradients between these."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from legfem.channels.kind import ChannelAccuracy, Frames, FramesError
from legfem.channels.site import Site
from legfem.common.units import FloatArray
from legfem.geometry.section import BONES

CELL_MM = 6.0
"""Points are taken together in cells of this size, or of more where there would be too many."""
_FEWEST, _STEP_MM = 4, 0.5
"""Places of a frame that have a gradient, and the step that it is taken over."""
_ALL_OFF_MM = 18.0
"""Distance of places between which the field bends too much for any gradient."""


def _in_tissue(points: FloatArray, site: Site, beyond: float) -> NDArray[np.bool_]:
    """Return which of points (n, 2) lie in soft tissue, or up to some mm beyond it (within, if these are below 0)."""
    section = site.section
    tissue = section.polygon("skin").buffer(beyond)
    for bone in BONES:
        tissue = tissue.difference(section.polygon(bone).buffer(max(-beyond, 0.0)))
    return np.asarray(shapely.contains_xy(tissue, points[:, 0], points[:, 1]))


def tissue_points(frames: Sequence[Frames], site: Site, beyond: float) -> list[NDArray[np.bool_]]:
    """Return which rows of every trial's frames lie in tissue; their first two columns are x and y (mm).

    Raises
    ------
    FramesError
        If most don't.
    """
    inside = [_in_tissue(one.columns[:, :2], site, beyond) for one in frames]
    kept, every = sum(int(own.sum()) for own in inside), sum(len(one.columns) for one in frames)
    if 2 * kept < every:
        raise FramesError(
            "x_mm, y_mm",
            f"{kept} of {every} points lie in soft tissue",
            "give the points in the outlines' coordinates, where they were before the cylinder pressed",
        )
    return inside


@dataclass(frozen=True, eq=False)
class Cells:
    """Points of all trials taken together.

    Parameters
    ----------
    middles
        Mean of each cell's points, (k, 2), mm.
    of_trial
        Cell of every point of a trial, in the trials' order.
    """

    middles: FloatArray
    of_trial: tuple[NDArray[np.int_], ...]


def cells_of(points: Sequence[FloatArray], origin: FloatArray, most: int) -> Cells:
    """Return cells of points (n, 2) of every trial, ``most`` of them at most."""
    every, size = np.concatenate(points), CELL_MM
    while True:
        known, cell = np.unique(np.floor((every - origin) / size).astype(int), axis=0, return_inverse=True)
        if len(known) <= most:
            break
        size *= 1.15
    cell = cell.ravel()
    middles = np.array([every[cell == k].mean(axis=0) for k in range(len(known))])
    return Cells(middles, tuple(np.split(cell, np.cumsum([len(one) for one in points])[:-1])))


def cell_means(
    time: FloatArray, cell: NDArray[np.int_], values: FloatArray
) -> tuple[FloatArray, NDArray[np.int_], FloatArray]:
    """Return time and cell of every cell in every frame, (m,), and the means (m, q) of its points' values (n, q)."""
    keys, row, count = np.unique(np.column_stack([time, cell]), axis=0, return_inverse=True, return_counts=True)
    means = np.column_stack([np.bincount(row.ravel(), column) / count for column in values.T])
    return keys[:, 0], keys[:, 1].astype(int), means


def displaced_image(
    at: FloatArray, values: FloatArray, group: NDArray[np.int_], accuracy: ChannelAccuracy
) -> dict[str, FloatArray]:
    """Return by name what a shift of the image in either direction does, and a turn about its middle, (k,).

    By where readings are taken alone: what a turn does to a reading's direction is its kind's.

    Parameters
    ----------
    at
        Places of the readings, (k, 2), mm.
    values
        Predicted, (k,).
    group
        Number of the field that each is of, one a frame and direction, (k,).
    accuracy
        Of the image's place.
    """
    slopes = np.zeros((len(values), 2))
    for number in np.unique(group):
        rows = group == number
        slopes[rows] = _gradient(at[rows], values[rows])
    x, y = (at - at.mean(axis=0)).T
    return {
        "shift in x": accuracy.shift * slopes[:, 0],
        "shift in y": accuracy.shift * slopes[:, 1],
        "turn": np.deg2rad(accuracy.turn) * (slopes[:, 1] * x - slopes[:, 0] * y),
    }


def gradient_error(at: FloatArray) -> float:
    """Return the share of itself by which a gradient between places (k, 2) is off: a third at 6 mm, and as they lie."""
    places = np.unique(at, axis=0)
    if len(places) < 2:
        return 1.0
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    return min(1.0, float(np.median(apart.min(axis=1))) / _ALL_OFF_MM)


def _gradient(at: FloatArray, values: FloatArray) -> FloatArray:
    """Return the gradient (n, 2) at places (n, 2) of a thin-plate spline through values (n,) there; 0 of a few."""
    if len(at) < _FEWEST or np.linalg.matrix_rank(at - at.mean(axis=0)) < 2:
        return np.zeros((len(at), 2))
    spline = RBFInterpolator(at, values)
    steps = _STEP_MM * np.eye(2)
    return np.column_stack([(spline(at + step) - spline(at - step)) / (2 * _STEP_MM) for step in steps])
