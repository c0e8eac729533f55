"""The report of a diagnosis: text and figures in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.common.units import kpa_to_mpa
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.inverse.verdict import Diagnosis
from legfem.legs.experiments import plane_strain_test
from legfem.legs.subject import Subject
from legfem.meshing.section import SectionMeshSettings
from legfem.report.diagnosis_document import Recorded
from legfem.report.filmed import filmed
from legfem.report.folder import NUMBERS, REPORT, ReportFile, made_in_place
from legfem.report.parameter_figure import parameter_figure
from legfem.report.placement_figure import SECTION_SHOWS, placement_figure
from legfem.report.ranking_figure import ranking_figure
from legfem.report.recording_figure import recording_figure
from legfem.report.signature_figure import leading, signature_figure
from legfem.report.style import save
from legfem.report.text import plain_page
from legfem.report.web.diagnosis import diagnosis_web_page
from legfem.report.web.page import listed, write_page
from legfem.report.web.section import PressedSection
from legfem.solve.settings import NewtonSettings, StepSettings

_COARSER = 2.4
"""Than the mesh that forces come from: that of the section to press."""
_RESULT = ReportFile([Path("diagnosis.json")], NUMBERS)


def write_diagnosis_report(
    diagnosis: Diagnosis, subject: Recorded, out: Path, plan: Sequence[str] = (), command: str = ""
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
        What could be done next, each with its chance, the best first.
    command
        That was given, for who wants to repeat it.
    """
    out = Path(out)
    with made_in_place(out) as folder:
        entries = [listed("curves"), *_figures(diagnosis, subject, folder)]
        pressed = _pressed(diagnosis, subject) if isinstance(subject, Subject) else None
        page = diagnosis_web_page(diagnosis, subject, plan, command, pressed)
        write_page(page, folder, plain_page(page, [*entries, _RESULT]))
    return out / REPORT


def _pressed(found: Diagnosis, subject: Subject) -> PressedSection | None:
    """Return the section with the base model, on a mesh coarse enough not to be waited for."""
    settings = PlaneStrainSettings(
        mesh=SectionMeshSettings().refined(1 / _COARSER),
        newton=NewtonSettings(reuse=0.7, relative_tolerance=1e-5),
        steps=StepSettings.regular(first=0.5, largest=2.0),
    )
    experiment = plane_strain_test(subject, settings)
    base = found.base
    values = {f"deep.{name}": kpa_to_mpa(base.value(name)) for name in base.fit.stiffness}
    depth = float(found.observed.displacement.max())
    shot = filmed(experiment, values, depth)
    return shot.section("the base model (a coarse mesh; what was found to be left out isn't in it)")


def _figures(found: Diagnosis, subject: Recorded, folder: Path) -> list[ReportFile]:
    whose = subject.title, subject.origin
    entries = []
    if isinstance(subject, Subject):
        figure = placement_figure(subject)
        entries.append(ReportFile(save(figure, folder, "section"), SECTION_SHOWS))
    several = len(found.observed.protocols) > 1
    for number, stations in enumerate(found.observed.protocols):
        name = f"recording-{number + 1}" if several else "recording"
        entries.append(
            ReportFile(
                save(recording_figure(found, number, *whose), folder, name),
                f"recordings ({stations.label}) against the model, what it misses, and where",
            )
        )
    if found.verdict != "consistent" and leading(found):
        figure = signature_figure(found, *whose)
        shows = "what the base model misses, and what each leading mechanism would leave"
        entries.append(ReportFile(save(figure, folder, "signatures"), shows))
    figure = ranking_figure(found, *whose)
    shows = "how probable every explanation is"
    entries.append(ReportFile(save(figure, folder, "ranking", svg=True), shows))
    figure = parameter_figure(found, *whose)
    shows = "the parameters with their 95 % intervals, before and after"
    entries.append(ReportFile(save(figure, folder, "parameters", svg=True), shows))
    return entries
