"""The 3D correction of the plane-strain force: where it enters, and the none there is so far."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from legfem.errors import InputError
from legfem.units import FloatArray


class Correction(Protocol):
    """A factor on the plane-strain force, with its uncertainty (``1 - P(d)``, Eq. 3).

    Stiffnesses are those of the deep tissue in kPa, of any shape ``(...)``; displacements are
    ``(n,)`` in mm.
    """

    @property
    def name(self) -> str:
        """What reports call it."""
        ...

    def factor(self, displacement: FloatArray, c10: FloatArray, c20: FloatArray) -> FloatArray:
        """Return the factor (..., n)."""
        ...

    def covariance(self, displacement: FloatArray, c10: float, c20: float) -> FloatArray:
        """Return the covariance (n, n) of the factor's error; it goes into the intervals."""
        ...


def find_correction(name: str) -> Correction | None:
    """Return the correction of that name or file; None for ``none``.

    Raises
    ------
    InputError
        For anything else: no correction has been calibrated yet.
    """
    if name == "none":
        return None
    raise InputError(
        "--correction", name, "no 3D correction is calibrated yet",
        "use --correction none: the stiffness is then that of the plane-strain model",
    )  # fmt: skip


def correction_factor(
    correction: Correction | None, displacement: FloatArray, c10: FloatArray, c20: FloatArray
) -> FloatArray:
    """Return the factor (..., n); 1 without a correction."""
    if correction is None:
        return np.ones((*np.shape(c10), len(displacement)))
    return correction.factor(displacement, c10, c20)
