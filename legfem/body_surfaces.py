"""Surfaces of a meshed leg, whole on every rank: the skin, and the border between two regions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray

from legfem.geometry.surface import TriangleSurface
from legfem.meshing.section import SKIN
from legfem.spaces import LegSpaces
from legfem.units import FloatArray


@dataclass(frozen=True, eq=False)
class BodySurface:
    """A surface of a leg of tetrahedra, with the values there of fields on the body.

    Parameters
    ----------
    surface : TriangleSurface
        Of all ranks.
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
    """Return the skin."""
    return _of_facets(spaces, spaces.facet_tags.find(SKIN))


def hull_surface(spaces: LegSpaces) -> BodySurface:
    """Return the border between the deep tissue and the superficial one."""
    mesh = spaces.mesh
    dimension = mesh.topology.dim
    shared = _in_both(spaces)
    mesh.topology.create_connectivity(dimension - 1, dimension)
    mesh.topology.create_connectivity(dimension, dimension - 1)
    around = mesh.topology.connectivity(dimension - 1, dimension)
    count = np.diff(around.offsets)
    tags = np.zeros(mesh.geometry.dofmap.shape[0], dtype=np.int32)
    tags[spaces.cell_tags.indices] = spaces.cell_tags.values
    deep = tags[around.array[around.offsets[:-1]]] == spaces.regions["deep"]
    last = tags[around.array[around.offsets[1:] - 1]] == spaces.regions["deep"]
    # A facet between two ranks has a single cell on either.
    candidates = np.flatnonzero(((count == 2) & (deep != last)) | (count == 1)).astype(np.int32)
    nodes = _facet_nodes(spaces, candidates)
    return _gathered(spaces, nodes[shared[nodes].all(axis=1)])


def _in_both(spaces: LegSpaces) -> NDArray[np.bool_]:
    """Tell of every node whether deep and superficial cells share it."""
    space = spaces.displacement_space
    both = np.ones(len(space.tabulate_dof_coordinates()), dtype=bool)
    mark = fem.Function(space)
    for region in ("deep", "superficial"):
        mark.x.array[:] = 0.0
        cells = spaces.cell_tags.find(spaces.regions[region])
        mark.x.array[np.unique(space.dofmap.list[cells]) * spaces.dimension] = 1.0
        mark.x.scatter_reverse(la.InsertMode.add)
        mark.x.scatter_forward()
        both &= mark.x.array[:: spaces.dimension] > 0
    return both


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
    surface = TriangleSurface(
        np.concatenate(comm.allgather(points)), np.concatenate(comm.allgather(numbered))
    )
    return BodySurface(surface, nodes.astype(np.int32), comm)
