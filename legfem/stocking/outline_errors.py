"""Errors of scanned outlines as a sum of independent ones, the greatest first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.curve import closed_lengths
from legfem.stocking.accuracy import ContourAccuracy

HELD = 0.95
"""Share of the errors' variance that the modes hold."""


@dataclass(frozen=True, eq=False)
class OutlineErrors:
    """Of one part of a leg.

    Parameters
    ----------
    modes : (n_levels, n_points, k) array
        Distances outwards of the part's points (mm), of a standard deviation each; orthogonal.
    """

    modes: FloatArray

    @property
    def count(self) -> int:
        """How many modes there are."""
        return self.modes.shape[-1]

    def shares(self, distances: FloatArray) -> FloatArray:
        """Return how much of every mode distances (n_levels, n_points, m) hold, (k, m)."""
        sizes = np.sum(self.modes**2, axis=(0, 1))
        return np.tensordot(self.modes, distances, ((0, 1), (0, 1))) / sizes[:, None]


def outline_errors(
    accuracy: ContourAccuracy, contours: FloatArray, levels: FloatArray, counts: FloatArray | float = 1.0
) -> OutlineErrors:
    """Return the errors of a part in one scan, as `ContourAccuracy.covariance` has them.

    Parameters
    ----------
    accuracy
        Of the scan.
    contours : (n_levels, n_points, 2) array
        Of the part, evenly spaced around (mm).
    levels : (n_levels,) array
        mm.
    counts : (n_levels,) array or float
        Share of the errors that counts at every level.
    """
    count = contours.shape[1]
    step = np.arange(count)
    way = np.minimum(step, count - step) / count * float(closed_lengths(contours).mean())
    height = np.abs(np.subtract.outer(levels, levels))
    zero = np.zeros(1)
    # The covariance is a product of one around and one along the leg; around, waves are its modes.
    around = np.fft.rfft(accuracy.covariance(way, zero)).real / accuracy.covariance(zero, zero)
    weight = np.broadcast_to(counts, levels.shape)
    size, along = np.linalg.eigh(accuracy.covariance(zero, height) * np.outer(weight, weight))
    waves, strength = _waves(around, count)
    variances = np.outer(strength, np.maximum(size, 0.0))
    order = np.argsort(-variances.ravel())
    share = np.cumsum(variances.ravel()[order]) / variances.sum()
    chosen = order[: 1 + int(np.searchsorted(share, HELD))]
    wave, line = np.unravel_index(chosen, variances.shape)
    scale = np.sqrt(variances.ravel()[chosen])
    return OutlineErrors(along[:, None, line] * waves[None, :, wave] * scale)


def _waves(around: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal waves on a closed contour, (count, m), and their variances, (m,)."""
    angle = 2 * np.pi * np.arange(count) / count
    columns, strength = [np.full(count, 1 / np.sqrt(count))], [around[0]]
    for number in range(1, (count + 1) // 2):
        for wave in (np.cos, np.sin):
            columns.append(np.sqrt(2 / count) * wave(number * angle))
            strength.append(around[number])
    return np.stack(columns, axis=1), np.maximum(np.array(strength), 0.0)
