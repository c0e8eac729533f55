"""A leg in plane strain by the second code: quadratic triangles by gmsh, with its own contact and Newton's method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.section import BONES, LegSection
from legfem.legs.subject import Subject, TissueParameters
from studies.other_code.pressing import OtherPressing, other_law, spread

type Ints = NDArray[np.int_]

GAUSS = (np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6), np.array([5.0, 8.0, 5.0]) / 9.0)
"""Points and weights on an edge from -1 to 1."""
BESIDE_MM = (-40.0, -25.0, 25.0, 40.0)
"""To the left of the travel, where the skin's rise is seen."""
_SIZES = {"contact": 1.2, "far": 4.0}


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Quadratic triangles of a leg."""

    points: FloatArray
    cells: Mapping[str, Ints]
    """(m, 6) by tissue."""
    skin: Ints
    """(k, 3): end points and middle of every edge."""
    bones: Mapping[str, Ints]
    """Points of every bone."""

    @cached_property
    def skin_weights(self) -> FloatArray:
        """Lengths (k, 3) that the Gauss points of an edge stand for, mm."""
        ends = self.points[self.skin[:, :2]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        return np.asarray(0.5 * length[:, None] * GAUSS[1][None, :])


def mesh_leg(section: LegSection, touch: FloatArray, finer: float = 1.0) -> TriangleMesh:
    """Return a mesh, fine about the point of first touch."""
    import gmsh

    inner = shapely.Polygon(section.fascia).buffer(-section.fascia_thickness)
    loops = {
        "skin": section.skin,
        "fascia": section.fascia,
        "inner": np.array(inner.exterior.coords)[:-1],
        **{bone: section.contour(bone) for bone in BONES},
    }
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("leg")
        lines = {name: _loop(gmsh, _resampled(points, 1.0)) for name, points in loops.items()}
        surfaces = {
            "superficial": gmsh.model.occ.addPlaneSurface([lines["skin"], lines["fascia"]]),
            "fascia": gmsh.model.occ.addPlaneSurface([lines["fascia"], lines["inner"]]),
            "deep": gmsh.model.occ.addPlaneSurface([lines["inner"], *(lines[b] for b in BONES)]),
        }
        gmsh.model.occ.synchronize()
        _sizes(gmsh, touch, section, finer)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        tags, flat, _ = gmsh.model.mesh.getNodes()
        cells = {
            name: gmsh.model.mesh.getElements(2, surface)[2][0].astype(int).reshape(-1, 6)
            for name, surface in surfaces.items()
        }
    finally:
        gmsh.finalize()
    # Points that only define a spline belong to no triangle.
    used = np.unique(np.vstack(list(cells.values())))
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[used] = np.arange(len(used))
    places = np.zeros((int(tags.max()) + 1, 2))
    places[tags] = flat.reshape(-1, 3)[:, :2]
    return _tidied(places[used], {name: number[own] for name, own in cells.items()}, section)


def _resampled(points: FloatArray, step: float) -> FloatArray:
    ring = shapely.LinearRing(points)
    count = max(24, round(ring.length / step))
    return np.array([ring.interpolate(s).coords[0] for s in np.arange(count) * ring.length / count])


def _loop(gmsh: Any, points: FloatArray) -> int:
    tags = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in points]
    spline = gmsh.model.occ.addSpline([*tags, tags[0]])
    return int(gmsh.model.occ.addCurveLoop([spline]))


def _sizes(gmsh: Any, touch: FloatArray, section: LegSection, finer: float) -> None:
    fields = gmsh.model.mesh.field
    ball = fields.add("MathEval")
    x, y = touch
    near, far = _SIZES["contact"] / finer, _SIZES["far"] / finer
    distance = f"Sqrt((x-({x}))^2+(y-({y}))^2)"
    fields.setString(ball, "F", f"Min({far}, {near}+0.12*Max(0,{distance}-16))")
    fields.setAsBackgroundMesh(ball)
    for name in ("MeshSizeFromPoints", "MeshSizeFromCurvature", "MeshSizeExtendFromBoundary"):
        gmsh.option.setNumber(f"Mesh.{name}", 0)


def _tidied(points: FloatArray, cells: Mapping[str, Ints], section: LegSection) -> TriangleMesh:
    """Return the mesh, triangles counter-clockwise; edges of one triangle lie on an outline."""
    turned = {}
    for name, own in cells.items():
        a, b, c = (points[own[:, k]] for k in range(3))
        cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        flipped = own.copy()
        flipped[cross < 0] = own[cross < 0][:, [0, 2, 1, 5, 4, 3]]
        turned[name] = flipped
    every = np.vstack(list(turned.values()))
    edges = np.vstack([every[:, [0, 1, 3]], every[:, [1, 2, 4]], every[:, [2, 0, 5]]])
    _, index, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True, return_counts=True)
    outer = edges[index[count == 1]]
    middle = shapely.points(points[outer[:, 2]])
    apart = {name: shapely.distance(middle, section.polygon(name).exterior) for name in ("skin", *BONES)}
    nearest = np.argmin(np.array(list(apart.values())), axis=0)
    bones = {bone: np.unique(outer[nearest == k + 1]) for k, bone in enumerate(BONES)}
    return TriangleMesh(points, turned, outer[nearest == 0], bones)


_CHORDS = np.array([[(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)] for s in np.linspace(0, 1, 9)])
"""Shape functions of an edge's ends and middle at nine points."""


def _edges(cells: Ints) -> Ints:
    return np.vstack([cells[:, [0, 1, 3]], cells[:, [1, 2, 4]], cells[:, [2, 0, 5]]])


def _shared(one: Ints, other: Ints) -> Ints:
    """Return the edges (n, 3) of one tissue that are another's too."""
    return one[np.isin(one[:, 2], other[:, 2])]


_PENALTY, _ALONG = 400.0, 200.0
"""Normal and tangential, times the fat's shear modulus over the cylinder's radius."""


@dataclass(frozen=True)
class Lump:
    """A stiffer or softer ellipse in the deep tissue, with an edge.

    Parameters
    ----------
    distance, side
        Of its middle from first touch, along the travel and across it (counter-clockwise), mm.
    along, across
        Its half-axes, mm.
    factor
        On C10 and C20.
    """

    distance: float
    along: float
    across: float
    factor: float
    side: float = 0.0

    def holds(self, points: FloatArray, touch: FloatArray, travel: FloatArray) -> NDArray[np.bool_]:
        """Return which points (n, 2) lie in it."""
        away = points - touch
        along = away @ travel - self.distance
        across = away @ np.array([-travel[1], travel[0]]) - self.side
        return np.asarray((along / self.along) ** 2 + (across / self.across) ** 2 < 1.0)


@dataclass(frozen=True)
class OtherCase:
    """What is solved; stiffness in kPa.

    Parameters
    ----------
    c10, c20
        Of the deep tissue.
    exponential
        alpha and beta of the deep tissue's exponential energy.
    factors
        On C10 of ``superficial`` and ``fascia``, and on D1 of ``deep``.
    friction
        Coulomb's coefficient; infinite for a skin that sticks.
    springs
        Of every bone, N/mm over the cylinder's length, across and along the travel; bones are held
        without it.
    lump
        In the deep tissue.
    """

    c10: float
    c20: float = 0.0
    exponential: tuple[float, float] = (0.0, 1.0)
    factors: Mapping[str, float] = field(default_factory=dict)
    friction: float = np.inf
    springs: float | None = None
    lump: Lump | None = None


class OtherCode(OtherPressing):
    """A leg in plane strain, pressed by a disk.

    Parameters
    ----------
    subject
        Leg, indenter and the laws of its tissues.
    case
        What is solved.
    finer
        Than the default mesh, a factor.
    """

    def __init__(self, subject: Subject, case: OtherCase, finer: float = 1.0) -> None:
        from legfem.meshing.section import first_touch

        indenter = subject.indenter
        self.subject, self.case = subject, case
        self.radius, travel = indenter.radius, indenter.direction
        self.start = np.asarray(first_touch(subject.section.skin, indenter.radius, indenter.aim, travel))
        at_skin = self.start + self.radius * travel
        self.mesh = mesh_leg(subject.section, at_skin, finer)
        bodies = list(self._made(at_skin, travel))
        super().__init__(bodies, self._kept(), travel, indenter.length)
        fat = subject.tissues["superficial"].C10
        assert fat is not None
        modulus = 2 * fat
        self.penalty = _PENALTY * modulus / self.radius
        self.along = _ALONG * modulus / self.radius
        xi = GAUSS[0]
        self._shape = np.column_stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2])

    def _made(self, touch: FloatArray, travel: FloatArray) -> Any:
        import felupe as fem

        for name, cells in self.mesh.cells.items():
            own = self.subject.tissues[name]
            parts = {1.0: cells}
            if name == "deep" and self.case.lump is not None:
                middle = self.mesh.points[cells[:, :3]].mean(axis=1)
                inside = self.case.lump.holds(middle, touch, travel)
                parts = {1.0: cells[~inside], self.case.lump.factor: cells[inside]}
            for factor, part in parts.items():
                region = fem.RegionQuadraticTriangle(fem.Mesh(self.mesh.points, part, "triangle6"))
                holder = fem.FieldContainer([fem.FieldPlaneStrain(region, dim=2)])
                law = self._law(name, own, factor)
                yield holder, fem.SolidBody(law, holder)

    def _law(self, name: str, own: TissueParameters, factor: float) -> Any:
        case = self.case
        if name != "deep":
            assert own.C10 is not None
            return other_law(own.C10 * case.factors.get(name, 1.0), own.D1)
        c10, c20 = (factor * kpa_to_mpa(c) for c in (case.c10, case.c20))
        alpha, beta = factor * kpa_to_mpa(case.exponential[0]), case.exponential[1]
        d1 = own.D1 * case.factors.get("deep", 1.0)
        return other_law(c10, d1, c20, own.D2, (alpha, beta))

    def _kept(self) -> csr_matrix:
        """Return the matrix from what is free to all displacements."""
        count = len(self.mesh.points)
        held = np.zeros(count, dtype=bool)
        for points in self.mesh.bones.values():
            held[points] = True
        free = np.flatnonzero(~held)
        rows: list[Any] = [np.repeat(2 * free, 2) + np.tile([0, 1], len(free))]
        columns: list[Any] = [np.arange(2 * len(free))]
        width = 2 * len(free)
        if self.case.springs is not None:
            for points in self.mesh.bones.values():
                rows.append(np.asarray(2 * points[:, None] + np.array([0, 1])).ravel())
                columns.append(np.tile([width, width + 1], len(points)))
                width += 2
        r, c = np.concatenate(rows), np.concatenate(columns)
        return csr_matrix((np.ones(len(r)), (r, c)), shape=(2 * count, width))

    def _seen(self, u: FloatArray, resultant: FloatArray) -> dict[str, float]:
        """Return the lateral force (N), both thicknesses on the line of travel and the skin's rise beside it (mm)."""
        moved = self.mesh.points + u.reshape(-1, 2)
        left = np.array([-self.travel[1], self.travel[0]])

        def place(edges: Ints, points: FloatArray = moved, beside: float = 0.0) -> float:
            """Where the line, shifted to its left, first meets edges: deformed, each is a parabola of eight chords."""
            bent = np.einsum("qn,knd->kqd", _CHORDS, points[edges])
            start = self.start + beside * left
            line = shapely.LineString([start - 200 * self.travel, start + 400 * self.travel])
            met = shapely.get_coordinates(line.intersection(shapely.MultiLineString(list(bent))))
            return float(((met - start) @ self.travel).min()) if len(met) else np.nan

        skin, outer, inner, bone = map(place, self._outlines)
        edges = self._outlines[0]
        rises = {
            f"skin_rise_{'left' if side > 0 else 'right'}_{abs(side):g}": place(edges, self.mesh.points, side)
            - place(edges, moved, side)
            for side in BESIDE_MM
        }
        return {
            **rises,
            "lateral_force": float(resultant @ left) * self.whole,
            "fat_thickness": outer - skin,
            "muscle_thickness": bone - inner,
        }

    @cached_property
    def _outlines(self) -> list[Ints]:
        """Edges of skin, the fascia's two faces and the bones, (n, 3) each: ends and middle."""
        fat, fascia, deep = (_edges(self.mesh.cells[name]) for name in ("superficial", "fascia", "deep"))
        on_bone = np.isin(deep, np.concatenate(list(self.mesh.bones.values()))).all(axis=1)
        return [self.mesh.skin, _shared(fat, fascia), _shared(deep, fascia), deep[on_bone]]

    def _untouched(self) -> FloatArray:
        return np.full(self.mesh.skin_weights.shape, np.nan)

    def _held(self, free: FloatArray, left: FloatArray, matrix: Any) -> tuple[FloatArray, Any]:
        if self.case.springs is None:
            return left, matrix
        each = self.case.springs / self.subject.indenter.length
        own = np.zeros(len(free))
        own[-2 * len(self.mesh.bones) :] = each
        return left + own * free, (matrix + coo_matrix((own, (np.arange(len(own)),) * 2), shape=matrix.shape)).tocsc()

    def _contact(self, u: FloatArray, to: float, before: FloatArray) -> tuple[FloatArray, Any, FloatArray, FloatArray]:
        """Return the disk's force on the skin, its tangent, the resultant, and where points stick.

        ``before`` (k, 3) is the way along the disk's surface at which each Gauss point holds; NaN
        where it hasn't touched.
        """
        edges, weights, stuck = self.mesh.skin, self.mesh.skin_weights, before
        centre = self.start + to * self.travel
        x = np.einsum("qn,knd->kqd", self._shape, (self.mesh.points + u.reshape(-1, 2))[edges])
        away = x - centre
        rho = np.linalg.norm(away, axis=2)
        n = away / rho[:, :, None]
        tau = np.stack([-n[:, :, 1], n[:, :, 0]], axis=2)
        pressed = np.maximum(self.radius - rho, 0.0)
        touching = pressed > 0
        pressure = self.penalty * pressed
        s = self.radius * np.arctan2(n @ np.array([-self.travel[1], self.travel[0]]), n @ self.travel)
        holding = touching & ~np.isnan(stuck)
        pull = np.where(holding, self.along * (s - np.where(holding, stuck, 0.0)), 0.0)
        limit = self.case.friction * pressure if np.isfinite(self.case.friction) else np.inf
        sliding = holding & (np.abs(pull) > limit)
        drag = np.where(sliding, np.sign(pull) * np.minimum(np.abs(pull), limit), pull)
        f = weights[:, :, None] * (pressure[:, :, None] * n - drag[:, :, None] * tau)
        by_normal = weights * self.penalty * touching
        by_along = weights * self.along * (holding & ~sliding) - weights * pressure / rho
        K = by_normal[:, :, None, None] * n[:, :, :, None] * n[:, :, None, :]
        K = K + by_along[:, :, None, None] * tau[:, :, :, None] * tau[:, :, None, :]
        if np.isfinite(self.case.friction):
            slope = weights * self.case.friction * self.penalty * np.sign(pull) * sliding
            K = K - slope[:, :, None, None] * tau[:, :, :, None] * n[:, :, None, :]
        outer, tangent = spread(self._shape, edges, f, K, len(u))
        held = np.where(touching, np.where(np.isnan(stuck), s, stuck), np.nan)
        held = np.where(sliding, s - drag / self.along, held)
        return outer, tangent, f.sum(axis=(0, 1)), held
