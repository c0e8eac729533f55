"""Meshes of legs as the commands use them, and what they are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from legfem.experiments.indentation_3d import Cylinder
from legfem.legs.loading import load_subject
from legfem.meshing.exchange import NamedMesh, named_mesh
from legfem.meshing.idealised_leg import IdealisedLeg, LegMeshSettings, mesh_leg
from legfem.meshing.section import REGIONS, SectionMeshSettings, mesh_section
from legfem.meshing.solid_leg import mesh_solid_leg, settings_for_cells
from legfem.stockings.loading import load_leg
from legfem.stockings.result import StockingSettings


@dataclass(frozen=True, eq=False)
class MadeMesh:
    """A mesh, and what it was made from."""

    mesh: NamedMesh
    definition: Mapping[str, Any]
    """Shape and sizes, as JSON types; lengths in mm."""


def section_mesh(folder: Path, finer: float = 1.0) -> MadeMesh:
    """Mesh the section of a subject's folder, as `legfem.identify` does."""
    subject = load_subject(folder, need_recordings=False, need_instrument=False)
    section, indenter = subject.section, subject.indenter
    sizes = SectionMeshSettings().refined(finer)
    made = mesh_section(section, indenter.radius, indenter.aim, indenter.direction, sizes)
    return MadeMesh(
        named_mesh(made.mesh, made.cell_tags, made.facet_tags, REGIONS),
        {
            "shape": "section",
            "subject": subject.id,
            "origin": subject.origin,
            "fascia_thickness": section.fascia_thickness,
            "indenter": {
                "radius": indenter.radius,
                "aim": indenter.aim.tolist(),
                "direction_deg": indenter.direction_deg,
            },
            "sizes": asdict(sizes),
        },
    )


def stocking_mesh(folder: Path, finer: float = 1.0) -> MadeMesh:
    """Mesh the bare leg of a folder, as `legfem.stocking` does."""
    leg = load_leg(folder)
    sizes = settings_for_cells(leg.bare, round(StockingSettings().cells * finer**3))
    made = mesh_solid_leg(leg.bare, sizes)
    return MadeMesh(
        named_mesh(made.mesh, made.cell_tags, made.facet_tags, made.regions),
        {
            "shape": "solid",
            "subject": leg.id,
            "origin": leg.origin,
            "levels": leg.bare.levels.tolist(),
            "sizes": asdict(sizes),
        },
    )


def idealised_mesh(finer: float = 1.0) -> MadeMesh:
    """Mesh a quarter of the reference leg of the 3D correction."""
    leg, cylinder, sizes = IdealisedLeg(), Cylinder(), LegMeshSettings().refined(finer)
    made = mesh_leg(leg, cylinder.radius, cylinder.length, sizes)
    return MadeMesh(
        named_mesh(made.mesh, made.cell_tags, made.facet_tags, made.regions),
        {"shape": "quarter", "leg": asdict(leg), "cylinder": asdict(cylinder), "sizes": asdict(sizes)},
    )
