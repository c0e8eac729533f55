"""Residual and tangent of a model on its spaces, and the state that a step starts from."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.fem.forms import RAISED_SKIN_DEGREE, SKIN_DEGREE, Clock, Rounding, Symbols, body_forms, skin_forms
from legfem.fem.spaces import LegSpaces, sum_over
from legfem.mechanics.kinematics import volume_ratio
from legfem.mechanics.model import LegModel

if TYPE_CHECKING:
    from legfem.fem.sliding import SlidingForces


@dataclass(frozen=True)
class Balance:
    """Resultants of one state, (dimension,) in N per mm of leg (2D) or N (3D), and works."""

    contact_force: FloatArray
    """Force of the indenter on the skin."""
    bone_reaction: FloatArray
    """Force of the bones on the tissue."""
    contact_work: float
    """Virtual work of the contact forces over the displacement."""
    internal_work: float
    """Virtual work of the stresses over the displacement."""


@dataclass(frozen=True, eq=False)
class Shift:
    """A change of a leg's shape, or of the indenter's way, that a path can be differentiated by; of the size 1.

    Parameters
    ----------
    nodes, skin_nodes : (n, 3) array
        Motion of the nodes of the mesh and of its skin's, mm.
    start, direction : (d,) array
        Change of the indenter's centre at zero displacement (mm), and of the unit vector of its travel.
    stated : (d,) array
        Change of the point on the line of travel that images refer to, mm.
    """

    nodes: FloatArray
    skin_nodes: FloatArray
    start: FloatArray
    direction: FloatArray
    stated: FloatArray


_SMALL = 1e-3
"""Part of a shift by which its derivatives are differences: their error is some 1e-6 of them."""


class System:
    """A model on a mesh: the state, and the residual and tangent there.

    Parameters
    ----------
    spaces
        Finite-element spaces of the leg.
    model
        The sum of terms.
    start, direction
        Centre of the indenter at zero displacement (mm) and unit vector of its travel; none for a
        model without one.
    quadrature_degree
        Degree of the quadrature in the body.
    rounding
        Rounding of the skin in 3D, where the mesh's facets are flat and the skin isn't.
    faces
        Forces of the model's faces between tissues, which no form can say.

    Raises
    ------
    InputError
        If the model has a face that there are no forces of.
    """

    def __init__(
        self,
        spaces: LegSpaces,
        model: LegModel,
        start: FloatArray | None = None,
        direction: FloatArray | None = None,
        quadrature_degree: int = 4,
        rounding: Rounding | None = None,
        faces: Sequence["SlidingForces"] = (),
    ) -> None:
        if len(faces) < len(model.at("face")):
            raise InputError("model", "face", "tissues slide along each other in a leg's section only", "leave it out")
        self.spaces, self.model, self.faces = spaces, model, tuple(faces)
        start = np.zeros(spaces.dimension) if start is None else start
        direction = np.zeros(spaces.dimension) if direction is None else direction
        self.comm = spaces.mesh.comm
        self.start, self.direction = start, direction
        self.shift_named: Callable[[str], Shift | None] = lambda _: None
        """What the model can be differentiated by beside its numbers."""
        self.body_symbols, self.skin_symbols = Symbols(spaces.mesh), Symbols(spaces.skin)
        self._clocks = Clock(spaces.mesh), Clock(spaces.skin)
        self.unknown = fem.Function(spaces.space)
        self._centre = fem.Constant(spaces.skin, start.copy())
        self._centre_before = fem.Constant(spaces.skin, start.copy())
        self.applied_pressure = fem.Function(fem.functionspace(spaces.skin, ("Lagrange", 1)))
        self.body = body_forms(spaces, model, self.unknown, self.body_symbols, self._clocks[0], quadrature_degree)
        self.skin = skin_forms(
            spaces,
            model,
            self.skin_symbols,
            self._clocks[1],
            (self._centre, self._centre_before),
            self.applied_pressure,
            rounding,
            SKIN_DEGREE if quadrature_degree < 6 else RAISED_SKIN_DEGREE,
        )
        self.tangent_matrix = self._matrix()
        self._kept: PETSc.Mat | None = None
        self._kept_serves = False
        self._skin_matrix = fem.create_matrix(self.skin.tangent)
        self._skin_force = fem.Function(spaces.skin_space)
        self._nodal_contact_force = fem.Function(spaces.skin_space)
        self.residual_vector = fem.Function(spaces.space)
        self._pinned = fem.Function(spaces.space)
        self._boundary = self._conditions()
        trace = spaces.trace
        # PETSc passes over negative indices: the skin adds nothing to the equations of supports.
        self._trace_free = np.where(np.isin(trace, spaces.pinned), -1, trace).astype(np.int32)
        self._volume_ratio = self.body.history.expression(volume_ratio(self.body.domain.deformation_gradient))
        dofmap = spaces.space.dofmap
        self._owned = dofmap.index_map.size_local * dofmap.index_map_bs
        self.evaluations = 0

    @property
    def owned_supports(self) -> NDArray[np.int32]:
        """The rank's own dofs that are held at zero."""
        pinned = self.spaces.pinned
        return pinned[pinned < self._owned]

    def set_parameters(self, values: dict[str, float]) -> None:
        """Change numbers of the model without compiling anew."""
        self.body_symbols.assign(values)
        self.skin_symbols.assign(values)
        for face in self.faces:
            face.assign(values)
        self._kept_serves = False

    def set_displacement(self, displacement: float) -> None:
        """Move the indenter to a displacement (mm) along its line of travel."""
        self._centre.value[:] = self.start + displacement * self.direction

    @contextmanager
    def shifted(self, shift: Shift, size: float) -> Iterator[None]:
        """Move mesh and indenter, before the step and now, for as long as a context lasts."""
        meshes, centres = (self.spaces.mesh, self.spaces.skin), (self._centre, self._centre_before)
        start, direction, before = self.start, self.direction, [one.value.copy() for one in centres]
        at_rest = [mesh.geometry.x.copy() for mesh in meshes]
        self.start, self.direction = start + size * shift.start, direction + size * shift.direction
        for mesh, nodes in zip(meshes, (shift.nodes, shift.skin_nodes), strict=True):
            mesh.geometry.x[:] += size * nodes
        for centre, was in zip(centres, before, strict=True):
            centre.value[:] = self.start + ((was - start) @ direction) * self.direction
        try:
            yield
        finally:
            self.start, self.direction = start, direction
            for mesh, x in zip(meshes, at_rest, strict=True):
                mesh.geometry.x[:] = x
            for centre, was in zip(centres, before, strict=True):
                centre.value[:] = was

    def by_shift(self, shift: Shift, values: Callable[[float], FloatArray]) -> FloatArray:
        """Return the derivative, at the present unknown, of what is computed of a shift's size."""
        sides = []
        for size in (_SMALL, -_SMALL):
            with self.shifted(shift, size):
                sides.append(values(size))
        return (sides[0] - sides[1]) / (2 * _SMALL)

    def set_time(self, time: float, step: float) -> None:
        """Set the time at the end of the step, and the step (s)."""
        for clock in self._clocks:
            clock.set(time, step)

    def assemble_residual(self) -> Any:
        """Assemble the residual at the present unknown; returns a ghosted function."""
        self.residual_vector.x.array[:] = 0.0
        self._add_internal(self.residual_vector.x.array)
        self.evaluations += 1
        return self._with_skin()

    def assemble_skin_load(self) -> Any:
        """Assemble what the skin's terms alone add to the residual at the present unknown."""
        self.residual_vector.x.array[:] = 0.0
        return self._with_skin()

    def _add_internal(self, residual: FloatArray) -> None:
        """Add the body's forces, and those on faces inside it."""
        fem.assemble_vector(residual, self.body.residual)
        for face in self.faces:
            residual += face.residual(self.unknown.x.array)

    def _with_skin(self) -> Any:
        """Add the skin's part to the residual, and gather it over the ranks."""
        self._trace()
        residual = self.residual_vector
        np.add.at(residual.x.array, self.spaces.trace, self._assemble_skin())
        residual.x.scatter_reverse(la.InsertMode.add)
        residual.x.array[self.spaces.pinned] = 0.0
        return residual

    def residual_norm(self) -> float:
        """Return the norm of the residual last assembled.

        PETSc keeps a vector's norm until PETSc itself changes it, which assembly does not.
        """
        owned = self.residual_vector.x.array[: self._owned]
        return float(np.sqrt(sum_over(self.comm, owned @ owned)))

    def assemble_tangent(self, *, keep: bool = False, reuse: bool = False) -> PETSc.Mat:
        """Assemble the tangent at the present unknown.

        Parameters
        ----------
        keep
            Whether to keep the body's part.
        reuse
            Whether the body's part may be the one kept since the system was reset or given other numbers; the skin's
            and the faces' are new.
        """
        self._trace()
        matrix = self.tangent_matrix
        if reuse and self._kept_serves:
            assert self._kept is not None
            self._kept.copy(matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        else:
            matrix.zeroEntries()
            fem_petsc.assemble_matrix(matrix, self.body.tangent, bcs=self._boundary)
            matrix.assemble()
            # What meets what on a face changes as it slides, and the matrix has entries more than one that was kept.
            if keep and not self.faces:
                self._keep(matrix)
        for face in self.faces:
            sliding = face.tangent(self.unknown.x.array)
            matrix.setValuesLocalIJV(sliding.indptr, sliding.indices, sliding.data, addv=PETSc.InsertMode.ADD)
        self._skin_matrix.data[:] = 0.0
        fem.assemble_matrix(self._skin_matrix, self.skin.tangent)
        skin = self._skin_matrix.to_scipy(ghosted=True).tocsr()
        trace = self._trace_free
        # Columns beyond the rank's own dofs and ghosts await what other ranks would send: they are
        # empty here, and PETSc passes over negative indices.
        columns = np.full(skin.shape[1], -1, dtype=np.int32)
        columns[: len(trace)] = trace
        matrix.setValuesLocalIJV(
            skin.indptr.astype(np.int32),
            columns[skin.indices],
            skin.data,
            addv=PETSc.InsertMode.ADD,
            rowmap=trace[: len(skin.indptr) - 1],
        )
        matrix.assemble()
        return matrix

    def _keep(self, body: PETSc.Mat) -> None:
        if self._kept is None:
            self._kept = body.duplicate(copy=True)
        else:
            body.copy(self._kept, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._kept_serves = True

    def advance(self) -> None:
        """End a step: update the history and what the next step starts from."""
        self._trace()
        self.body.advance()
        self.skin.advance()
        self.seek()
        self._centre_before.value[:] = self._centre.value

    def reset(self) -> None:
        """Return to the undeformed state at zero displacement and time."""
        self.body.reset()
        self.skin.reset()
        self.seek()
        self.set_time(0.0, 1.0)
        self.set_displacement(0.0)
        self._centre_before.value[:] = self._centre.value
        self._kept_serves = False

    def state(self) -> dict[str, FloatArray]:
        """Return the rank's part of the state at the end of a step, by name."""
        return {name: function.x.array.copy() for name, function in self._state().items()}

    def restore(self, state: Mapping[str, FloatArray], displacement: float) -> None:
        """Return to a state that ended a step at a displacement (mm)."""
        for name, function in self._state().items():
            function.x.array[:] = state[name]
        self._trace()
        self.seek()
        self.set_displacement(displacement)
        self._centre_before.value[:] = self._centre.value
        self._kept_serves = False

    def _state(self) -> dict[str, Any]:
        both = {"body": self.body.remembered, "skin": self.skin.remembered}
        remembered = {f"{name}.{key}": function for name, held in both.items() for key, function in held.items()}
        return {"unknown": self.unknown, **remembered}

    def minimum_volume_ratio(self) -> float:
        """Return the least J over all quadrature points."""
        local = self.body.history.values(self._volume_ratio)
        least = float(np.min(local, initial=np.inf))
        return float(self.comm.allreduce(least if np.isfinite(local).all() else -np.inf, MPI.MIN))

    def force(self) -> float:
        """Return the indenter's force along its travel (N per mm of leg in 2D, N in 3D)."""
        return float(self.contact_force() @ self.direction)

    def contact_scale(self) -> float:
        """Return the norm of the contact's nodal forces at the last residual."""
        nodal = self._nodal_contact_force.x
        nodal.array[:] = self._skin_force.x.array
        nodal.scatter_reverse(la.InsertMode.add)
        dofmap = self.spaces.skin_space.dofmap
        owned = nodal.array[: dofmap.index_map.size_local * dofmap.index_map_bs]
        return float(np.sqrt(sum_over(self.comm, owned @ owned)))

    def balance(self) -> Balance:
        """Return resultants and virtual works at the present state, for checks of equilibrium."""
        contact = self.contact_force()
        internal = fem.Function(self.spaces.space)
        self._add_internal(internal.x.array)
        internal.x.scatter_reverse(la.InsertMode.add)
        own = np.where(np.arange(len(internal.x.array)) < self._owned, internal.x.array, 0.0)
        at_bone = np.zeros_like(own)
        at_bone[self.spaces.bone] = own[self.spaces.bone]
        reaction = at_bone[self.spaces.displacement_dofs].reshape(-1, self.spaces.dimension)
        return Balance(
            contact,
            sum_over(self.comm, reaction.sum(axis=0)),
            -float(sum_over(self.comm, self._skin_force.x.array @ self.skin.domain.unknown.x.array)),
            float(sum_over(self.comm, own @ self.unknown.x.array)),
        )

    def contact_force(self) -> FloatArray:
        """Return the indenter's force on the skin, (dimension,), N per mm of leg in 2D, N in 3D."""
        self._trace()
        return -sum_over(self.comm, self._assemble_skin().reshape(-1, self.spaces.dimension).sum(axis=0))

    def nodal_contact_force(self) -> FloatArray:
        """Return what the rank adds to the indenter's force on each of its skin's nodes, (nodes, dimension)."""
        self._trace()
        return -self._assemble_skin().reshape(-1, self.spaces.dimension)

    @property
    def displacement(self) -> float:
        """Displacement of the indenter along its line of travel, mm."""
        return float((self._centre.value - self.start) @ self.direction)

    def seek(self) -> None:
        """Find what meets what on faces inside the body, at the present unknown."""
        for face in self.faces:
            face.seek(self.unknown.x.array)

    def _trace(self) -> None:
        self.skin.domain.unknown.x.array[:] = self.unknown.x.array[self.spaces.trace]

    def _assemble_skin(self) -> FloatArray:
        force = self._skin_force.x.array
        force[:] = 0.0
        fem.assemble_vector(force, self.skin.residual)
        return force

    def _matrix(self) -> PETSc.Mat:
        """Return an empty tangent; with faces its pattern holds what meets there."""
        made = fem_petsc.create_matrix(self.body.tangent)
        if not self.faces:
            return made
        made.assemble()
        pattern = csr_matrix(made.getValuesCSR()[::-1], shape=made.size)
        pattern.data[:] = 1.0
        pattern = sum((face.pattern(made.size[0]) for face in self.faces), pattern).tocsr()
        pattern.sort_indices()
        rows, columns = pattern.indptr.astype(np.int32), pattern.indices.astype(np.int32)
        matrix = PETSc.Mat().createAIJ(made.size, csr=(rows, columns, np.zeros(len(columns))), comm=self.comm)
        matrix.setBlockSize(made.getBlockSize())
        matrix.setLGMap(*made.getLGMap())
        matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        return matrix

    def _conditions(self) -> list[Any]:
        """Return the supports as conditions on the space, one a component where it is blocked."""
        space, pinned = self.spaces.space, np.unique(self.spaces.pinned)
        size = space.dofmap.index_map_bs
        if size == 1:
            return [fem.dirichletbc(self._pinned, pinned)]
        return [fem.dirichletbc(PETSc.ScalarType(0), pinned[pinned % size == k], space.sub(k)) for k in range(size)]
