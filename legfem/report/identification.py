"""The report of an identification: text, figures and fields in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.identify.result import IdentificationResult
from legfem.jobs.background import in_background
from legfem.legs.subject import Subject
from legfem.report.cost_figure import cost_figure
from legfem.report.filmed import filmed
from legfem.report.fit_figure import fit_figure
from legfem.report.in_place import REPORT, made_in_place
from legfem.report.leg_figure import leg_figure
from legfem.report.listing import RESULT, ReportFile
from legfem.report.paraview import write_fields
from legfem.report.placement_figure import SECTION_SHOWS, placement_figure
from legfem.report.plain import plain_page
from legfem.report.style import LAW_NAMES, save
from legfem.report.web.identification import identification_page
from legfem.report.web.page import listed, write_page
from legfem.report.web.section import PressedSection


def write_identification_report(
    results: Sequence[IdentificationResult],
    subject: Subject,
    experiment: PlaneStrainIndentation | None,
    out: Path,
    command: str = "",
    jobs: int = 1,
) -> Path:
    """Write report.txt, report.html, the figures and the fields of an identification.

    Returns report.txt's path.

    Parameters
    ----------
    results
        One a law, of one subject.
    subject
        Whose results they are.
    experiment
        Solved once more with the law that fits best, for the deformed state; None leaves picture
        and fields of it out. Under MPI all ranks of its communicator call.
    out
        Folder; made if missing.
    command
        That was given, for who wants to repeat it.
    jobs
        Processes: with several the figures are drawn while the deformed state is read.
    """
    out = Path(out)
    comm = MPI.COMM_SELF if experiment is None else experiment.comm
    if comm.size == 1 and MPI.COMM_WORLD.rank > 0:
        return out / REPORT
    note, entries, pressed = "", list[ReportFile](), None
    apart = jobs > 1 and experiment is not None and comm.size == 1
    with (
        made_in_place(out, comm) as folder,
        in_background(lambda: _figures(results, subject, folder), apart) as figures,
    ):
        if experiment is not None:
            note, entries, pressed = _deformed_state(results, subject, experiment, folder)
        if comm.rank == 0:
            entries = [listed("curves and leg"), *figures(), *entries]
            page = identification_page(results, subject, pressed, command, note)
            write_page(page, folder, plain_page(page, [*entries, RESULT]))
    return out / REPORT


def _figures(results: Sequence[IdentificationResult], subject: Subject, folder: Path) -> list[ReportFile]:
    entries = [
        ReportFile(
            save(fit_figure(results), folder, "fit", svg=True),
            "measured and simulated force and their difference, each law (as the paper's Fig. 7)",
        )
    ]
    for result in results:
        if len(result.parameters) > 2:
            continue
        two = len(result.parameters) == 2
        shows = f"cost of the {LAW_NAMES[result.law]} law over its parameters, and the search"
        if two:
            shows += (
                ". The 95 % region follows the noise, which is correlated along the curve, "
                "so its axes need not be those of the cost's contours"
            )
        entries.append(ReportFile(save(cost_figure(result), folder, f"cost-{result.law}", svg=not two), shows))
    entries.append(ReportFile(save(placement_figure(subject), folder, "section"), SECTION_SHOWS))
    return entries


def pressed_leg(results: Sequence[IdentificationResult], experiment: PlaneStrainIndentation) -> PressedSection | None:
    """Solve the best law once more; return its section to press, None where that fails."""
    best = _best(results)
    shot = filmed(experiment, best.model_values, float(best.measured.displacement[-1]))
    return shot.section(f"the {LAW_NAMES[best.law]} law")


def _best(results: Sequence[IdentificationResult]) -> IdentificationResult:
    return min(results, key=lambda result: result.cost.value)


def _deformed_state(
    results: Sequence[IdentificationResult], subject: Subject, experiment: PlaneStrainIndentation, folder: Path
) -> tuple[str, list[ReportFile], PressedSection | None]:
    """Solve the best law once more; return a note on that, what was written of it, and the film."""
    best = _best(results)
    shot = filmed(experiment, best.model_values, float(best.measured.displacement[-1]))
    solved = shot.solved
    if not shot.is_final:
        return (
            f"The deformed state at {best.measured.displacement[-1]:g} mm could not be solved for "
            f"again with the same mesh ({solved.report.reason}): its picture and fields are left "
            "out.",
            [],
            None,
        )
    fields = shot.fields
    entries, pressed = [], None
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
        entries.append(ReportFile(save(figure, folder, "leg"), shows))
    written = write_fields(fields, folder, solved.report.reached)
    entries.append(
        ReportFile(
            written,
            "the same for ParaView: displacement (mm), hydrostatic pressure and von Mises stress "
            "(kPa), greatest stretch, J, tissue; contact pressure on the skin (kPa)",
        )
    )
    note = (
        f"Picture and fields of the deformed leg are of the {LAW_NAMES[best.law]} law at "
        f"{solved.report.reached:g} mm, from one more full solve that isn't among the "
        f"{best.forward_solves} counted above ({solved.report.factorisations} factorisations, "
        f"{solved.report.seconds:.1f} s)."
    )
    return note, entries, pressed
