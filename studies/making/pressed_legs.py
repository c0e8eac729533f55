"""A simulated leg as a lab's folder would have it, and its true curve by another code or by legfem's finer elements."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import Literal

from legfem.common.errors import UnsolvedError
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import MUSCLE, LegSection
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.subject import Subject, TissueParameters
from legfem.solve.path import ForceCurve
from studies.making.plane_leg import OtherCase, OtherCode
from studies.making.recording import INSTRUMENT

RADIUS_MM, LENGTH_MM = 15.0, 50.0
"""Of the cylinder."""


def stated_leg(
    name: str,
    section: LegSection,
    aim: FloatArray,
    direction_deg: float,
    fat_kpa: float,
    law: Literal["neo-hookean", "reduced-polynomial"] = "neo-hookean",
    site: str = "",
) -> Subject:
    """Return a leg in plane strain without recordings, pressed by a cylinder; all tissues but its fat are as usual."""
    second = 28.0 if law == "reduced-polynomial" else None
    tissues = {"deep": TissueParameters(law, None, None, 28.0, second)}
    if MUSCLE not in section.lacks:
        tissues["superficial"] = TissueParameters("neo-hookean", kpa_to_mpa(fat_kpa), None, 22.5, None)
        tissues["fascia"] = TissueParameters("neo-hookean", kpa_to_mpa(100.0), None, 22.5, None)
    return Subject(
        id=name,
        title=f"{name}, simulated",
        origin="simulated",
        section=section,
        indenter=Indenter(RADIUS_MM, LENGTH_MM, aim, direction_deg),
        tissues=MappingProxyType(tissues),
        instrument=INSTRUMENT,
        recordings=(),
        directory=Path(),
        plane_strain=True,
        plane_strain_stated=True,
        site=site,
    )


def true_force(
    leg: Subject, case: OtherCase, depth: float, least: float, settings: PlaneStrainSettings | None = None
) -> ForceCurve:
    """Return a leg's force to a depth (mm), by legfem's elements of given settings, or by another code without any.

    Raises
    ------
    UnsolvedError
        If that stops; the other code's Newton iteration may, beyond the least depth that is asked for.
    """
    if settings is None:
        found = OtherCode(leg, case).solve(depth)
        if found.displacement[-1] < least:
            raise UnsolvedError(f"{leg.id}: felupe stops at {found.displacement[-1]:g} mm")
        return ForceCurve(found.displacement, found.force, {})
    solved = plane_strain_test(leg, settings).solve(
        {"deep.C10": kpa_to_mpa(case.c10), "deep.C20": kpa_to_mpa(case.c20)}, depth
    )
    if not solved.report.complete:
        raise UnsolvedError(f"{leg.id}: {solved.report.reason}")
    return solved.curve
