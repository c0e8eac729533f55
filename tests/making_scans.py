"""One leg, drawn by ellipses, as a label volume, as surfaces and as cross-sections.

Voxels are labelled by the ellipses' equations and surfaces triangulated by trimesh: nothing here
runs through what reads them.
"""

from __future__ import annotations

from pathlib import Path

import nibabel
import numpy as np
import trimesh

HEIGHT = 100.0
SPACING = (0.8, 0.9, 2.0)
"""Of the voxels, mm."""
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
    grid = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    points = origin + grid * spacing
    found = np.zeros(counts, dtype=np.uint8)
    for label, parts in ((1, ("skin",)), (2, ("muscle_hull",)), (3, ("tibia", "fibula"))):
        for part in parts:
            found[inside(part, points)] = label
    return found, origin


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
