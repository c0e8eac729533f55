"""What the front door returns: the same ways to look at every result."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.api.loading import Given

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from legfem.inverse.fit import Fit
    from legfem.inverse.laws import LawName
    from legfem.inverse.outcome import JointForward
    from legfem.legs.forward import PlaneStrainForward
    from legfem.legs.subject import SitedLeg, Subject
    from legfem.report.web.page import WebPage
    from legfem.specimens.folder import SpecimenFolder


class Result(ABC):
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
        from legfem.report.web.page import rendered

        page = self._page()
        table = self.to_frame().to_html(index=False, na_rep="", float_format="{:.4g}".format)
        return (
            f'{table}<iframe title="{html.escape(page.title, quote=True)}" '
            'sandbox="allow-scripts" style="width: 100%; height: 640px; border: 1px solid #c8c8c8" '
            f'srcdoc="{html.escape(rendered(page), quote=True)}"></iframe>'
        )


@dataclass(frozen=True, eq=False)
class Identification(Result):
    """Stiffness identified from recordings of a leg, of its sites together, or of specimens."""

    given: Subject | SitedLeg | SpecimenFolder
    fits: tuple[Fit[Any], ...]
    """One a law."""
    _section: JointForward[PlaneStrainForward] | None = None
    jobs: int = 1
    """Processes that may draw a report."""

    def __getitem__(self, law: LawName) -> Fit[Any]:
        """A law's fit; raises KeyError for one that wasn't identified."""
        found = {fit.law: fit for fit in self.fits}
        if law not in found:
            raise KeyError(f"{law!r} was not identified: there is {', '.join(found)}")
        return found[law]

    def summary(self) -> str:
        """Values, intervals, which law fits better, whether sites agree, how well the rest is predicted, warnings."""
        from legfem.report.plain import brief

        return brief(self._pressed_page(False))

    def _page(self) -> WebPage:
        return self._pressed_page(True)

    def document(self) -> Any:
        """What ``result.json`` holds, one a law."""
        return [self._document_of(fit) for fit in self.fits]

    def _rows(self) -> Iterator[dict[str, Any]]:
        for fit in self.fits:
            for name, entry in self._document_of(fit)["parameters"].items():
                yield {"law": fit.law} | row(name, entry)

    @property
    def _kind(self) -> str:
        """Which pages show it: ``section`` of a leg with one site, ``sites``, or ``specimens``."""
        from legfem.legs.details import LegDetails, SpatialSites

        details = self.fits[0].details
        if not isinstance(details, LegDetails):
            return "specimens"
        together = len(details.leg.sites) > 1 or isinstance(details.spatial, SpatialSites)
        return "sites" if together else "section"

    @property
    def _shown(self) -> list[Any]:
        """Results as the pages have them."""
        from legfem.identify.result import identification_result
        from legfem.sites.result import sites_result
        from legfem.specimens.result import specimen_result

        made: Any = {"section": identification_result, "sites": sites_result, "specimens": specimen_result}
        return [made[self._kind](fit) for fit in self.fits]

    def _document_of(self, fit: Fit[Any]) -> dict[str, Any]:
        from legfem.identify.document import result_document
        from legfem.report.sites_numbers import sites_document
        from legfem.report.specimen_numbers import specimen_document

        made: Any = {"section": result_document, "sites": sites_document, "specimens": specimen_document}
        document: dict[str, Any] = made[self._kind](self._shown[self.fits.index(fit)])
        return document

    def _pressed_page(self, pressed: bool) -> WebPage:
        from legfem.report.identification import pressed_leg
        from legfem.report.web.identification import identification_page
        from legfem.report.web.sites import sites_web_page
        from legfem.report.web.specimen import specimen_web_page

        shown = self._shown
        if self._kind != "section":
            return (sites_web_page if self._kind == "sites" else specimen_web_page)(shown)
        model = self._section.models[0] if pressed and self._section else None
        film = None if model is None else pressed_leg(shown, model.experiment)
        return identification_page(shown, self.fits[0].details.subject, film)

    def plot(self) -> Figure:
        """Recordings, model and their difference: for each law, or every site beside the law that fits better."""
        from legfem.report.fit_figure import fit_figure
        from legfem.report.sites_figure import sites_figure
        from legfem.report.specimen_figure import specimen_figure
        from legfem.report.web.sites import best_law

        shown = self._shown
        if self._kind == "sites":
            return sites_figure(best_law(shown))
        return (fit_figure if self._kind == "section" else specimen_figure)(shown)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, report.html, figures and fields; return the path of report.txt."""
        from legfem.identify.run import write_results
        from legfem.report.identification import write_identification_report
        from legfem.report.sites import write_sites_report
        from legfem.report.specimen import write_specimen_report
        from legfem.report.web.page import command_line

        shown, folder, command = self._shown, Path(folder), command_line()
        if self._kind == "specimens":
            return write_specimen_report(shown, folder, command)
        if self._kind == "sites":
            return write_sites_report(shown, folder, command)[1]
        write_results(shown, folder, as_list=len(shown) > 1)
        model = None if self._section is None else self._section.models[0].experiment
        subject = self.fits[0].details.subject
        return write_identification_report(shown, subject, model, folder, command, self.jobs)


IdentifiedLeg = IdentifiedSites = IdentifiedSpecimen = Identification
"""Names that the result had when each kind had its own."""


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
