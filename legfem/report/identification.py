"""The folder of an identification: result.json, pages, figures, tables and fields, of any kind."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpi4py import MPI

from legfem.common.documents import write_document
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Fit
from legfem.legs.details import LegDetails
from legfem.legs.site_test import curve_of
from legfem.report.estimates import preferred
from legfem.report.folder import REPORT, RESULT, ReportFile, keep_another, made_in_place
from legfem.report.kinds import kind_of
from legfem.report.leg_figure import leg_figure
from legfem.report.page import PressedSection
from legfem.report.paraview import write_fields
from legfem.report.render.table import estimates_frame
from legfem.report.section import filmed
from legfem.report.style import LAW_NAMES, save
from legfem.report.write import write_page

type LegFits = Sequence[Fit[LegDetails]]
type Drawn = list[ReportFile]


@dataclass(frozen=True, eq=False)
class _Solved:
    """What one more solve of the best law gives to look at."""

    note: str = ""
    files: Drawn = field(default_factory=list)
    pressed: PressedSection | None = None


def write_report(
    fits: Sequence[Fit[Any]],
    out: Path,
    command: str = "",
    experiment: PlaneStrainIndentation | None = None,
    every_rank: bool = False,
) -> Path:
    """Write the folder of fits: result.json, report.html and report.txt, tables, figures; return report.txt's path.

    Parameters
    ----------
    fits
        One a law, of one leg, one folder of specimens, or one leg in its stocking.
    out
        Folder; made if missing.
    command
        That was given, for who wants to repeat it.
    experiment
        Of the only site, solved once more with the law that fits best for the deformed state; None leaves picture
        and fields of it out. Under MPI all ranks of its communicator call.
    every_rank
        Whether each rank has fits and a folder of its own; else the first one of MPI's writes alone.
    """
    kind, out = kind_of(fits), Path(out)
    comm = kind.comm(fits) if experiment is None else experiment.comm
    if comm.size == 1 and MPI.COMM_WORLD.rank > 0 and not every_rank:
        return out / REPORT
    if comm.rank == 0:
        keep_another(out, command, "result.json")
        write_document(out / "result.json", fit_document(fits, kind.document))
    with made_in_place(out, comm) as folder:
        solved = _Solved(files=kind.fields(fits, folder))
        if experiment is not None:
            solved = _deformed_state(fits, experiment, folder)
        if comm.rank == 0:
            page = kind.page(fits, solved.pressed, command, solved.note)
            entries = [*kind.files(fits, folder), *solved.files, RESULT]
            write_page(page, folder, kind.explore, entries, estimates_frame(fits))
    return out / REPORT


def pressed_section_of(fits: LegFits, experiment: PlaneStrainIndentation) -> PressedSection | None:
    """The section under the best law, solved once more to be pressed; None where that fails."""
    best = preferred(fits)
    shot = filmed(experiment, best.model_values, float(curve_of(best.tests[0]).displacement[-1]))
    return shot.section(f"the {LAW_NAMES[best.law]} law")


def _deformed_state(fits: LegFits, experiment: PlaneStrainIndentation, folder: Path) -> _Solved:
    """Solve the best law once more, and write what is to be seen of it."""
    best = preferred(fits)
    subject = best.details.subject
    depth = float(curve_of(best.tests[0]).displacement[-1])
    shot = filmed(experiment, best.model_values, depth)
    solved = shot.solved
    if not shot.is_final:
        return _Solved(
            f"The deformed state at {depth:g} mm could not be solved for again with the same mesh "
            f"({solved.report.reason}): its picture and fields are left out."
        )
    fields = shot.fields
    files, pressed = [], None
    if shot.film is not None:
        pressed = shot.section(f"the {LAW_NAMES[best.law]} law")
        figure = leg_figure(
            fields,
            subject.section,
            subject.indenter.radius,
            solved.report.reached,
            float(solved.curve.force[-1]),
            f"{subject.title}, {LAW_NAMES[best.law]} law",
            subject.origin,
        )
        shows = "the section with its mesh, and deformed with the hydrostatic pressure"
        files.append(ReportFile(save(figure, folder, "leg"), shows))
    files.append(
        ReportFile(
            write_fields(fields, folder, solved.report.reached),
            "the same for ParaView: displacement (mm), hydrostatic pressure and von Mises stress "
            "(kPa), greatest stretch, J, tissue; contact pressure on the skin (kPa)",
        )
    )
    note = (
        f"The picture and the fields of the deformed leg were computed with the {LAW_NAMES[best.law]} law at "
        f"{solved.report.reached:g} mm, in one full solve in addition to the search's {best.log.forward_solves} "
        f"({solved.report.factorisations} factorisations, {solved.report.seconds:.1f} s)."
    )
    return _Solved(note, files, pressed)
