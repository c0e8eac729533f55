"""Stiffness identified from recordings of a leg, or of specimens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from legfem.api.found import ByLaw
from legfem.api.loading import Given, load_subject
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.identify.laws import LawName
from legfem.subjects.loading import SUBJECTS
from legfem.subjects.subject import Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
    from legfem.identify.result import IdentificationResult
    from legfem.identify.settings import IdentificationSettings
    from legfem.inference.parameter import Parameter
    from legfem.report.web.page import WebPage
    from legfem.specimens.folder import SpecimenFolder
    from legfem.specimens.result import SpecimenResult

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
        from legfem.report.plain import brief
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
        return write_identification_report(
            self.results, self.subject, self._experiment, Path(folder)
        )


@dataclass(frozen=True, eq=False)
class IdentifiedSpecimen(ByLaw["SpecimenResult"]):
    """A tissue's law identified from all recordings of a folder of specimens together."""

    folder: SpecimenFolder
    results: tuple[SpecimenResult, ...]
    """One a law."""

    def summary(self) -> str:
        """Return values, intervals, how well what was left out is predicted, and warnings."""
        from legfem.report.plain import brief

        return brief(self._page())

    def _document_of(self, result: SpecimenResult) -> dict[str, Any]:
        from legfem.report.specimen_numbers import specimen_document

        return specimen_document(result)

    def plot(self) -> Figure:
        """Return recordings, model and their difference, for each law."""
        from legfem.report.specimen_figure import specimen_figure

        return specimen_figure(self.results)

    def _page(self) -> WebPage:
        from legfem.report.web.specimen import specimen_web_page

        return specimen_web_page(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt and the figure; return the report's path."""
        from legfem.report.specimen import write_specimen_report

        return write_specimen_report(self.results, Path(folder))


@overload
def identify(
    leg: Subject | Given,
    law: LawName | Literal["both"] = "both",
    *,
    correction: str = "auto",
    depth: float | None = None,
    settings: IdentificationSettings | None = None,
    mesh: PlaneStrainSettings | Literal["coarse"] | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
    model: Literal["2d", "3d"] = "2d",
) -> IdentifiedLeg: ...
@overload
def identify(
    leg: SpecimenFolder,
    law: LawName | Literal["both"] = "both",
    *,
    settings: IdentificationSettings | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
    leave_out: Sequence[str] = (),
) -> IdentifiedSpecimen: ...
def identify(
    leg: Subject | SpecimenFolder | Given,
    law: LawName | Literal["both"] = "both",
    *,
    correction: str = "auto",
    depth: float | None = None,
    settings: IdentificationSettings | None = None,
    mesh: PlaneStrainSettings | Literal["coarse"] | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
    leave_out: Sequence[str] = (),
    model: Literal["2d", "3d"] = "2d",
) -> IdentifiedLeg | IdentifiedSpecimen:
    """Identify the stiffness of a leg's tissues, or of specimens, from recordings.

    Parameters
    ----------
    leg : Subject, SpecimenFolder, str or Path
        The leg, or what `load_subject` takes; or what `load_specimen` returned.
    law : str
        ``"neo-hookean"``, ``"reduced-polynomial"`` or ``"both"``; ``"yeoh"`` and ``"exponential"``
        of specimens.
    correction : str
        Of the cylinder's ends: ``"own"``, ``"none"``, a file, or ``"auto"``: the leg's own where
        it is due.
    depth : float, optional
        Greatest displacement to use, mm.
    settings : IdentificationSettings, optional
        Of the search: weighting, seed, minimiser.
    mesh : PlaneStrainSettings or "coarse", optional
        Of the finite elements; ``"coarse"`` is for a quick look, and no result to rely on.
    out : str or Path, optional
        Folder that keeps every full solve, so that the same call goes on where it was stopped;
        nothing is written without it.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    parameters : sequence of Parameter, optional
        What to identify, with bounds and priors; C10 and C20 of the deep tissue without them. See
        `legfem.identify.request.SearchRequest`.
    fixed : Mapping[str, float], optional
        Values that are held in place of the folder's, by full name, in MPa, 1/MPa, N or mm.
    leave_out : sequence of str
        Recordings or specimens of a folder of specimens that are predicted, and not fitted. Of
        specimens there are no correction, depth, mesh and model to choose.
    model : {"2d", "3d"}
        Whether the correction is a table's, or confirmed by full solves of the leg in 3D.

    Returns
    -------
    IdentifiedLeg or IdentifiedSpecimen
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``.

    Raises
    ------
    InputError
        If the leg can't be meshed or its recordings can't be used.
    SearchError
        If too few full solves reach the measured depth.
    """
    from legfem.correction.choice import choose_correction
    from legfem.identify.laws import LAWS
    from legfem.identify.request import SearchRequest
    from legfem.identify.run import forward_model, identify_subject
    from legfem.identify.settings import IdentificationSettings
    from legfem.identify.spatial import SOLVES, LegModels, check_has_ends

    if not isinstance(leg, Subject | str | Path):
        return _identify_specimen(
            leg, law, leave_out, settings, out, jobs, progress, parameters, fixed
        )
    if law not in (*LAWS, "both"):
        raise InputError("law", repr(law), "unknown law", f"give one of {', '.join(LAWS)}, both")
    subject = leg if isinstance(leg, Subject) else load_subject(leg)
    if not subject.instrument.stated:
        raise InputError(
            subject.directory / SUBJECTS.file, "instrument", "missing",
            "add force_sd_N and displacement_sd_mm, or accuracies",
        )  # fmt: skip
    request = SearchRequest(
        parameters, fixed or {}, depth, settings or IdentificationSettings(),
        None if out is None else Path(out), jobs,
    )  # fmt: skip
    section = forward_model(subject, request, _meshed(mesh))
    if model == "3d":
        check_has_ends(subject)
    with progress_on(quiet=not progress) as told:
        leg_in_3d = None
        if model == "3d":
            kept = None if out is None else Path(out) / SOLVES
            leg_in_3d = LegModels.of_subject(subject, section.depth, kept, progress=told)
        results = identify_subject(
            subject, [name for name in LAWS if law in ("both", name)],
            replace(request, progress=told), choose_correction(correction, subject), section,
            leg_in_3d,
        )  # fmt: skip
    return IdentifiedLeg(subject, tuple(results), section.experiment)


def _identify_specimen(
    folder: SpecimenFolder,
    law: str,
    leave_out: Sequence[str],
    settings: IdentificationSettings | None,
    out: Given | None,
    jobs: int,
    progress: bool,
    parameters: Sequence[Parameter] | None,
    fixed: Mapping[str, float] | None,
) -> IdentifiedSpecimen:
    from legfem.specimens.identification import identify_specimen
    from legfem.specimens.laws import Asked, laws_named

    given = parameters or ()
    asked = Asked(
        tuple(one.name for one in given if one.role == "identified"),
        {one.name: one.prior for one in given if one.prior is not None},
        {one.name: one.bounds for one in given},
        fixed or {},
    )
    with progress_on(quiet=not progress) as told:
        results = identify_specimen(
            folder, laws_named(law), asked, leave_out, settings,
            None if out is None else Path(out), jobs, told,
        )  # fmt: skip
    return IdentifiedSpecimen(folder, tuple(results))


def _meshed(mesh: PlaneStrainSettings | Literal["coarse"] | None) -> PlaneStrainSettings | None:
    if mesh != "coarse":
        return mesh
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.meshing.section import SectionMeshSettings

    return PlaneStrainSettings(SectionMeshSettings().refined(1 / COARSENING))
