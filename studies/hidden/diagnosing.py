"""What a diagnosis says of the cases, each kept as soon as it is done, and counted by kind."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from legfem.common.progress import Progress, Silent
from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.verdict import Diagnosis
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.diagnosis import Diagnoser
from legfem.report.diagnosis_sentences import headline
from studies.hidden.cases import KINDS, HiddenCase, Recorder
from studies.lab.outcomes import Rate, said_line

MODULES = ("legfem.legs.diagnosis", "legfem.report.diagnosis_sentences", "studies.hidden.diagnosing")
WRONG = 0.15
"""Of C10: a "yes" beside a value that is further off is what may not be."""
type Called = Literal["named", "listed", "unknown", "may hide", "missed"]


@dataclass(frozen=True)
class HiddenOutcome:
    """What was said of a case; kPa."""

    case: HiddenCase
    verdict: str
    models: tuple[tuple[str, ...], ...]
    probabilities: tuple[float, ...]
    answer: str
    """To the page's title."""
    called: Called
    """What became of the true cause; of two, of either."""
    c10: float
    interval: tuple[float, float]
    solutions: int
    seconds: float
    """Of a processor, the library's solutions left out where they were kept."""

    @property
    def wrong_yes(self) -> bool:
        """Whether it says yes beside a C10 that is more than `WRONG` off."""
        return self.answer.startswith("Yes") and abs(self.c10 / self.case.true_c10 - 1.0) > WRONG

    @property
    def covered(self) -> bool:
        """Whether C10's 95 % interval holds the truth."""
        return self.interval[0] <= self.case.true_c10 <= self.interval[1]

    @property
    def half_width(self) -> float:
        """Of the interval, over the value."""
        return 0.5 * (self.interval[1] - self.interval[0]) / self.c10


@dataclass(eq=False)
class HiddenDiagnoser:
    """Diagnoses cases.

    Parameters
    ----------
    recorder
        Of the cases.
    diagnoser
        With its libraries.
    """

    recorder: Recorder
    diagnoser: Diagnoser

    def outcome(self, case: HiddenCase) -> HiddenOutcome | None:
        """Return what is said of a case; None where the other code stopped."""
        subject = self.recorder.subject(case)
        if subject is None:
            return None
        begun = time.process_time()
        found = self.diagnoser.diagnose(subject, Silent(), 0)
        return HiddenOutcome(
            case,
            found.verdict,
            tuple(tuple(model.names) for model in found.models),
            tuple(model.probability for model in found.models),
            headline(found, ()).heading,
            _called(found, KINDS[case.kind].names),
            mpa_to_kpa(found.best.value(DEEP_C10)),
            found.shown_interval(DEEP_C10),
            found.solutions,
            time.process_time() - begun,
        )


def _called(found: Diagnosis, true: Sequence[str]) -> Called:
    """Return what became of the true names, of none where nothing is concealed."""
    if found.verdict == "unexplained":
        return "unknown"
    if found.verdict == "consistent":
        return "may hide" if any(limit.name in true for limit, _ in found.hidden) else "missed"
    if not any(set(model.names) & set(true) for model in found.models):
        return "missed"
    return "named" if found.verdict == "named" else "listed"


def diagnose(cases: Sequence[HiddenCase], diagnoser: HiddenDiagnoser, out: Path, jobs: int, progress: Progress) -> None:
    """Diagnose the cases that aren't kept yet."""
    with Workers(_outcome, diagnoser, jobs) as workers:
        finish(workers, cases, store_of(out), progress, "recordings with what hides", _line)


def store_of(out: Path) -> Store[HiddenOutcome | None]:
    """Return where outcomes are kept."""
    return Store(out / "kept", HiddenOutcome | None, "hidden", MODULES)  # type: ignore[arg-type]


def _outcome(diagnoser: HiddenDiagnoser, case: HiddenCase) -> HiddenOutcome | None:
    return diagnoser.outcome(case)


def _line(case: HiddenCase, found: HiddenOutcome | None) -> str:
    if found is None:
        return f"{case.name}: the other code stopped"
    held = "" if found.covered else " OUTSIDE"
    low, high = found.interval
    numbers = f"C10 {found.c10:.3f} ({low:.3f} to {high:.3f}{held}), true {case.true_c10:.3f}"
    said = said_line(case.name, f"{found.answer} {found.verdict}", found.models, found.seconds)
    return f"{said} {numbers}; cause {found.called}"


def page(found: Sequence[HiddenOutcome]) -> str:
    """Return what is counted of the cases by kind, and their table."""
    lines = [
        f'| kind | C10\'s interval holds the truth | "yes" beside a C10 over {100 * WRONG:.0f} % off | '
        "cause named, listed, unknown, may hide | half-width, median |",
        "|---|---|---|---|---|",
    ]
    effects = [one for one in found if one.case.kind != "none"]
    for kind, mine in [
        *((kind, [one for one in found if one.case.kind == kind]) for kind in KINDS),
        ("all with an effect", effects),
        ("all", list(found)),
    ]:
        if mine:
            lines.append(_row(kind, mine))
    sure = [one for one in effects if one.models and max(one.probabilities) >= _SURE]
    right = sum(bool(set(one.models[0]) & set(KINDS[one.case.kind].names)) for one in sure)
    lines += ["", f"Said first with {_SURE:g} or more, and right: {Rate(right, len(sure))}", ""]
    lines += ["| case | answer | named | C10 (kPa) | interval | true |", "|---|---|---|---|---|---|"]
    for one in found:
        names = " or ".join("+".join(names) for names in one.models) or one.verdict
        low, high = one.interval
        held = "" if one.covered else " **outside**"
        numbers = f"{one.c10:.2f} | {low:.2f} to {high:.2f}{held} | {one.case.true_c10:.2f}"
        lines.append(f"| {one.case.name} | {one.answer} | {names} | {numbers} |")
    return "\n".join(lines) + "\n"


_SURE = 0.8


def _row(kind: str, mine: Sequence[HiddenOutcome]) -> str:
    covered, wrong = sum(one.covered for one in mine), sum(one.wrong_yes for one in mine)
    called = "-"
    if kind not in ("none", "all"):
        ways: tuple[Called, ...] = ("named", "listed", "unknown", "may hide")
        each = [sum(one.called == way for one in mine) for way in ways]
        called = f"{', '.join(map(str, each))}: {Rate(sum(each), len(mine))}"
    half = 100 * float(np.median([one.half_width for one in mine]))
    return f"| {kind} | {Rate(covered, len(mine))} | {wrong}/{len(mine)} | {called} | {half:.0f} % |"
