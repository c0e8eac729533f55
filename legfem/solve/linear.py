"""The linear solver of Newton's steps: factors where they are cheap, iterations where they aren't.

Factors of a section's tangent are cheap at any size that is used. In 3D their cost grows faster
than the number of unknowns, and that of conjugate directions with algebraic multigrid in proportion
to it. With a fast BLAS factors take less time up to 200,000 unknowns at least, and half as much
memory again there (``python -m studies.solvers``). Any choice gives way
to PETSc options: with the prefix ``legfem_`` for factors, ``legfem_mixed_`` or
``legfem_displacement_`` for iterations on either form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from legfem.fem.spaces import LegSpaces
from legfem.solve.lagged_factors import LaggedFactors


@dataclass(frozen=True)
class LinearSettings:
    """Which solver, and how exact an iterative one is.

    Parameters
    ----------
    solver : {"auto", "direct", "iterative"}
        ``"auto"`` iterates above ``direct_limit`` unknowns in 3D.
    direct_limit : int
        Number of unknowns.
    tolerance : float
        Reduction of the residual of a linear system. One tied to Newton's (Eisenstat and Walker)
        takes as many linear iterations and more of Newton's, hence more tangents.
    max_iterations : int
        Of an iterative solver.
    kept_iterations : int
        Iterations with factors of an earlier tangent that are worth less than new factors; 0
        factorises every tangent.
    """

    solver: Literal["auto", "direct", "iterative"] = "auto"
    direct_limit: int = 200_000
    tolerance: float = 1e-4
    max_iterations: int = 300
    kept_iterations: int = 0

    def iterates(self, spaces: LegSpaces) -> bool:
        """Tell whether the leg's tangent is to be solved by iterations; a porous one never is."""
        if spaces.formulation == "porous":
            return False
        if self.solver != "auto":
            return self.solver == "iterative"
        return spaces.dimension == 3 and spaces.unknowns > self.direct_limit


def configure(linear: PETSc.KSP, spaces: LegSpaces, settings: LinearSettings) -> None:
    """Set a solver up for a leg; PETSc options are read afterwards, by the caller."""
    if settings.iterates(spaces):
        _iterate(linear, spaces, settings)
        return
    if settings.kept_iterations > 0:
        linear.setType("gmres")
        # Preconditioned by a near tangent's factors the residual is nearly the error.
        linear.setPCSide(PETSc.PC.Side.LEFT)
        linear.setGMRESRestart(settings.max_iterations)
        linear.setTolerances(rtol=settings.tolerance, max_it=settings.max_iterations)
        LaggedFactors(settings.kept_iterations).attach(linear)
        return
    preconditioner = linear.getPC()
    linear.setType("preonly")
    preconditioner.setType("lu")
    if spaces.mesh.comm.size == 1 and spaces.dimension == 2:
        preconditioner.setFactorSolverType("petsc")
        preconditioner.setFactorOrdering(_least_fill())
    else:
        preconditioner.setFactorSolverType("mumps")


def renew_factors(linear: PETSc.KSP) -> None:
    """Have the next tangent factorised: several solutions with it are to come."""
    preconditioner = linear.getPC()
    if preconditioner.getType() == "python":
        preconditioner.getPythonContext().renew()


def prepare(matrix: PETSc.Mat, spaces: LegSpaces, settings: LinearSettings) -> None:
    """Give a tangent what multigrid needs to know of it."""
    if settings.iterates(spaces) and spaces.formulation == "displacement":
        matrix.setNearNullSpace(rigid_motions(spaces))


MULTIGRID: Mapping[str, str | float] = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_pc_type": "sor",
}
# The pressures of a cell belong to it alone: their exact elimination leaves a matrix for the
# displacements with the pattern of a displacement form's.
_ELIMINATION: Mapping[str, str | float] = {
    "pc_type": "fieldsplit",
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "full",
    "pc_fieldsplit_schur_precondition": "selfp",
    "fieldsplit_pressure_ksp_type": "preonly",
    "fieldsplit_pressure_pc_type": "pbjacobi",
    "fieldsplit_displacement_mat_schur_complement_ainv_type": "blockdiag",
    "fieldsplit_displacement_ksp_type": "preonly",
    **{f"fieldsplit_displacement_{name}": value for name, value in MULTIGRID.items()},
}


def _iterate(linear: PETSc.KSP, spaces: LegSpaces, settings: LinearSettings) -> None:
    linear.setType("gmres")
    linear.setGMRESRestart(100)
    linear.setTolerances(rtol=settings.tolerance, max_it=settings.max_iterations)
    mixed = spaces.formulation == "mixed"
    prefix = "legfem_mixed_" if mixed else "legfem_displacement_"
    set_defaults(linear, prefix, _ELIMINATION if mixed else MULTIGRID)
    if not mixed:
        return
    displacement, pressure = field_sets(spaces, spaces.dimension + 1)
    linear.getPC().setType("fieldsplit")
    linear.getPC().setFieldSplitIS(("pressure", pressure), ("displacement", displacement))


def set_defaults(linear: PETSc.KSP, prefix: str, defaults: Mapping[str, str | float]) -> None:
    """Give a solver a prefix of its own, and options that a user's under it go before.

    PETSc's options are global: direct solvers must not read those of iterations.
    """
    linear.setOptionsPrefix(prefix)
    options = PETSc.Options(prefix)
    for name, value in defaults.items():
        if not options.hasName(name):
            options.setValue(name, value)


def fields(spaces: LegSpaces) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the rank's own dofs that are displacements, and those that are pressures; sorted."""
    displacement = _displacements(spaces)
    owned = np.arange(_owned_size(spaces), dtype=np.int32)
    return displacement, np.setdiff1d(owned, displacement)


def field_sets(spaces: LegSpaces, pressure_block: int) -> tuple[PETSc.IS, PETSc.IS]:
    """Return the index sets of displacements, with their rigid motions, and of pressures.

    ``pressure_block`` is the number of pressures that belong together.
    """
    first = spaces.space.dofmap.index_map.local_range[0] * spaces.space.dofmap.index_map_bs
    sets = []
    for dofs, block in zip(fields(spaces), (spaces.dimension, pressure_block), strict=True):
        indices = (first + dofs).astype(np.int32)
        sets.append(PETSc.IS().createGeneral(indices, comm=spaces.mesh.comm))
        sets[-1].setBlockSize(block)
    sets[0].compose("nearnullspace", rigid_motions(spaces))
    return sets[0], sets[1]


def rigid_motions(spaces: LegSpaces) -> PETSc.NullSpace:
    """Return translations and rotations, orthonormal, which multigrid's coarse levels must hold."""
    dimension = spaces.dimension
    x = spaces.displacement_space.tabulate_dof_coordinates()[:, :dimension]
    planes = [(i, j) for i in range(dimension) for j in range(i + 1, dimension)]
    space, own = spaces.space.dofmap, _displacements(spaces)
    size = (space.index_map.size_local + space.index_map.num_ghosts) * space.index_map_bs
    vectors: list[PETSc.Vec] = []
    for number in range(dimension + len(planes)):
        motion = np.zeros_like(x)
        if number < dimension:
            motion[:, number] = 1.0
        else:
            i, j = planes[number - dimension]
            motion[:, i], motion[:, j] = -x[:, j], x[:, i]
        values = np.zeros(size)
        values[spaces.displacement_dofs] = motion.ravel()
        values[spaces.pinned] = 0.0
        vector = PETSc.Vec().createWithArray(values[own], comm=spaces.mesh.comm).copy()
        for other in vectors:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors, comm=spaces.mesh.comm)


def _displacements(spaces: LegSpaces) -> NDArray[np.int32]:
    """Return the rank's own dofs that are displacements, sorted."""
    dofs = spaces.displacement_dofs
    return np.sort(dofs[dofs < _owned_size(spaces)])


def _owned_size(spaces: LegSpaces) -> int:
    dofmap = spaces.space.dofmap
    return int(dofmap.index_map.size_local * dofmap.index_map_bs)


def _least_fill() -> str:
    """Return the name of the ordering whose LU factors have fewest entries, of those PETSc has.

    On a section's tangent (15,000 unknowns) numeric factorisation takes 8.4 ms with approximate
    minimum degree, 10.8 ms with quotient minimum degree and 14.4 ms with nested dissection.
    """
    one = PETSc.Mat().createAIJ([1, 1], nnz=1, comm=PETSc.COMM_SELF)
    one.setValue(0, 0, 1.0)
    one.assemble()
    try:
        one.getOrdering("amd")
    except PETSc.Error:  # built without SuiteSparse
        return "qmd"
    finally:
        one.destroy()
    return "amd"
