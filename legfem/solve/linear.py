"""The linear solver of Newton's steps: factors where they are cheap, iterations where they aren't.

Factors of a section's tangent are cheap at any size that is used. In 3D their cost grows faster
than the number of unknowns, and that of conjugate directions with algebraic multigrid in proportion
to it. With a fast BLAS factors take less time up to 200,000 unknowns at least, and half as much
memory again there (``python -m studies.solvers``). Any choice gives way
to PETSc options: with the prefix ``legfem_`` for factors, ``legfem_mixed_`` or
``legfem_displacement_`` for iterations on either form.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray
from petsc4py import PETSc

from legfem.common.units import FloatArray
from legfem.fem.compiled import compiled
from legfem.fem.spaces import LegSpaces
from legfem.fem.system import System
from legfem.mechanics.terms.tissue import Tissue


class LaggedFactors:
    """A PETSc preconditioner that keeps a tangent's factors for its neighbours.

    Where many like systems are solved (states near each other, derivatives), factors of an earlier
    tangent bring iterations on a later one to their end after a few. They are made anew once that
    takes too many.

    Parameters
    ----------
    allowed : int
        Iterations of a solution above which the next tangent is factorised.
    """

    def __init__(self, allowed: int) -> None:
        self._allowed = allowed
        self._factors: PETSc.PC | None = None
        self._worn_out = True
        self.factorisations = 0

    def attach(self, linear: PETSc.KSP) -> None:
        """Become the preconditioner of a solver."""
        linear.getPC().setType("python")
        linear.getPC().setPythonContext(self)
        linear.setMonitor(self._watch)

    def renew(self) -> None:
        """Factorise the next tangent, however well these factors serve."""
        self._worn_out = True

    def setUp(self, preconditioner: PETSc.PC) -> None:
        """Factorise the tangent, if the factors at hand took too many iterations."""
        if not self._worn_out:
            return
        _, tangent = preconditioner.getOperators()
        if self._factors is None:
            self._factors = PETSc.PC().create(tangent.comm)
            self._factors.setType("lu")
            self._factors.setFactorSolverType("mumps")
        self._factors.setReusePreconditioner(False)
        self._factors.setOperators(tangent)
        self._factors.setUp()
        self._factors.setReusePreconditioner(True)
        self._worn_out = False
        self.factorisations += 1

    def apply(self, preconditioner: PETSc.PC, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the factors."""
        assert self._factors is not None
        self._factors.apply(right, solution)

    def _watch(self, linear: PETSc.KSP, iteration: int, norm: float) -> None:
        self._worn_out = self._worn_out or iteration > self._allowed


@dataclass(frozen=True)
class LinearSettings:
    """Which solver, and how exact an iterative one is.

    Parameters
    ----------
    solver : {"auto", "direct", "iterative"}
        ``"auto"`` iterates above ``direct_limit`` unknowns in 3D.
    direct_limit : int
        Number of unknowns above which ``"auto"`` iterates in 3D.
    tolerance : float
        Reduction of the residual of a linear system. One tied to Newton's (Eisenstat and Walker)
        takes as many linear iterations and more of Newton's, hence more tangents.
    max_iterations : int
        Greatest number of iterations of an iterative solver.
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


def by_skin_load(linear: PETSc.KSP, system: System, share: float = 1.0) -> FloatArray:
    """Return the unknown's derivative by a share of the skin's load, by the tangent as it was factorised last."""
    right: Any = system.assemble_skin_load().x.petsc_vec
    right.scale(-share)
    rate = fem.Function(system.spaces.space)
    linear.solve(right, rate.x.petsc_vec)
    rate.x.scatter_forward()
    return np.asarray(rate.x.array).copy()


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
    space, displacements = spaces.space.dofmap, _displacements(spaces)
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
        vector = PETSc.Vec().createWithArray(values[displacements], comm=spaces.mesh.comm).copy()
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


_TRIANGLE: Mapping[str, str | float] = {
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "upper",
    "fieldsplit_pressure_ksp_type": "preonly",
    "fieldsplit_pressure_pc_type": "jacobi",
    "fieldsplit_displacement_ksp_type": "preonly",
    **{f"fieldsplit_displacement_{name}": value for name, value in MULTIGRID.items()},
}


class SaddlePreconditioner:
    r"""The preconditioner of a system in the formulation ``"continuous"``.

    The tangent of displacements and continuous pressures is a saddle point,

    .. math:: \begin{pmatrix} A & B^T \\ B & -C \end{pmatrix},

    and a block triangle of algebraic multigrid for :math:`A` and of the diagonal of
    :math:`-C - M / \mu` for the Schur complement bounds the number of iterations, whatever the mesh's
    size and however close to incompressible: M is the pressures' mass matrix, lumped. H. Elman, D.
    Silvester, A. Wathen, Finite Elements and Fast Iterative Solvers (2014), chapter 4.

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
    tissues = [term for term in system.model.at("body") if isinstance(term, Tissue)]
    return sum(
        body.pressure_variations[tissue.region]
        / ufl.as_ufl(body.symbols.of(tissue.region, tissue.law).shear_modulus)
        * body.regions[tissue.region]
        for tissue in tissues
    )
