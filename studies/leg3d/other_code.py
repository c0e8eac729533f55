"""The round leg in 3D by the second code: quadratic hexahedra, with their own mesh, contact and steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from legfem.common.errors import UnsolvedError
from legfem.common.units import FloatArray
from legfem.experiments.indenter_pose import Cylinder
from legfem.jobs.store import Store
from legfem.meshing.structured import IdealisedLeg
from legfem.solve.path import ForceCurve
from studies.leg3d.planted import CYLINDER, LEG, Planted, folder_of
from studies.making.pressing import OtherMuscle, OtherPressing, other_law, spread

type Ints = NDArray[np.int_]

_FACE = (1, 2, 6, 5, 9, 18, 13, 17)
"""Nodes of a hexahedron's outer face, corners first."""
_GAUSS = np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6), np.array([5.0, 8.0, 5.0]) / 9.0
_SIZES = {"round": 2.5, "deep": 3.0, "end": 1.8}
"""Under the cylinder round the leg, along its rays, and along it at the cylinder's end, mm."""
_GROWTH, _FAR = 0.22, 9.0


@dataclass(frozen=True, eq=False)
class HexahedralMesh:
    """Quadratic hexahedra of a quarter of a round leg, mm."""

    points: FloatArray
    """(n, 3)."""
    cells: Mapping[str, Ints]
    """(m, 20) by tissue."""
    skin: Ints
    """(k, 8): corners and middles of every face's edges."""
    skin_weights: FloatArray
    """(k, 9): areas that the Gauss points of a face stand for, mm^2."""
    held: NDArray[np.bool_]
    """(n, 3): on the bone; across mirrors and end faces."""


def face_shapes() -> FloatArray:
    """Return the functions of a face's eight nodes at its nine Gauss points, (9, 8)."""
    import felupe as fem

    element = fem.QuadraticQuad()
    return np.array([element.function(point) for point in _gauss_points()])


def mesh_quarter(leg: IdealisedLeg, cylinder: Cylinder, finer: float = 1.0) -> HexahedralMesh:
    """Return a mesh, fine under a cylinder and at its end."""
    import felupe as fem

    reach, end = 1.2 * cylinder.radius, cylinder.length / 2 - cylinder.edge_radius / 2
    half = leg.length / 2
    size = {name: value / finer for name, value in _SIZES.items()}
    growth, far = _GROWTH / finer, _FAR / finer

    def turned(s: FloatArray) -> FloatArray:
        return np.minimum(size["round"] + growth * np.maximum(s - reach, 0.0), far)

    def along(z: FloatArray) -> FloatArray:
        return np.minimum(size["end"] + growth * np.abs(z - end), far)

    angles = _divided(np.pi * leg.radius, turned) / leg.radius
    levels = _divided(half, along)
    radii, regions = [leg.bone_radius], []
    for region, outer in leg.layers:
        below = leg.radius - outer

        def inward(t: FloatArray, below: float = below) -> FloatArray:
            return np.minimum(size["deep"] + growth * (below + t), far)

        nodes = outer - _divided(outer - radii[-1], inward)[::-1]
        radii.extend(nodes[1:])
        regions.extend([region] * (len(nodes) - 1))
    axes = np.array(radii), angles, levels
    counts = tuple(len(values) for values in axes)
    grid = fem.Cube(a=(0, 0, 0), b=tuple(n - 1 for n in counts), n=counts)
    grid = grid.convert(order=2, calc_points=True)
    radius, theta, z = (np.interp(grid.points[:, k], np.arange(len(values)), values) for k, values in enumerate(axes))
    points = np.column_stack([radius * np.sin(theta), -radius * np.cos(theta), z])
    ring = grid.points[grid.cells].mean(axis=1)[:, 0].astype(int)
    of = np.array(regions)[ring]
    held = np.repeat((radius < leg.bone_radius + 1e-9)[:, None], 3, axis=1)
    held[:, 0] |= (theta < 1e-9) | (theta > np.pi - 1e-9)
    held[:, 2] |= (z < 1e-9) | (z > half - 1e-9)
    skin = grid.cells[ring == counts[0] - 2][:, _FACE]
    cells = {name: grid.cells[of == name] for name, _ in leg.layers}
    return HexahedralMesh(points, cells, skin, _areas(points[skin]), held)


def _gauss_points() -> FloatArray:
    xi = _GAUSS[0]
    return np.array([(a, b) for a in xi for b in xi])


def _areas(faces: FloatArray) -> FloatArray:
    """Return what the Gauss points of faces (k, 8, 3) stand for, (k, 9)."""
    import felupe as fem

    element = fem.QuadraticQuad()
    slopes = np.array([element.gradient(point) for point in _gauss_points()])
    tangents = np.einsum("qna,knd->kqad", slopes, faces)
    weights = np.outer(_GAUSS[1], _GAUSS[1]).ravel()
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return np.asarray(np.linalg.norm(normal, axis=2) * weights)


def _divided(length: float, size: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return nodes from 0 to a length, between which elements have a size, or less."""
    s = np.linspace(0.0, length, 2001)
    density = 1 / size(s)
    number = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(s))])
    count = max(1, int(np.ceil(number[-1] - 1e-9)))
    return np.interp(np.linspace(0.0, number[-1], count + 1), number, s)


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
    """

    def __init__(self, planted: Planted, finer: float = 1.0) -> None:
        self.mesh = mesh_quarter(LEG, CYLINDER, finer)
        self.planted, self.tissues = planted, planted.tissues
        free = np.flatnonzero(~self.mesh.held.ravel())
        size = self.mesh.held.size
        kept = csr_matrix((np.ones(len(free)), (free, np.arange(len(free)))), (size, len(free)))
        travel = np.array([0.0, 1.0, 0.0])
        super().__init__(list(self._made()), kept, travel, _IMAGES)
        self.start = -(LEG.radius + CYLINDER.radius) * travel
        modulus = self.tissues["superficial"].shear_modulus
        self.penalty = _PENALTY * modulus / CYLINDER.radius
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
