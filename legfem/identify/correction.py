"""The 3D correction of the plane-strain force: where it enters."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from legfem.correction import read_correction
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
        """Return the covariance (n, n) of the factor's relative error, for the intervals."""
        ...


def find_correction(name: str) -> Correction | None:
    """Return the correction in a file; None for ``none``.

    Raises
    ------
    InputError
        If the file isn't a correction's.
    """
    return None if name == "none" else read_correction(Path(name))


def correction_factor(
    correction: Correction | None, displacement: FloatArray, c10: FloatArray, c20: FloatArray
) -> FloatArray:
    """Return the factor (..., n); 1 without a correction."""
    if correction is None:
        return np.ones((*np.shape(c10), len(displacement)))
    return correction.factor(displacement, c10, c20)
