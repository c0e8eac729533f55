"""A leg's mesh as an Abaqus input file, which CalculiX and FEBio Studio read too.

meshio's own writer knows neither plane strain's elements nor surfaces of elements.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from legfem.meshing.named_mesh import NamedMesh

_TYPES = {"triangle": "CPE3", "quad": "CPE4", "tetra": "C3D4", "wedge": "C3D6", "hexahedron": "C3D8"}
# Nodes of the faces S1, S2, ... (Abaqus Elements Guide, "Element faces").
_FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}


def abaqus_text(mesh: NamedMesh) -> str:
    """Return nodes, elements by region, and every surface as nodes and as faces of elements."""
    return "\n".join(_lines(mesh)) + "\n"


def _lines(mesh: NamedMesh) -> Iterator[str]:
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
        yield from _surface(mesh, name, tag)


def _surface(mesh: NamedMesh, name: str, tag: int) -> Iterator[str]:
    facets = [face for block in mesh.facets for face in block.nodes[block.tags == tag]]
    yield f"*NSET, NSET={name}"
    yield from _wrapped(np.unique(np.concatenate(facets)) + 1)
    sought = {tuple(sorted(face)) for face in facets}
    faces: list[tuple[str, str]] = []
    # A surface between two regions is of the last one's elements alone.
    order = np.argsort(-mesh.cells.tags, kind="stable")
    taken: set[tuple[int, ...]] = set()
    members: dict[int, list[int]] = {}
    for cell in order:
        for side, corners in enumerate(_FACES[mesh.cells.kind], start=1):
            face = tuple(sorted(mesh.cells.nodes[cell, corners]))
            if face in sought and face not in taken:
                taken.add(face)
                members.setdefault(side, []).append(int(cell) + 1)
    for side, cells in sorted(members.items()):
        yield f"*ELSET, ELSET={name}_S{side}"
        yield from _wrapped(sorted(cells))
        faces.append((f"{name}_S{side}", f"S{side}"))
    yield f"*SURFACE, TYPE=ELEMENT, NAME={name}"
    yield from (f"{cells}, {side}" for cells, side in faces)


def _wrapped(numbers: Iterable[int], width: int = 12) -> Iterator[str]:
    listed = [str(number) for number in numbers]
    for start in range(0, len(listed), width):
        yield ", ".join(listed[start : start + width])
