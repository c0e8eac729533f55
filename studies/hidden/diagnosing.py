"""What a diagnosis says of the cases, each kept as soon as it is done, and counted."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.progress import Progress, Silent
from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.diagnosis import Diagnoser
from legfem.report.diagnosis_headline import headline
from studies.hidden.cases import HiddenCase, Recorder
from studies.lab.outcomes import Rate, said_line

MODULES = ("legfem.legs.diagnosis", "legfem.report.diagnosis_headline", "studies.hidden.diagnosing")
WRONG = 0.15
"""Of C10: a "yes" beside a value that is further off is what may not be."""


@dataclass(frozen=True)
class HiddenOutcome:
    """What was said of a case; kPa."""

    case: HiddenCase
    verdict: str
    models: tuple[tuple[str, ...], ...]
    answer: str
    """To the page's title."""
    c10: float
    interval: tuple[float, float]
    lump_open: bool
    """Whether a lump's limit is open."""
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
            headline(found, ()).heading,
            mpa_to_kpa(found.best.value(DEEP_C10)),
            found.shown_interval(DEEP_C10),
            any(getattr(limit, "open", False) for limit in found.limits if limit.name == "uneven-muscle"),
            found.solutions,
            time.process_time() - begun,
        )


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
    return said_line(case.name, f"{found.answer} {found.verdict}", found.models, found.seconds)


def page(found: Sequence[HiddenOutcome]) -> str:
    """Return the table of the cases, and what is counted of them."""
    nulls = [one for one in found if one.case.effect == "none"]
    effects = [one for one in found if one.case.effect != "none"]
    lines = [
        "| | |",
        "|---|---|",
        f"| a yes beside a C10 over {100 * WRONG:.0f} % off | {Rate(sum(o.wrong_yes for o in found), len(found))} |",
        f"| C10's interval holds the truth, with an effect | {Rate(sum(o.covered for o in effects), len(effects))} |",
        f"| the same without | {Rate(sum(o.covered for o in nulls), len(nulls))} |",
    ]
    for programme in ("loading", "holds"):
        mine = [one for one in nulls if one.case.programme == programme]
        if mine:
            yes = sum(one.answer.startswith("Yes") for one in mine)
            half = float(np.median([one.half_width for one in mine]))
            lines.append(
                f"| {programme}, nulls: half-width of C10, median; yes | {100 * half:.0f} %; {yes}/{len(mine)} |"
            )
    lines += ["", "| case | answer | named | C10 (kPa) | interval | true |", "|---|---|---|---|---|---|"]
    for one in found:
        names = " or ".join("+".join(names) for names in one.models) or one.verdict
        low, high = one.interval
        held = "" if one.covered else " **outside**"
        numbers = f"{one.c10:.2f} | {low:.2f} to {high:.2f}{held} | {one.case.true_c10:g}"
        lines.append(f"| {one.case.name} | {one.answer} | {names} | {numbers} |")
    return "\n".join(lines) + "\n"
