"""The small round leg pressed along its axis and across it by hexahedra, recorded as two sites."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

from legfem.data.recording import write_recording
from legfem.experiments.indenter_pose import Cylinder
from legfem.mechanics.indenters import FiniteCylinder, RigidIndenter
from legfem.meshing.structured import LegMeshSettings
from studies.leg3d.planted import CYLINDER, Planted, folder_of, recorded, true_curve

FINE = LegMeshSettings(contact_size=3, depth_size=5, edge_size=2.5, growth=0.4, far_size=14)
"""Of both presses' hexahedra: finer than that of one along the leg, whose ends are elsewhere."""
WAYS = {"along": 0.0, "across": 90.0}


@dataclass(frozen=True)
class Across(Cylinder):
    """The cylinder, lying across the leg: as wide as it is long, it takes as much of the skin."""

    def shape(self, dimension: int) -> RigidIndenter:
        """Return the signed distance in 3D."""
        return FiniteCylinder(self.radius, self.length / 2, self.edge_radius, 1.0, 0.0, 0.0)


PRESSED = {"along": CYLINDER, "across": Across(length=CYLINDER.length)}
"""By the name of the way."""


def sited_folder(planted: Planted, ways: tuple[str, ...], out: Path, seed: int, kept: Path) -> Path:
    """Write a folder with a site for each way, recorded with a lab's errors; no ratio is stated."""
    shutil.rmtree(out, ignore_errors=True)
    curves = {way: true_curve(planted, kept, PRESSED[way]) for way in ways}
    first = next(iter(curves.values()))
    folder = folder_of(replace(planted, fibres=1.0), first, out, seed)
    shutil.rmtree(folder / "recordings")
    tables = ""
    for number, way in enumerate(ways):
        tables += f'\n[[site]]\nname = "{way}"\n[site.indenter]\naxis_deg = {WAYS[way]}\n'
        place = folder / "recordings" / way
        place.mkdir(parents=True)
        for trial in recorded(curves[way], planted.depth, 10 * seed + number):
            write_recording(trial, place / f"{trial.trial}.csv")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text(encoding="utf-8") + tables, encoding="utf-8")
    return folder
