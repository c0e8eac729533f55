r"""Outlines of a section's parts as it deforms, where lines cross them, how crossings move; points inside it.

A deformed outline is :math:`x(s) = X(s) + u(X(s))`, quadratic along every edge of the mesh. A line
through :math:`o` along :math:`t`, at an offset :math:`e` beside it, meets it where

.. math:: c(s) = (x(s) - o) \cdot n - e = 0, \qquad a = (x(s) - o) \cdot t,

with :math:`n` across the line. As the nodes move at the rates :math:`x'`, the crossing slides along
the outline, and its place along the line changes by

.. math:: a' = x' \cdot t - \frac{a_s}{c_s}\, x' \cdot n.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.fem.spaces import LegSpaces, cells_behind
from legfem.geometry.section import across

_EDGES = np.array([[1, 2, 3], [2, 0, 4], [0, 1, 5]])
"""Nodes of a quadratic triangle's edges: their ends, then their middle."""
_ROUND = 1e-9
"""By how much a crossing may lie beyond the ends of its edge, over its length: at a node it is both edges'."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Edges of a section's mesh in any order, those of all ranks.

    Parameters
    ----------
    nodes : (n, 3) int array
        The rank's edges as nodes of the displacement space: ends, then middle.
    places : (m, 3, 2) array
        Undeformed nodes of all ranks' edges, mm.
    comm
        The ranks.
    """

    nodes: NDArray[np.int32]
    places: FloatArray
    comm: MPI.Intracomm

    def values(self, nodal: FloatArray) -> FloatArray:
        """Return fields at the edges' nodes, (..., m, 3, 2), from their values at the rank's nodes, (..., nodes, 2)."""
        return np.concatenate(self.comm.allgather(nodal[..., self.nodes, :]), axis=-3)


@dataclass(frozen=True)
class Crossing:
    """Where a line first meets an outline.

    Parameters
    ----------
    edge
        Number of the edge.
    position
        Along the edge, from 0 to 1.
    along
        Along the line, from its origin (mm).
    slip
        a_s / c_s: how far along the line the crossing moves as the outline moves by 1 across it.
    """

    edge: int
    position: float
    along: float
    slip: float

    def rate(self, rates: FloatArray, direction: FloatArray) -> FloatArray:
        """Return derivatives (...) of its place along the line, from those of the edges' nodes (..., m, 3, 2)."""
        moves = edge_shapes(self.position) @ rates[..., self.edge, :, :]
        return np.asarray(moves @ direction - self.slip * (moves @ across(direction)))


def first_crossings(points: FloatArray, origins: FloatArray, directions: FloatArray) -> list[Crossing | None]:
    """Return each line's first crossing with an outline; None where there is none.

    Parameters
    ----------
    points
        Deformed nodes of the outline's edges, (m, 3, 2), mm.
    origins, directions
        A point on each of k lines (k, 2), mm, and their unit vectors (k, 2).
    """
    away = points - origins[:, None, None]
    offset, along = (
        np.einsum("kmnd,kd->kmn", away, ways) for ways in (np.array([across(one) for one in directions]), directions)
    )
    first, last, middle = np.moveaxis(offset, -1, 0)
    # The edge is within the hull of its Bezier points.
    bezier = 2 * middle - 0.5 * (first + last)
    low, high = (of(of(first, last), bezier) for of in (np.minimum, np.maximum))
    found: list[list[Crossing]] = [[] for _ in origins]
    for line, edge in np.argwhere((low <= _ROUND) & (high >= -_ROUND)):
        square, linear, constant = _coefficients(offset[line, edge])
        for position in _roots(square, linear, constant):
            slope = 2 * square * position + linear
            if slope != 0.0:
                bend, rise, start = _coefficients(along[line, edge])
                place = (bend * position + rise) * position + start
                found[line].append(Crossing(int(edge), position, place, (2 * bend * position + rise) / slope))
    return [min(one, key=lambda crossing: crossing.along, default=None) for one in found]


def edge_shapes(position: float | FloatArray) -> FloatArray:
    """Return the shape functions (..., 3) of an edge's ends and middle, at positions (...) from 0 to 1."""
    s = np.asarray(position)
    return np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=-1)


def _coefficients(nodal: FloatArray) -> tuple[float, float, float]:
    """Return those of s^2, s and 1 of a field along an edge."""
    first, last, middle = map(float, nodal)
    return 2 * first + 2 * last - 4 * middle, 4 * middle - 3 * first - last, first


def _roots(square: float, linear: float, constant: float) -> list[float]:
    """Return the real roots in an edge of a polynomial of second degree, nearly linear ones too."""
    under = linear**2 - 4 * square * constant
    if under < 0:
        return []
    half = -0.5 * (linear + math.copysign(math.sqrt(under), linear))
    roots = [constant / half] if half else []
    if square:
        roots.append(half / square)
    return [min(max(root, 0.0), 1.0) for root in roots if -_ROUND <= root <= 1 + _ROUND]


def outline_of_facets(spaces: LegSpaces, tag: int) -> Outline:
    """Return the outline that a mesh's tagged facets make, such as its skin."""
    return _gathered(spaces, *cells_behind(spaces.mesh, spaces.facet_tags.find(tag)))


def outline_between(spaces: LegSpaces, these: Sequence[int], other: int) -> Outline:
    """Return the outline along which cells of some tags meet those of another: edges of the first."""
    marks = fem.Function(spaces.displacement_space)
    dofs, size = spaces.displacement_space.dofmap.list, spaces.dimension
    tags = spaces.cell_tags
    owned = tags.indices < spaces.mesh.topology.index_map(2).size_local
    marks.x.array[size * dofs[tags.indices[owned & (tags.values == other)]]] = 1.0
    # The neighbour may be another rank's.
    marks.x.scatter_reverse(la.InsertMode.add)
    marks.x.scatter_forward()
    cells = tags.indices[owned & np.isin(tags.values, these)]
    shared = marks.x.array[size * dofs[cells][:, _EDGES[:, 2]]] > 0
    where, edges = np.nonzero(shared)
    return _gathered(spaces, cells[where], edges)


def _gathered(spaces: LegSpaces, cells: NDArray[np.int32], edges: NDArray[np.int_]) -> Outline:
    """Return the outline along local edges of cells."""
    space, comm = spaces.displacement_space, spaces.mesh.comm
    nodes = np.take_along_axis(space.dofmap.list[cells], _EDGES[edges], axis=1).astype(np.int32)
    places = space.tabulate_dof_coordinates()[:, :2]
    return Outline(nodes, np.concatenate(comm.allgather(places[nodes])), comm)


_OUTSIDE = 0.3
"""Share of a cell's size by which a point may lie beyond the mesh: outlines are chords of what was drawn."""


@dataclass(frozen=True, eq=False)
class PointsInside:
    """Points in quadratic triangles, each in one of one rank.

    Parameters
    ----------
    nodes : (m, 6) int array
        Of the displacement space, of each point's triangle.
    shapes : (m, 6) array
        The triangle's shape functions there; nothing on ranks that haven't the point, NaN outside the mesh.
    comm
        The ranks.
    """

    nodes: NDArray[np.int32]
    shapes: FloatArray
    comm: MPI.Intracomm

    @classmethod
    def found(cls, spaces: LegSpaces, points: FloatArray) -> "PointsInside":
        """Find points (m, 2), mm, in an undeformed section; collective over its ranks."""
        space, comm = spaces.displacement_space, spaces.mesh.comm
        cells = space.dofmap.list[: spaces.mesh.topology.index_map(2).size_local]
        corners = space.tabulate_dof_coordinates()[:, :2][cells[:, :3]]
        sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
        within = np.einsum("cij,pcj->pci", np.linalg.inv(sides), points[:, None] - corners[None, :, 0])
        shares = np.concatenate([1 - within.sum(axis=-1, keepdims=True), within], axis=-1)
        least = shares.min(axis=-1)
        cell = least.argmax(axis=1)
        rows = np.arange(len(points))
        ranks = np.array(comm.allgather(least[rows, cell]))
        # Beyond the mesh the nearest of a triangle's points stands for one that is just outside.
        share = np.maximum(shares[rows, cell], 0.0)
        share /= share.sum(axis=1, keepdims=True)
        a, b, c = share.T
        quadratic = a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * b * c, 4 * a * c, 4 * a * b
        shapes = np.stack(quadratic, axis=-1) * (ranks.argmax(axis=0) == comm.rank)[:, None]
        shapes[ranks.max(axis=0) < -_OUTSIDE] = np.nan
        return cls(cells[cell], shapes, comm)

    def values(self, nodal: FloatArray) -> FloatArray:
        """Return fields (..., m, d) at the points from their values at the rank's nodes, (..., nodes, d)."""
        local = np.einsum("pk,...pkd->...pd", self.shapes, nodal[..., self.nodes, :])
        return np.asarray(self.comm.allreduce(local))
