"""Images of the section: which of their points lie in tissue, cells of points, and gradients between these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from legfem.channels.kind import Frames, FramesError
from legfem.channels.site import Site
from legfem.common.units import FloatArray
from legfem.geometry.section import BONES

CELL_MM = 6.0
"""Points are taken together in cells of this size, or of more where there would be too many."""
_FEWEST, _STEP_MM = 4, 0.5
"""Places of a frame that have a gradient, and the step that it is taken over."""


def in_tissue(points: FloatArray, site: Site, beyond: float) -> NDArray[np.bool_]:
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
    inside = [in_tissue(one.columns[:, :2], site, beyond) for one in frames]
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


def gradient(at: FloatArray, values: FloatArray) -> FloatArray:
    """Return the gradient (n, 2) at places (n, 2) of a thin-plate spline through values (n,) there; 0 of a few."""
    if len(at) < _FEWEST or np.linalg.matrix_rank(at - at.mean(axis=0)) < 2:
        return np.zeros((len(at), 2))
    spline = RBFInterpolator(at, values)
    steps = _STEP_MM * np.eye(2)
    return np.column_stack([(spline(at + step) - spline(at - step)) / (2 * _STEP_MM) for step in steps])
