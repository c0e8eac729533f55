"""Surfaces as VTK's polydata: ``.vtp`` (XML) and ``.vtk`` (legacy), ASCII or binary.

Formats: Kitware, VTK File Formats (docs.vtk.org/en/latest/vtk_file_formats).
"""

from __future__ import annotations

import base64
import lzma
import re
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray

type Triangles = NDArray[np.intp]
_Any = NDArray[np.generic]

_LEGACY = {
    "float": "f4",
    "double": "f8",
    "int": "i4",
    "unsigned_int": "u4",
    "short": "i2",
    "unsigned_short": "u2",
    "char": "i1",
    "unsigned_char": "u1",
    "long": "i8",
    "unsigned_long": "u8",
    "vtktypeint64": "i8",
    "vtkidtype": "i8",
}
_XML = {
    "Int8": "i1",
    "Int16": "i2",
    "Int32": "i4",
    "Int64": "i8",
    "UInt8": "u1",
    "UInt16": "u2",
    "UInt32": "u4",
    "UInt64": "u8",
    "Float32": "f4",
    "Float64": "f8",
}
_UNPACKED: dict[str, Callable[[bytes], bytes]] = {
    "vtkZLibDataCompressor": zlib.decompress,
    "vtkLZMADataCompressor": lzma.decompress,
}
_TO_LPS = np.array([-1.0, -1.0, 1.0])


def is_polydata(path: Path) -> bool:
    """Return whether a file says that it is VTK's polydata."""
    if path.suffix.lower() == ".vtp":
        return True
    with path.open("rb") as file:
        return bool(re.search(rb"^DATASET\s+POLYDATA", file.read(1000), re.M | re.I))


def read_polydata(path: Path) -> tuple[FloatArray, Triangles]:
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


def _fans(connectivity: _Any, ends: _Any) -> Triangles:
    """Return the triangles of polygons that end where they are said to."""
    nodes, stops = connectivity.astype(np.intp), ends.astype(np.intp)
    starts = np.concatenate([[0], stops[:-1]])
    corners = stops - starts
    found = [
        starts[corners == count, None] + np.array([0, j + 1, j + 2])
        for count in np.unique(corners)
        for j in range(count - 2)
    ]
    return nodes[np.concatenate(found)] if found else np.zeros((0, 3), dtype=np.intp)


def _strips(connectivity: _Any, ends: _Any) -> Triangles:
    """Return the triangles of strips, every second one turned."""
    nodes, stops = connectivity.astype(np.intp), ends.astype(np.intp)
    found = []
    for start, stop in zip(np.concatenate([[0], stops[:-1]]), stops, strict=True):
        strip = nodes[start:stop]
        each = np.column_stack([strip[:-2], strip[1:-1], strip[2:]])
        each[1::2] = each[1::2, ::-1]
        found.append(each)
    return np.concatenate(found) if found else np.zeros((0, 3), dtype=np.intp)


_CELLS = {"POLYGONS": _fans, "TRIANGLE_STRIPS": _strips}


@dataclass
class _Cursor:
    """Where a legacy file is read."""

    content: bytes
    binary: bool = False
    at: int = 0

    def line(self) -> str:
        """Return the next line that isn't empty; empty at the end."""
        while self.at < len(self.content):
            end = self.content.find(b"\n", self.at)
            end = len(self.content) if end < 0 else end
            text = self.content[self.at : end].decode("ascii", "replace").strip()
            self.at = end + 1
            if text:
                return text
        return ""

    def numbers(self, count: int, kind: str) -> _Any:
        """Return the next numbers of a legacy type."""
        code = _LEGACY.get(kind.lower())
        if code is None or count < 0:
            raise ValueError(f"{count} numbers of type '{kind}'")
        if self.binary:
            size = count * np.dtype(code).itemsize
            found: _Any = np.frombuffer(self.content[self.at : self.at + size], f">{code}")
            self.at += size
        else:
            words: list[str] = []
            while len(words) < count and (text := self.line()):
                words += text.split()
            found = np.array(words, dtype=float).astype(code)
        if len(found) != count:
            raise ValueError(f"{len(found)} numbers where {count} are announced")
        return found


def _of_legacy(content: bytes) -> tuple[FloatArray, Triangles]:
    cursor = _Cursor(content)
    version = re.match(r"# vtk DataFile Version (\d+)", cursor.line())
    if version is None:
        raise ValueError("the first line names no version")
    # The title may be empty: it is the second line in any case.
    end = content.find(b"\n", cursor.at)
    title, cursor.at = content[cursor.at : end], end + 1
    cursor.binary = cursor.line().upper() == "BINARY"
    points, faces = np.zeros((0, 3)), list[Triangles]()
    while words := cursor.line().split():
        key = words[0].upper()
        if key in ("POINT_DATA", "CELL_DATA"):
            break
        if key == "POINTS":
            points = cursor.numbers(3 * int(words[1]), words[2]).astype(float).reshape(-1, 3)
        elif key in ("VERTICES", "LINES", *_CELLS):
            connectivity, ends = _legacy_cells(cursor, int(version[1]), words)
            if key in _CELLS:
                faces.append(_CELLS[key](connectivity, ends))
        elif key == "FIELD":
            _pass_fields(cursor, int(words[2]))
        elif key == "METADATA":
            stop = cursor.content.find(b"\n\n", cursor.at)
            cursor.at = len(content) if stop < 0 else stop + 2
        elif key != "DATASET":
            raise ValueError(f"'{words[0][:40]}' is not understood")
    if b"SPACE=RAS" in title:
        points = points * _TO_LPS
    return points, _together(faces)


def _together(faces: Sequence[Triangles]) -> Triangles:
    return np.concatenate([np.zeros((0, 3), dtype=np.intp), *faces])


def _legacy_cells(cursor: _Cursor, version: int, words: Sequence[str]) -> tuple[_Any, _Any]:
    """Return the points of all cells of a kind, and where each cell's end."""
    count, size = int(words[1]), int(words[2])
    if version >= 5:
        found = []
        for length in (count, size):
            found.append(cursor.numbers(length, cursor.line().split()[1]))
        return found[1], found[0][1:]
    flat, heads = cursor.numbers(size, "int").astype(np.intp), [0]
    for _ in range(count):
        heads.append(heads[-1] + 1 + int(flat[heads[-1]]))
    return np.delete(flat, heads[:-1]), np.array(heads[1:]) - np.arange(1, count + 1)


def _pass_fields(cursor: _Cursor, count: int) -> None:
    for _ in range(count):
        name, components, tuples, kind = cursor.line().split()
        if kind == "string":
            raise ValueError(f"the field '{name}' of words is not understood")
        cursor.numbers(int(components) * int(tuples), kind)


@dataclass(frozen=True)
class _Coded:
    """How an XML file writes its arrays."""

    order: str
    header: np.dtype[np.generic]
    unpacked: Callable[[bytes], bytes] | None
    appended: bytes = b""
    raw: bool = False
    """Whether what is appended is in no code."""

    def array(self, element: ElementTree.Element) -> _Any:
        """Return what a ``DataArray`` holds, flat."""
        kind = np.dtype(self.order + _XML[element.attrib["type"]])
        written = element.attrib.get("format", "ascii")
        if written == "ascii":
            return np.array((element.text or "").split(), dtype=float).astype(kind)
        if written == "appended":
            source, raw = self.appended[int(element.attrib["offset"]) :], self.raw
        else:
            source, raw = "".join((element.text or "").split()).encode(), False
        return np.frombuffer(self._bytes(source, raw), kind)

    def _bytes(self, source: bytes, raw: bool) -> bytes:
        item = self.header.itemsize

        def part(start: int, size: int) -> bytes:
            """Return bytes, of which a code of its own begins at a place of the source."""
            if raw:
                return source[start : start + size]
            return base64.b64decode(source[start : start + _coded(size)])[:size]

        def numbers(count: int) -> list[int]:
            return np.frombuffer(part(0, count * item), self.header).astype(int).tolist()

        (first,) = numbers(1)
        if self.unpacked is None:
            return part(0, item + first)[item:]
        sizes = numbers(3 + first)[3:]
        head = (3 + first) * item
        packed = part(head if raw else _coded(head), sum(sizes))
        ends = np.cumsum([0, *sizes])
        return b"".join(self.unpacked(packed[a:b]) for a, b in pairwise(ends))


def _coded(size: int) -> int:
    """Return how many characters so many bytes have in base64."""
    return 4 * -(-size // 3)


def _of_xml(content: bytes) -> tuple[FloatArray, Triangles]:
    appended, raw = b"", False
    if begun := re.search(rb"<AppendedData([^>]*)>\s*_", content):
        end = content.rfind(b"</AppendedData>")
        appended, raw = content[begun.end() : end], b"raw" in begun[1]
        content = content[: begun.start()] + content[end + len(b"</AppendedData>") :]
    root = ElementTree.fromstring(content)
    grid = root.find("PolyData")
    if root.tag != "VTKFile" or grid is None:
        raise ValueError("it holds no PolyData")
    packer = root.attrib.get("compressor", "")
    if packer and packer not in _UNPACKED:
        raise ValueError(f"its compression {packer} is not known")
    order = ">" if root.attrib.get("byte_order") == "BigEndian" else "<"
    header = np.dtype(order + _XML[root.attrib.get("header_type", "UInt32")])
    coded = _Coded(order, header, _UNPACKED.get(packer), appended.rstrip() if not raw else appended, raw)
    points, faces, before = list[FloatArray](), list[Triangles](), 0
    for piece in grid.iter("Piece"):
        at = piece.find("Points/DataArray")
        if at is None:
            continue
        points.append(coded.array(at).astype(float).reshape(-1, 3))
        for tag, triangles in (("Polys", _fans), ("Strips", _strips)):
            named = {one.attrib.get("Name"): one for one in piece.findall(f"{tag}/DataArray")}
            if int(piece.attrib.get(f"NumberOf{tag}", "0")):
                arrays = (coded.array(named[name]) for name in ("connectivity", "offsets"))
                faces.append(before + triangles(*arrays))
        before += len(points[-1])
    return np.concatenate([np.zeros((0, 3)), *points]), _together(faces)
