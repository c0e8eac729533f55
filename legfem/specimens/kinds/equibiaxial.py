r"""A sheet in equibiaxial tension: stretched alike in both directions of its plane, free across it.

.. math:: F = \mathrm{diag}(\lambda, \lambda, \lambda_3), \quad \tau_3 = 0, \quad P = \tau_1 / \lambda

(L. R. G. Treloar, Trans. Faraday Soc. 40 (1944) 59-70). An incompressible sheet has :math:`\lambda_3 = \lambda^{-2}`
and :math:`P = 2 w (\lambda - \lambda^{-5})`: of a neo-Hookean one the slope at small strain is :math:`12 C_{10}`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from legfem.common.input_files import FileTable, Positive
from legfem.experiments.bodies import HomogeneousBody
from legfem.specimens.kind import HomogeneousKind


class EquibiaxialEntry(FileTable):
    """``[equibiaxial]``: a sheet that is pulled alike in both directions of its plane."""

    length_mm: Positive | None = None
    """Length of the sheet between its grips, in the direction whose force is recorded."""
    area_mm2: Positive | None = None
    """Cross-section on which that force acts: width times thickness."""


@dataclass(frozen=True)
class StretchedSheet(HomogeneousBody):
    """A sheet, ``length`` between the grips, ``area`` that of the cross-section of one direction."""

    free: ClassVar = (2,)
    component: ClassVar = (0, 0)

    def gradient(self, strain: Any, free: Any) -> Any:
        """Return two equal stretches in the plane, and a free one across."""
        return np.stack([1 + strain, 1 + strain, *free], axis=-1)[..., None] * np.eye(3)

    def free_stretch(self, strain: Any) -> Any:
        """Return the stretch across of an incompressible sheet."""
        return (1 + strain) ** -2.0


class EquibiaxialKind(HomogeneousKind[EquibiaxialEntry, StretchedSheet]):
    """The sheet."""

    table: ClassVar = "equibiaxial"
    words: ClassVar = "a sheet in equibiaxial tension"
    done: ClassVar = "a sheet pulled alike in both directions of its plane"
    no_slip: ClassVar = "a sheet's grips are taken to hold it"
    one_way: ClassVar = '[uniaxial] with direction = "compression", if it was pressed'
