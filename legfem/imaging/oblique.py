"""Label volumes whose grid is turned against the patient's axes, brought onto them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import affine_transform, binary_dilation

from legfem.common.errors import InputError
from legfem.common.units import FloatArray

_SHEAR = 1e-3
_HALF = 0.5


def along_axes(array: NDArray[np.integer], affine: FloatArray, source: str) -> tuple[NDArray[np.integer], FloatArray]:
    """Return labels resampled on a grid along the coordinates' axes, and its affine (4, 4).

    Every label's share is interpolated linearly, and the largest wins, so that outlines move by a
    small part of a voxel. Only levels remain at which no tissue lies at the old grid's ends: beyond
    them nothing is known of the leg.

    Parameters
    ----------
    array
        Labels, (n_1, n_2, n_3), 0 in the background.
    affine
        The array's indices to mm; its axes are nearest to x, y and z in this order, and point
        their way.
    source
        What errors name as the file.

    Raises
    ------
    InputError
        If the grid is sheared, or nowhere holds the leg's whole section.
    """
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    cosines = affine[:3, :3] / spacing
    if np.abs(cosines.T @ cosines - np.eye(3)).max() > _SHEAR:
        raise InputError(
            source,
            "affine",
            "the grid is sheared: its axes aren't square to each other",
            "resample the volume along the scanner's axes",
        )
    ends = np.array(np.meshgrid(*([0, n - 1] for n in array.shape), indexing="ij")).reshape(3, -1)
    corners = affine[:3, :3] @ ends + affine[:3, 3:]
    origin = corners.min(axis=1)
    shape = tuple(np.ceil((corners.max(axis=1) - origin) / spacing).astype(int) + 1)
    back = np.linalg.inv(affine[:3, :3])
    matrix, offset = back * spacing, back @ (origin - affine[:3, 3])

    def moved(values: NDArray[np.generic], outside: float) -> NDArray[np.float32]:
        return np.asarray(
            affine_transform(
                values.astype(np.float32), matrix, offset, shape, np.float32, 1, "constant", outside, prefilter=False
            )
        )

    best = np.zeros(shape, dtype=np.float32)
    found = np.zeros(shape, dtype=array.dtype)
    for label in np.unique(array):
        share = moved(array == label, float(label == 0))
        larger = share > best
        best[larger], found[larger] = share[larger], label
    outside = moved(np.ones(array.shape), 0.0) < _HALF
    cut = (binary_dilation(outside, iterations=2) & (found > 0)).any(axis=(0, 1))
    first, last = _longest(~cut & (found > 0).any(axis=(0, 1)))
    if last - first < 2:
        raise InputError(
            source,
            "affine",
            "the grid is oblique, and no level holds the leg's whole section",
            "scan or label more of the leg",
        )
    straight = np.diag([*spacing, 1.0])
    straight[:3, 3] = origin
    straight[2, 3] += first * spacing[2]
    return np.ascontiguousarray(found[:, :, first:last]), straight


def _longest(kept: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the first number, and the one after the last, of the longest run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], kept.astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    if not len(runs):
        return 0, 0
    first, last = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return int(first), int(last)
