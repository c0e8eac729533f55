"""Limbs that are no calf, drawn by ellipses along them: as volumes of a segmenter's labels, surfaces and outlines.

Voxels are labelled by the ellipses' equations, and outlines are the ellipses: nothing of legfem's runs here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import nibabel
import numpy as np
import trimesh

type Ellipse = tuple[float, float, float, float]
"""Centre and half axes, mm."""


@dataclass(frozen=True)
class Limb:
    """Parts from the outermost to the innermost, and what they do along the limb."""

    parts: Mapping[str, Ellipse]
    labels: Mapping[str, tuple[int, ...]]
    """A part's labels in the volume by the segmenter's names; several share it by their angle about its centre."""
    height: float = 60.0
    cut: Mapping[str, float] | None = None
    """Levels below which there is nothing of a part: of a residual limb's bones, and of its soft end."""

    def ellipse(self, part: str, z: float) -> Ellipse | None:
        """Return a part at a level; rounded off over 25 mm above its end, where it is soft."""
        x, y, a, b = self.parts[part]
        end = (self.cut or {}).get(part)
        if end is None:
            grown = 1 + 0.001 * (z - self.height / 2)
        elif z <= end:
            return None
        else:
            grown = 1.0 if part in BONES else float(np.sqrt(1 - max(0.0, 1 - (z - end) / 25.0) ** 2))
        return x, y, a * grown, b * grown

    def outline(self, part: str, z: float, n: int = 300) -> np.ndarray:
        """Return points around a part, (n, 2)."""
        x, y, a, b = self.ellipse(part, z)
        turn = 2 * np.pi * np.arange(n) / n
        return np.column_stack([x + a * np.cos(turn), y + b * np.sin(turn)])


BONES = ("femur", "radius", "ulna", "tibia", "fibula", "calcaneus")
LIMBS = {
    # By TotalSegmentator's tissue_4_types and total.
    "thigh": Limb(
        {"skin": (0, 0, 84, 80), "muscle": (2, -2, 68, 66), "septum": (2, -2, 18, 4), "femur": (8, 14, 14, 13)},
        {"subcutaneous_fat": (1,), "skeletal_muscle": (3,), "intermuscular_fat": (4,), "femur_left": (75,)},
    ),
    # By MuscleMap's model of the forearm, with the skin that it hasn't.
    "forearm": Limb(
        {"skin": (0, 0, 45, 34), "muscle": (0, 0, 40.5, 29.5), "radius": (-17, 5, 6, 6), "ulna": (16, 7, 6.5, 6)},
        {"skin": (9,), "other muscles": (1, 4, 5), "radius": (2,), "ulna": (3,)},
    ),
    "residual": Limb(
        {"skin": (0, 0, 56, 54), "muscle": (0, -2, 46, 43), "tibia": (-8, -18, 12, 11), "fibula": (20, -8, 6, 6)},
        {"body_extremities": (2,), "muscles": (3,), "tibia": (4,), "fibula": (5,)},
        height=110.0,
        cut={"skin": 0.0, "muscle": 8.0, "tibia": 30.0, "fibula": 45.0},
    ),
}
LEVEL = {"thigh": 30.0, "forearm": 30.0, "residual": 80.0}
DIRECTION = {"thigh": "90", "forearm": "90", "residual": "270"}
"""Of travel, degrees: a residual limb is pressed from behind, away from its bones."""
SPACING = np.array([1.1, 1.0, 2.5])


def write_volume(folder: Path, limb: Limb, eroded: float = 0.0) -> Path:
    """Write a limb's labels as NIfTI; shared labels are ``eroded`` (mm) where they meet, and the skin's is there."""
    half = 6 + np.ceil(max(np.abs(limb.parts["skin"]).reshape(2, 2).sum(axis=0)))
    x = np.arange(-half, half, SPACING[0])
    y, z = np.arange(-half, half, SPACING[1]), np.arange(-5.0, limb.height + 5.0, SPACING[2])
    found = np.zeros((len(x), len(y), len(z)), dtype=np.int16)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    for k, level in enumerate(z):
        for part, numbers in zip(limb.parts, limb.labels.values(), strict=True):
            if not 0 <= level <= limb.height or (at := limb.ellipse(part, level)) is None:
                continue
            off = points - at[:2]
            inside = (off[..., 0] / at[2]) ** 2 + (off[..., 1] / at[3]) ** 2 < 1
            angle = np.arctan2(off[..., 1], off[..., 0]) % (2 * np.pi)
            for j, number in enumerate(numbers):
                start, stop = 2 * np.pi * np.array([j, j + 1]) / len(numbers)
                apart = np.minimum(angle - start, stop - angle)
                room = np.hypot(off[..., 0], off[..., 1]) * np.sin(apart.clip(0, np.pi / 2))
                found[inside & (apart >= 0) & ((len(numbers) == 1) | (room >= eroded)), k] = number
    affine = np.diag([-SPACING[0], -SPACING[1], SPACING[2], 1.0])
    affine[:3, 3] = -x[0], -y[0], z[0]
    image = nibabel.Nifti1Image(found, affine)
    image.header.set_xyzt_units("mm")
    nibabel.save(image, folder / "limb.nii.gz")
    return folder / "limb.nii.gz"


def write_outlines(folder: Path, limb: Limb, step: float = 5.0) -> Path:
    """Write the ellipses at levels as cross-sections of all that is at every one of them."""
    low = max((limb.cut or {}).values(), default=0.0) + 5.0
    rows = ["level_mm,part,loop,i,x_mm,y_mm"]
    for z in np.arange(low, limb.height, step):
        for part in (part for part in limb.parts if part != "septum"):
            rows += [f"{z:g},{part},0,{i},{x:.4f},{y:.4f}" for i, (x, y) in enumerate(limb.outline(part, z))]
    (folder / "sections.csv").write_text("\n".join(rows) + "\n")
    return folder / "sections.csv"


def write_surfaces(folder: Path, limb: Limb) -> dict[str, Path]:
    """Write every part's surface, open where the scan ends, and closed where a part does."""
    files = {}
    for part in (part for part in limb.parts if part != "septum"):
        end = (limb.cut or {}).get(part)
        levels = np.linspace(0.0 if end is None else end + 0.05, limb.height, 60)
        rings = [np.column_stack([limb.outline(part, z, 120), np.full(120, z)]) for z in levels]
        i, j = np.meshgrid(np.arange(59), np.arange(120), indexing="ij")
        a, b = 120 * i + j, 120 * i + (j + 1) % 120
        faces = np.concatenate([np.stack([a, b, b + 120], -1), np.stack([a, b + 120, a + 120], -1)]).reshape(-1, 3)
        points = np.concatenate(rings)
        if end is not None:
            cap = np.column_stack([np.full(120, len(points)), (np.arange(120) + 1) % 120, np.arange(120)])
            points, faces = np.vstack([points, rings[0].mean(axis=0)]), np.vstack([faces, cap])
        files[part] = folder / f"{part}.stl"
        trimesh.Trimesh(points, faces).export(files[part])
    return files
