r"""A face on which one tissue slides along another by any way, and can't part from it.

A Gauss point :math:`x` of an edge of the one meets the outline :math:`y(\xi) = \sum N_k y_k` of the other where it is
nearest, :math:`(x - y) \cdot y' = 0`, and is the gap :math:`g = (x - y) \cdot n` away from it. The virtual work of
:math:`\frac{k_n}{2} g^2` is that of a force along the normal at both, which has no resultant and no moment. With
:math:`l = |y'|`, the unit tangent :math:`t = y' / l` and the places :math:`z = (x, y_1, y_2, ...)`,

.. math:: \frac{\partial g}{\partial z} = (n, -N_k n), \qquad
          \frac{\partial n}{\partial z} = -\frac{1}{l} t \otimes
          \left((0, N_k' n) + (n \cdot y'') \frac{\partial \xi}{\partial z}\right), \qquad
          \frac{\partial \xi}{\partial z} = \frac{l\, (t, -N_k t) + g\, (0, N_k' n)}{l^2 - g\, n \cdot y''}.

T. A. Laursen, Computational Contact and Impact Mechanics (2002), chapter 5. Points that slide over the corners of
elements stick there: the outline is a cubic between two nodes, with the slopes that both neighbours give, and has no
corner. For the same reason the middles of a mesh's straight edges are taken to lie on a curve, for both tissues alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.spatial import cKDTree

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.fem.outlines import edge_shapes, outline_of_facets
from legfem.fem.spaces import LegSpaces
from legfem.mechanics.terms.membranes import SlidingFace
from legfem.meshing.section import OUTER_FASCIA, UNDER_FAT

type _Ints = NDArray[Any]

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_SHAPES = edge_shapes(0.5 * (_POINTS + 1))
"""An edge's functions at its Gauss points, (3, 3)."""
_REACH_MM = 6.0
"""Way of sliding for which the tangent's pattern is made; farther ones extend it."""
_PROJECTIONS = 6
"""Newton steps to the nearest point, from that of the chord."""


@dataclass(eq=False)
class SlidingForces:
    """Forces between two tissues on a face, with their tangent.

    Parameters
    ----------
    spaces
        Of a section whose mesh is split along the fascia.
    term
        The face's law.

    Raises
    ------
    InputError
        If the mesh isn't split, or is spread over several ranks.
    """

    spaces: LegSpaces
    term: SlidingFace
    values: dict[str, float] = field(init=False)
    _met: _Ints = field(init=False)
    """(3 k,): the other tissue's edge that each Gauss point meets, sought at the end of a step: were it sought in every
    iteration, points at a corner would go to and fro."""

    def __post_init__(self) -> None:
        """Find both tissues' edges."""
        if self.spaces.mesh.comm.size > 1:
            raise InputError("model", self.term.name, "a sliding face is of one process", "run it without mpirun")
        self.values = dict(self.term.parameters)
        self._space_dofs = self.spaces.displacement_dofs.reshape(-1, 2)
        (self._fat, self._fat_places), (self._fascia, self._fascia_places) = (
            self._edges(tag) for tag in (UNDER_FAT, OUTER_FASCIA)
        )
        # All nodes one after the other, each between the inner two of a piece that its neighbours bend.
        dofs = self._fascia[:, [0, 2]].reshape(-1, 2)
        places = self._fascia_places[:, [0, 2]].reshape(-1, 2)
        around = (np.arange(len(dofs))[:, None] + np.arange(-1, 3)) % len(dofs)
        self._pieces, self._piece_places = dofs[around], places[around]
        self._steps = np.linalg.norm(np.diff(self._piece_places, axis=1), axis=2)
        length = np.linalg.norm(self._fat_places[:, 1] - self._fat_places[:, 0], axis=1)
        self._weights = (0.5 * length[:, None] * _WEIGHTS).ravel()
        rest = np.zeros(int(self._space_dofs.max()) + 1)
        self._closed: FloatArray | float = 0.0
        self.seek(rest)
        # Both outlines stand for one curve, and press on each other nowhere before they move.
        self._closed = self._gaps(rest, bend=False)[0]

    def _edges(self, tag: int) -> tuple[_Ints, FloatArray]:
        """Return a face's edges as dofs and rounded places (k, 3, 2), one after the other, leftwards round."""
        outline = outline_of_facets(self.spaces, tag)
        if not len(outline.nodes):
            raise InputError("mesh", self.term.name, "the mesh isn't split along the fascia", "mesh it so")
        nodes = _ring(outline.nodes)
        every = self.spaces.displacement_space.tabulate_dof_coordinates()[:, :2]
        if not shapely.is_ccw(shapely.linearrings(every[nodes[:, 0]])):
            nodes = nodes[::-1][:, [1, 0, 2]]
        return self._space_dofs[nodes], _rounded(every[nodes[:, 0]])

    @cached_property
    def _pairs(self) -> tuple[_Ints, _Ints, FloatArray]:
        """Dofs (m, 2) of nodes at one place, of both tissues, and the lengths (m,) that they stand for, mm."""
        dofs, index = np.unique(self._fat.reshape(-1, 2), axis=0, return_index=True)
        others = self._fascia.reshape(-1, 2)
        _, near = cKDTree(self._fascia_places.reshape(-1, 2)).query(self._fat_places.reshape(-1, 2)[index])
        length = np.linalg.norm(self._fat_places[:, 1] - self._fat_places[:, 0], axis=1)
        share = np.zeros(int(dofs.max()) + 1)
        np.add.at(share, self._fat[:, :, 0].ravel(), np.outer(length, [1 / 6, 1 / 6, 2 / 3]).ravel())
        return dofs, others[near], share[dofs[:, 0]]

    def assign(self, values: Mapping[str, float]) -> None:
        """Set those of the values that are the face's."""
        self.values |= {name: value for name, value in values.items() if name in self.values}

    def seek(self, unknown: FloatArray) -> None:
        """Find what each point meets at a state (n,)."""
        points = self._piece_places + unknown[self._pieces]
        chords = shapely.STRtree(shapely.linestrings(points[:, 1:3]))
        self._met = np.asarray(chords.nearest(shapely.points(self._at(unknown))))

    def _at(self, unknown: FloatArray) -> FloatArray:
        """Return the Gauss points (3 k, 2)."""
        return np.einsum("qn,knd->kqd", _SHAPES, self._fat_places + unknown[self._fat]).reshape(-1, 2)

    def residual(self, unknown: FloatArray) -> FloatArray:
        """Return the forces (n,) of a state (n,), N per mm of the leg."""
        return self._residual(unknown, self.values)

    def _residual(self, unknown: FloatArray, values: Mapping[str, float]) -> FloatArray:
        gap, slope, _ = self._gaps(unknown, bend=False)
        found = np.zeros(len(unknown))
        scale = values[self._named("normal")] * self._weights * gap
        np.add.at(found, self._places, ((scale[:, None] * slope)[:, None] @ self._spread)[:, 0])
        fat, fascia, share = self._pairs
        away = values[self._named("shear")] * share[:, None] * (unknown[fat] - unknown[fascia])
        np.add.at(found, fat, away)
        np.add.at(found, fascia, -away)
        return found

    def tangent(self, unknown: FloatArray) -> csr_matrix:
        """Return their derivative (n, n)."""
        gap, slope, bend = self._gaps(unknown)
        scale = self.values[self._named("normal")] * self._weights
        blocks = slope[:, :, None] * slope[:, None, :] + gap[:, None, None] * bend
        blocks = self._spread.transpose(0, 2, 1) @ (scale[:, None, None] * blocks) @ self._spread
        places = self._places
        width = places.shape[1]
        rows, columns = np.repeat(places, width, axis=1).ravel(), np.tile(places, (1, width)).ravel()
        fat, fascia, share = self._pairs
        stiff = self.values[self._named("shear")] * np.repeat(share, 2)
        a, b = fat.ravel(), fascia.ravel()
        rows, columns = np.concatenate([rows, a, b, a, b]), np.concatenate([columns, a, b, b, a])
        values = np.concatenate([blocks.ravel(), stiff, stiff, -stiff, -stiff])
        return coo_matrix((values, (rows, columns)), shape=(len(unknown), len(unknown))).tocsr()

    def partial(self, unknown: FloatArray, name: str) -> FloatArray:
        """Return the forces' derivative (n,) by a parameter of the face, in which they are linear."""
        return self._residual(unknown, {key: float(key == name) for key in self.values})

    def pattern(self, size: int) -> csr_matrix:
        """Return a matrix (n, n) of ones where the tangent may have entries while points slide a usual way."""
        middles = self._piece_places[:, 1]
        reach = cKDTree(middles).query_ball_point(self._fat_places[:, 2], _REACH_MM)
        rows, columns = [], []
        for fat, near in zip(self._fat, reach, strict=True):
            dofs = np.concatenate([fat.ravel(), self._pieces[near].ravel()])
            rows.append(np.repeat(dofs, len(dofs)))
            columns.append(np.tile(dofs, len(dofs)))
        there = np.concatenate(rows), np.concatenate(columns)
        return coo_matrix((np.ones(len(there[0])), there), shape=(size, size)).tocsr()

    def slips(self, unknown: FloatArray) -> FloatArray:
        """Return how far nodes that lay at one place are apart (m,), mm."""
        fat, fascia, _ = self._pairs
        return np.linalg.norm(unknown[fat] - unknown[fascia], axis=1)

    def gaps(self, unknown: FloatArray) -> FloatArray:
        """Return how far the face is open or closed at its Gauss points (3 k,), mm."""
        return np.abs(self._gaps(unknown, bend=False)[0])

    def _named(self, number: str) -> str:
        return f"{self.term.name}.{number}"

    @property
    def _places(self) -> _Ints:
        """Dofs (3 k, 14) of the edge and the piece that meet at every Gauss point."""
        fat = np.repeat(self._fat, len(_POINTS), axis=0)
        return np.concatenate([fat, self._pieces[self._met]], axis=1).reshape(len(self._met), 14)

    @cached_property
    def _spread(self) -> FloatArray:
        """From a Gauss point and the piece that it meets (10) to both's nodes (14); (3 k, 10, 14)."""
        found = np.zeros((len(_POINTS), 10, 14))
        for d in range(2):
            found[:, d, d:6:2] = _SHAPES
        found[:, 2:, 6:] = np.eye(8)
        return np.tile(found, (len(self._fat), 1, 1))

    def _gaps(self, unknown: FloatArray, bend: bool = True) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return gaps (p,), their first derivatives (p, 8) by points and edges met, and the second (p, 8, 8)."""
        pieces = (self._piece_places + unknown[self._pieces])[self._met]
        gap, first, second = _gap(self._at(unknown), pieces, self._steps[self._met], bend)
        return gap - self._closed, first, second


def _ring(edges: _Ints) -> _Ints:
    """Return the edges (k, 3) of a closed line one after the other, each from where the one before ends."""
    at: dict[int, list[int]] = {}
    for number, (first, last, _) in enumerate(edges.tolist()):
        at.setdefault(first, []).append(number)
        at.setdefault(last, []).append(number)
    ordered, number, node = [], 0, int(edges[0, 0])
    for _ in edges:
        first, last, middle = edges[number].tolist()
        end = last if first == node else first
        ordered.append((node, end, middle))
        number, node = next(n for n in at[end] if n != number), end
    return np.array(ordered)


def _rounded(corners: FloatArray) -> FloatArray:
    """Return ends and middles (k, 3, 2) of a closed line's edges, bent to the tangents that neighbours give."""
    along = np.roll(corners, -1, axis=0) - corners
    length = np.linalg.norm(along, axis=1)[:, None]
    unit, before = along / length, np.roll(length, 1, axis=0)
    tangent = before * unit + length * np.roll(unit, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    ends = np.roll(corners, -1, axis=0)
    middle = 0.5 * (corners + ends) + length / 8 * (tangent - np.roll(tangent, -1, axis=0))
    return np.stack([corners, ends, middle], axis=1)


def _gap(
    x: FloatArray, nodes: FloatArray, steps: FloatArray, bend: bool = True
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return gaps of points (p, 2) outside pieces (p, 4, 2), with their derivatives (p, 10) and (p, 10, 10).

    ``steps`` (p, 3) are the undeformed lengths between a piece's nodes.
    """
    powers = _powers(steps)
    coefficients = np.einsum("pck,pkd->pcd", powers, nodes)
    along = nodes[:, 2] - nodes[:, 1]
    xi = np.clip(np.sum((x - nodes[:, 1]) * along, axis=1) / np.sum(along**2, axis=1), -0.5, 1.5)
    for _ in range(_PROJECTIONS):
        y, slope, curve = (np.einsum("pc,pcd->pd", m, coefficients) for m in _monomials(xi))
        away = x - y
        xi = xi + np.sum(away * slope, axis=1) / (np.sum(slope**2, axis=1) - np.sum(away * curve, axis=1))
    shape, by_xi, _ = (np.einsum("pc,pck->pk", m, powers) for m in _monomials(xi))
    y, slope, curve = (np.einsum("pc,pcd->pd", m, coefficients) for m in _monomials(xi))
    length = np.linalg.norm(slope, axis=1)
    t = slope / length[:, None]
    n = np.column_stack([t[:, 1], -t[:, 0]])
    gap = np.sum((x - y) * n, axis=1)
    by_place = np.column_stack([np.ones(len(xi)), -shape])
    first = (by_place[:, :, None] * n[:, None, :]).reshape(-1, 10)
    if not bend:
        return gap, first, np.zeros((0, 10, 10))
    turning = np.column_stack([np.zeros(len(xi)), by_xi])
    across = (turning[:, :, None] * n[:, None, :]).reshape(-1, 10)
    sideways = (by_place[:, :, None] * t[:, None, :]).reshape(-1, 10)
    curved = np.sum(n * curve, axis=1)
    moved = (length[:, None] * sideways + gap[:, None] * across) / (length**2 - gap * curved)[:, None]
    turned = (across + curved[:, None] * moved) / length[:, None]
    # The normal turns by -t (turned . dz), and the place on the piece moves.
    second = -sideways[:, :, None] * turned[:, None, :] - across[:, :, None] * moved[:, None, :]
    return gap, first, second


def _monomials(xi: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return 1, xi, xi^2, xi^3 (p, 4) and their first two derivatives."""
    one, zero = np.ones(len(xi)), np.zeros(len(xi))
    return (
        np.column_stack([one, xi, xi**2, xi**3]),
        np.column_stack([zero, one, 2 * xi, 3 * xi**2]),
        np.column_stack([zero, zero, 2 * one, 6 * xi]),
    )


def _powers(steps: FloatArray) -> FloatArray:
    """Return from four nodes to a cubic's coefficients between the inner two, (p, 4, 4).

    Its slopes there are those of the parabolas through a node and its neighbours.
    """
    a, h, b = steps.T
    zero, one = np.zeros(len(a)), np.ones(len(a))
    start = np.column_stack([-h * h / (a * (a + h)), (h - a) / a, a / (a + h), zero])
    end = np.column_stack([zero, -b / (h + b), (b - h) / b, h * h / (b * (h + b))])
    at0 = np.column_stack([zero, one, zero, zero])
    at1 = np.column_stack([zero, zero, one, zero])
    return np.stack([at0, start, 3 * (at1 - at0) - 2 * start - end, 2 * (at0 - at1) + start + end], axis=1)
