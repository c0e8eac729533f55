"""Fixed points of a map that is dear to evaluate."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray


class AndersonMixing:
    r"""Anderson's acceleration of :math:`x_{k+1} = g(x_k)`.

    The next point is that combination of the last ones, weights summing to one, whose residuals
    :math:`g(x) - x` nearly cancel, plus what is left of them. D. G. Anderson, J. ACM 12 (1965)
    547-560.

    Parameters
    ----------
    memory : int
        Number of differences kept.
    """

    def __init__(self, memory: int = 6) -> None:
        self._memory = memory
        self._points: list[FloatArray] = []
        self._residuals: list[FloatArray] = []

    def next(self, point: FloatArray, image: FloatArray) -> FloatArray:
        """Return the next point, of a point and its image."""
        self._points.append(point.copy())
        self._residuals.append(image - point)
        del self._points[: -self._memory - 1], self._residuals[: -self._memory - 1]
        if len(self._points) == 1:
            return image.copy()
        moved = np.diff(self._points, axis=0).reshape(len(self._points) - 1, -1)
        changed = np.diff(self._residuals, axis=0).reshape(len(moved), -1)
        last = self._residuals[-1].ravel()
        share = np.linalg.lstsq(changed.T, last, rcond=1e-10)[0]
        return image - (share @ (moved + changed)).reshape(image.shape)
