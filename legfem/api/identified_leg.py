"""Stiffness identified from a leg's recordings and one section of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.api.called import IdentifyCall
from legfem.api.checking import wrong_mesh
from legfem.api.found import ByLaw
from legfem.api.loading import Given
from legfem.common.progress import progress_on
from legfem.legs.subject import Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from legfem.api.called import Mesh
    from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
    from legfem.identify.result import IdentificationResult
    from legfem.report.web.page import WebPage

COARSENING = 2.0
"""Of the elements, for a quick look."""


@dataclass(frozen=True, eq=False)
class IdentifiedLeg(ByLaw["IdentificationResult"]):
    """Stiffness identified from a leg's recordings."""

    subject: Subject
    results: tuple[IdentificationResult, ...]
    """One a law."""
    _experiment: PlaneStrainIndentation | None = None

    def summary(self) -> str:
        """Return values, intervals, which law fits better, and warnings."""
        from legfem.report.text import brief
        from legfem.report.web.identification import identification_page

        return brief(identification_page(self.results, self.subject, None))

    def _document_of(self, result: IdentificationResult) -> dict[str, Any]:
        from legfem.identify.document import result_document

        return result_document(result)

    def plot(self) -> Figure:
        """Return recordings, model and their difference, for each law."""
        from legfem.report.fit_figure import fit_figure

        return fit_figure(self.results)

    def _page(self) -> WebPage:
        from legfem.report.identification import pressed_leg
        from legfem.report.web.identification import identification_page

        pressed = None if self._experiment is None else pressed_leg(self.results, self._experiment)
        return identification_page(self.results, self.subject, pressed)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, the figures and the fields; return the report's path."""
        from legfem.identify.run import write_results
        from legfem.report.identification import write_identification_report

        write_results(self.results, Path(folder), as_list=len(self.results) > 1)
        return write_identification_report(self.results, self.subject, self._experiment, Path(folder))


def identify_section(subject: Subject, asked: IdentifyCall) -> IdentifiedLeg:
    """Identify a leg from its section; see `legfem.identify`."""
    from legfem.identify.run import forward_model, identify_subject
    from legfem.legs.correction_of_leg import choose_correction
    from legfem.legs.experiments import tissues_of
    from legfem.legs.forward import values_of
    from legfem.legs.model_3d import SOLVES, LegModels, check_has_ends

    nominal = values_of(tissues_of(subject))
    request = asked.request_of(nominal)
    laws = asked.laws(request, nominal, subject)
    correction = choose_correction(asked.correction, subject)
    section = forward_model(subject, request, plane_settings(asked.mesh))
    if asked.in_3d:
        check_has_ends(subject)
    with progress_on(quiet=not asked.progress) as told:
        leg = None
        if asked.in_3d:
            kept = None if request.out is None else request.out / SOLVES
            leg = LegModels.of_subject(subject, section.depth, kept, progress=told)
        results = identify_subject(subject, laws, replace(request, progress=told), correction, section, leg)
    return IdentifiedLeg(subject, tuple(results), section.experiment)


def plane_settings(mesh: Mesh | None) -> PlaneStrainSettings | None:
    """Return the numerical settings of sections that a call's ``mesh`` names.

    Raises
    ------
    InputError
        If it is none of a section's.
    """
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.meshing.section import SectionMeshSettings

    if mesh == "coarse":
        return PlaneStrainSettings(SectionMeshSettings().refined(1 / COARSENING))
    if mesh is None or isinstance(mesh, PlaneStrainSettings):
        return mesh
    raise wrong_mesh(mesh, "is no section's", "give coarse, or PlaneStrainSettings")
