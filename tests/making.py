"""Subject folders and recordings with known properties, for the tests of the input side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from legfem.data import Recording
from legfem.geometry.motion import RigidTransform

SHARED = Path(__file__).resolve().parents[2] / "shared"
CROSSCHECK = Path(__file__).resolve().parent / "data" / "crosscheck"

TOML = """\
id = "made"
title = "Made for a test"
origin = "simulated"

[section]
contours = "contours.csv"
fascia_thickness_mm = 0.6

[indenter]
diameter_mm = 30.0
length_mm = 50.0
aim_mm = [0.0, 0.0]
direction_deg = 90.0

[tissues.deep]
law = "reduced-polynomial"
D1_per_MPa = 28.0
D2_per_MPa = 28.0

[tissues.superficial]
law = "neo-hookean"
C10_kPa = 2.0
D1_per_MPa = 22.5

[tissues.fascia]
law = "neo-hookean"
C10_kPa = 100.0
D1_per_MPa = 22.5

[instrument]
force_sd_N = 0.04
displacement_sd_mm = 0.02
"""


def turned_and_moved(degrees: tuple[float, float, float], translation: np.ndarray) -> RigidTransform:
    """Turns about x, y and z, in this order, then a translation, mm."""
    return RigidTransform(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix(), np.asarray(translation, float))


def circle(x: float, y: float, radius: float, n: int = 48) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


def leg() -> dict[str, np.ndarray]:
    """Girth 377 mm, 6 mm of fat; tibia in front (+y up), fibula at its side."""
    return {
        "skin": circle(0, 0, 60, 200),
        "fascia": circle(0, 0, 54, 180),
        "tibia": circle(-15, 30, 13),
        "fibula": circle(20, 25, 6),
    }


def write_contours(path: Path, parts: dict[str, np.ndarray]) -> Path:
    rows = ["part,x_mm,y_mm"]
    rows += [f"{part},{x:.4f},{y:.4f}" for part, xy in parts.items() for x, y in xy]
    path.write_text("\n".join(rows) + "\n")
    return path


def tissue_force(depth: np.ndarray) -> np.ndarray:
    """A curve like a calf's, N: 0.3 N at 1 mm, 13 N at 20 mm."""
    return np.where(depth > 0, 0.26 * np.abs(depth) + 0.02 * depth**2, 0.0)


def press(
    air: float = 0.0,
    depth: float = 20.0,
    hold: float = 0.0,
    unload: bool = False,
    speed: float = 0.4,
    rate: float = 10.0,
    force_sd: float = 0.0,
    displacement_sd: float = 0.0,
    offset: float = 0.0,
    seed: int = 0,
    trial: str = "trial1",
) -> Recording:
    """Return a recording that starts ``air`` mm before contact; unloading is 20 % softer."""
    rng = np.random.default_rng(seed)
    up = (air + depth) / speed
    t = np.arange(0.0, up * (2 if unload else 1) + hold + 1e-9, 1 / rate)
    d = np.minimum(t, up) * speed
    back = np.maximum(t - up - hold, 0.0)
    d = d - back * speed
    force = tissue_force(d - air)
    holding = np.clip(t - up, 0.0, hold)
    force = force * (1 - 0.2 * (1 - np.exp(-holding / 3.0))) * np.where(back > 1e-6, 0.8, 1.0)
    return Recording(
        time=t,
        displacement=d + displacement_sd * rng.standard_normal(len(t)),
        force=force + offset + force_sd * rng.standard_normal(len(t)),
        trial=trial,
    )


def write_recording(path: Path, recording: Recording) -> Path:
    rows = ["time_s,displacement_mm,force_N"]
    rows += [
        f"{t:.3f},{d:.4f},{f:.4f}"
        for t, d, f in zip(recording.time, recording.displacement, recording.force, strict=True)
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(rows) + "\n")
    return path


def write_subject(folder: Path, toml: str = TOML, trials: int = 1) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "subject.toml").write_text(toml)
    write_contours(folder / "contours.csv", leg())
    for k in range(trials):
        write_recording(folder / "recordings" / f"trial{k + 1}.csv", press(force_sd=0.03, displacement_sd=0.02, seed=k))
    return folder
