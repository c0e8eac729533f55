"""A leg's mesh as other programs take it: nodes, elements, and names of regions and surfaces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx.plot import vtk_mesh
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.meshing.idealised_leg import END, MIRROR_X, MIRROR_Z
from legfem.meshing.section import BONE, HULL, SKIN

SURFACES = {"skin": SKIN, "bone": BONE, "mirror_x": MIRROR_X, "mirror_z": MIRROR_Z, "end": END, "hull": HULL}
"""Tags of facets by name; ``hull`` lies between deep and superficial tissue."""

# Kinds by the numbers that DOLFINx gives them, VTK's of Lagrange elements.
_KINDS = {68: "line", 69: "triangle", 70: "quad", 71: "tetra", 72: "hexahedron"}
_SIMPLICES = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "tetra": ((0, 1, 2, 3),),
    "wedge": ((0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5)),
    "hexahedron": ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
}
"""Simplices that fill an element whose faces are flat."""
_MIRRORED = {"triangle": (0, 2, 1), "quad": (0, 3, 2, 1), "tetra": (0, 2, 1, 3), "hexahedron": (4, 5, 6, 7, 0, 1, 2, 3)}
"""Order of the nodes that turns an element inside out."""


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one kind."""

    kind: str
    """As meshio calls it: ``triangle``, ``tetra``, ``hexahedron`` ..."""
    nodes: NDArray[np.int64]
    """(m, nodes of one), counted from 0, in VTK's order."""
    tags: NDArray[np.int64]
    """(m,): of the region, or the surface."""


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A mesh whose regions and surfaces have names.

    Parameters
    ----------
    points : ndarray
        (n, 3), mm.
    cells : Elements
        Of the tissue, none inside out.
    facets : tuple of Elements
        On the surfaces, by kind.
    regions, surfaces : mapping
        Tag by name.
    """

    points: FloatArray
    cells: Elements
    facets: tuple[Elements, ...]
    regions: Mapping[str, int]
    surfaces: Mapping[str, int]

    @property
    def dimension(self) -> int:
        """2 for a section, 3 for a body."""
        return 2 if self.cells.kind in ("triangle", "quad") else 3

    def measures(self) -> dict[str, float]:
        """Return the area (mm2) or the volume (mm3) of each region."""
        sizes = measure(self.points, self.cells.kind, self.cells.nodes)
        return {name: float(sizes[self.cells.tags == tag].sum()) for name, tag in self.regions.items()}


def named_mesh(mesh: Any, cell_tags: Any, facet_tags: Any, regions: Mapping[str, int]) -> NamedMesh:
    """Return what DOLFINx holds of a mesh on one process, with the names of its tags.

    Parameters
    ----------
    mesh, cell_tags, facet_tags
        `dolfinx.mesh.Mesh` and `dolfinx.mesh.MeshTags`; every cell is tagged.
    regions
        Tags of the cells by name.
    """
    dimension = mesh.topology.dim
    mesh.topology.create_connectivity(dimension - 1, dimension)
    points = np.array(mesh.geometry.x)
    kind, nodes = _entities(mesh, dimension, cell_tags.indices)
    # DOLFINx doesn't mind elements that are inside out; other programs do.
    wrong = measure(points, kind, nodes) < 0
    nodes[wrong] = nodes[wrong][:, _MIRRORED[kind]]
    cells = Elements(kind, nodes, cell_tags.values.astype(np.int64))
    surfaces = {name: tag for name, tag in SURFACES.items() if tag in facet_tags.values}
    known = np.isin(facet_tags.values, list(surfaces.values()))
    kind, nodes = _entities(mesh, dimension - 1, facet_tags.indices[known])
    facets = Elements(kind, nodes, facet_tags.values[known].astype(np.int64))
    return NamedMesh(points, cells, (facets,), dict(regions), surfaces)


def extruded(section: NamedMesh, thickness: float) -> NamedMesh:
    """Return a slab of a section, one element thick, for programs without plane strain.

    Its two flat faces are the surface ``end``: held along z, they make the slab's strain plane.

    Parameters
    ----------
    section : NamedMesh
        Of triangles or quadrilaterals.
    thickness : float
        Along z (mm).
    """
    count = len(section.points)
    above = section.points + np.array([0.0, 0.0, thickness])
    cells, (lines,) = section.cells, section.facets
    solid = Elements(
        {"triangle": "wedge", "quad": "hexahedron"}[cells.kind],
        np.hstack([cells.nodes, cells.nodes + count]),
        cells.tags,
    )
    sides = Elements("quad", np.hstack([lines.nodes, lines.nodes[:, ::-1] + count]), lines.tags)
    ends = Elements(
        cells.kind, np.vstack([cells.nodes[:, ::-1], cells.nodes + count]), np.full(2 * len(cells.nodes), END)
    )
    return NamedMesh(
        np.vstack([section.points, above]), solid, (sides, ends), section.regions, {**section.surfaces, "end": END}
    )


def measure(points: FloatArray, kind: str, nodes: NDArray[np.int64]) -> FloatArray:
    """Return signed areas (of those in the plane) or volumes of elements with flat faces; (m,)."""
    total = np.zeros(len(nodes))
    for simplex in _SIMPLICES[kind]:
        corners, dimension = points[nodes[:, simplex]], len(simplex) - 1
        edges = corners[:, 1:, :dimension] - corners[:, :1, :dimension]
        total += np.linalg.det(edges) / math.factorial(dimension)
    return total


def _entities(mesh: Any, dimension: int, entities: NDArray[np.int32]) -> tuple[str, NDArray[np.int64]]:
    topology, kinds, _ = vtk_mesh(mesh, dimension, entities)
    nodes = topology.reshape(len(entities), -1)[:, 1:].astype(np.int64)
    return _KINDS[int(kinds[0])], nodes
