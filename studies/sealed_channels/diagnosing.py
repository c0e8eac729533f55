"""One diagnosis of a sealed recording with some of its channels, and what it says beside the truth."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from legfem.common.progress import Silent
from legfem.data import Recording, segment_all
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.library import Library
from legfem.inverse.observations import observe
from legfem.inverse.verdict import Diagnosis
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import choose_correction
from legfem.legs.diagnosis import accuracy_of, diagnose_body, ruled_out_of, with_correction
from legfem.legs.mechanisms import mechanisms
from legfem.legs.subject import Subject
from studies.concealed.cases import SealedCase, sealed_leg
from studies.lab.recording import INSTRUMENT
from studies.sealed_channels.cases import SUBSETS, truths_of


@dataclass(frozen=True)
class Said:
    """What one diagnosis said of a case."""

    case: int
    kind: str
    subset: str
    truth: list[str]
    verdict: str
    first: list[str]
    """Mechanisms of the first explanation."""
    listed: list[list[str]]
    probability: float
    """Of the first statement."""
    c10: tuple[float, float]
    """Interval, kPa."""
    true_c10: float
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the first thing said is the truth: nothing, the effects, or something unknown."""
        if self.kind == "none":
            return self.verdict == "consistent"
        if not self.truth:
            return self.verdict == "unexplained"
        return self.verdict in ("named", "ambiguous") and set(self.first) == set(self.truth)

    @property
    def in_list(self) -> bool:
        """Whether the truth is among what is listed."""
        return self.right or any(set(names) == set(self.truth) for names in self.listed)

    @property
    def holds(self) -> bool:
        """Whether C10's interval holds the truth."""
        return self.c10[0] <= self.true_c10 <= self.c10[1]

    @property
    def half_width(self) -> float:
        """Of C10's interval, over the truth."""
        return 0.5 * (self.c10[1] - self.c10[0]) / self.true_c10


def say(found: Diagnosis, case: SealedCase, subset: str, seconds: float) -> Said:
    """Return what a diagnosis says, beside the truth."""
    first = found.explained.statements()[0]
    names = [list(model.names) for model in found.models]
    low, high = found.shown_interval(DEEP_C10)
    return Said(
        case.number,
        case.kind,
        subset,
        list(truths_of(case)),
        found.verdict,
        names[0] if names else [],
        names,
        first.probability,
        (low, high),
        case.true_c10_kpa,
        seconds,
    )


@dataclass(eq=False)
class Lab:
    """Diagnoses cases of one leg, by a library of its responses."""

    correction: TabulatedCorrection
    leg: int
    seed: int
    library: Library

    @property
    def stated(self) -> Subject:
        """The leg as the lab states it."""
        return sealed_leg(self.leg, self.seed).stated

    def diagnose(self, recordings: Sequence[Recording], names: Sequence[str]) -> Diagnosis:
        """Diagnose recordings with some of their channels, by the library alone."""
        kept = [replace(r, channels=tuple(c for c in r.channels if c.name in names)) for r in recordings]
        observed, library, stated = observe(segment_all(kept, INSTRUMENT, False)), self.library, self.stated
        ends = choose_correction("auto", stated)
        return diagnose_body(
            observed.with_channels(library.beside.names),
            INSTRUMENT,
            stated.tissues["deep"].law,
            library,
            None,
            Silent(),
            accuracy_of(stated),
            ends,
            0,
            ruled_out_of(stated, ends),
            with_correction(mechanisms(), self.correction),
        )


@dataclass(frozen=True, eq=False)
class Task:
    """One diagnosis."""

    case: SealedCase
    subset: str
    recordings: list[Recording]

    @property
    def asked(self) -> dict[str, int | str]:
        """What it is kept under."""
        return {"case": self.case.number, "subset": self.subset}


def diagnosed(lab: Lab, task: Task) -> Said:
    """Return what a diagnosis of some of a recording's channels says."""
    begun = time.process_time()
    found = lab.diagnose(task.recordings, SUBSETS[task.subset])
    return say(found, task.case, task.subset, time.process_time() - begun)
