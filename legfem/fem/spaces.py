"""Finite-element spaces of a leg: on the body's mesh, on its skin, the trace between them; whole surfaces.

The skin is a mesh of its own, of one dimension less. Contact is assembled there with ordinary
forms, its history lives at ordinary quadrature points, and its contributions are added to the
body's at the dofs that the two share.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import basix.ufl
import numpy as np
from dolfinx import fem, la
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.fem.compat import cell_nodes, collapse
from legfem.geometry.leg_shape import TriangleSurface
from legfem.mechanics.model import Formulation
from legfem.meshing.grid import Support
from legfem.meshing.section import BONE, HULL, REGIONS, SKIN

Symmetry = Literal["plane", "axial"]
type Tags = int | tuple[int, ...]
POROUS = ("superficial", "deep")
"""Regions with a pressure in a porous form."""


def sum_over(comm: MPI.Comm, values: ArrayLike) -> FloatArray:
    """Return the sum of values (...) over ranks; ``allreduce`` pickles them, which takes thirty times as long."""
    own = np.asarray(values, dtype=float, order="C")
    total = np.empty_like(own)
    comm.Allreduce(own, total)
    return total


@dataclass(frozen=True, eq=False)
class LegSpaces:
    """Spaces and dof maps; all indices are local to the rank and unblocked."""

    mesh: Any
    cell_tags: Any
    facet_tags: Any
    formulation: Formulation
    space: Any
    """Space of the unknown: displacement, or displacement and pressure."""
    skin: Any
    """Mesh of the skin."""
    skin_space: Any
    skin_outward: NDArray[np.float64]
    """Sign (1 or -1) by cell of the skin that turns its own orientation's normal out of the body."""
    trace: NDArray[np.int32]
    """Dofs of ``space`` in the order of the dofs of ``skin_space``."""
    displacement_dofs: NDArray[np.int32]
    """Dofs of ``space`` that are displacements, in the order of ``displacement_space``."""
    displacement_space: Any
    pinned: NDArray[np.int32]
    """Dofs of ``space`` that a support holds at zero, or where the pressure is."""
    bone: NDArray[np.int32]
    """Pinned dofs of the bones, for their reaction."""
    regions: Mapping[str, Tags]
    """Cell tags of the tissues that the mesh has; one may lie within another."""
    symmetry: Symmetry = "plane"
    """Plane strain or axial symmetry, of a mesh of two dimensions."""

    def cells(self, region: str) -> NDArray[np.int32]:
        """Return the cells of a region."""
        return np.asarray(self.cell_tags.indices[np.isin(self.cell_tags.values, self.regions[region])])

    @property
    def dimension(self) -> int:
        """Number of the displacement's components: 2 or 3."""
        return int(self.mesh.geometry.dim)

    @property
    def unknowns(self) -> int:
        """Number of unknowns over all ranks."""
        return int(self.space.dofmap.index_map.size_global * self.space.dofmap.index_map_bs)


def build_spaces(
    mesh: Any,
    cell_tags: Any,
    facet_tags: Any,
    formulation: Formulation = "displacement",
    degree: int = 2,
    regions: Mapping[str, Tags] = REGIONS,
    supports: Sequence[Support] | None = None,
    drained: Sequence[int] = (),
    symmetry: Symmetry = "plane",
) -> LegSpaces:
    """Build the spaces of a leg.

    Parameters
    ----------
    mesh, cell_tags, facet_tags
        The mesh with regions, and facets marked `SKIN` and `BONE`.
    formulation
        ``"displacement"``, or ``"mixed"``: displacements enriched by bubbles with a pressure that
        is discontinuous between elements, since layers of different stiffness meet in the leg, or
        ``"continuous"``: a pressure of its own in every region, continuous there, one degree below
        the displacement's and at least of the first (which at degree 1 needs
        `legfem.mechanics.terms.PressureStabilisation`), or ``"porous"``: a continuous pressure in
        the regions of `POROUS`, so that fluid can flow from element to element, and none in the
        others. The thin layer of the fascia, much stiffer and more compressible, keeps the two
        pressures apart; all its nodes have to be on its faces.
    degree
        Degree of the displacement.
    regions
        Cell tags of the tissues that the mesh has.
    supports
        What is held; by default the bones, in all components.
    drained
        Tags of facets where the pressure of a porous form is zero; all others are sealed.
    symmetry
        ``"plane"`` strain, or ``"axial"``: a mesh of two dimensions is the meridional half plane,
        with the axis at the first coordinate's zero.

    Raises
    ------
    InputError
        If facets are to be drained in another form.
    """
    if drained and formulation != "porous":
        raise InputError(
            "formulation", "drained", f"a {formulation} form has no fluid to drain", 'choose the formulation "porous"'
        )
    dimension = mesh.geometry.dim
    lagrange = basix.ufl.element("Lagrange", mesh.basix_cell(), degree, shape=(dimension,))
    displacement = fem.functionspace(mesh, lagrange)
    if formulation == "displacement":
        space = displacement
        dofs: NDArray[np.int32] = np.arange(_local_size(space), dtype=np.int32)
    else:
        space = fem.functionspace(mesh, _element(formulation, mesh, degree, len(regions)))
        dofs = _shared_dofs(space, displacement, dimension)

    skin = dolfinx_mesh.create_submesh(mesh, mesh.topology.dim - 1, np.sort(facet_tags.find(SKIN)))[0]
    skin_space = fem.functionspace(skin, ("Lagrange", degree, (dimension,)))
    if supports is None:
        supports = (Support(BONE, tuple(range(dimension))),)

    def held(support: Support) -> NDArray[np.int32]:
        facets = facet_tags.find(support.tag)
        nodes = fem.locate_dofs_topological(displacement, mesh.topology.dim - 1, facets)
        return dofs[nodes[:, None] * dimension + np.array(support.components)].ravel()

    def dry(tag: int) -> NDArray[np.int32]:
        facets = facet_tags.find(tag)
        return np.asarray(fem.locate_dofs_topological(space.sub(1), mesh.topology.dim - 1, facets))

    found = [(support.tag, held(support)) for support in supports]
    none = np.empty(0, dtype=np.int32)
    bone = [held for tag, held in found if tag == BONE]
    dropped = [] if formulation != "continuous" else _elsewhere(space, cell_tags, regions)
    return LegSpaces(
        mesh,
        cell_tags,
        facet_tags,
        formulation,
        space,
        skin,
        skin_space,
        _outward(mesh, facet_tags.find(SKIN), skin),
        dofs[_blocks(_trace_nodes(displacement, skin_space), dimension)],
        dofs,
        displacement,
        np.unique(np.concatenate([none, *(held for _, held in found), *map(dry, drained), *dropped])),
        np.unique(np.concatenate([none, *bone])),
        regions,
        symmetry,
    )


def _element(formulation: Formulation, mesh: Any, degree: int, regions: int) -> Any:
    cell, shape = mesh.basix_cell(), (mesh.geometry.dim,)
    displacement = basix.ufl.element("Lagrange", cell, degree, shape=shape)
    if formulation != "mixed":
        pressure = basix.ufl.element("Lagrange", cell, max(degree - 1, 1))
        return basix.ufl.mixed_element([displacement, *[pressure] * (regions if formulation == "continuous" else 1)])
    if cell.name in ("quadrilateral", "hexahedron"):  # these need no bubble for linear pressures
        linear = basix.ufl.element("DPC", cell, degree - 1, discontinuous=True)
        return basix.ufl.mixed_element([displacement, linear])
    enriched = basix.ufl.enriched_element(
        [basix.ufl.element("Lagrange", cell, degree), basix.ufl.element("Bubble", cell, degree + 1)]
    )
    pressure = basix.ufl.element("Lagrange", cell, degree - 1, discontinuous=True)
    return basix.ufl.mixed_element([basix.ufl.blocked_element(enriched, shape=shape), pressure])


def _elsewhere(space: Any, cell_tags: Any, regions: Mapping[str, Tags]) -> list[NDArray[np.int32]]:
    """Return the dofs of every region's pressure that no cell of the region has."""
    used, unused = fem.Function(space), []
    for number, tags in enumerate(regions.values(), 1):
        used.x.array[space.sub(number).dofmap.list[cell_tags.indices[np.isin(cell_tags.values, tags)]]] = 1.0
    # Another rank may hold the only cell of a region at a node.
    used.x.scatter_reverse(la.InsertMode.add)
    used.x.scatter_forward()
    for number in range(1, len(regions) + 1):
        dofs = np.unique(space.sub(number).dofmap.list)
        unused.append(dofs[used.x.array[dofs] == 0].astype(np.int32))
    return unused


def _shared_dofs(mixed: Any, displacement: Any, dimension: int) -> NDArray[np.int32]:
    """Return the dofs of a mixed space at the nodes of its Lagrange displacement."""
    collapsed, parent = collapse(mixed.sub(0))
    nodes = displacement.dofmap.list
    enriched = collapsed.dofmap.list[:, : nodes.shape[1]]
    dofs = np.full(_local_size(displacement), -1, dtype=np.int32)
    dofs[_blocks(nodes.ravel(), dimension)] = parent[_blocks(enriched.ravel(), dimension)]
    return dofs


def _trace_nodes(displacement: Any, skin_space: Any) -> NDArray[np.int64]:
    """Return the body's node at every node of the skin."""
    nodes = skin_space.tabulate_dof_coordinates()
    if len(nodes) == 0:
        return np.empty(0, dtype=np.int64)
    distance, index = cKDTree(displacement.tabulate_dof_coordinates()).query(nodes)
    if distance.max() > 1e-6:
        raise RuntimeError("the skin's nodes are not nodes of the body")
    return np.asarray(index)


def _outward(mesh: Any, facets: NDArray[np.int32], skin: Any) -> NDArray[np.float64]:
    """Return the sign of every cell of the skin: 1 where its orientation's normal points out of the body."""
    local = skin.topology.index_map(skin.topology.dim)
    cells = np.arange(local.size_local + local.num_ghosts, dtype=np.int32)
    if len(cells) == 0:
        return np.empty(0)
    surface = mesh.topology.dim - 1
    middle = dolfinx_mesh.compute_midpoints(skin, skin.topology.dim, cells)
    _, facet = cKDTree(dolfinx_mesh.compute_midpoints(mesh, surface, facets)).query(middle)
    inside = cells_behind(mesh, facets)[0][facet]
    away = middle - dolfinx_mesh.compute_midpoints(mesh, mesh.topology.dim, inside)
    corner = skin.geometry.x[cell_nodes(skin)]
    along = corner[:, 1] - corner[:, 0]
    if surface == 1:
        normal = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=1)
    else:
        normal = np.cross(along, corner[:, 2] - corner[:, 0])
    return np.sign(np.einsum("ij,ij->i", normal, away))


def cells_behind(mesh: Any, facets: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int_]]:
    """Return the first cell of every facet (n,) that it belongs to, and the facet's number in it."""
    topology, dimension = mesh.topology, mesh.topology.dim
    topology.create_connectivity(dimension - 1, dimension)
    topology.create_connectivity(dimension, dimension - 1)
    around, sides = topology.connectivity(dimension - 1, dimension), topology.connectivity(dimension, dimension - 1)
    cells = around.array[around.offsets[facets]]
    every = sides.array.reshape(sides.num_nodes, -1)
    return cells, np.argmax(every[cells] == facets[:, None], axis=1)


def _blocks(nodes: NDArray[Any], size: int) -> NDArray[np.int32]:
    return (np.asarray(nodes)[:, None] * size + np.arange(size)).ravel().astype(np.int32)


def _local_size(space: Any) -> int:
    index_map = space.dofmap.index_map
    return int((index_map.size_local + index_map.num_ghosts) * space.dofmap.index_map_bs)


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


def surface_of(spaces: LegSpaces, part: Literal["skin", "hull"]) -> BodySurface:
    """Return the surface of the skin, or that between deep and superficial tissue, gathered from all ranks."""
    comm, dimension = spaces.mesh.comm, spaces.dimension
    cells, opposite = cells_behind(spaces.mesh, spaces.facet_tags.find(SKIN if part == "skin" else HULL))
    corners = np.array([[k for k in range(dimension + 1) if k != i] for i in range(dimension + 1)])
    dofs: Any = spaces.displacement_space.dofmap.list
    triangles = np.take_along_axis(dofs[cells], corners[opposite], axis=1)
    nodes, local = np.unique(triangles, return_inverse=True)
    points = spaces.displacement_space.tabulate_dof_coordinates()[nodes]
    counts = comm.allgather(len(nodes))
    first = sum(counts[: comm.rank])
    numbered = local.reshape(-1, 3).astype(np.int64) + first
    surface = TriangleSurface(np.concatenate(comm.allgather(points)), np.concatenate(comm.allgather(numbered)))
    return BodySurface(surface, nodes.astype(np.int32), comm)
