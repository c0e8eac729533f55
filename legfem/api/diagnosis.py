"""Where model and recordings differ and which physics was left out; which tests of a leg would show which effects."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pandas as pd
from matplotlib.figure import Figure
from pydantic import Field

from legfem.api import loading
from legfem.api.results import Diagnosed, Result
from legfem.common.documents import write_document
from legfem.common.errors import Doubt, log_doubts
from legfem.common.progress import NEVER, Deadline, progress_on
from legfem.common.units import kpa_to_mpa
from legfem.inverse.correction import read_correction
from legfem.inverse.parse_parameters import deep_prior
from legfem.inverse.plan import DesignValue
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import library_folder
from legfem.legs.loading import load_subject
from legfem.legs.plan import Expected, MusclesTold, plan_after, plan_before
from legfem.legs.plausibility import doubts_about, room_before
from legfem.legs.schema import SUBJECTS, site_names
from legfem.legs.subject import SitedLeg, Subject
from legfem.report.diagnosis_document import versions
from legfem.report.folder import NUMBERS, REPORT, ReportFile, keep_another, made_in_place
from legfem.report.page import WebPage, command_line
from legfem.report.plan import RANKED, SHOWN, plan_document, plan_web_page
from legfem.report.render import brief, write_page

if TYPE_CHECKING:
    from legfem.api.specimens import DiagnosedFolder
    from legfem.specimens.folder import SpecimenFolder


@loading.checked
def diagnose(
    leg: "Subject | SitedLeg | SpecimenFolder | loading.Given",
    *,
    library: loading.Folder | None = None,
    correction: loading.Folder | None = None,
    seed: loading.Seed = 0,
    out: loading.Folder | None = None,
    jobs: loading.Jobs = 1,
    progress: bool = False,
    specimens: loading.Texts = (),
    site: str = "",
    prior: loading.Texts = (),
    within: str | Deadline | None = None,
) -> "Diagnosed | DiagnosedFolder":
    """Say where model and recordings differ, which physics was left out, and what adding it does.

    The first diagnosis of a leg solves its library of responses, which takes a minute or some. After an ambiguous
    verdict tests that would settle it are ranked.

    Parameters
    ----------
    leg : Subject, SitedLeg, SpecimenFolder, str or Path
        What `load_subject`, `load_sites` or `load_specimen` returned; or a leg's id or folder.
    library : str or Path, optional
        Folder of the legs' responses; ``~/.cache/legfem/responses`` without it.
    correction : str or Path, optional
        File of the 3D correction behind ``end-effects``; that of legfem without it.
    seed : int
        Seed of the draws behind p-values.
    out : str or Path, optional
        Folder into which specimens' reports are written as each is diagnosed; `write` then has nothing left to do.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    specimens : sequence of str
        Names of those to diagnose, of a folder of specimens; all without any.
    site : str
        Name of the one to take, of a leg with several ``[[site]]``.
    prior : sequence of str
        What is known of the leg's C10 beforehand, as of `legfem.identify`: ``"deep.C10=cohort/population.json"``.
    within : str or Deadline
        Time after which nothing more is solved of a leg, such as ``"30s"``: the answer is provisional, and says how
        many effects were weighed. A later call goes on from there. The base model alone is solved in any case.

    Returns
    -------
    Diagnosed or DiagnosedFolder
        With ``verdict`` (or ``verdicts`` by specimen), ``summary()``, ``plot()``, ``to_frame()``,
        ``document()``, ``write(folder)``.

    Examples
    --------
    >>> import legfem as lf
    >>> found = lf.diagnose("3", within="60s")  # or lf.load_specimen(folder)
    >>> found.verdict
    >>> print(found.summary())
    """
    responses = library_folder() if library is None else Path(library)
    loading.check_folder("library", responses)
    if loading.are_specimens(leg):
        from legfem.api.specimens import diagnose_folder
        from legfem.specimens.diagnosis import SpecimenDiagnoser

        of_legs = {"site": site != "", "correction": correction is not None, "prior": bool(prior)}
        loading.check_unused("specimens", {**of_legs, "within": bool(within)})
        with progress_on(quiet=not progress) as shown:
            asked = SpecimenDiagnoser(responses, jobs, shown, seed)
            return diagnose_folder(asked, leg, specimens or (), None if out is None else Path(out))
    loading.check_unused("a leg", {"specimens": bool(specimens)})
    subject = loading.one_of(leg, site)
    if prior:
        subject = replace(subject, stiffness_prior=deep_prior(prior, subject.people))
    started = time.perf_counter()
    deadline = within if isinstance(within, Deadline) else Deadline.after(loading.seconds_of("within", within))
    ends = read_correction(REFERENCE if correction is None else Path(correction))
    diagnoser = Diagnoser(responses, ends, jobs, deadline)
    with progress_on(quiet=not progress) as shown:
        found = diagnoser.diagnose(subject, shown, seed)
        ranked = [] if deadline != NEVER else plan_after(found, subject, diagnoser, shown)
    return Diagnosed(subject, found, time.perf_counter() - started, tuple(ranked))


PLAN = "plan.json"


@dataclass(frozen=True, eq=False)
class PlannedTests(Result):
    """Tests of a leg, the most informative first."""

    subject: Subject
    expected: Expected
    """Stiffness and test that the plan is made for."""
    ranked: tuple[DesignValue, ...]
    doubts: tuple[Doubt, ...] = ()
    muscles: tuple[MusclesTold, ...] = ()
    """How well tests tell muscles that the leg has by name; none without such."""

    def summary(self) -> str:
        """Tests by their chances, and what each would show."""
        return brief(self._page(), (RANKED, SHOWN))

    def document(self) -> dict[str, Any]:
        """What ``plan.json`` holds."""
        return plan_document(self.ranked, self.subject.id, self.muscles)

    def plot(self) -> Figure:
        """Chance of every test to detect an effect of usual strength."""
        figure = Figure(figsize=(6.0, 0.6 + 0.4 * len(self.ranked)), layout="constrained")
        axes = figure.subplots()
        axes.barh([one.design.name for one in self.ranked], [100 * one.chance for one in self.ranked])
        axes.invert_yaxis()
        axes.set(xlim=(0, 100), xlabel="chance to distinguish effects (%), simulated")
        return figure

    def write(self, folder: loading.Given) -> Path:
        """Write plan.json, report.txt, report.html and tables; return the path of report.txt."""
        out = Path(folder)
        keep_another(out, command_line(), PLAN)
        path = write_document(out / PLAN, self.document())
        with made_in_place(out) as hidden:
            write_page(self._page(), hidden, "what each test would show", [ReportFile([path], NUMBERS)])
        return out / REPORT

    def _page(self) -> WebPage:
        given = self.subject, self.expected, self.doubts, versions(), command_line()
        return plan_web_page(self.ranked, *given, self.muscles)

    def to_frame(self) -> pd.DataFrame:
        """Return the chance of every test to tell an effect from another: a row each."""
        return pd.DataFrame(
            {"test": one.design.name, "effect": effect, "against": other, "chance": chance}
            for one in self.ranked
            for (effect, other), chance in one.chances.items()
        )


type ExpectedC10 = Annotated[float, Field(ge=0.05, le=50.0), loading.Wanted("give 0.05 to 50 kPa")]
type ExpectedC20 = Annotated[float, Field(ge=0.0, le=50.0), loading.Wanted("give 0 to 50 kPa")]
type PlannedDepth = Annotated[float, Field(ge=5.0, le=200.0), loading.Wanted("give 5 to 200 mm")]
type PlannedRate = Annotated[float, Field(ge=0.01, le=50.0), loading.Wanted("give 0.01 to 50 mm/s")]


@loading.checked
def plan(
    leg: "Subject | loading.Given",
    *,
    c10: ExpectedC10 = 0.8,
    c20: ExpectedC20 = 0.0,
    depth: PlannedDepth = 20.0,
    rate: PlannedRate = 0.5,
    library: loading.Folder | None = None,
    jobs: loading.Jobs = 1,
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

    Examples
    --------
    >>> import legfem as lf
    >>> tests = lf.plan("3", c10=0.7, depth=25.0)
    >>> print(tests.summary())  # which test shows which effect, the best first
    """
    folder = library_folder() if library is None else Path(library)
    loading.check_folder("library", folder)
    subject = leg
    if isinstance(subject, str | Path):
        subject = load_subject(
            loading.folder_of(subject, SUBJECTS), need_recordings=False, need_instrument=False, site=site
        )
    elif not isinstance(subject, Subject):
        raise loading.not_a_leg(subject, "is indented", "load_subject")
    if depth >= (room := room_before(subject)):
        raise loading.wrong("depth", f"{depth:g} mm", f"the leg leaves the cylinder {room:.0f} mm", "give less")
    doubts = tuple(doubts_about(subject))
    log_doubts(doubts)
    expected = Expected(kpa_to_mpa(c10), kpa_to_mpa(c20), depth, rate)
    diagnoser = Diagnoser(folder, read_correction(REFERENCE), jobs)
    sites = site_names(subject.directory / SUBJECTS.file) if subject.section.muscles and subject.site else ()
    others = [load_subject(subject.directory, False, False, name) for name in sites if name != subject.site]
    with progress_on(quiet=not progress) as told:
        ranked, muscles = plan_before(subject, others, diagnoser, expected, told)
    return PlannedTests(subject, expected, tuple(ranked), doubts, tuple(muscles))
