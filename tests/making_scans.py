"""One leg, drawn by ellipses, as a label volume, as surfaces and as cross-sections.

Voxels are labelled by the ellipses' equations and surfaces triangulated by trimesh: nothing that is
written here runs through what reads it.
"""

from __future__ import annotations

import base64
import zlib
from pathlib import Path

import nibabel
import numpy as np
import trimesh
from making import TOML
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from legfem.geometry.__main__ import app
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject

HEIGHT = 100.0
SPACING = (0.8, 0.9, 2.0)
"""Of the voxels, mm."""
FLAT = 'contours = "contours.csv"'
PLACE = "aim_mm = [0.0, 0.0]\ndirection_deg = 90.0"
PARTS = ("skin", "muscle_hull", "tibia", "fibula")
# Centre and half axes at z = 0, mm, and their change per mm of z; +y is posterior.
_ELLIPSES = {
    "skin": ((0.0, 0.0, 58.0, 54.0), (0.02, 0.05, 0.05, 0.04)),
    "muscle_hull": ((1.0, -2.0, 48.0, 45.0), (0.02, 0.05, 0.04, 0.03)),
    "tibia": ((-8.0, -26.0, 13.0, 11.0), (0.01, -0.03, 0.02, 0.02)),
    "fibula": ((24.0, -14.0, 6.0, 7.0), (0.02, 0.02, 0.01, 0.01)),
}


def ellipse(part: str, z: np.ndarray | float) -> np.ndarray:
    """Return centre and half axes of a part at levels, (4, ...)."""
    start, slope = (np.array(numbers) for numbers in _ELLIPSES[part])
    return start.reshape(4, *[1] * np.ndim(z)) + np.multiply.outer(slope, np.asarray(z))


def outline(part: str, z: float, n: int = 400) -> np.ndarray:
    """Return points of a part's outline, (n, 2)."""
    x, y, a, b = ellipse(part, z)
    turn = 2 * np.pi * np.arange(n) / n
    return np.column_stack([x + a * np.cos(turn), y + b * np.sin(turn)])


def inside(part: str, points: np.ndarray) -> np.ndarray:
    """Return which points (..., 3) lie in a part."""
    x, y, a, b = ellipse(part, points[..., 2])
    return ((points[..., 0] - x) / a) ** 2 + ((points[..., 1] - y) / b) ** 2 < 1


def labels(spacing: tuple[float, float, float] = SPACING) -> tuple[np.ndarray, np.ndarray]:
    """Return labels (fat 1, muscle 2, bone 3) and where the first voxel's centre lies, mm."""
    origin = np.array([-75.3, -71.6, 0.4])
    counts = np.ceil((np.array([75.0, 72.0, HEIGHT]) - origin) / spacing).astype(int)
    return _labelled(_grid(counts) * spacing + origin), origin


def turned_labels(degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Return labels on a grid turned about two axes, and its affine to x, y and z (4, 4)."""
    turn = Rotation.from_euler("xz", [degrees, 0.6 * degrees], degrees=True).as_matrix()
    counts = np.array([190, 175, 60])
    affine = np.eye(4)
    affine[:3, :3] = turn * SPACING
    affine[:3, 3] = [0.0, 0.0, HEIGHT / 2] - affine[:3, :3] @ ((counts - 1) / 2)
    points = _grid(counts) @ affine[:3, :3].T + affine[:3, 3]
    return _labelled(points), affine


def _grid(counts: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)


def _labelled(points: np.ndarray) -> np.ndarray:
    found = np.zeros(points.shape[:-1], dtype=np.uint8)
    for label, parts in ((1, ("skin",)), (2, ("muscle_hull",)), (3, ("tibia", "fibula"))):
        for part in parts:
            found[inside(part, points)] = label
    return found


def write_nifti(path: Path, found: np.ndarray, origin: np.ndarray, spacing=SPACING) -> Path:
    """Write labels in NIfTI's axes, x to the right and y to the front."""
    affine = np.diag([-spacing[0], -spacing[1], spacing[2], 1.0])
    affine[:3, 3] = origin * [-1, -1, 1]
    image = nibabel.Nifti1Image(found, affine)
    image.header.set_xyzt_units("mm")
    nibabel.save(image, path)
    return path


def surface(part: str) -> trimesh.Trimesh:
    """Return a part's closed surface: an extruded circle that is stretched level by level."""
    made = trimesh.creation.cylinder(1.0, height=HEIGHT, sections=240)
    for _ in range(2):
        made = made.subdivide()
    z = made.vertices[:, 2] + HEIGHT / 2
    x, y, a, b = ellipse(part, z)
    on = made.vertices[:, :2]
    made.vertices = np.column_stack([x + a * on[:, 0], y + b * on[:, 1], z])
    return made


def write_surfaces(folder: Path, kind: str = "stl") -> dict[str, Path]:
    """Write every part's surface; return the files."""
    files = {part: folder / f"{part}.{kind}" for part in PARTS}
    for part, path in files.items():
        surface(part).export(path)
    return files


def write_polydata(path: Path, surface: trimesh.Trimesh, how: str) -> Path:
    """Write a surface as VTK's documents say: ``how`` is the code, and what it is packed by."""
    points, faces = surface.vertices, surface.faces
    ends = 3 * np.arange(1, len(faces) + 1)
    if path.suffix == ".vtp":
        path.write_bytes(_vtp(points, faces, ends, how))
        return path
    head = f"# vtk DataFile Version {'5.1' if how == 'binary' else '3.0'}\nmade; SPACE=LPS\n"
    if how == "binary":
        cells = [
            b"OFFSETS vtktypeint64\n" + np.append(0, ends).astype(">i8").tobytes(),
            b"CONNECTIVITY vtktypeint64\n" + faces.astype(">i8").tobytes(),
        ]
        path.write_bytes(
            b"\n".join(
                [
                    f"{head}BINARY\nDATASET POLYDATA\nPOINTS {len(points)} double".encode(),
                    points.astype(">f8").tobytes(),
                    b"METADATA\nINFORMATION 0\n",
                    f"POLYGONS {len(faces) + 1} {faces.size}".encode(),
                    *cells,
                    f"CELL_DATA {len(faces)}\n".encode(),
                ]
            )
        )
        return path
    rows = [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
    cells = [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text(
        "\n".join(
            [
                f"{head}ASCII\nDATASET POLYDATA\nPOINTS {len(points)} float",
                *rows,
                f"POLYGONS {len(faces)} {4 * len(faces)}",
                *cells,
                "",
            ]
        )
    )
    return path


def _vtp(points: np.ndarray, faces: np.ndarray, ends: np.ndarray, how: str) -> bytes:
    """``ascii``, ``binary``, ``zlib`` (inline), ``raw`` or ``raw zlib`` (appended)."""
    packed, kept = "zlib" in how, b""
    size = np.dtype("<u4" if how == "binary" else "<u8")

    def coded(values: np.ndarray) -> tuple[bytes, bytes]:
        data = values.tobytes()
        if not packed:
            return b"", np.array([len(data)], size).tobytes() + data
        blocks = [data[k : k + 32768] for k in range(0, len(data), 32768)]
        small = [zlib.compress(block) for block in blocks]
        last = len(blocks[-1]) % 32768
        head = np.array([len(blocks), 32768, last, *map(len, small)], size).tobytes()
        return head, b"".join(small)

    def array(name: str, values: np.ndarray, kind: str, more: str = "") -> bytes:
        nonlocal kept
        tag = f'<DataArray type="{kind}" Name="{name}" {more}'
        if how == "ascii":
            text = " ".join(f"{value:.9g}" for value in values.ravel())
            return f'{tag} format="ascii">\n{text}\n</DataArray>'.encode()
        head, data = coded(values)
        if how.startswith("raw"):
            tag += f' format="appended" offset="{len(kept)}"/>'
            kept += head + data
            return tag.encode()
        text = base64.b64encode(head) + base64.b64encode(data)
        return f'{tag} format="binary">\n'.encode() + text + b"\n</DataArray>"

    packer = 'compressor="vtkZLibDataCompressor"' if packed else ""
    kind = "UInt32" if size.itemsize == 4 else "UInt64"
    three = 'NumberOfComponents="3"'
    body = b"".join(
        [
            f'<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" '
            f'header_type="{kind}" {packer}><PolyData><Piece NumberOfPoints="{len(points)}" '
            f'NumberOfPolys="{len(faces)}" NumberOfStrips="0"><Points>'.encode(),
            array("Points", points.astype("<f4"), "Float32", three),
            b"</Points><Polys>",
            array("connectivity", faces.astype("<i8"), "Int64"),
            array("offsets", ends.astype("<i8"), "Int64"),
            b"</Polys></Piece></PolyData>",
        ]
    )
    if kept:
        body += b'<AppendedData encoding="raw">\n_' + kept + b"\n</AppendedData>"
    return body + b"</VTKFile>"


def write_cross_sections(path: Path, levels: np.ndarray) -> Path:
    """Write outlines at levels as CSV."""
    rows = ["level_mm,part,loop,i,x_mm,y_mm"]
    rows += [
        f"{z:g},{part},0,{i},{x:.4f},{y:.4f}"
        for z in levels
        for part in PARTS
        for i, (x, y) in enumerate(outline(part, z))
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


def write_leg(folder: Path) -> None:
    """Write the leg in every way that it can be read."""
    write_nifti(folder / "leg.nii.gz", *labels())
    write_surfaces(folder)
    for part in PARTS:
        write_polydata(folder / f"{part}.vtp", surface(part), "raw zlib")
    turned, affine = turned_labels(17.0)
    nibabel.save(nibabel.Nifti1Image(turned, np.diag([-1, -1, 1, 1]) @ affine), folder / "turned.nii")
    write_cross_sections(folder / "sections.csv", np.arange(0.0, HEIGHT + 1, 5.0))


def subject_of_scan(folder: Path, section: str, place: str = PLACE, more: str = "") -> Subject:
    """Return a subject whose section is cut from a scan."""
    folder.mkdir(exist_ok=True)
    toml = TOML.replace(FLAT, section).replace(PLACE, place)
    (folder / "subject.toml").write_text(toml + more)
    return load_subject(folder, need_recordings=False)


def entry_of(leg_files: Path, kind: str) -> str:
    """Return the entry of subject.toml for a way in which the leg was written."""
    return {
        "nifti": f'scan = "{leg_files}/leg.nii.gz"',
        "oblique": f'scan = "{leg_files}/turned.nii"',
        "stl": "surfaces = {" + ", ".join(f'{p} = "{leg_files}/{p}.stl"' for p in PARTS) + "}",
        "vtp": "surfaces = {" + ", ".join(f'{p} = "{leg_files}/{p}.vtp"' for p in PARTS) + "}",
        "csv": f'contours = "{leg_files}/sections.csv"',
    }[kind]


def made_leg(folder: Path, *options: str) -> Subject:
    """Return the subject that the command makes of a scan."""
    done = CliRunner().invoke(app, [*options, "--out", str(folder)])
    assert done.exit_code == 0, done.output
    assert f"picture: {folder}/section.png" in done.output.replace("\n", "")
    return load_subject(folder, need_recordings=False)
