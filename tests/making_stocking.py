"""A short leg for stockings: 60 mm of the fourth one of legfem."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.geometry.leg_shape import LegShape
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import SolidMeshSettings
from studies.making.shapes import parametric_leg, read_legs
from studies.stockings.command import LEGS

PLANTED_KPA = (2.5, 6.0)
LEG_TOML = """id = "a"
title = "A leg"
origin = "simulated"
[bare]
contours = "bare.csv"
[compressed]
contours = "compressed.csv"
[stocking]
compression_class = "2"
"""
"""A leg's file: with the least that it needs."""
COARSE = SolidMeshSettings(skin_size=9, inside_size=11, bone_size=8)
COARSEST = SolidMeshSettings(skin_size=16, inside_size=20, bone_size=12, layer_elements=0.3, turn_elements=6)
"""Where words and columns are looked at, and no number."""


def write_shape(shape: LegShape, path: Path) -> None:
    """Write a shape, to 0.1 micrometre."""
    rows = ["level_mm,part,i,x_mm,y_mm"]
    rows += [
        f"{level:.4f},{part},{i},{x:.4f},{y:.4f}"
        for part in shape.parts
        for level, loop in zip(shape.levels, shape.contours[part], strict=True)
        for i, (x, y) in enumerate(loop)
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def short_leg() -> LegShape:
    """Return the leg."""
    whole = parametric_leg(read_legs(LEGS)["4"], n_points=90)
    return whole.at_levels(np.linspace(50, 110, 13))


def write_scanned(folder: Path) -> Path:
    """Write the leg bare, with its tissues' stiffness, as a folder of contours."""
    write_shape(short_leg(), folder / "bare.csv")
    (folder / "leg.toml").write_text("""id = "short"
title = "60 mm of a leg"
origin = "simulated"
bare.contours = "bare.csv"
stocking.compression_class = "2"
tissues = {deep = {C10_kPa = 2.5}, superficial = {C10_kPa = 6.0}}
""")
    return folder


GIRTHS = {"B": 215.0, "B1": 268.0, "C": 362.0, "D": 345.0}
HEIGHTS = {"B": 120.0, "B1": 190.0, "C": 310.0, "D": 390.0}


def write_tape(folder: Path, girths: dict[str, float] = GIRTHS, unstretched: str = "stocking.csv") -> Path:
    """Write a leg by tape, in a stocking of a fifth to a third less girth, as a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "stocking.csv").write_text("level_mm,perimeter_mm\n120,158\n190,205\n310,288\n390,280\n")
    (folder / "leg.toml").write_text(f"""id = "tape"
title = "A leg by tape"
origin = "measured"
bare.girths_mm = {{{", ".join(f"{name} = {girth}" for name, girth in girths.items())}}}
[stocking]
stiffness_N_per_mm = 0.3
unstretched = "{unstretched}"
intended_class = "2"
levels_mm = {{{", ".join(f"{name} = {height}" for name, height in HEIGHTS.items())}}}
[accuracy]
tension_relative_sd = 0.05
""")
    return folder


def laws(deep_kpa: float, fat_kpa: float) -> dict[str, NeoHookean]:
    """Return the tissues' laws by their C10."""
    return {"deep": NeoHookean(1e-3 * deep_kpa, 2.0), "superficial": NeoHookean(1e-3 * fat_kpa, 2.0)}
