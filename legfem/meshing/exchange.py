"""Files of a leg's mesh for other programs.

.msh
    gmsh's format 2.2, which gmsh, DOLFINx, FEBio Studio and meshio read: regions and surfaces are
    physical groups with names.
.xdmf
    For DOLFINx and ParaView: the cells with their tags, and the surfaces in a second file.
.vtu
    For ParaView: tags, and a field of 0 and 1 for every name.
.inp
    For Abaqus, CalculiX and FEBio Studio: element sets, node sets and surfaces.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.meshing.abaqus import abaqus_text
from legfem.meshing.named_mesh import Elements, NamedMesh


def write_mesh(mesh: NamedMesh, path: Path) -> tuple[Path, ...]:
    """Write a mesh in the format that the path's ending names, making the folder.

    Returns
    -------
    tuple of Path
        The file, and those that belong to it.

    Raises
    ------
    InputError
        If no format has that ending.
    """
    write = format_of(path)
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
        raise InputError(
            "--out",
            str(path),
            f"there is no format {path.suffix or 'without an ending'}",
            f"give a file that ends in {', '.join(_FORMATS)}",
        )
    return _FORMATS[path.suffix]


def _write_msh(mesh: NamedMesh, path: Path) -> None:
    blocks = _by_tag([mesh.cells, *mesh.facets])
    tags = [block.tags for block in blocks]
    dimension = mesh.dimension
    names = {name: np.array([tag, dimension]) for name, tag in mesh.regions.items()}
    names |= {name: np.array([tag, dimension - 1]) for name, tag in mesh.surfaces.items()}
    # FEBio Studio parts a mesh by its geometrical entities.
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    made = _meshio(mesh.points, blocks, data, names)
    made.write(path, "gmsh22", binary=False, float_fmt=".10g")


def _write_vtu(mesh: NamedMesh, path: Path) -> None:
    blocks = [mesh.cells, *mesh.facets]
    data = {"tag": [block.tags for block in blocks]}
    for name, tag in {**mesh.regions, **mesh.surfaces}.items():
        data[name] = [(block.tags == tag).astype(np.int64) for block in blocks]
    _meshio(mesh.points, blocks, data).write(path, "vtu")


def _write_xdmf(mesh: NamedMesh, path: Path) -> None:
    surfaces = path.with_name(f"{path.stem}-surfaces{path.suffix}")
    parts: tuple[tuple[Path, Sequence[Elements]], ...] = ((path, [mesh.cells]), (surfaces, mesh.facets))
    for file, blocks in parts:
        made = _meshio(mesh.points[:, : mesh.dimension], blocks, {"tag": [block.tags for block in blocks]})
        # Not every HDF5 that comes with DOLFINx can decompress.
        made.write(file, "xdmf", compression=None)


def _write_inp(mesh: NamedMesh, path: Path) -> None:
    path.write_text(abaqus_text(mesh), encoding="ascii")


_FORMATS: dict[str, Callable[[NamedMesh, Path], None]] = {
    ".msh": _write_msh,
    ".xdmf": _write_xdmf,
    ".vtu": _write_vtu,
    ".inp": _write_inp,
}


def _by_tag(blocks: Sequence[Elements]) -> list[Elements]:
    """Part blocks so that the elements of each are of one tag, as gmsh's entities are."""
    return [
        Elements(block.kind, block.nodes[block.tags == tag], block.tags[block.tags == tag])
        for block in blocks
        for tag in np.unique(block.tags)
    ]


def _meshio(
    points: FloatArray,
    blocks: Sequence[Elements],
    data: dict[str, list[NDArray[np.int64]]],
    names: dict[str, NDArray[np.int64]] | None = None,
) -> meshio.Mesh:
    cells = [(block.kind, block.nodes) for block in blocks]
    return meshio.Mesh(points, cells, cell_data=data, field_data=names)
