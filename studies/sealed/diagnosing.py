"""One diagnosis of a sealed recording with some of its channels, and what it says beside the truth."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from legfem.common.progress import Progress, Silent
from legfem.common.units import mpa_to_kpa
from legfem.data import Recording
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.library import Library
from legfem.inverse.verdict import Diagnosis
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import choose_correction
from legfem.legs.diagnosis import Diagnoser, accuracy_of, diagnose_body, ruled_out_of, with_correction
from legfem.legs.mechanisms import mechanisms
from legfem.legs.occurrence import OCCURRENCES
from legfem.legs.subject import Subject
from legfem.report.diagnosis_headline import headline
from studies.concealed.cases import SealedCase, sealed_leg
from studies.concealed.truth import Truths
from studies.lab.recording import INSTRUMENT
from studies.sealed.cases import PROGRAMMES, SUBSETS, true_sights, truths_of
from studies.sealed.instruments import recorded

WRONG = 0.15
"""Of C10: a "yes" beside a value that is further off is what may not be."""
SURE = 0.8


@dataclass(frozen=True)
class Said:
    """What one diagnosis said of a case; kPa."""

    case: int
    kind: str
    concealed: str
    """What was, in words."""
    subset: str
    truth: list[str]
    verdict: str
    listed: list[list[str]]
    """Mechanisms of the explanations that are listed, the first first."""
    probability: float
    """Of the first statement, ..."""
    stated: list[str]
    """... its mechanisms, none where nothing shows or something unknown does, ..."""
    unknown: bool
    """... and whether something unknown is said to be there, by itself, beside a name, or in a part set aside."""
    may_hide: list[str]
    """Mechanisms that are said to be possible unseen, and would move C10."""
    answer: str
    c10: float
    interval: tuple[float, float]
    true_c10: float
    seconds: float

    @property
    def first(self) -> list[str]:
        """Mechanisms of the first explanation."""
        return self.listed[0] if self.listed else []

    @property
    def right(self) -> bool:
        """Whether the first thing said is the truth: nothing, the effects, or something unknown."""
        if self.kind == "none":
            return self.verdict == "consistent"
        if not self.truth:
            return self.unknown
        return self.verdict in ("named", "ambiguous") and set(self.first) == set(self.truth)

    @property
    def in_list(self) -> bool:
        """Whether the truth is among what is listed."""
        return self.right or any(set(names) == set(self.truth) for names in self.listed)

    @property
    def wrong(self) -> bool:
        """Whether the first name is of nothing that is there."""
        return bool(self.first) and not set(self.first) & set(self.truth)

    @property
    def told(self) -> bool:
        """Whether a cause is named or listed, if only one of two, said to be unknown, or said to be possible unseen."""
        names = {name for one in self.listed for name in one} | set(self.may_hide)
        return self.unknown or bool(names & set(self.truth))

    @property
    def sure(self) -> bool | None:
        """Whether what is said with `SURE` or more is right; None where nothing is, or where it is that nothing shows."""
        if self.probability < SURE or (self.verdict == "consistent" and self.kind != "none"):
            return None
        if self.verdict == "consistent":
            return True
        if self.verdict == "unexplained":
            return not self.truth or self.kind == "outside"
        return bool(self.stated) and set(self.stated) <= set(self.truth)

    @property
    def holds(self) -> bool:
        """Whether C10's interval holds the truth."""
        return self.interval[0] <= self.true_c10 <= self.interval[1]

    @property
    def wrong_yes(self) -> bool:
        """Whether it says yes beside a C10 that is more than `WRONG` off."""
        return self.answer.startswith("Yes") and abs(self.c10 / self.true_c10 - 1.0) > WRONG

    @property
    def half_width(self) -> float:
        """Of C10's interval, over the truth."""
        return 0.5 * (self.interval[1] - self.interval[0]) / self.true_c10


def say(found: Diagnosis, case: SealedCase, subset: str, seconds: float) -> Said:
    """Return what a diagnosis says, beside the truth."""
    first = found.explained.statements()[0]
    low, high = found.shown_interval(DEEP_C10)
    named = found.models and found.models[0].in_part
    return Said(
        case.number,
        case.kind,
        "+".join(name for name, _ in (*case.effects, *case.outside)) or "nothing",
        subset,
        list(truths_of(case)),
        found.verdict,
        [list(model.names) for model in found.models],
        first.probability,
        list(first.names),
        found.verdict == "unexplained" or bool(named) or found.aside is not None,
        sorted({limit.name for limit, _ in found.hidden}),
        headline(found, ()).heading,
        mpa_to_kpa(found.best.value(DEEP_C10)),
        (low, high),
        case.true_c10_kpa,
        seconds,
    )


@dataclass(eq=False)
class Lab:
    """Records cases, and diagnoses them by a leg's library alone.

    Parameters
    ----------
    folder
        Of solutions.
    correction
        Of a cylinder's ends.
    seed
        Of legs and errors.
    """

    folder: Path
    correction: TabulatedCorrection
    seed: int
    _libraries: dict[tuple[int, str], Library] = field(default_factory=dict, repr=False)
    _truths: dict[int, Truths] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave libraries and models out: every process has its own."""
        return {**self.__dict__, "_libraries": {}, "_truths": {}}

    def recordings(self, case: SealedCase, programme: str) -> list[Recording] | None:
        """Return a case's recordings with all channels; None where a solution stopped."""
        if case.leg not in self._truths:
            true, sights = sealed_leg(case.leg, self.seed).true, true_sights(case.leg, self.seed)
            self._truths = {case.leg: Truths(true, self.folder / "truth", self.correction, sights)}
        truth = self._truths[case.leg].of(case, PROGRAMMES[programme])
        return None if truth is None else recorded(case, self.seed, truth.trials)

    def stated(self, case: SealedCase, recordings: Sequence[Recording]) -> Subject:
        """Return the leg as the lab states it."""
        return replace(
            sealed_leg(case.leg, self.seed).stated,
            recordings=tuple(recordings),
            instrument=INSTRUMENT,
            starts_at_contact=False,
            plane_strain=True,
            plane_strain_stated=True,
        )

    def library(
        self, case: SealedCase, programme: str, recordings: Sequence[Recording], jobs: int = 1, progress: Progress | None = None
    ) -> Library:
        """Return a leg's library for a programme, as the first recordings of it have it made."""
        key = case.leg, programme
        if key not in self._libraries:
            subject, diagnoser = self.stated(case, recordings), Diagnoser(self.folder, self.correction, jobs)
            observed = diagnoser.observations(subject)
            self._libraries[key] = diagnoser.library(subject, observed, progress or Silent())[0]
        return self._libraries[key]

    def diagnose(self, case: SealedCase, recordings: Sequence[Recording], names: Sequence[str], library: Library) -> Diagnosis:
        """Diagnose recordings with some of their channels."""
        kept = [replace(r, channels=tuple(c for c in r.channels if c.name in names)) for r in recordings]
        subject = self.stated(case, kept)
        observed = Diagnoser(self.folder, self.correction).observations(subject).with_channels(library.beside.names)
        ends = choose_correction("auto", subject)
        return diagnose_body(
            observed,
            INSTRUMENT,
            subject.tissues["deep"].law,
            library.seeing([course for one in observed.channels for course in one.courses]),
            None,
            Silent(),
            accuracy_of(subject),
            ends,
            0,
            ruled_out_of(subject, ends),
            with_correction(mechanisms(), self.correction),
            OCCURRENCES,
        )

    def said(self, case: SealedCase, subset: str, recordings: Sequence[Recording], library: Library) -> Said:
        """Return what a diagnosis of some of a recording's channels says."""
        begun = time.process_time()
        found = self.diagnose(case, recordings, SUBSETS[subset][1], library)
        return say(found, case, subset, time.process_time() - begun)
