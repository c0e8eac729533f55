"""A leg in plane strain by the second code: quadratic triangles by gmsh, with its own contact and Newton's method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from legfem.channels import Sight
from legfem.channels.kinds.section_image import WINDOW_MM
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.indenter import first_touch
from legfem.legs.subject import Subject, TissueParameters
from studies.making.plane_mesh import GAUSS, Ints, TriangleMesh, distances_from_edges, in_muscles, mesh_leg
from studies.making.pressing import OtherPressing, other_law, spread

BESIDE_MM = (-40.0, -25.0, 25.0, 40.0)
"""To the left of the travel, where the skin's rise is seen."""


_SHAPE = np.column_stack([GAUSS[0] * (GAUSS[0] - 1) / 2, GAUSS[0] * (GAUSS[0] + 1) / 2, 1 - GAUSS[0] ** 2])
"""Functions (3, 3) of an edge's ends and middle at its Gauss points."""
_LEAST_SHEAR = 1e-4
"""Of a sliding face, over its normal stiffness: or the fat could turn round the muscle."""


@dataclass(frozen=True, eq=False)
class SlidingFace:
    """A face on which one side's edges slide along the other's, by a penalty that holds them together.

    Parameters
    ----------
    edges, onto
        (k, 3) and (l, 3): of what slides, and of what it slides along; ends and middle.
    weights
        Lengths (k, 3) that Gauss points of an edge stand for, mm.
    pairs
        (m, 2): points that lie at one place to begin with.
    normal, shear
        Stiffness of the face, MPa/mm, the latter shared out among the pairs (MPa).
    """

    edges: Ints
    onto: Ints
    weights: FloatArray
    pairs: Ints
    normal: float
    shear: FloatArray

    def met(self, points: FloatArray) -> Ints:
        """Return the edge (3 k, 3) that each Gauss point meets where points (n, 2) are."""
        chords = shapely.STRtree(shapely.linestrings(points[self.onto[:, [0, 2, 1]]]))
        return self.onto[chords.nearest(shapely.points(self._gauss_points(points)))]

    def _gauss_points(self, points: FloatArray) -> FloatArray:
        return np.einsum("qn,knd->kqd", _SHAPE, points[self.edges]).reshape(-1, 2)

    def force(self, points: FloatArray, met: Ints) -> tuple[FloatArray, csr_matrix]:
        """Return the energy's gradient (2 n,) by the points' places (n, 2), and its derivative.

        ``met`` are the edges (3 k, 3) that Gauss points meet: were they sought anew in every iteration, points at a
        corner would go to and fro.
        """
        xi, shape, at = GAUSS[0], _SHAPE, self._gauss_points(points)
        own = np.repeat(np.arange(len(self.edges)), len(xi))
        nodes = points[met]
        gap, slope = distances_from_edges(at, nodes)
        step = 1e-6
        bend = np.empty((len(at), 8, 8))
        for k in range(8):
            moved = []
            for side in (step, -step):
                here, there = at.copy(), nodes.copy()
                if k < 2:
                    here[:, k] += side
                else:
                    there[:, (k - 2) // 2, (k - 2) % 2] += side
                moved.append(distances_from_edges(here, there)[1])
            bend[:, k] = (moved[0] - moved[1]) / (2 * step)
        scale = self.normal * self.weights.ravel()
        f8 = (scale * gap)[:, None] * slope
        k8 = scale[:, None, None] * (slope[:, :, None] * slope[:, None, :] + gap[:, None, None] * bend)
        # From a Gauss point and the edge that it meets to the nodes of both.
        spread_out = np.zeros((len(at), 8, 12))
        for d in range(2):
            spread_out[:, d, d:6:2] = np.tile(shape, (len(self.edges), 1))
        spread_out[:, 2:, 6:] = np.eye(6)
        places = 2 * np.hstack([self.edges[own], met])[:, :, None] + np.arange(2)
        places = places.reshape(len(at), 12)
        total = np.zeros(points.size)
        np.add.at(total, places.ravel(), np.einsum("kio,ki->ko", spread_out, f8).ravel())
        blocks = np.einsum("kio,kij,kjp->kop", spread_out, k8, spread_out)
        rows, columns = np.repeat(places, 12, axis=1).ravel(), np.tile(places, (1, 12)).ravel()
        a, b = (2 * self.pairs[:, k, None] + np.arange(2) for k in range(2))
        away = (points[self.pairs[:, 0]] - points[self.pairs[:, 1]]) * self.shear[:, None]
        total[a] += away
        total[b] -= away
        s = np.repeat(self.shear, 2)
        a, b = a.ravel(), b.ravel()
        rows, columns = np.concatenate([rows, a, b, a, b]), np.concatenate([columns, a, b, b, a])
        values = np.concatenate([blocks.ravel(), s, s, -s, -s])
        return total, coo_matrix((values, (rows, columns)), shape=(points.size, points.size)).tocsr()


def parted(mesh: TriangleMesh, normal: float, shear: float) -> tuple[TriangleMesh, SlidingFace]:
    """Return a leg's mesh whose fat has points of its own on the fascia, and the face between.

    Parameters
    ----------
    mesh
        Grown together.
    normal, shear
        Stiffness, MPa/mm.
    """
    fat, fascia = mesh.cells["superficial"], mesh.cells["fascia"]
    edges = _shared(_edges(fascia), _edges(fat))
    number = np.arange(len(mesh.points))
    on = np.unique(edges)
    number[on] = len(mesh.points) + np.arange(len(on))
    points = np.vstack([mesh.points, mesh.points[on]])
    length = np.linalg.norm(np.diff(mesh.points[edges[:, :2]], axis=1)[:, 0], axis=1)
    weights = 0.5 * length[:, None] * GAUSS[1][None, :]
    share = np.zeros(len(points))
    np.add.at(share, edges.ravel(), np.outer(length, [1 / 6, 1 / 6, 2 / 3]).ravel())
    pairs = np.column_stack([number[on], on])
    face = SlidingFace(number[edges], edges, weights, pairs, normal, max(shear, _LEAST_SHEAR * normal) * share[on])
    return TriangleMesh(points, {**mesh.cells, "superficial": number[fat]}, mesh.skin, mesh.bones), face


_CHORDS = np.array([[(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)] for s in np.linspace(0, 1, 9)])
"""Shape functions of an edge's ends and middle at nine points."""


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _edges(cells: Ints) -> Ints:
    return np.vstack([cells[:, [0, 1, 3]], cells[:, [1, 2, 4]], cells[:, [2, 0, 5]]])


def _shared(one: Ints, other: Ints) -> Ints:
    """Return the edges (n, 3) of one tissue that are another's too."""
    return one[np.isin(one[:, 2], other[:, 2])]


_PENALTY, _BETWEEN = 2000.0, 4000.0
"""Of the cylinder on the skin, normal and tangential, and of fat on the fascia: times the shear modulus of fat or
muscle, whichever is larger, over the cylinder's radius. With a tenth of it along the skin a soft fat under a stiff
muscle yields by 2 % of the force."""


_IN_SHAPE = 0.05
"""Of what resists changes of volume."""


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
    lumps
        In the deep tissue; the last one counts.
    sliding
        Shear stiffness (kPa/mm) of the face between fat and fascia, on which the fat slides; without it they are one.
    muscles
        C10 of those of the section's that differ from the rest of the deep tissue.
    """

    c10: float
    c20: float = 0.0
    exponential: tuple[float, float] = (0.0, 1.0)
    factors: Mapping[str, float] = field(default_factory=dict)
    friction: float = np.inf
    springs: float | None = None
    lumps: Sequence[Lump] = ()
    sliding: float | None = None
    muscles: Mapping[str, float] = field(default_factory=dict)


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
    sights
        Places at which displacements are seen.
    """

    def __init__(self, subject: Subject, case: OtherCase, finer: float = 1.0, sights: Sequence[Sight] = ()) -> None:
        indenter = subject.indenter
        self.subject, self.case = subject, case
        self._sights = {sight.name: np.array(sight.places) for sight in sights}
        self.radius, travel = indenter.radius, indenter.direction
        self.start = np.asarray(first_touch(subject.section.skin, indenter.radius, indenter.aim, travel))
        at_skin = self.start + self.radius * travel
        self.mesh = mesh_leg(subject.section, at_skin, finer)
        outer = [tissue.C10 or 0.0 for name, tissue in subject.tissues.items() if name == "superficial"]
        fat = max(outer, default=0.0) * case.factors.get("superficial", 1.0)
        modulus = 2 * max(fat, kpa_to_mpa(case.c10))
        self.face: SlidingFace | None = None
        if case.sliding is not None:
            self.mesh, self.face = parted(self.mesh, _BETWEEN * modulus / self.radius, kpa_to_mpa(case.sliding))
        super().__init__(list(self._made(at_skin, travel)), self._kept(), travel, indenter.length)
        self.penalty = _PENALTY * modulus / self.radius
        self._shape = _SHAPE

    def _made(self, touch: FloatArray, travel: FloatArray) -> Any:
        import felupe as fem

        for name, cells in self.mesh.cells.items():
            own = self.subject.tissues[name]
            factors: FloatArray = np.ones(len(cells))
            if name == "deep":
                factors = in_muscles(self.mesh, self.subject.section, self.case.muscles, self.case.c10)
                for lump in self.case.lumps:
                    factors[lump.holds(self.mesh.points[cells[:, :3]].mean(axis=1), touch, travel)] = lump.factor
            for factor in np.unique(factors):
                mesh = fem.Mesh(self.mesh.points, cells[factors == factor], "triangle6")
                for law, order in self._laws(name, own, factor):
                    region = fem.RegionQuadraticTriangle(mesh, quadrature=fem.TriangleQuadrature(order=order))
                    holder = fem.FieldContainer([fem.FieldPlaneStrain(region, dim=2)])
                    yield holder, fem.SolidBody(law, holder)

    def _laws(self, name: str, own: TissueParameters, factor: float) -> list[tuple[Any, int]]:
        """Return a tissue's laws, each with the order of its integration.

        Muscle hardly changes its volume: with all that resists such changes at three points of a triangle a soft one
        locks (by 1.4 % of the force). Most of it is integrated at one point, as a pressure that is constant in a
        triangle (D. S. Malkus, T. J. R. Hughes, Comput. Methods Appl. Mech. Eng. 15 (1978) 63-81); the rest keeps
        triangles in shape.
        """
        case = self.case
        if name != "deep":
            assert own.C10 is not None
            return [(other_law(own.C10 * case.factors.get(name, 1.0), own.D1), 2)]
        c10, c20 = (factor * kpa_to_mpa(c) for c in (case.c10, case.c20))
        alpha, beta = factor * kpa_to_mpa(case.exponential[0]), case.exponential[1]
        d1 = own.D1 * case.factors.get("deep", 1.0)
        d2 = np.inf if own.D2 is None else own.D2
        at_all, at_one = _IN_SHAPE, 1 - _IN_SHAPE
        return [
            (other_law(c10, d1 / at_all, c20, d2 / at_all, (alpha, beta)), 2),
            (other_law(0.0, d1 / at_one, 0.0, d2 / at_one), 1),
        ]

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

        skin, outer, inner, bone = (place(edges) if len(edges) else np.nan for edges in self._outlines)
        edges = self._outlines[0]
        rises = {
            f"skin_rise_{'left' if side > 0 else 'right'}_{abs(side):g}": place(edges, self.mesh.points, side)
            - place(edges, moved, side)
            for side in BESIDE_MM
        }
        inside = self._sights.get("section_displacement", np.zeros((0, 3)))
        moves = self.displacements(u, inside[:, :2])[np.arange(len(inside)), inside[:, 2].astype(int)]
        strained = np.asarray(self._sights.get("section_strain", np.zeros((0, 2)))).reshape(-1, 2)
        half = 0.5 * WINDOW_MM * self.travel
        ahead, behind = (self.displacements(u, strained + way) for way in (half, -half))
        strains = (ahead - behind) @ self.travel / WINDOW_MM
        at, load = self._face if np.any(resultant) else (np.zeros(0), np.zeros(0))
        ends = self._sights.get("contact_pressure", ())
        pressures = [1e3 * float(load[(at >= a) & (at < b)].sum()) / (b - a) for a, b in ends]
        return {
            **rises,
            **{f"contact_pressure:{k}": value for k, value in enumerate(pressures)},
            "contact_width": float(np.ptp(at)) if len(at) else 0.0,
            **{f"section_displacement:{k}": float(value) for k, value in enumerate(moves)},
            **{f"section_strain:{k}": float(value) for k, value in enumerate(strains)},
            "lateral_force": float(resultant @ left) * self.whole,
            "fat_thickness": outer - skin,
            "muscle_thickness": bone - inner,
            "tissue_thickness": bone - skin,
        }

    def displacements(self, u: FloatArray, points: FloatArray) -> FloatArray:
        """Return the displacements (m, 2) of points (m, 2) of the undeformed section, mm, from all nodes' (n,)."""
        cells = np.concatenate(list(self.mesh.cells.values()))
        corners = self.mesh.points[cells[:, :3]]
        found = np.empty((len(points), 2))
        for row, point in zip(found, points, strict=True):
            # Areas of the triangles that the point makes with the corners, over the cell's.
            a, b, c = (corners - point).transpose(1, 0, 2)
            areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-1)
            shares = areas / areas.sum(axis=1, keepdims=True)
            cell = int(shares.min(axis=1).argmax())
            s = shares[cell]
            ends, middles = s * (2 * s - 1), 4 * s * np.roll(s, -1)
            row[:] = np.concatenate([ends, middles]) @ u.reshape(-1, 2)[cells[cell]]
        return found

    @cached_property
    def _outlines(self) -> list[Ints]:
        """Edges of skin, the fascia's two faces and the bones, (n, 3) each: ends and middle."""
        none = np.zeros((0, 6), dtype=int)
        fat, fascia, deep = (_edges(self.mesh.cells.get(name, none)) for name in ("superficial", "fascia", "deep"))
        on_bone = np.isin(deep, np.concatenate(list(self.mesh.bones.values()))).all(axis=1)
        return [self.mesh.skin, _shared(fat, fascia), _shared(deep, fascia), deep[on_bone]]

    def _untouched(self) -> FloatArray:
        return np.full(self.mesh.skin_weights.shape, np.nan)

    def _begin(self, free: FloatArray) -> None:
        if self.face is not None:
            self._met = self.face.met(self.mesh.points + (self._reduction @ free).reshape(-1, 2))

    def _held(self, free: FloatArray, left: FloatArray, matrix: Any) -> tuple[FloatArray, Any]:
        if self.face is not None:
            T = self._reduction
            pull, tangent = self.face.force(self.mesh.points + (T @ free).reshape(-1, 2), self._met)
            left, matrix = left + T.T @ pull, (matrix + T.T @ tangent @ T).tocsc()
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
        pull = np.where(holding, self.penalty * (s - np.where(holding, stuck, 0.0)), 0.0)
        limit = self.case.friction * pressure if np.isfinite(self.case.friction) else np.inf
        sliding = holding & (np.abs(pull) > limit)
        drag = np.where(sliding, np.sign(pull) * np.minimum(np.abs(pull), limit), pull)
        f = weights[:, :, None] * (pressure[:, :, None] * n - drag[:, :, None] * tau)
        by_normal = weights * self.penalty * touching
        by_along = weights * self.penalty * (holding & ~sliding) - weights * pressure / rho
        K = by_normal[:, :, None, None] * n[:, :, :, None] * n[:, :, None, :]
        K = K + by_along[:, :, None, None] * tau[:, :, :, None] * tau[:, :, None, :]
        if np.isfinite(self.case.friction):
            slope = weights * self.case.friction * self.penalty * np.sign(pull) * sliding
            K = K - slope[:, :, None, None] * tau[:, :, :, None] * n[:, :, None, :]
        outer, tangent = spread(self._shape, edges, f, K, len(u))
        self._face = s[touching], (weights * pressure)[touching]
        held = np.where(touching, np.where(np.isnan(stuck), s, stuck), np.nan)
        held = np.where(sliding, s - drag / self.penalty, held)
        return outer, tangent, f.sum(axis=(0, 1)), held
