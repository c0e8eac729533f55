r"""A smooth stand-in for a model, through its solved values and exact derivatives.

Of :math:`\ln F(d_i)` at all grid points :math:`d_i` at once (`legfem.inference.kriging`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.inference.kriging import Kriging

# The solved curve is a spline through adaptive steps, so that it is smooth in the stiffness to some
# 1e-4 only; less makes neighbouring samples contradict each other.
_NUGGET = 1e-8
_SMALLEST_FORCE_N = 1e-9


@dataclass(frozen=True, eq=False)
class Samples:
    """Solved points: forces on the grid and their derivatives.

    Parameters
    ----------
    at : (n, p) array
        Coordinates.
    force : (n, m) array
        N.
    slopes : (n, p, m) array
        Derivatives of the force by the coordinates (N).
    """

    at: FloatArray
    force: FloatArray
    slopes: FloatArray


class Emulator:
    """Force on a grid of displacement anywhere, from solved samples.

    Parameters
    ----------
    samples : Samples
        At least one, through which alone ln F is linear in the coordinates.
    """

    def __init__(self, samples: Samples) -> None:
        self.samples = samples
        force = np.maximum(samples.force, _SMALLEST_FORCE_N)
        slopes = samples.slopes / force[:, None, :]
        self._log_force = Kriging(samples.at, np.log(force), slopes, _NUGGET)

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return self._log_force.dimensions

    @property
    def lengths(self) -> FloatArray:
        """Lengths (p,) of the covariance."""
        return self._log_force.lengths

    def __call__(self, at: FloatArray) -> FloatArray:
        """Return the force (..., m) in N at coordinates (..., p)."""
        # Far outside the samples the trend may run away.
        return np.asarray(np.exp(np.clip(self._log_force(at), -30.0, 30.0)))
