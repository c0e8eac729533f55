"""What the front door returns: one set of ways to look at every result."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from legfem.api.arguments import wrong_mesh
from legfem.api.identification import IdentifyCall
from legfem.api.loading import Given
from legfem.common.progress import progress_on
from legfem.inverse.laws import LawName
from legfem.legs.subject import Subject

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from legfem.api.identification import Mesh
    from legfem.experiments.leg_3d import SolidLegSettings
    from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
    from legfem.identify.result import IdentificationResult
    from legfem.inverse.parameter import Parameter
    from legfem.inverse.settings import IdentificationSettings
    from legfem.legs.subject import SitedLeg
    from legfem.report.page import WebPage
    from legfem.sites.result import SitesResult
    from legfem.specimens.folder import SpecimenFolder
    from legfem.specimens.result import SpecimenResult


class Found(ABC):
    """What was found in a leg: the same five ways to look at it for all that is found."""

    @abstractmethod
    def summary(self) -> str:
        """Return what a person reads first."""

    @abstractmethod
    def document(self) -> Any:
        """Return everything as JSON types, every number with its unit."""

    @abstractmethod
    def plot(self) -> Figure:
        """Return the figure that shows most."""

    @abstractmethod
    def write(self, folder: str | Path) -> Path:
        """Write report, figures and numbers into a folder; return the report's path."""

    @abstractmethod
    def _rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row a parameter."""

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters: a row each, with value, 95 % interval and unit."""
        import pandas as pd

        return pd.DataFrame(list(self._rows()))

    @abstractmethod
    def _page(self) -> WebPage:
        """Return what ``report.html`` shows."""

    def _repr_html_(self) -> str:
        """Return the parameters and the report's page for a notebook, its curves and leg alive."""
        from legfem.report.render.html import rendered

        page = self._page()
        table = self.to_frame().to_html(index=False, na_rep="", float_format="{:.4g}".format)
        return (
            f'{table}<iframe title="{html.escape(page.title, quote=True)}" '
            'sandbox="allow-scripts" style="width: 100%; height: 640px; border: 1px solid #c8c8c8" '
            f'srcdoc="{html.escape(rendered(page), quote=True)}"></iframe>'
        )


class OfLaw(Protocol):
    """What belongs to one law."""

    @property
    def law(self) -> str:
        """Its name."""


class ByLaw[Result: OfLaw](Found):
    """Results of one identification, one a law."""

    results: tuple[Result, ...]

    @abstractmethod
    def _document_of(self, result: Result) -> dict[str, Any]:
        """Return what ``result.json`` holds of a law."""

    def document(self) -> list[dict[str, Any]]:
        """Return what ``result.json`` holds, one a law."""
        return [self._document_of(result) for result in self.results]

    def __getitem__(self, law: LawName) -> Result:
        """Return a law's result; raises KeyError for one that wasn't identified."""
        found = {result.law: result for result in self.results}
        if law not in found:
            raise KeyError(f"{law!r} was not identified: there is {', '.join(found)}")
        return found[law]

    def _rows(self) -> Iterator[dict[str, Any]]:
        for found in self.document():
            for name, entry in found["parameters"].items():
                yield {"law": found["law"]} | row(name, entry)


def row(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return a parameter's row of a table, of its entry in a document."""
    low, high = entry.get("ci95") or (None, None)
    return {
        "parameter": name,
        "value": entry["value"],
        "low": low,
        "high": high,
        "unit": entry["unit"],
        "identifiability": entry.get("identifiability"),
    }


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
        from legfem.report.render.text import brief
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


@dataclass(frozen=True, eq=False)
class IdentifiedSites(ByLaw["SitesResult"]):
    """What all sites of a leg share, identified from all of them together.

    Of one site, too, where the leg is solved in 3D alone: where its fibres' ratio is asked for, or
    it is pressed by a turned cylinder, a ball or a punch.
    """

    leg: SitedLeg
    results: tuple[SitesResult, ...]
    """One a law; each says in ``sites`` what every site by itself asks for."""

    def summary(self) -> str:
        """Return values, intervals, whether the sites agree, and warnings."""
        from legfem.report.render.text import brief

        return brief(self._page())

    def _document_of(self, result: SitesResult) -> dict[str, Any]:
        from legfem.report.sites_numbers import sites_document

        return sites_document(result)

    def plot(self) -> Figure:
        """Return every site beside the law that fits better, and their differences."""
        from legfem.report.sites_figure import sites_figure
        from legfem.report.web.sites import best_law

        return sites_figure(best_law(self.results))

    def _page(self) -> WebPage:
        from legfem.report.web.sites import sites_web_page

        return sites_web_page(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, report.html and figures; return the report's path."""
        from legfem.report.sites import write_sites_report

        return write_sites_report(self.results, Path(folder))[1]


def identify_together(leg: SitedLeg, asked: IdentifyCall) -> IdentifiedSites:
    """Identify what all sites of a leg share; see `legfem.identify`."""
    from legfem.legs.identification import check_joint, nominal_of
    from legfem.sites.identification import identify_together as together

    in_3d = asked.in_3d
    check_joint(leg, asked.request.settings, asked.correction, in_3d)
    nominal = nominal_of(leg, in_3d)
    request = asked.request_of(nominal)
    laws = asked.laws(request, nominal, leg.sites[0])
    numbers = _solid_settings(asked.mesh) if in_3d else plane_settings(asked.mesh)
    with progress_on(quiet=not asked.progress) as told:
        request = replace(request, progress=told)
        results = together(leg, laws, request, asked.correction, in_3d, settings=numbers)
    return IdentifiedSites(leg, tuple(results))


def _solid_settings(mesh: Mesh | None) -> SolidLegSettings | None:
    from legfem.experiments.leg_3d import SolidLegSettings

    if mesh is None or isinstance(mesh, SolidLegSettings):
        return mesh
    raise wrong_mesh(mesh, "is a section's", "leave it out, or give SolidLegSettings")


@dataclass(frozen=True, eq=False)
class IdentifiedSpecimen(ByLaw["SpecimenResult"]):
    """A tissue's law identified from all recordings of a folder of specimens together."""

    folder: SpecimenFolder
    results: tuple[SpecimenResult, ...]
    """One a law."""

    def summary(self) -> str:
        """Return values, intervals, how well what was left out is predicted, and warnings."""
        from legfem.report.render.text import brief

        return brief(self._page())

    def _document_of(self, result: SpecimenResult) -> dict[str, Any]:
        from legfem.report.specimen_numbers import specimen_document

        return specimen_document(result)

    def plot(self) -> Figure:
        """Return recordings, model and their difference, for each law."""
        from legfem.report.specimen_figure import specimen_figure

        return specimen_figure(self.results)

    def _page(self) -> WebPage:
        from legfem.report.specimens import specimen_web_page

        return specimen_web_page(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt and the figure; return the report's path."""
        from legfem.report.specimen import write_specimen_report

        return write_specimen_report(self.results, Path(folder))


def identify_folder(
    folder: SpecimenFolder,
    law: str | None,
    leave_out: Sequence[str],
    settings: IdentificationSettings | None,
    out: Given | None,
    jobs: int,
    progress: bool,
    parameters: Sequence[Parameter | str] | None,
    fixed: Mapping[str, float] | None,
) -> IdentifiedSpecimen:
    """Identify a tissue's law from a folder of specimens; see `legfem.identify`."""
    from legfem.specimens.identification import identify_specimen
    from legfem.specimens.laws import Asked, laws_named

    names = tuple(
        one if isinstance(one, str) else one.name
        for one in parameters or ()
        if isinstance(one, str) or one.role == "identified"
    )
    given = [one for one in parameters or () if not isinstance(one, str)]
    asked = Asked(
        names,
        {one.name: one.prior for one in given if one.prior is not None},
        {one.name: one.bounds for one in given},
        fixed or {},
    )
    with progress_on(quiet=not progress) as told:
        results = identify_specimen(
            folder, laws_named(law), asked, leave_out, settings, None if out is None else Path(out), jobs, told
        )
    return IdentifiedSpecimen(folder, tuple(results))
