"""A correction for a cylinder's ends: a factor on the force in plane strain, what it errs by, and its derivatives."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values, deep_stiffness
from legfem.inverse.comparison import ErrorSource

_STEP = 1e-4


class Correction(Protocol):
    """A factor on the plane-strain force, with its uncertainty (``1 - P(d)``, Eq. 3).

    Stiffnesses are those of the deep tissue in MPa, of any shape ``(...)``; displacements are ``(n,)`` in mm.
    """

    @property
    def name(self) -> str:
        """What reports call it."""
        ...

    @property
    def sources(self) -> Mapping[str, ErrorSource]:
        """Sources that its errors count to, by name; of others that is the ends."""
        ...

    def factor(self, displacement: FloatArray, c10: FloatArray, c20: FloatArray) -> FloatArray:
        """Return the factor (..., n)."""
        ...

    def relative_errors(self, displacement: FloatArray, c10: float, c20: float) -> Mapping[str, FloatArray]:
        """Return the modes (n,) of the factor's relative error, by what causes them."""
        ...


def corrected(
    correction: Correction | None,
    displacement: FloatArray,
    force: FloatArray,
    by: Mapping[str, FloatArray],
    values: Values,
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return forces at displacements (n,), mm, and their derivatives, times a correction's factor.

    Parameters
    ----------
    correction
        There is a factor of one without it.
    displacement
        (n,), mm.
    force
        (n,), N, in plane strain.
    by
        Its derivatives (n,) by the model's parameters, by name.
    values
        Of the model: MPa.
    """
    if correction is None:
        return force, dict(by)
    c10, c20 = deep_stiffness(values)

    def factor_at(one: float, other: float) -> FloatArray:
        return np.asarray(correction.factor(displacement, np.asarray(one), np.asarray(other)))

    factor = factor_at(c10, c20)
    found: dict[str, FloatArray] = {name: factor * derivative for name, derivative in by.items()}
    further, stiffening = c10 * (1 + _STEP), c20 + _STEP * c10
    for name, ends in ((DEEP_C10, (further, c20)), (DEEP_C20, (c10, stiffening))):
        if name in found:
            step = (ends[0] - c10) + (ends[1] - c20)
            found[name] = found[name] + force * (factor_at(*ends) - factor) / step
    return np.asarray(factor * force), found
