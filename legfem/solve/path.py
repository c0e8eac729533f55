"""What a simulated test went through: force and its derivatives against time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from legfem.common.units import FloatArray
from legfem.solve.force_curve import ForceCurve


@dataclass(frozen=True, eq=False)
class Path:
    """All solved steps of a test, the start included.

    Parameters
    ----------
    time : ndarray
        (n,), s, increasing.
    displacement : ndarray
        (n,), mm.
    force : ndarray
        (n,), N.
    sensitivities : Mapping[str, ndarray]
        Derivative of the force (N per unit of the parameter) by the parameter's full name, (n,).
    """

    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def loading(self) -> ForceCurve:
        """The first loading, against displacement."""
        moves_in = np.diff(self.displacement) > 0
        end = len(moves_in) if moves_in.all() else int(np.argmin(moves_in))
        part = slice(0, end + 1)
        return ForceCurve(
            self.displacement[part],
            self.force[part],
            {name: values[part] for name, values in self.sensitivities.items()},
        )

    def force_at(self, time: ArrayLike) -> FloatArray:
        """Return the force (N) at times (s)."""
        return self._at(time, self.force)

    def sensitivity_at(self, parameter: str, time: ArrayLike) -> FloatArray:
        """Return the derivative of the force by a parameter at times (s)."""
        return self._at(time, self.sensitivities[parameter])

    def _at(self, time: ArrayLike, values: FloatArray) -> FloatArray:
        """Interpolate within the parts between which the speed jumps.

        Splines where the indenter moves; in holds, monotonic pieces, since what relaxes faster than
        the first step would make a spline swing.
        """
        asked = np.clip(np.asarray(time, dtype=float), self.time[0], self.time[-1])
        result = np.empty_like(asked)
        rate = np.diff(self.displacement) / np.diff(self.time)
        scale = np.abs(rate).max()
        jumps = np.flatnonzero(np.abs(np.diff(rate)) > 1e-6 * scale) + 1
        ends = np.concatenate([[0], jumps, [len(rate)]])
        for first, last in pairwise(ends):
            part = slice(first, last + 1)
            inside = (asked >= self.time[first]) & (asked <= self.time[last])
            spline = CubicSpline if abs(rate[first]) > 1e-6 * scale else PchipInterpolator
            result[inside] = spline(self.time[part], values[part])(asked[inside])
        return result
