"""Structured grids: boxes of unit cells with graded nodes and tagged sides."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self, get_type_hints

import numpy as np
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from legfem.common.errors import Checked
from legfem.common.units import FloatArray


@dataclass(frozen=True)
class ElementSizes(Checked):
    """Sizes of a mesh's elements: the fields that are numbers with a fraction."""

    def refined(self, factor: float) -> Self:
        """Return settings with all sizes divided by ``factor``."""
        sizes = (name for name, kind in get_type_hints(type(self)).items() if kind is float)
        return replace(self, **{name: getattr(self, name) / factor for name in sizes})


@dataclass(frozen=True, eq=False)
class TaggedMesh:
    """A mesh (mm) with tags of all its cells and of some facets, those of `dolfinx.mesh`."""

    mesh: Any
    cell_tags: Any
    facet_tags: Any

    @property
    def tagged(self) -> tuple[Any, Any, Any]:
        """Mesh, cell tags and facet tags, as `legfem.fem.spaces.build_spaces` takes them."""
        return self.mesh, self.cell_tags, self.facet_tags


def unit_cells(comm: MPI.Intracomm, counts: Sequence[int], simplices: bool = False) -> Any:
    """Return a box of unit squares or cubes, or of the triangles or tetrahedra in them."""
    kinds, three = dolfinx_mesh.CellType, len(counts) == 3
    make = dolfinx_mesh.create_box if three else dolfinx_mesh.create_rectangle
    whole, parts = (kinds.hexahedron, kinds.tetrahedron) if three else (kinds.quadrilateral, kinds.triangle)
    corners = [np.zeros(len(counts)), np.array(counts, dtype=float)]
    return make(comm, corners, counts, parts if simplices else whole, ghost_mode=dolfinx_mesh.GhostMode.none)


def spaced(length: float, size: Callable[[FloatArray], FloatArray], stops: tuple[float, ...] = ()) -> FloatArray:
    """Return nodes from 0 to a length, spaced by ``size``, with nodes at the stops."""
    ends = [0.0, *(stop for stop in stops if 1e-9 < stop < length - 1e-9), length]
    nodes = [np.zeros(1)]
    for start, end in pairwise(ends):
        fine = np.linspace(start, end, 2001)
        count = cumulative_trapezoid(1 / size(fine), fine, initial=0)
        number = max(1, round(count[-1]))
        nodes.append(np.interp(np.arange(1, number + 1) / number * count[-1], count, fine))
    return np.concatenate(nodes)


def tagged(made: Any, layer: list[int], sides: dict[tuple[int, int], int]) -> tuple[Any, Any]:
    """Tag the cells of a box of unit cells by their ring, and the facets of its sides."""
    topology, dimension = made.topology, made.topology.dim
    topology.create_entities(dimension - 1)
    topology.create_connectivity(dimension - 1, dimension)
    cell_map = topology.index_map(dimension)
    cells = np.arange(cell_map.size_local + cell_map.num_ghosts, dtype=np.int32)
    middle = dolfinx_mesh.compute_midpoints(made, dimension, cells)
    tags = np.array(layer, dtype=np.int32)[np.floor(middle[:, 1]).astype(int)]
    cell_tags = dolfinx_mesh.meshtags(made, dimension, cells, tags)

    def facets_on(axis: int, position: int) -> NDArray[np.int32]:
        on = dolfinx_mesh.locate_entities_boundary(made, dimension - 1, lambda x: np.isclose(x[axis], position))
        return np.asarray(on, dtype=np.int32)

    facets = [facets_on(*side) for side in sides]
    every, values = np.concatenate(facets), np.repeat(np.array([*sides.values()], np.int32), [*map(len, facets)])
    order = np.argsort(every)
    return cell_tags, dolfinx_mesh.meshtags(made, dimension - 1, every[order], values[order])


@dataclass(frozen=True)
class Support:
    """Displacement components that are zero on the facets of a tag."""

    tag: int
    components: tuple[int, ...]
