"""The report of a leg in its stocking: text, figures, numbers and fields in one folder."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.documents import write_document
from legfem.common.units import FloatArray
from legfem.fem.fields import fields_of
from legfem.report.folder import REPORT, ReportFile, keep_another, made_in_place
from legfem.report.paraview import write_fields
from legfem.report.stocking_figures import (
    stocking_contours_figure,
    stocking_fat_figure,
    stocking_pressure_figure,
    stocking_section_figure,
)
from legfem.report.stocking_page import stocking_web_page
from legfem.report.style import save
from legfem.report.write import write_page
from legfem.stockings.document import stocking_document
from legfem.stockings.leg_model import SURFACES
from legfem.stockings.pressures import FatPressures, PressureProbe, SectionPressures, fat_pressures, section_pressures
from legfem.stockings.result import StockingResult

NUMBERS = "result.json"


@dataclass(frozen=True, eq=False)
class _Sampled:
    """What is taken from the mesh for the report, whole on every rank."""

    section: SectionPressures | None
    fat: FatPressures | None
    moved: dict[str, FloatArray] | None
    """Displacement (mm) of the points of skin and hull."""


def write_stocking_report(result: StockingResult, folder: Path, command: str = "") -> Path:
    """Write report.txt, report.html, result.json, the figures and the fields of a run.

    Returns report.txt's path.

    Parameters
    ----------
    result
        Of a run; under MPI all ranks of its communicator call.
    folder
        Made if missing.
    command
        That was given, for who wants to repeat it.
    """
    folder = Path(folder)
    comm, sampled = result.model.compression.comm, _sample(result)
    if comm.rank == 0:
        keep_another(folder, command)
    with made_in_place(folder, comm) as hidden:
        entries = _fields(result, hidden)
        if comm.rank == 0:
            entries = [*_figures(result, sampled, hidden), *entries]
            numbers = write_document(hidden / NUMBERS, stocking_document(result, sampled.fat))
            entries.append(ReportFile([numbers], "all numbers with their units"))
            page = stocking_web_page(result, sampled.moved, sampled.fat, command)
            write_page(page, hidden, "the leg to turn", entries)
    return folder / REPORT


def _sample(result: StockingResult) -> _Sampled:
    moved = moved_surfaces(result)
    if result.pressures is None:
        return _Sampled(None, None, moved)
    probe, shape = PressureProbe(result.model.compression), result.leg.bare
    level = float(np.median(result.leg.slices))
    return _Sampled(
        section_pressures(shape, level, result.equilibrium, probe),
        fat_pressures(shape, result.equilibrium, probe),
        moved,
    )


def moved_surfaces(result: StockingResult) -> dict[str, FloatArray] | None:
    """Return the displacement (mm) of the points of skin and hull; None without an equilibrium."""
    if result.pressures is None:
        return None
    return {part: result.model.displacement(part, result.equilibrium.state.unknown) for part in SURFACES}


def _figures(result: StockingResult, sampled: _Sampled, folder: Path) -> list[ReportFile]:
    entries = []
    if sampled.section is not None and sampled.fat is not None:
        entries = [
            ReportFile(
                save(stocking_pressure_figure(result), folder, "interface-pressure"),
                "pressure of the stocking on the skin, unrolled and on the leg (the second paper's Fig. 4)",
            ),
            ReportFile(
                save(stocking_section_figure(result, sampled.section), folder, "mid-calf"),
                "hydrostatic pressure in the section at mid calf, with the veins (Figs. 5 and 6); "
                "the outlines before and in the stocking",
            ),
            ReportFile(
                save(stocking_fat_figure(result, sampled.fat, sampled.section.level), folder, "fat"),
                "fat thickness round the leg against the pressures over it and in it",
            ),
        ]
    if result.best is not None:
        figure = stocking_contours_figure(result, result.best)
        shows = "the slices that were compared: outlines, and distances of model and bare leg"
        entries.append(ReportFile(save(figure, folder, "contours"), shows))
    return entries


def _fields(result: StockingResult, folder: Path) -> list[ReportFile]:
    if not result.equilibrium.state.report.complete:
        return []
    result.model.set_state(result.equilibrium.state, result.equilibrium.pressure, result.parameters)
    written = write_fields(fields_of(result.model.compression.system), folder)
    shows = (
        "the leg in its stocking for ParaView: displacement (mm), hydrostatic pressure and von Mises stress (kPa), "
        "greatest stretch, J, tissue (1 fat, 3 muscle); interface pressure on the skin (kPa)"
    )
    return [ReportFile(written, shows)]
