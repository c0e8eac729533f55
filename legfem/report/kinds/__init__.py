"""What each kind of problem shows of its fits, one a file."""

import sys
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from matplotlib.figure import Figure
from mpi4py import MPI

from legfem.common.registry import made_in, registered
from legfem.inverse.document import KindDocument
from legfem.inverse.fit import Fit
from legfem.report.folder import ReportFile
from legfem.report.page import TESTED, PressedSection, WebPage


class ReportKind(ABC):
    """What a kind of problem has of its own to show.

    Attributes
    ----------
    kind : str
        Of its fits.
    document : KindDocument
        What it adds to result.json.
    explore : str
        What there is to explore on the page for a browser, in words.
    told : tuple of str
        Chapters of the page that a summary has.
    """

    kind: ClassVar[str]
    document: ClassVar[KindDocument]
    explore: ClassVar[str] = "curves"
    told: ClassVar[tuple[str, ...]] = (TESTED,)

    @abstractmethod
    def page(
        self, fits: Sequence[Fit[Any]], pressed: PressedSection | None = None, command: str = "", note: str = ""
    ) -> WebPage:
        """Return the page of fits, with the section pressed, the command, and a note on the solve that pressed it."""

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
        found: ReportKind = made_in(import_module(f"{__name__}.{kind}"), ReportKind)[0]
        return found
    return next(one for one in registered(sys.modules[__name__], ReportKind, "legfem.reports") if one.kind == kind)


def kind_of(fits: Sequence[Fit[Any]]) -> ReportKind:
    """Return how fits are shown, by their kind: a file here is called as its kind is, and the others aren't loaded."""
    return _named(fits[0].kind)
