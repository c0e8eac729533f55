"""Folders of results, of any kind: of an identification and of a diagnosis, with pages, figures, tables and fields."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from mpi4py import MPI

from legfem.common.documents import write_document
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.field_files import write_fields
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Fit, preferred
from legfem.inverse.plan import DesignValue
from legfem.inverse.verdict import Diagnosis
from legfem.legs.details import LegDetails
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.site import curve_of
from legfem.legs.subject import Subject
from legfem.meshing.section import SectionMeshSettings
from legfem.report import diagnosis_document
from legfem.report.curves import curves_figure
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_curves import recording_figure, signatures_of
from legfem.report.folder import NUMBERS, REPORT, RESULT, ReportFile, keep_another, made_in_place
from legfem.report.kinds import kind_of, page_of
from legfem.report.leg_figure import SECTION_SHOWS, placement_figure
from legfem.report.page import PressedSection
from legfem.report.pressed_section import Filmed, filmed
from legfem.report.render import estimates_frame, write_page
from legfem.report.style import picture
from legfem.report.words import LAW_NAMES, TOLD
from legfem.solve.settings import NewtonSettings, StepSettings

type LegFits = Sequence[Fit[LegDetails]]


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
        write_document(out / "result.json", fit_document(fits))
    with made_in_place(out, comm) as folder:
        files, pressed, note = kind.fields(fits, folder), None, ""
        if experiment is not None:
            files, pressed, note = _deformed_state(fits, experiment, folder)
        if comm.rank == 0:
            page = page_of(fits, pressed, command, note)
            entries = [*kind.files(fits, folder), *files, RESULT]
            write_page(page, folder, kind.explore, entries, estimates_frame(fits))
    return out / REPORT


def pressed_section_of(fits: LegFits, experiment: PlaneStrainIndentation) -> PressedSection | None:
    """The section under the best law, solved once more to be pressed; None where that fails."""
    return _filmed(fits, experiment).section(_under(preferred(fits)))


def _filmed(fits: LegFits, experiment: PlaneStrainIndentation) -> Filmed:
    best = preferred(fits)
    return filmed(experiment, best.model_values, float(curve_of(best.tests[0]).displacement[-1]))


def _under(best: Fit[LegDetails]) -> str:
    return f"the {LAW_NAMES[best.law]} law"


def _deformed_state(
    fits: LegFits, experiment: PlaneStrainIndentation, folder: Path
) -> tuple[list[ReportFile], PressedSection | None, str]:
    """Solve the best law once more, and write what is to be seen of it; return files, section and what was done."""
    best, shot = preferred(fits), _filmed(fits, experiment)
    solved = shot.solved.report
    if not shot.is_final:
        depth = curve_of(best.tests[0]).displacement[-1]
        note = TOLD["no_fields"].format(depth=depth, reason=solved.reason)
        return [], None, note
    fields = ReportFile(write_fields(shot.fields, folder, solved.reached), TOLD["section_fields"])
    note = TOLD["fields"].format(under=_under(best), solved=solved, solves=best.log.forward_solves)
    return [fields], shot.section(_under(best)), note


_COARSER = 2.4
"""Than the mesh that forces come from: that of the section to press."""
_RESULT = ReportFile([Path("diagnosis.json")], NUMBERS)


def write_diagnosis_report(
    diagnosis: Diagnosis,
    subject: diagnosis_document.Recorded,
    out: Path,
    plan: Sequence[DesignValue] = (),
    command: str = "",
) -> Path:
    """Write report.txt, report.html and the figures of a diagnosis; return report.txt's path.

    Parameters
    ----------
    diagnosis
        What was found.
    subject
        Whose recordings they are.
    out
        Folder; made if missing.
    plan
        Tests that could be made next, the best first.
    command
        That was given, for who wants to repeat it.
    """
    out, whose, pressed = Path(out), (subject.title, subject.origin), None
    protocols = diagnosis.observed.protocols
    with made_in_place(out) as folder:
        entries = []
        if isinstance(subject, Subject):
            entries.append(picture(placement_figure(subject), folder, "section", SECTION_SHOWS))
            pressed = _pressed(diagnosis, subject)
        for number, stations in enumerate(protocols):
            name = f"recording-{number + 1}" if len(protocols) > 1 else "recording"
            shows = f"recordings ({stations.label}) against the model, what it misses, and where"
            entries.append(picture(recording_figure(diagnosis, number, *whose), folder, name, shows))
        if blocks := signatures_of(diagnosis):
            figure = curves_figure(blocks, "What the base model misses", *whose)
            shows = "what the base model misses, and what each leading mechanism would leave"
            entries.append(picture(figure, folder, "signatures", shows))
        page = diagnosis_web_page(diagnosis, subject, plan, command, pressed)
        numbers = pd.DataFrame(diagnosis_document.parameter_rows(diagnosis))
        write_page(page, folder, "curves", [*entries, _RESULT], numbers)
    return out / REPORT


def _pressed(found: Diagnosis, subject: Subject) -> PressedSection | None:
    """Return the section with the base model, on a mesh coarse enough not to be waited for."""
    settings = PlaneStrainSettings(
        mesh=SectionMeshSettings().refined(1 / _COARSER),
        newton=NewtonSettings(reuse=0.7, relative_tolerance=1e-5),
        steps=StepSettings.regular(first=0.5, largest=2.0),
    )
    base = found.base_model
    values = {name: base.value(name) for name in base.fit.stiffness}
    shot = filmed(plane_strain_test(subject, settings), values, float(found.observed.displacement.max()))
    return shot.section("the base model (a coarse mesh; what was found to be left out isn't in it)")
