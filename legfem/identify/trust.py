"""Where an emulator is to be trusted: near complete solves, away from failed ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray

# Distance from what was solved beyond which an emulator of two coordinates isn't trusted.
_REACH = 1.2


@dataclass(frozen=True, eq=False)
class Trust:
    """The trusted region, in the emulator's q coordinates.

    Parameters
    ----------
    complete : (n, q) array
        Solves that reached their depth; at least one.
    failed : (k, q) array
        Solves that stopped short.
    """

    complete: FloatArray
    failed: FloatArray

    def share_of_way(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest complete solves (m, q), and how far from there to ``at`` (m,).

        1 is all the way: the point itself is trusted. Else a point goes along the straight line
        to the nearest complete solve: until within reach of it, and until no failed solve is
        nearer.
        """
        solved = self.complete
        distance = np.linalg.norm(at[:, None] - solved[None], axis=-1)
        nearest = solved[np.argmin(distance, axis=1)]
        apart = np.min(distance, axis=1)
        reach = _REACH * math.sqrt(max(solved.shape[1], 2) / 2)
        share = np.minimum(1.0, reach / np.maximum(apart, 1e-300))
        direction = at - nearest
        for one in self.failed:
            # Where the line from the complete solve meets the plane half-way to the failed one.
            gap = one - nearest
            along = np.sum(direction * gap, axis=-1)
            half = 0.5 * np.sum(gap**2, axis=-1)
            share = np.where(along > half, np.minimum(share, half / np.maximum(along, 1e-300)), share)
        return nearest, share
