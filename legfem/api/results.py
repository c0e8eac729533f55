"""What the front door returns, of identifications and of diagnoses: the same ways to look at every result."""

import html
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.figure import Figure

from legfem.api.loading import Given
from legfem.common.documents import json_types, write_document
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.inverse import stored
from legfem.inverse.catalogue import LawName
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Fit, KindDetails, preferred
from legfem.inverse.outcome import JointForward
from legfem.inverse.plan import DesignValue
from legfem.inverse.verdict import Diagnosis
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.subject import SitedLeg, Subject
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_curves import recording_figure
from legfem.report.diagnosis_document import Recorded, document, parameter_rows
from legfem.report.folder import keep_another
from legfem.report.kinds import kind_of, page_of
from legfem.report.page import WebPage, command_line
from legfem.report.plan import plan_document
from legfem.report.render import brief, estimates_frame, plain_page, rendered
from legfem.report.results import pressed_section_of, write_diagnosis_report, write_report

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder
    from legfem.specimens.sizes import LeftOut
    from legfem.stockings.leg import StockingLeg


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
    def to_frame(self) -> pd.DataFrame:
        """Return a table, a row a parameter."""

    @abstractmethod
    def _page(self) -> WebPage:
        """Return what ``report.html`` shows."""

    def _repr_html_(self) -> str:
        """Return the parameters and the report's page for a notebook, its curves and leg alive."""
        page = self._page()
        table = self.to_frame().to_html(index=False, na_rep="", float_format="{:.4g}".format)
        return (
            f'{table}<iframe title="{html.escape(page.title, quote=True)}" '
            'sandbox="allow-scripts" style="width: 100%; height: 640px; border: 1px solid #c8c8c8" '
            f'srcdoc="{html.escape(rendered(page), quote=True)}"></iframe>'
        )


def read_result(folder: Given) -> stored.StoredResult:
    """Read back what an identification, a stocking or a diagnosis has written into a folder.

    Parameters
    ----------
    folder : str or Path
        Folder of results, with ``result.json`` or ``diagnosis.json``.

    Returns
    -------
    stored.StoredResult
        With ``answer``, ``laws``, their ``parameters``, ``notices`` and ``tests``.

    Raises
    ------
    InputError
        If there is no such document, or another version of legfem wrote it.

    Examples
    --------
    >>> import legfem as lf
    >>> found = lf.read_result("results/identify-3")
    >>> found.answer.tone, {name: law.parameters for name, law in found.laws.items()}
    """
    return stored.read_result(folder)


@dataclass(frozen=True, eq=False)
class Identification(Result):
    """Stiffness identified from a leg's recordings, of its sites together, from specimens, or from both scans of a leg.

    Of a leg in its stocking also the pressures on the skin and inside.
    """

    given: "Subject | SitedLeg | SpecimenFolder | StockingLeg"
    fits: tuple[Fit[Any], ...]
    """One a law."""
    _section: JointForward[PlaneStrainForward] | None = None

    def __getitem__(self, law: LawName) -> Fit[Any]:
        """A law's fit; raises KeyError for one that wasn't identified."""
        found = {fit.law: fit for fit in self.fits}
        if law not in found:
            raise KeyError(f"{law!r} was not identified: there is {', '.join(found)}")
        return found[law]

    @property
    def best(self) -> Fit[Any]:
        """The fit of the law that the recordings ask for."""
        return preferred(self.fits)

    def summary(self) -> str:
        """Values, intervals, which law fits better, whether sites agree, how well the rest is predicted, warnings."""
        return brief(page_of(self.fits), kind_of(self.fits).told)

    def document(self) -> dict[str, Any]:
        """What ``result.json`` holds; its laws are members."""
        return fit_document(self.fits)

    def plot(self) -> Figure:
        """Recordings, model and their difference, for each law."""
        return kind_of(self.fits).figure(self.fits)

    def write(self, folder: Given, every_rank: bool = False) -> Path:
        """Write result.json, report.txt, report.html, tables, figures and fields; return the path of report.txt.

        Under MPI the first rank writes alone, unless every rank has a leg and a folder of its own.
        """
        return write_report(self.fits, Path(folder), command_line(), self._experiment, every_rank)

    def to_frame(self) -> pd.DataFrame:
        """The parameters: a row each, with law, value, 95 % interval, unit and verdict."""
        return estimates_frame(self.fits)

    @property
    def _experiment(self) -> PlaneStrainIndentation | None:
        """The section of the only site, which a report presses; None of others."""
        only = self._section is not None and len(self._section.models) == 1
        return self._section.models[0].experiment if self._section is not None and only else None

    def _page(self) -> WebPage:
        experiment = self._experiment
        return page_of(self.fits, None if experiment is None else pressed_section_of(self.fits, experiment))


DIAGNOSIS = "diagnosis.json"


@dataclass(frozen=True, eq=False)
class Diagnosed(Result):
    """Where model and recordings of a leg or a specimen differ, and which physics was left out."""

    subject: Recorded
    diagnosis: Diagnosis
    seconds: float
    next_tests: tuple[DesignValue, ...] = ()
    """Tests that would tell what an ambiguous verdict leaves open, the most telling first."""
    left_out: "tuple[LeftOut, ...] | None" = None
    """Recordings of specimens that weren't used."""

    @property
    def verdict(self) -> str:
        """Return ``consistent``, ``named``, ``ambiguous`` or ``unexplained``."""
        return self.diagnosis.verdict

    @property
    def base(self) -> Fit[KindDetails]:
        """Return the base model's fit to all recordings, as an identification's, each recording a test."""
        return self.diagnosis.base

    def summary(self) -> str:
        """Return the report's text."""
        return plain_page(self._page(), [])

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds."""
        content = document(self.diagnosis, self.subject, self.seconds)
        if self.left_out is not None:
            content["recordings_not_used"] = json_types(self.left_out)
        if self.next_tests:
            content["next_experiment_ranked"] = plan_document(self.next_tests, self.subject.id)["tests"]
        return content

    def plot(self) -> Figure:
        """Return the recordings against the model, what it misses, and where."""
        return recording_figure(self.diagnosis, 0, self.subject.title, self.subject.origin)

    def write(self, folder: Given) -> Path:
        """Write diagnosis.json, report.txt, report.html and the figures; return report.txt's path."""
        keep_another(Path(folder), command_line(), DIAGNOSIS)
        write_document(Path(folder) / DIAGNOSIS, self.document())
        return write_diagnosis_report(self.diagnosis, self.subject, Path(folder), self.next_tests, command_line())

    def _page(self) -> WebPage:
        return diagnosis_web_page(self.diagnosis, self.subject, self.next_tests)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters: a row each, with value, 95 % interval and unit."""
        return pd.DataFrame(list(parameter_rows(self.diagnosis)))
