"""What each kind of problem shows of its fits, one a file."""

import sys
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from matplotlib.figure import Figure
from mpi4py import MPI

from legfem.common.registry import made_in, registered
from legfem.inverse.claims import check_fits
from legfem.inverse.fit import Fit
from legfem.report.answers import headline_of, sentences_of
from legfem.report.folder import ReportFile
from legfem.report.page import TESTED, Chapter, Known, PressedSection, Repeat, WebPage
from legfem.report.words import DataKind


class ReportKind(ABC):
    """What a kind of problem has of its own to show.

    Attributes
    ----------
    kind : str
        Of its fits.
    explore : str
        What there is to explore on the page for a browser, in words.
    told : tuple of str
        Chapters of the page that a summary has.
    seeded : bool
        Whether draws have a part in the result, which hangs on the seed.
    simulated : DataKind, optional
        What kind of data simulated ones are, where the origin's words don't say it.
    """

    kind: ClassVar[str]
    explore: ClassVar[str] = "curves"
    told: ClassVar[tuple[str, ...]] = (TESTED,)
    seeded: ClassVar[bool] = True
    simulated: ClassVar[DataKind | None] = None

    @abstractmethod
    def question(self, chosen: Fit[Any]) -> str:
        """Return the question that the page of the law that the data ask for answers: its title."""

    @abstractmethod
    def answers(self, chosen: Fit[Any]) -> list[tuple[str, str]]:
        """Return further questions of someone who knows no statistics, each with its answer."""

    @abstractmethod
    def known(self, fits: Sequence[Fit[Any]]) -> Iterable[Known]:
        """Return the numbers in the result, or that it depends on, and where each comes from."""

    @abstractmethod
    def chapters(self, fits: Sequence[Fit[Any]], pressed: PressedSection | None, note: str) -> Iterable[Chapter]:
        """Return the chapters."""

    @abstractmethod
    def figure(self, fits: Sequence[Fit[Any]]) -> Figure:
        """Return the figure that shows most."""

    @abstractmethod
    def files(self, fits: Sequence[Fit[Any]], folder: Path) -> list[ReportFile]:
        """Write the figures into a folder."""

    def comm(self, fits: Sequence[Fit[Any]]) -> MPI.Intracomm:
        """Return the ranks that hold the fits' model, all of which write its fields."""
        return MPI.COMM_SELF

    def fields(self, fits: Sequence[Fit[Any]], folder: Path) -> list[ReportFile]:
        """Write fields of the fits' own solution into a folder; none where there is nothing to write."""
        return []


@cache
def _named(kind: str) -> ReportKind:
    if find_spec(f"{__name__}.{kind}"):
        return next(one for one in made_in(import_module(f"{__name__}.{kind}"), ReportKind) if one.kind == kind)
    return next(one for one in registered(sys.modules[__name__], ReportKind, "legfem.reports") if one.kind == kind)


def kind_of(fits: Sequence[Fit[Any]]) -> ReportKind:
    """Return how fits are shown, by their kind: a file here is called as its kind is, and the others aren't loaded."""
    return _named(fits[0].kind)


def page_of(
    fits: Sequence[Fit[Any]], pressed: PressedSection | None = None, command: str = "", note: str = ""
) -> WebPage:
    """Return the page of fits.

    Parameters
    ----------
    fits
        One a law, of one problem.
    pressed
        The section of a leg's only site, to be pressed; as it is unpressed without it.
    command
        That was given; empty where there was none.
    note
        On the solve that pressed it.
    """
    check_fits(fits)
    kind = kind_of(fits)
    chosen = fits[0].details.chosen(fits)
    return WebPage(
        kind.question(chosen),
        chosen.subject.title,
        chosen.subject.origin,
        headline_of(chosen.answer, kind.answers(chosen)),
        sentences_of((chosen, *fits)),
        list(kind.known(fits)),
        list(kind.chapters(fits, pressed, note)),
        Repeat(
            command, chosen.versions, {"seed": f"{chosen.log.seed}"} if kind.seeded else {}, chosen.subject.directory
        ),
        kind.simulated if chosen.subject.origin == "simulated" else None,
    )
