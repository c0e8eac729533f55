"""A small cone of a leg, as a subject's folder with stacked contours, and a round leg's shape."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from legfem.data import Instrument, Recording
from legfem.data.recording import write_recording
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
from legfem.legs.folder import subject_text

FAT, BONE = 9.0, 9.0
LEVELS = np.arange(20.0, 181.0, 10.0)


def CONE(level: float) -> float:
    """Return the skin's radius at a level (mm)."""
    return 50.0 + 0.05 * (level - 100.0)


def cone_contours(path: Path, slope: float = 1.0) -> Path:
    """Write the contours of a cone, or at ``slope`` 0 of a round leg, with two bones in it."""
    angle = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    rows = ["level_mm,part,i,x_mm,y_mm"]
    for level in LEVELS:
        radius = 50.0 + slope * (CONE(level) - 50.0)
        parts = {
            "skin": radius * ring,
            "hull": (radius - FAT) * ring,
            "tibia": BONE * ring + (8.0, 6.0),
            "fibula": 0.6 * BONE * ring + (-14.0, 6.0),
        }
        rows += [
            f"{level},{part},{i},{x:.5f},{y:.5f}" for part, points in parts.items() for i, (x, y) in enumerate(points)
        ]
    path.write_text("\n".join(rows) + "\n")
    return path


def cone_folder(
    folder: Path,
    level: float | None = None,
    pose: str | None = None,
    more: str = "",
    slope: float = 1.0,
    recordings: Sequence[Recording] = (),
) -> Path:
    """Write a subject's folder of a cone that is pressed along +y.

    Without a level the cylinder stands by ``pose`` in the contours' coordinates.
    """
    cone_contours(folder / "cone.csv", slope)
    text = subject_text(
        "cone", "A cone", "simulated", 0.6, (0.0, -60.0), 90.0, True, Instrument(0.02, 0.02), plane_strain=False
    )
    at = "" if level is None else f"\nlevel_mm = {level}"
    text = text.replace('"contours.csv"', f'"cone.csv"{at}\n{more}')
    if pose is not None:
        lines = text.splitlines()
        first = next(k for k, line in enumerate(lines) if line.startswith("aim_mm"))
        lines[first : first + 2] = pose.splitlines()
        text = "\n".join(lines) + "\n"
    (folder / "recordings").mkdir()
    for recording in recordings:
        write_recording(recording, folder / "recordings" / f"{recording.trial}.csv")
    (folder / "subject.toml").write_text(text)
    return folder


def round_leg(
    radius: float = 57.0,
    hull_radius: float = 51.0,
    core_radius: float = 15.0,
    length: float = 60.0,
    n_levels: int = 13,
    n_points: int = 180,
) -> LegShape:
    """Return a thick-walled cylinder about a round core, the bone ``core``; mm, z from 0."""
    levels = np.linspace(0.0, length, n_levels)
    radii = {SKIN: radius, HULL: hull_radius, "core": core_radius}
    unit = np.column_stack([f(2 * np.pi * np.arange(720) / 720) for f in (np.cos, np.sin)])
    return shape_of_contours(levels, {part: [r * unit] * n_levels for part, r in radii.items()}, n_points)
