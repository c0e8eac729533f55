"""Which tests of a leg would show which effects, before any is made."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from legfem.api.arguments import check_finite, check_folder, check_whole, wrong
from legfem.api.loading import Given, folder_of
from legfem.api.results import Result
from legfem.common.documents import write_document
from legfem.common.errors import Doubt, log_doubts
from legfem.common.progress import progress_on
from legfem.inverse.plan import DesignValue
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject
from legfem.legs.plan import Expected, plan_before
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.legs.variants import library_folder
from legfem.report.diagnosis_document import versions
from legfem.report.folder import NUMBERS, REPORT, ReportFile, keep_another, made_in_place
from legfem.report.page import WebPage, command_line
from legfem.report.plan import RANKED, SHOWN, plan_document, plan_web_page
from legfem.report.render.text import brief
from legfem.report.write import write_page

PLAN = "plan.json"


@dataclass(frozen=True, eq=False)
class PlannedTests(Result):
    """Tests of a leg, the most informative first."""

    subject: Subject
    expected: Expected
    """Stiffness and test that the plan is made for."""
    ranked: tuple[DesignValue, ...]
    doubts: tuple[Doubt, ...] = ()

    def summary(self) -> str:
        """Tests by their chances, and what each would show."""
        return brief(self._page(), (RANKED, SHOWN))

    def document(self) -> dict[str, Any]:
        """What ``plan.json`` holds."""
        return plan_document(self.ranked, self.subject.id)

    def plot(self) -> Figure:
        """Chance of every test to detect an effect of usual strength."""
        figure = Figure(figsize=(6.0, 0.6 + 0.4 * len(self.ranked)), layout="constrained")
        axes = figure.subplots()
        axes.barh([one.design.name for one in self.ranked], [100 * one.chance for one in self.ranked])
        axes.invert_yaxis()
        axes.set(xlim=(0, 100), xlabel="chance to distinguish effects (%), simulated")
        return figure

    def write(self, folder: Given) -> Path:
        """Write plan.json, report.txt, report.html and tables; return the path of report.txt."""
        out = Path(folder)
        keep_another(out, command_line(), PLAN)
        path = write_document(out / PLAN, self.document())
        with made_in_place(out) as hidden:
            write_page(self._page(), hidden, "what each test would show", [ReportFile([path], NUMBERS)])
        return out / REPORT

    def _page(self) -> WebPage:
        return plan_web_page(self.ranked, self.subject, self.expected, self.doubts, versions(), command_line())

    def _rows(self) -> Iterator[dict[str, Any]]:
        for one in self.ranked:
            for (effect, other), chance in one.chances.items():
                yield {"test": one.design.name, "effect": effect, "against": other, "chance": chance}


def plan(
    leg: Subject | Given,
    *,
    c10: float = 0.8,
    c20: float = 0.0,
    depth: float = 20.0,
    rate: float = 0.5,
    library: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    site: str = "",
) -> PlannedTests:
    """Say before any test which tests of a leg would show which effects, and how probably.

    The leg's responses to all tests are solved once, in some minutes.

    Parameters
    ----------
    leg : Subject, str or Path
        The leg, its id or folder; recordings aren't needed.
    c10, c20 : float
        Expected stiffness of the deep tissue, kPa.
    depth, rate : float
        Greatest displacement (mm) and its rate (mm/s) in the test that is meant.
    library : str or Path, optional
        Folder of the legs' responses, shared with diagnoses; ``~/.cache/legfem/responses`` without it.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    site : str
        The one to take, of a leg with several ``[[site]]``.

    Returns
    -------
    PlannedTests
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``.
    """
    for name, value, unit in (("c10", c10, "kPa"), ("c20", c20, "kPa"), ("depth", depth, "mm"), ("rate", rate, "mm/s")):
        check_finite(name, value, unit)
    check_whole("jobs", jobs, 1)
    folder = library_folder() if library is None else Path(library)
    check_folder("library", folder)
    subject = leg
    if isinstance(subject, str | Path):
        subject = load_subject(folder_of(subject, SUBJECTS), need_recordings=False, need_instrument=False, site=site)
    elif not isinstance(subject, Subject):
        raise wrong("leg", type(subject).__name__, "is no leg that is indented", "give an id, a folder or a Subject")
    doubts = tuple(doubts_about(subject))
    log_doubts(doubts)
    expected = Expected(c10, c20, depth, rate)
    diagnoser = Diagnoser(folder, read_correction(REFERENCE), jobs)
    with progress_on(quiet=not progress) as told:
        return PlannedTests(subject, expected, tuple(plan_before(subject, diagnoser, expected, told)), doubts)
