"""Points inside a section: where they lie in its mesh, and what a field is there."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.fem.spaces import LegSpaces

_OUTSIDE = 0.3
"""Of a cell's size, by which a point may lie beyond the mesh: outlines are chords of what was drawn."""


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
        shapes = _shapes(share) * (ranks.argmax(axis=0) == comm.rank)[:, None]
        shapes[ranks.max(axis=0) < -_OUTSIDE] = np.nan
        return cls(cells[cell], shapes, comm)

    def values(self, nodal: FloatArray) -> FloatArray:
        """Return a field (m, d) at the points from its values at the rank's nodes, (nodes, d)."""
        own = np.einsum("pk,pkd->pd", self.shapes, nodal[self.nodes])
        return np.asarray(self.comm.allreduce(own))


def _shapes(share: FloatArray) -> FloatArray:
    """Return the shape functions (m, 6) at barycentric coordinates (m, 3)."""
    a, b, c = share.T
    return np.stack([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * b * c, 4 * a * c, 4 * a * b], axis=-1)
