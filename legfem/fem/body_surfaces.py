"""Surfaces of a meshed leg, whole on every rank: the skin, and the border between two regions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.fem.spaces import LegSpaces
from legfem.geometry.leg_surface import TriangleSurface
from legfem.meshing.section import HULL, SKIN


@dataclass(frozen=True, eq=False)
class BodySurface:
    """A surface of a leg of tetrahedra, with the values there of fields on the body.

    Parameters
    ----------
    surface : TriangleSurface
        The whole surface, that of all ranks.
    nodes : (n,) int array
        The rank's part of the surface's points, as nodes of the displacement space.
    comm
        The ranks.
    """

    surface: TriangleSurface
    nodes: NDArray[np.int32]
    comm: MPI.Intracomm

    def values(self, nodal: FloatArray) -> FloatArray:
        """Return values at the surface's points of a field at the rank's nodes, (nodes, ...)."""
        return np.concatenate(self.comm.allgather(nodal[self.nodes]))


def skin_surface(spaces: LegSpaces) -> BodySurface:
    """Return the skin's surface, gathered from all ranks."""
    return _of_facets(spaces, spaces.facet_tags.find(SKIN))


def hull_surface(spaces: LegSpaces) -> BodySurface:
    """Return the interface between deep and superficial tissue, gathered from all ranks."""
    return _of_facets(spaces, spaces.facet_tags.find(HULL))


def _of_facets(spaces: LegSpaces, facets: NDArray[np.int32]) -> BodySurface:
    return _gathered(spaces, _facet_nodes(spaces, facets))


def _facet_nodes(spaces: LegSpaces, facets: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the corners of facets as nodes of the displacement space, (n, 3)."""
    topology = spaces.mesh.topology
    dimension = topology.dim
    topology.create_connectivity(dimension - 1, dimension)
    topology.create_connectivity(dimension, dimension - 1)
    around = topology.connectivity(dimension - 1, dimension)
    cells = around.array[around.offsets[facets]]
    sides = topology.connectivity(dimension, dimension - 1).array.reshape(-1, dimension + 1)
    opposite = np.argmax(sides[cells] == facets[:, None], axis=1)
    corners = np.array([[k for k in range(dimension + 1) if k != i] for i in range(dimension + 1)])
    nodes: Any = spaces.displacement_space.dofmap.list
    return np.take_along_axis(nodes[cells], corners[opposite], axis=1)


def _gathered(spaces: LegSpaces, triangles: NDArray[np.int32]) -> BodySurface:
    comm = spaces.mesh.comm
    nodes, local = np.unique(triangles, return_inverse=True)
    points = spaces.displacement_space.tabulate_dof_coordinates()[nodes]
    counts = comm.allgather(len(nodes))
    first = sum(counts[: comm.rank])
    numbered = local.reshape(-1, 3).astype(np.int64) + first
    surface = TriangleSurface(np.concatenate(comm.allgather(points)), np.concatenate(comm.allgather(numbered)))
    return BodySurface(surface, nodes.astype(np.int32), comm)
