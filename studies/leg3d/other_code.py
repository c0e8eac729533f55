r"""A second code in 3D: felupe's hexahedra, with a mesh, a contact and steps of its own.

Quadratic serendipity hexahedra of 20 nodes and eight Gauss points, displacements alone. The
cylinder's skin is all that lies a distance :math:`\rho`, its edges' radius, from a core: a cylinder
shorter and thinner by that. Contact is a penalty at Gauss points of the skin's faces; along the
surface a spring to where the point first touched.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from legfem.common.errors import UnsolvedError
from legfem.common.units import FloatArray
from legfem.experiments.indentation_3d import Cylinder
from legfem.jobs.store import Store
from legfem.solve.path import ForceCurve
from studies.concealed.other_pressing import OtherPressing, spread
from studies.concealed.other_tissue import other_law
from studies.fibrous_specimens.other_muscle import OtherMuscle
from studies.leg3d.other_mesh import face_shapes, mesh_quarter
from studies.leg3d.planted import CYLINDER, LEG, Planted, folder_of

_PENALTY = 9000.0
"""Normal and along the surface, times the fat's shear modulus over the cylinder's radius."""
_ONSET_MM = 0.005
"""Half the gap over which pressure and hold grow from nothing."""
_IMAGES = 4.0
"""That make the whole leg."""
_KRYLOV = 25
"""Iterations of a linear solution until its matrix is factored."""


@dataclass(frozen=True)
class PlantedByFelupe(Planted):
    """What felupe's hexahedra record in place of legfem's."""

    @property
    def name(self) -> str:
        """What tells its folder from others."""
        return f"{super().name}-felupe"

    def written(self, out: Path, seed: int, kept: Path) -> Path:
        """Write the folder with recordings; solves are kept. See `other_curve`."""
        return folder_of(self, other_curve(self, kept), out, seed)


@dataclass(frozen=True, eq=False)
class Nearness:
    """Of points to a cylinder."""

    gap: FloatArray
    """(...), mm, negative within."""
    normal: FloatArray
    """Gradient of the gap, (..., 3)."""
    bend: FloatArray
    """Its second derivatives, (..., 3, 3), 1/mm."""


def nearness(cylinder: Cylinder, y: FloatArray) -> Nearness:
    """Return how near points (..., 3), from the cylinder's middle, its axis along z, are to it."""
    edge = cylinder.edge_radius
    s = np.maximum(np.hypot(y[..., 0], y[..., 1]), 1e-12)
    a, b = s - (cylinder.radius - edge), np.abs(y[..., 2]) - (cylinder.length / 2 - edge)
    # Within the core, beyond any equilibrium, the nearer face counts.
    inside = np.maximum(a, b) <= 0
    over = np.where(inside, np.where(a >= b, 1.0, 0.0), np.maximum(a, 0.0))
    past = np.where(inside, np.where(a >= b, 0.0, 1.0), np.maximum(b, 0.0))
    far = np.hypot(over, past)
    gap = np.where(inside, np.maximum(a, b), far) - edge
    out = np.stack([y[..., 0] / s, y[..., 1] / s, np.zeros(s.shape)], axis=-1)
    up = np.zeros(y.shape)
    up[..., 2] = np.where(y[..., 2] < 0, -1.0, 1.0)
    round_it = np.stack([-out[..., 1], out[..., 0], np.zeros(s.shape)], axis=-1)
    radial, axial = (over / far)[..., None], (past / far)[..., None]
    across = radial * up - axial * out
    corner = np.where((a > 0) & (b > 0), 1 / far, 0.0)
    bend = corner[..., None, None] * _squared(across)
    bend += (radial[..., 0] / s)[..., None, None] * _squared(round_it)
    return Nearness(gap, radial * out + axial * up, bend)


def _squared(a: FloatArray) -> FloatArray:
    return a[..., :, None] * a[..., None, :]


@dataclass(frozen=True, eq=False)
class _Touched:
    """What the contact remembers: places relative to the cylinder's middle, (k, 9, 3)."""

    place: FloatArray
    anchor: FloatArray
    """NaN where it doesn't touch."""


class OtherLeg(OtherPressing):
    """The study's round leg in 3D, a quarter of it, pressed by a cylinder.

    Parameters
    ----------
    planted
        Its tissues.
    finer
        Than the default mesh, a factor.
    penalty
        On the contact's stiffness, a factor.
    """

    def __init__(self, planted: Planted, finer: float = 1.0, penalty: float = 1.0) -> None:
        self.mesh = mesh_quarter(LEG, CYLINDER, finer)
        self.planted, self.tissues = planted, planted.tissues
        free = np.flatnonzero(~self.mesh.held.ravel())
        size = self.mesh.held.size
        kept = csr_matrix((np.ones(len(free)), (free, np.arange(len(free)))), (size, len(free)))
        travel = np.array([0.0, 1.0, 0.0])
        super().__init__(list(self._made()), kept, travel, _IMAGES)
        self.start = -(LEG.radius + CYLINDER.radius) * travel
        modulus = self.tissues["superficial"].shear_modulus
        self.penalty = penalty * _PENALTY * modulus / CYLINDER.radius
        self._shape = face_shapes()
        self._solver: Any = None

    def _made(self) -> Any:
        import felupe as fem

        reduced = fem.GaussLegendre(order=1, dim=3)
        for name, cells in self.mesh.cells.items():
            mesh = fem.Mesh(self.mesh.points, cells, "hexahedron20")
            region = fem.RegionQuadraticHexahedron(mesh, quadrature=reduced)
            holder = fem.FieldContainer([fem.Field(region, dim=3)])
            yield holder, fem.SolidBody(self._law(name), holder)

    def _law(self, name: str) -> Any:
        law = self.tissues[name]
        c20, d2 = getattr(law, "C20", 0.0), getattr(law, "D2", np.inf)
        if name != "deep" or not self.planted.mechanisms:
            return other_law(law.C10, law.D1, c20, d2)
        (fibres,) = self.planted.mechanisms
        return OtherMuscle(
            law.C10, c20, 0.0, 1.0, 1 / law.D1, 1 / d2, shear=fibres.shear, extension=fibres.extension, axis=fibres.axis
        )

    def _places(self, u: FloatArray, to: float) -> FloatArray:
        """Return the skin's Gauss points relative to the cylinder's middle, (k, 9, 3)."""
        moved = (self.mesh.points + u.reshape(-1, 3))[self.mesh.skin]
        return np.einsum("qn,knd->kqd", self._shape, moved) - self.start - to * self.travel

    def _solved(self, matrix: Any, right: FloatArray) -> FloatArray:
        """Return the solution by GMRES; factors of an earlier matrix serve while it is near."""
        from petsc4py import PETSc

        rows = matrix.tocsr()
        given = rows.indptr, rows.indices, rows.data
        A = PETSc.Mat().createAIJ(rows.shape, csr=given, comm=PETSc.COMM_SELF)
        b, x = A.createVecs()
        b.array[:] = right
        if self._solver is None:
            self._solver = PETSc.KSP().create(PETSc.COMM_SELF)
            self._solver.setType("gmres")
            self._solver.getPC().setType("lu")
            self._solver.getPC().setFactorSolverType("mumps")
            self._solver.setTolerances(rtol=1e-8, max_it=_KRYLOV)
        solver = self._solver
        solver.setOperators(A)
        for lagged in (True, False):
            solver.getPC().setReusePreconditioner(lagged)
            solver.solve(b, x)
            if solver.getConvergedReason() > 0:
                return np.array(x.array)
        return np.full(len(right), np.nan)

    def _untouched(self) -> _Touched:
        place = self._places(np.zeros(self.mesh.points.size), 0.0)
        return _Touched(place, np.full(place.shape, np.nan))

    def _contact(self, u: FloatArray, to: float, before: _Touched) -> tuple[FloatArray, Any, FloatArray, _Touched]:
        """Return the cylinder's force on the skin, its tangent, the resultant, what to remember."""
        y, weights = self._places(u, to), self.mesh.skin_weights
        near = nearness(CYLINDER, y)
        n, bend = near.normal, near.bend
        within = _ONSET_MM - near.gap
        touching = within > 0
        starting = touching & (within < 2 * _ONSET_MM)
        pressed = np.where(starting, within**2 / (4 * _ONSET_MM), np.maximum(-near.gap, 0.0))
        stiffening = np.where(starting, within / (2 * _ONSET_MM), 1.0 * touching)
        holding = touching & np.isfinite(before.anchor[..., 0])
        way = np.where(holding[..., None], y - before.anchor, 0.0)
        lift = np.einsum("kqd,kqd->kq", n, way)
        slip = way - lift[..., None] * n
        grip = stiffening * holding
        tightening = np.where(holding & starting, -1 / (2 * _ONSET_MM), 0.0)
        f = (weights * self.penalty * pressed)[..., None] * n
        f -= (weights * self.penalty * grip)[..., None] * slip

        def scaled(factor: FloatArray, matrix: FloatArray) -> FloatArray:
            return (weights * factor)[..., None, None] * matrix

        normals = _squared(n)
        turned = np.einsum("kqde,kqe->kqd", bend, way)
        slipping = np.eye(3) - normals - lift[..., None, None] * bend
        slipping -= n[..., :, None] * turned[..., None, :]
        K = scaled(self.penalty * stiffening, normals) - scaled(self.penalty * pressed, bend)
        K += scaled(self.penalty * grip, slipping)
        K += scaled(self.penalty * tightening, slip[..., :, None] * n[..., None, :])
        outer, tangent = spread(self._shape, self.mesh.skin, f, K, len(u))
        return outer, tangent, f.sum(axis=(0, 1)), self._remembered(y, near.gap, before)

    def _remembered(self, y: FloatArray, gap: FloatArray, before: _Touched) -> _Touched:
        """Return places and anchors; a point that is new sticks where it passed the surface."""
        earlier = nearness(CYLINDER, before.place).gap
        share = (earlier - _ONSET_MM) / np.maximum(earlier - gap, 1e-12)
        share = np.clip(share, 0.0, 1.0)[..., None]
        entered = before.place + share * (y - before.place)
        anchor = np.where(np.isfinite(before.anchor), before.anchor, entered)
        return _Touched(y, np.where((gap < _ONSET_MM)[..., None], anchor, np.nan))


def other_curve(planted: Planted, kept: Path) -> ForceCurve:
    """Return the leg's force in 3D by felupe's hexahedra; it is kept in a folder.

    Raises
    ------
    UnsolvedError
        If the solution stops short.
    """

    def solved() -> ForceCurve:
        found = OtherLeg(planted).solve(planted.depth)
        if not found.reached:
            raise UnsolvedError(f"the leg in 3D: felupe stops at {found.displacement[-1]:g} mm")
        return ForceCurve(found.displacement, found.force, {})

    return Store(kept, ForceCurve, modules=(__name__,)).get_or_make(planted, solved)
