"""Files of a leg's mesh for other programs: nodes, elements, and names of regions and surfaces.

.msh
    gmsh's format 2.2, which gmsh, DOLFINx, FEBio Studio and meshio read: regions and surfaces are
    physical groups with names.
.xdmf
    For DOLFINx and ParaView: the cells with their tags, and the surfaces in a second file.
.vtu
    For ParaView: tags, and a field of 0 and 1 for every name.
.inp
    For Abaqus, CalculiX and FEBio Studio: element sets, node sets and surfaces, and materials if any are given.
.feb
    For FEBio 4: parts with their materials, and surfaces whose normals point outwards.
"""

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from dolfinx.plot import vtk_mesh
from numpy.typing import NDArray

from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.units import FloatArray
from legfem.meshing.materials import TissueCard
from legfem.meshing.section import BONE, HULL, SKIN
from legfem.meshing.structured import END, MIRROR_X, MIRROR_Z

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
    """Nodes of the elements, (m, nodes of one), counted from 0, in VTK's order."""
    tags: NDArray[np.int64]
    """Tags of the elements' region or surface, (m,)."""


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A mesh whose regions and surfaces have names.

    Parameters
    ----------
    points : ndarray
        (n, 3), mm.
    cells : Elements
        Elements of the tissue, none inside out.
    facets : tuple of Elements
        On the surfaces, by kind.
    regions, surfaces : mapping
        Tag by name.
    materials : mapping
        Law by region; of all regions, or of none.
    """

    points: FloatArray
    cells: Elements
    facets: tuple[Elements, ...]
    regions: Mapping[str, int]
    surfaces: Mapping[str, int]
    materials: Mapping[str, TissueCard] = field(default_factory=dict)

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
        Mesh of triangles or quadrilaterals.
    thickness : float
        Thickness of the slab along z, mm.
    """
    count = len(section.points)
    above = section.points + np.array([0.0, 0.0, thickness])
    cells, (lines,) = section.cells, section.facets
    kind = {"triangle": "wedge", "quad": "hexahedron"}[cells.kind]
    solid = Elements(kind, np.hstack([cells.nodes, cells.nodes + count]), cells.tags)
    sides = Elements("quad", np.hstack([lines.nodes, lines.nodes[:, ::-1] + count]), lines.tags)
    both = np.vstack([cells.nodes[:, ::-1], cells.nodes + count])
    ends, surfaces = Elements(cells.kind, both, np.full(len(both), END)), {**section.surfaces, "end": END}
    return NamedMesh(np.vstack([section.points, above]), solid, (sides, ends), section.regions, surfaces)


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


_TYPES = {"triangle": "CPE3", "quad": "CPE4", "tetra": "C3D4", "wedge": "C3D6", "hexahedron": "C3D8"}
# Nodes of the faces S1, S2, ... (Abaqus Elements Guide, "Element faces").
_FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}


def _abaqus(mesh: NamedMesh) -> Iterator[str]:
    kind = mesh.cells.kind
    yield "*HEADING"
    yield "a leg by legfem; lengths in mm"
    yield f"** {_TYPES[kind]} can be made {_TYPES[kind]}H: the tissue is nearly incompressible"
    yield "*NODE, NSET=all"
    for number, (x, y, z) in enumerate(mesh.points, start=1):
        yield f"{number}, {x:.10g}, {y:.10g}, {z:.10g}"
    for name, tag in mesh.regions.items():
        yield f"*ELEMENT, TYPE={_TYPES[kind]}, ELSET={name}"
        for cell in np.flatnonzero(mesh.cells.tags == tag):
            yield ", ".join(map(str, [cell + 1, *(mesh.cells.nodes[cell] + 1)]))
    for name, tag in mesh.surfaces.items():
        cells, sides, facets = _sides(mesh, tag)
        yield f"*NSET, NSET={name}"
        yield from _wrapped(np.unique(np.concatenate(facets)) + 1)
        for side in np.unique(sides):
            yield f"*ELSET, ELSET={name}_S{side + 1}"
            yield from _wrapped(np.sort(cells[sides == side]) + 1)
        yield f"*SURFACE, TYPE=ELEMENT, NAME={name}"
        yield from (f"{name}_S{side + 1}, S{side + 1}" for side in np.unique(sides))
    for region, card in mesh.materials.items():
        yield from card.abaqus(region)


def _sides(mesh: NamedMesh, tag: int) -> tuple[NDArray[np.int64], NDArray[np.int64], list[NDArray[np.int64]]]:
    """Return the cells of a surface, which of their faces lie on it, and those faces' nodes, normals inwards."""
    sought = {frozenset(map(int, face)) for block in mesh.facets for face in block.nodes[block.tags == tag]}
    found, facets = [], []
    # A surface between two regions is of the last one's elements alone.
    for cell in np.argsort(-mesh.cells.tags, kind="stable"):
        for side, corners in enumerate(_FACES[mesh.cells.kind]):
            face = mesh.cells.nodes[cell, corners]
            if (nodes := frozenset(map(int, face))) in sought:
                sought.remove(nodes)
                found.append((cell, side))
                facets.append(face)
    return *np.array(found).T, facets


def _wrapped(numbers: Iterable[int]) -> Iterator[str]:
    listed = [str(number) for number in numbers]
    for start in range(0, len(listed), 12):
        yield ", ".join(listed[start : start + 12])


def write_mesh(mesh: NamedMesh, path: Path) -> tuple[Path, ...]:
    """Write a mesh in the format that the path's ending names, making the folder.

    Returns
    -------
    tuple of Path
        The file, and those that belong to it.

    Raises
    ------
    InputError
        If no format has that ending, or it has no place for the materials.
    """
    write = format_of(path)
    if path.suffix == ".feb" and not (mesh.dimension == 3 and mesh.materials):
        remedy = Remedy("give ", Argument("results"), ", and ", Argument("extrude"), " for a section")
        raise InputError(Argument("out"), str(path), "is a model in 3D with its materials", remedy)
    if mesh.materials and path.suffix not in (".inp", ".feb"):
        raise InputError(Argument("out"), str(path), "has no place for materials", "give an .inp or .feb")
    path.parent.mkdir(parents=True, exist_ok=True)
    # There whole, or not at all: some formats are of several files that name each other.
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".mesh.") as folder:
        write(mesh, Path(folder) / path.name)
        made = sorted(Path(folder).iterdir(), key=lambda file: file.name != path.name)
        return tuple(file.replace(path.parent / file.name) for file in made)


def format_of(path: Path) -> Callable[[NamedMesh, Path], None]:
    """Return the function that writes a mesh to a path of this ending.

    Raises
    ------
    InputError
        If no format has it.
    """
    if path.suffix not in _FORMATS:
        problem = f"there is no format {path.suffix or 'without an ending'}"
        raise InputError(Argument("out"), str(path), problem, f"give a file that ends in {', '.join(_FORMATS)}")
    return _FORMATS[path.suffix]


def _write_msh(mesh: NamedMesh, path: Path) -> None:
    blocks = [  # gmsh's entities have one tag each
        Elements(block.kind, block.nodes[block.tags == tag], block.tags[block.tags == tag])
        for block in (mesh.cells, *mesh.facets)
        for tag in np.unique(block.tags)
    ]
    tags = [block.tags for block in blocks]
    dimension = mesh.dimension
    names = {name: np.array([tag, dimension]) for name, tag in mesh.regions.items()}
    names |= {name: np.array([tag, dimension - 1]) for name, tag in mesh.surfaces.items()}
    # FEBio Studio parts a mesh by its geometrical entities.
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    made = meshio.Mesh(mesh.points, _cells(blocks), cell_data=data, field_data=names)
    made.write(path, "gmsh22", binary=False, float_fmt=".10g")


def _write_vtu(mesh: NamedMesh, path: Path) -> None:
    blocks = [mesh.cells, *mesh.facets]
    data = {"tag": [block.tags for block in blocks]}
    for name, tag in {**mesh.regions, **mesh.surfaces}.items():
        data[name] = [(block.tags == tag).astype(np.int64) for block in blocks]
    meshio.Mesh(mesh.points, _cells(blocks), cell_data=data).write(path, "vtu")


def _write_xdmf(mesh: NamedMesh, path: Path) -> None:
    surfaces = path.with_name(f"{path.stem}-surfaces{path.suffix}")
    parts: tuple[tuple[Path, Sequence[Elements]], ...] = ((path, [mesh.cells]), (surfaces, mesh.facets))
    for file, blocks in parts:
        tags = {"tag": [block.tags for block in blocks]}
        made = meshio.Mesh(mesh.points[:, : mesh.dimension], _cells(blocks), cell_data=tags)
        # Not every HDF5 that comes with DOLFINx can decompress.
        made.write(file, "xdmf", compression=None)


_FEBIO = {"tetra": "tet4", "wedge": "penta6", "hexahedron": "hex8", 3: "tri3", 4: "quad4"}


def _febio(mesh: NamedMesh) -> Iterator[str]:
    def numbered(tag: str, rows: FloatArray | NDArray[np.int64], numbers: Iterable[int] | None = None) -> Iterator[str]:
        for number, row in zip(numbers or range(1, len(rows) + 1), rows, strict=True):
            yield f'<{tag} id="{number}">{",".join(f"{value:.10g}" for value in row)}</{tag}>'

    yield '<?xml version="1.0" encoding="ISO-8859-1"?>\n<febio_spec version="4.0">\n<Module type="solid"/>\n<Material>'
    yield from (card.febio(region, k) for k, (region, card) in enumerate(mesh.materials.items(), start=1))
    yield '</Material>\n<Mesh>\n<Nodes name="all">'
    yield from numbered("node", mesh.points)
    yield "</Nodes>"
    for name, tag in mesh.regions.items():
        cells = np.flatnonzero(mesh.cells.tags == tag)
        yield f'<Elements type="{_FEBIO[mesh.cells.kind]}" name="{name}">'
        yield from numbered("elem", mesh.cells.nodes[cells] + 1, list(cells + 1))
        yield "</Elements>"
    for name, tag in mesh.surfaces.items():
        faces = np.array(_sides(mesh, tag)[2])[:, ::-1] + 1
        yield f'<Surface name="{name}">'
        yield from numbered(_FEBIO[faces.shape[1]], faces)
        yield "</Surface>"
    yield "</Mesh>\n<MeshDomains>"
    yield from (f'<SolidDomain name="{name}" mat="{name}"/>' for name in mesh.regions)
    yield "</MeshDomains>\n</febio_spec>"


def _write_lines(lines: Callable[[NamedMesh], Iterator[str]], mesh: NamedMesh, path: Path) -> None:
    path.write_text("\n".join(lines(mesh)) + "\n", encoding="ascii")


_FORMATS: dict[str, Callable[[NamedMesh, Path], None]] = {
    ".msh": _write_msh,
    ".xdmf": _write_xdmf,
    ".vtu": _write_vtu,
    ".inp": partial(_write_lines, _abaqus),
    ".feb": partial(_write_lines, _febio),
}


def _cells(blocks: Sequence[Elements]) -> list[tuple[str, NDArray[np.int64]]]:
    return [(block.kind, block.nodes) for block in blocks]
