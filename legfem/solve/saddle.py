r"""Iterations on the saddle point of displacements and continuous pressures.

The tangent is

.. math:: \begin{pmatrix} A & B^T \\ B & -C \end{pmatrix},

and a block triangle of algebraic multigrid for :math:`A` and of the diagonal of
:math:`-C - M / \mu` for the Schur complement bounds the number of iterations, whatever the mesh's
size and however close to incompressible: M is the pressures' mass matrix, lumped. H. Elman, D.
Silvester, A. Wathen, Finite Elements and Fast Iterative Solvers (2014), chapter 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import ufl
from dolfinx import fem, la
from petsc4py import PETSc

from legfem.fem.compiled import compiled
from legfem.fem.system import System
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.terms.tissue import Tissue
from legfem.solve.linear import MULTIGRID, LinearSettings, field_sets, fields, set_defaults

_TRIANGLE: Mapping[str, str | float] = {
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "upper",
    "fieldsplit_pressure_ksp_type": "preonly",
    "fieldsplit_pressure_pc_type": "jacobi",
    "fieldsplit_displacement_ksp_type": "preonly",
    **{f"fieldsplit_displacement_{name}": value for name, value in MULTIGRID.items()},
}


class SaddlePreconditioner:
    """The preconditioner of a system in the formulation ``"continuous"``.

    Parameters
    ----------
    system
        The model on its mesh.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        _, self._pressure = fields(system.spaces)
        self._lumped = fem.Function(system.spaces.space)
        self._lumping = compiled(_lumped_over_modulus(system))
        owned = len(self._pressure)
        self._schur = PETSc.Mat().createAIJ(((owned, None), (owned, None)), nnz=1, comm=system.comm)
        self._diagonal = self._schur.createVecLeft()

    def configure(self, linear: PETSc.KSP, settings: LinearSettings) -> None:
        """Set a solver up."""
        spaces = self._system.spaces
        linear.setType("gmres")
        linear.setPCSide(PETSc.PC.Side.RIGHT)
        linear.setGMRESRestart(60)
        linear.setTolerances(rtol=settings.tolerance, max_it=settings.max_iterations)
        set_defaults(linear, "legfem_continuous_", _TRIANGLE)
        displacement, pressure = field_sets(spaces, 1)
        preconditioner = linear.getPC()
        preconditioner.setType("fieldsplit")
        preconditioner.setFieldSplitIS(("displacement", displacement), ("pressure", pressure))
        preconditioner.setFieldSplitSchurPreType(PETSc.PC.FieldSplitSchurPreType.USER, self._schur)

    def update(self) -> None:
        """Follow the tangent just assembled and the present parameters."""
        lumped = self._lumped.x
        lumped.array[:] = 0.0
        fem.assemble_vector(lumped.array, self._lumping)
        lumped.scatter_reverse(la.InsertMode.add)
        tangent = self._system.tangent_matrix.getDiagonal().array_r[self._pressure]
        self._diagonal.array[:] = tangent - lumped.array[self._pressure]
        self._schur.setDiagonal(self._diagonal)
        self._schur.assemble()


def _lumped_over_modulus(system: System) -> Any:
    """Return the rows' sums of the pressures' mass matrix over the shear modulus, as a form."""
    body = system.body.domain
    assert isinstance(body, Body)
    tissues = [term for term in system.model.at("body") if isinstance(term, Tissue)]
    return sum(
        body.pressure_variations[tissue.region]
        / ufl.as_ufl(body.symbols.of(tissue.region, tissue.law).shear_modulus)
        * body.regions[tissue.region]
        for tissue in tissues
    )
