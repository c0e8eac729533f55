r"""Outlines of a section's parts as it deforms, where lines cross them, how crossings move; points inside it.

A deformed outline is :math:`x(s) = X(s) + u(X(s))`, quadratic along every edge of the mesh. A line
through :math:`o` along :math:`t`, at an offset :math:`e` beside it, meets it where

.. math:: c(s) = (x(s) - o) \cdot n - e = 0, \qquad a = (x(s) - o) \cdot t,

with :math:`n` across the line. As the nodes move at the rates :math:`x'`, the crossing slides along
the outline, and its place along the line changes by

.. math:: a' = x' \cdot t - \frac{a_s}{c_s}\, x' \cdot n.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.fem.spaces import LegSpaces, cells_behind, sum_over
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
        own = nodal[..., self.nodes, :]
        return own if self.comm.size == 1 else np.concatenate(self.comm.allgather(own), axis=-3)


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where k lines first meet an outline.

    Parameters
    ----------
    edge
        Numbers of the edges, (k,).
    position
        Along the edges, from 0 to 1, (k,).
    along
        Along the lines, from their origins (k,), mm; NaN of those that don't meet it.
    slip
        a_s / c_s: how far along the lines the crossings move as the outline moves by 1 across them, (k,).
    """

    edge: NDArray[np.int_]
    position: FloatArray
    along: FloatArray
    slip: FloatArray

    def rates(self, rates: FloatArray, directions: FloatArray) -> FloatArray:
        """Return derivatives (p, k) of the places along lines, of directions (k, 2), from the nodes' (p, m, 3, 2)."""
        moves = np.einsum("ks,pksd->pkd", edge_shapes(self.position), rates[:, self.edge])
        slide = directions - self.slip[:, None] * across(directions)
        return np.where(np.isnan(self.along), np.nan, np.vecdot(moves, slide))


def first_crossings(points: FloatArray, origins: FloatArray, directions: FloatArray) -> Crossings:
    """Return each line's first crossing with an outline.

    Parameters
    ----------
    points
        Deformed nodes of the outline's edges, (m, 3, 2), mm.
    origins, directions
        A point on each of k lines (k, 2), mm, and their unit vectors (k, 2).
    """
    normals = across(directions)
    offset = np.einsum("mnd,kd->kmn", points, normals) - np.vecdot(origins, normals)[:, None, None]
    first, last, middle = np.moveaxis(offset, -1, 0)
    # The edge is within the hull of its Bezier points.
    bezier = 2 * middle - 0.5 * (first + last)
    low, high = (of(of(first, last), bezier) for of in (np.minimum, np.maximum))
    line, edge = np.nonzero((low <= _ROUND) & (high >= -_ROUND))
    square, linear, constant = _coefficients(offset[line, edge])
    bend, rise, start = _coefficients(np.vecdot(points[edge] - origins[line, None], directions[line, None]))
    with np.errstate(divide="ignore", invalid="ignore"):
        # Both roots, of what is nearly linear too; NaN, or infinite, where there is none.
        half = -0.5 * (linear + np.copysign(np.sqrt(linear**2 - 4 * square * constant), linear))
        root = np.array([constant / half, half / square])
        position = np.clip(root, 0.0, 1.0)
        slope = 2 * square * position + linear
        met = (root >= -_ROUND) & (root <= 1 + _ROUND) & (slope != 0.0)
        place = np.where(met, (bend * position + rise) * position + start, np.inf).T.ravel()
        slip = ((2 * bend * position + rise) / slope).T.ravel()
    # Of what is written in one place the last stays: the nearest.
    order = np.argsort(place, kind="stable")[: np.count_nonzero(met)][::-1]
    crossing, found = np.repeat(line, 2)[order], Crossings(np.zeros(len(origins), int), *np.zeros((3, len(origins))))
    found.along[:] = np.nan
    own = (np.repeat(edge, 2), position.T.ravel(), place, slip)
    for values, each in zip((found.edge, found.position, found.along, found.slip), own, strict=True):
        values[crossing] = each[order]
    return found


def edge_shapes(position: float | FloatArray) -> FloatArray:
    """Return the shape functions (..., 3) of an edge's ends and middle, at positions (...) from 0 to 1."""
    s = np.asarray(position)
    return np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=-1)


def _coefficients(nodal: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return those of s^2, s and 1 of fields (c, 3) along edges, (c,)."""
    first, last, middle = nodal.T
    return 2 * first + 2 * last - 4 * middle, 4 * middle - 3 * first - last, first


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
    return Outline(nodes, np.concatenate(comm.allgather(space.tabulate_dof_coordinates()[nodes, :2])), comm)


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
        return sum_over(self.comm, np.einsum("pk,...pkd->...pd", self.shapes, nodal[..., self.nodes, :]))
