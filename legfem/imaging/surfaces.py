"""A leg's shape from closed surfaces of its parts: STL and what else trimesh reads, and VTK's polydata.

Polydata are ``.vtp`` (XML) and ``.vtk`` (legacy), ASCII or binary: Kitware, VTK File Formats
(docs.vtk.org/en/latest/vtk_file_formats).
"""

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapely
import trimesh
from numpy.typing import ArrayLike, NDArray
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import MUSCLE_HULL, check_girth
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.motion import CuttingPlane
from legfem.geometry.section_from_outlines import Clearances, joined
from legfem.imaging.outlines import nested_shape

_END = 1e-3  # mm; nearer than that to a surface's end a plane passes through it


def read_surfaces(paths: Mapping[str, Sequence[Path]]) -> dict[str, list[Any]]:
    """Read the closed surfaces of a leg's parts.

    Parameters
    ----------
    paths : mapping
        ``skin``, ``muscle_hull`` and the bones by any names to their files; coordinates in mm, z
        along the leg. The hull may be given muscle by muscle.

    Raises
    ------
    InputError
        If a file is missing, its surface has holes, or the coordinates are not mm.
    """
    for part in (SKIN, MUSCLE_HULL):
        if part not in paths:
            raise InputError("surfaces", part, "the part is missing", "give its file")
    surfaces = {part: [read_surface(file) for file in files] for part, files in paths.items()}
    # Before anything else: levels in mm don't meet a leg in metres.
    skin = surfaces[SKIN][0]
    pieces = _pieces(skin, CuttingPlane.at_level(float(skin.bounds[:, 2].mean())))
    check_girth(max((piece.exterior.length for piece in pieces), default=0.0), paths[SKIN][0])
    return surfaces


def read_surface(path: Path) -> Any:
    """Read a closed surface (`trimesh.Trimesh`, mm).

    Raises
    ------
    InputError
        If the file can't be read, or the surface has holes.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", "not found", "check the path")
    try:
        with path.open("rb") as file:
            legacy = re.search(rb"^DATASET\s+POLYDATA", file.read(1000), re.M | re.I)
        polydata = legacy or path.suffix.lower() == ".vtp"
        surface = trimesh.Trimesh(*_read_polydata(path)) if polydata else trimesh.load(path, force="mesh")
    except ImportError as error:  # trimesh looks for the encoding of what it takes for text
        if error.name == "meshio":
            raise
        raise InputError(path, "file", "is neither a whole binary STL nor text", "save it again") from None
    except Exception as error:  # the readers raise all kinds
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(path, "file", f"is not a surface that can be read ({said})", "save it as STL") from None
    if not isinstance(surface, trimesh.Trimesh):
        what = "points" if isinstance(surface, trimesh.PointCloud) else "a drawing"
        raise InputError(path, "file", f"contains {what}, not a surface", "save the leg's part as STL, PLY or OBJ")
    if len(surface.faces) == 0:
        raise InputError(path, "file", "contains no triangles", "save it as STL, PLY or OBJ")
    if not np.isfinite(surface.vertices).all():
        raise InputError(path, "surface", "has corners that are not finite numbers", "save it again")
    if not surface.is_watertight:
        edges, count = np.unique(surface.edges_sorted, axis=0, return_counts=True)
        free = edges[count == 1]
        near = surface.vertices[free[0]].mean(axis=0) if len(free) else surface.centroid
        at = ", ".join(f"{c:.1f}" for c in near)
        problem = f"has holes: {len(free)} free edges, one near ({at})"
        raise InputError(path, "surface", problem, "close it in the program that made it")
    return surface


def outlines_of_surfaces(
    surfaces: Mapping[str, Sequence[Any]], plane: CuttingPlane, source: str | Path
) -> dict[str, Polygon]:
    """Return the outline of every part on a plane: its largest, the muscles' joined.

    Parameters
    ----------
    surfaces : mapping
        ``skin``, ``muscle_hull`` and the bones to their surfaces; the muscles may have several.
    plane : CuttingPlane
        Plane that cuts them.
    source : str or Path
        What errors name as the file.

    Raises
    ------
    InputError
        If the plane doesn't meet a part, or passes the skin's end.
    """
    outlines = {}
    for part, every in surfaces.items():
        pieces = [piece for surface in every for piece in _pieces(surface, plane)]
        low, high = (f([s.bounds[k, 2] for s in every]) for f, k in ((min, 0), (max, 1)))
        if not pieces:
            raise InputError(
                source, part, f"no closed outline at {plane}", f"choose levels between {low:.1f} and {high:.1f} mm"
            )
        outlines[part] = (
            joined(pieces, source, str(plane)) if part == MUSCLE_HULL else max(pieces, key=lambda piece: piece.area)
        )
        if part == SKIN:
            _check_ends(outlines[part], plane, low, high, source)
    return outlines


def shape_of_surfaces(
    surfaces: Mapping[str, Sequence[Any]], levels: ArrayLike, source: str | Path, clearances: Clearances | None = None
) -> LegShape:
    """Make a leg's shape of the closed surfaces of its parts.

    Parameters
    ----------
    surfaces : mapping
        As `read_surfaces` returns.
    levels : (n,) array
        Evenly spaced z, mm.
    source : str or Path
        What errors name as the file.
    clearances : Clearances, optional
        Room to keep between the parts; see `legfem.imaging.outlines.nested_shape`.

    Raises
    ------
    InputError
        If a level doesn't meet a surface, the coordinates are not mm, or the parts do not nest.
    """
    z = np.asarray(levels, dtype=np.float64)
    outlines = [outlines_of_surfaces(surfaces, CuttingPlane.at_level(at), source) for at in z]
    return nested_shape(z, outlines, source, clearances)


def _pieces(surface: Any, plane: CuttingPlane) -> list[Polygon]:
    """Return the outlines of a surface on a plane, without their holes; mm in the plane."""
    segments = trimesh.intersections.mesh_plane(surface, plane.normal, plane.point)
    # The two triangles at an edge find the same point but for rounding.
    lines = shapely.linestrings(np.round(plane.flat(segments), 6)) if len(segments) else []
    faces = shapely.union_all(shapely.polygonize(list(lines)))
    return [
        Polygon(face.exterior)
        for face in getattr(faces, "geoms", [faces])
        if isinstance(face, Polygon) and face.area > 0
    ]


def _check_ends(skin: Polygon, plane: CuttingPlane, low: float, high: float, source: str | Path) -> None:
    """Check that a plane cuts the skin all around, and not its closed end."""
    corners = np.asarray(skin.exterior.coords)
    z = corners @ plane.axes[:, 2] + (plane.point @ plane.normal) * plane.normal[2]
    if z.min() < low + _END or z.max() > high - _END:
        remedy = f"the surface reaches from {low:.1f} to {high:.1f} mm: cut it elsewhere"
        raise InputError(source, SKIN, f"ends within the section at {plane}", remedy)


type _Triangles = NDArray[np.intp]
type _Numbers = NDArray[np.generic]

_LEGACY = {
    **{"float": "f4", "double": "f8", "char": "i1", "short": "i2", "int": "i4", "long": "i8", "vtkidtype": "i8"},
    **{"unsigned_char": "u1", "unsigned_short": "u2", "unsigned_int": "u4", "unsigned_long": "u8"},
    "vtktypeint64": "i8",
}
_TO_LPS = np.array([-1.0, -1.0, 1.0])


def _read_polydata(path: Path) -> tuple[FloatArray, _Triangles]:
    """Read points (n, 3), mm, and triangles (m, 3) of a surface; polygons are cut into fans.

    Slicer's ``SPACE=RAS`` in a legacy file's title is brought to the patient's left and back.

    Raises
    ------
    ValueError
        If the file isn't what it says.
    """
    content = path.read_bytes()
    points, faces = _of_xml(content) if path.suffix.lower() == ".vtp" else _of_legacy(content)
    if len(faces) and not (0 <= faces.min() and faces.max() < len(points)):
        raise ValueError("a polygon names a point that isn't there")
    return points, faces


def _fans(connectivity: _Numbers, ends: _Numbers) -> _Triangles:
    """Return the triangles of polygons that end where they are said to."""
    nodes, stops = connectivity.astype(np.intp), ends.astype(np.intp)
    starts = np.concatenate([[0], stops[:-1]])
    corners = stops - starts
    if (corners < 0).any() or (len(stops) and stops[-1] > len(nodes)):
        raise ValueError("a polygon ends where there are no points")
    found = [
        starts[corners == count, None] + np.array([0, j + 1, j + 2])
        for count in np.unique(corners)
        for j in range(count - 2)
    ]
    return nodes[np.concatenate(found)] if found else np.zeros((0, 3), dtype=np.intp)


def _strips(connectivity: _Numbers, ends: _Numbers) -> _Triangles:
    """Return the triangles of strips, every second one turned."""
    strips = np.split(connectivity.astype(np.intp), ends.astype(np.intp)[:-1])
    return np.asarray(trimesh.util.triangle_strips_to_faces(strips), dtype=np.intp)


_CELLS = {"POLYGONS": _fans, "TRIANGLE_STRIPS": _strips}


class _Legacy(BytesIO):
    """A legacy file, as far as it is read."""

    binary = False

    def text(self) -> str:
        """Return the next line that isn't empty; empty at the end."""
        lines = (line.decode("ascii", "replace").strip() for line in self)
        return next(filter(None, lines), "")

    def numbers(self, count: int, kind: str) -> _Numbers:
        """Return the next numbers of a legacy type."""
        code = _LEGACY.get(kind.lower())
        if code is None or count < 0:
            raise ValueError(f"{count} numbers of type '{kind}'")
        if self.binary:
            found: _Numbers = np.frombuffer(self.read(count * np.dtype(code).itemsize), f">{code}")
        else:
            words: list[str] = []
            while len(words) < count and (text := self.text()):
                words += text.split()
            found = np.array(words, dtype=float).astype(code)
        if len(found) != count:
            raise ValueError(f"{len(found)} numbers where {count} are announced")
        return found


def _of_legacy(content: bytes) -> tuple[FloatArray, _Triangles]:
    file = _Legacy(content)
    version = re.match(r"# vtk DataFile Version (\d+)", file.text())
    if version is None:
        raise ValueError("the first line names no version")
    # The title may be empty: it is the second line in any case.
    title = file.readline()
    file.binary = file.text().upper() == "BINARY"
    points, faces = np.zeros((0, 3)), list[_Triangles]()
    while words := file.text().split():
        key = words[0].upper()
        if key in ("POINT_DATA", "CELL_DATA"):
            break
        if key == "POINTS":
            points = file.numbers(3 * int(words[1]), words[2]).astype(float).reshape(-1, 3)
        elif key in ("VERTICES", "LINES", *_CELLS):
            connectivity, ends = _legacy_cells(file, int(version[1]), words)
            if key in _CELLS and len(ends):
                faces.append(_CELLS[key](connectivity, ends))
        elif key == "FIELD":
            for _ in range(int(words[2])):
                name, components, tuples, kind = file.text().split()
                if kind == "string":
                    raise ValueError(f"the field '{name}' of words is not understood")
                file.numbers(int(components) * int(tuples), kind)
        elif key == "METADATA":
            while file.readline().strip():
                pass
        elif key != "DATASET":
            raise ValueError(f"'{words[0][:40]}' is not understood")
    if b"SPACE=RAS" in title:
        points = points * _TO_LPS
    return points, _together(faces)


def _together(faces: Sequence[_Triangles]) -> _Triangles:
    return np.concatenate([np.zeros((0, 3), dtype=np.intp), *faces])


def _legacy_cells(file: _Legacy, version: int, words: Sequence[str]) -> tuple[_Numbers, _Numbers]:
    """Return the points of all cells of a kind, and where each cell's end."""
    count, size = int(words[1]), int(words[2])
    if version >= 5:
        ends, connectivity = (file.numbers(length, file.text().split()[1]) for length in (count, size))
        return connectivity, ends[1:]
    flat, heads = file.numbers(size, "int").astype(np.intp), [0]
    for _ in range(count):
        heads.append(heads[-1] + 1 + int(flat[heads[-1]]))
    return np.delete(flat, heads[:-1]), np.array(heads[1:]) - np.arange(1, count + 1)


def _of_xml(content: bytes) -> tuple[FloatArray, _Triangles]:
    from meshio.vtu._vtu import VtuReader

    raw = b""
    if begun := re.search(rb"<AppendedData[^>]*\braw\b[^>]*>\s*_", content):
        end = content.rfind(b"</AppendedData>")
        raw, content = content[begun.end() : end], content[: begun.start()] + content[end + len(b"</AppendedData>") :]
    root = ElementTree.fromstring(content)
    grid, appended = root.find("PolyData"), root.findtext("AppendedData", "").strip().removeprefix("_")
    if root.tag != "VTKFile" or grid is None:
        raise ValueError("it contains no PolyData")
    # Its arrays are written as an unstructured grid's, which is all that meshio reads by itself.
    coded = VtuReader.__new__(VtuReader)
    coded.compression, coded.byte_order = root.get("compressor"), root.get("byte_order")
    coded.header_type = root.get("header_type", "UInt32")
    header = np.dtype((">u" if coded.byte_order == "BigEndian" else "<u") + str(int(coded.header_type[4:]) // 8))
    there = [one for one in root.iter("DataArray") if one.get("format") == "appended"]
    starts = sorted(int(one.attrib["offset"]) for one in there)
    for one in there:
        start = int(one.attrib["offset"])
        part = slice(start, next((other for other in starts if other > start), None))
        block = raw[part]
        # What says how blocks are packed is in a code of its own.
        head = header.itemsize * (3 + int(np.frombuffer(block, header, 1)[0])) if raw and coded.compression else 0
        one.text = (b64encode(block[:head]) + b64encode(block[head:])).decode() if raw else appended[part]
        one.set("format", "binary")
    points, faces, before = list[FloatArray](), list[_Triangles](), 0
    for piece in grid.iter("Piece"):
        at = piece.find("Points/DataArray")
        if at is None:
            continue
        points.append(coded.read_data(at).astype(float).reshape(-1, 3))
        for tag, triangles in (("Polys", _fans), ("Strips", _strips)):
            named = {one.attrib.get("Name"): one for one in piece.findall(f"{tag}/DataArray")}
            if int(piece.attrib.get(f"NumberOf{tag}", "0")):
                arrays = (coded.read_data(named[name]).ravel() for name in ("connectivity", "offsets"))
                faces.append(before + triangles(*arrays))
        before += len(points[-1])
    return np.concatenate([np.zeros((0, 3)), *points]), _together(faces)
