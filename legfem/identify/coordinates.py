"""The emulator's coordinates, in which a leg's force is smooth and a change by 1 is a large one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.identify.laws import IdentifiedLaw


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates of the q free parameters that are the model's.

    They are ln C10, which carries the scale of a tissue's stiffness, and ln(1 + C20 / C10), which
    is 0 for a neo-Hookean tissue and stays smooth where C20 rules; the logarithm of other
    logarithmic parameters, and a linear one over a quarter of its bounds' width.

    Parameters
    ----------
    law : IdentifiedLaw
        p free parameters.
    """

    law: IdentifiedLaw

    def of(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (..., q) of points (..., p)."""
        columns = [self._of(k, points) for k in self.law.of_model]
        return np.stack(columns, axis=-1) if columns else np.zeros((*points.shape[:-1], 0))

    def points(self, at: FloatArray, like: FloatArray) -> FloatArray:
        """Return the points (n, p) at coordinates (n, q), the instrument's as in others (n, p)."""
        found = np.array(like)
        names = self.law.names
        # A C20 is a multiple of its C10, which comes first.
        order = sorted(enumerate(self.law.of_model), key=lambda one: names[one[1]][-3:] == "C20")
        for q, k in order:
            if names[k].endswith(".C20"):
                found[..., k] = self._first(k, found) * np.expm1(at[..., q])
            elif self.law.parameters[k].scale == "linear":
                found[..., k] = at[..., q] * self._width(k)
            else:
                found[..., k] = np.exp(at[..., q])
        return found

    def derivatives(self, points: FloatArray) -> FloatArray:
        """Return those of the model's parameters by the coordinates at points (n, p); (n, q, q)."""
        indices, names = self.law.of_model, self.law.names
        matrix = np.zeros((len(points), len(indices), len(indices)))
        for q, k in enumerate(indices):
            if names[k].endswith(".C20"):
                first = self._first(k, points)
                matrix[:, q, q] = first + points[:, k]
                scale = self.law.index(_stiffness_of(names[k]))
                if scale is not None:
                    matrix[:, q, indices.index(scale)] = points[:, k]
            elif self.law.parameters[k].scale == "linear":
                matrix[:, q, q] = self._width(k)
            else:
                matrix[:, q, q] = points[:, k]
        return matrix

    def _of(self, k: int, points: FloatArray) -> FloatArray:
        parameter, value = self.law.parameters[k], points[..., k]
        if parameter.name.endswith(".C20"):
            return np.log1p(value / self._first(k, points))
        return value / self._width(k) if parameter.scale == "linear" else np.log(value)

    def _first(self, k: int, points: FloatArray) -> FloatArray:
        return self.law.column(points, _stiffness_of(self.law.names[k]))

    def _width(self, k: int) -> float:
        low, high = self.law.parameters[k].bounds
        return 0.25 * (high - low)


def _stiffness_of(name: str) -> str:
    """Return the name of the C10 that belongs to a C20."""
    return name.removesuffix("C20") + "C10"
