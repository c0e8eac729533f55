"""Visits of a lab that does what `legfem live` advises, beside a lab that presses three times: all simulated.

``scripts/in-env env PYTHONPATH=.:tests python -m making_visits SEED FIRST LAST`` makes visits to the sealed study's
legs (`studies.cases.sealed`): half of the truths by felupe, a lab's errors, some effect concealed or none. Each visit
begins with one loading by force alone. The advised lab makes the test that is said to leave least of C10's error, with
what it recorded before, until C10 is known to 10 % or `MOST` trials are made; the plain one presses three times.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.progress import Silent
from legfem.data import Recording
from legfem.geometry.indenter import Site
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.correction import read_correction
from legfem.inverse.search import SearchError
from legfem.inverse.verdict import Diagnosis, answer_of
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.plan import bought_in_visit, with_channels
from legfem.legs.subject import Subject
from legfem.report.answers import headline_of
from legfem.solve.protocol import Protocol
from studies.cases.instruments import recorded
from studies.cases.sealed import AIR_MM, Lab
from studies.cases.sealed_case import SealedCase, sealed_leg
from studies.cases.sealed_draw import PROGRAMMES, SUBSETS, channel_cases, true_sights, truths_of
from studies.cases.truth import Truths

CAN = ("hold", "rates", *SUBSETS["all"][1])
WANTED_PERCENT, MOST, PLAIN = 10.0, 6, 3
BETWEEN_S = 60.0
"""From the end of a trial to the next one's start."""
A_LEG = 5
"""Cases of each leg."""
HOW = {"hold": "hold at", "rates": "press at"}
"""How the advice begins, by what is to be done."""


@dataclass(frozen=True)
class Answer:
    """What is known after so many trials."""

    trials: int
    minutes: float
    percent: float
    """Half of C10's interval over its middle; infinite where it isn't determined."""
    held: bool
    named: bool
    says: str


@dataclass(frozen=True)
class Visited:
    """A leg in a rig, and what trials of it are like."""

    lab: Lab
    case: SealedCase
    folder: Path

    @cached_property
    def trials(self) -> dict[str, list[Recording]]:
        """All trials that can be made, by what they are, with all channels."""
        leg, seed = self.case.leg, self.lab.seed
        truths = Truths(sealed_leg(leg, seed).true, self.lab.folder / "truth", true_sights(leg, seed))
        loading, holding = (truths.of(self.case, PROGRAMMES[name]) for name in ("loading", "holds"))
        if loading is None or holding is None:
            raise UnsolvedError("a true leg can't be solved")
        again = replace(self.case, noise_seed=self.case.noise_seed + 1)
        pressed = [one for case in (self.case, again) for one in recorded(case, seed, loading, AIR_MM)]
        held = recorded(self.case, seed, holding, AIR_MM)
        return {"press again": pressed, "hold": held[:2], "rates": held[2:]}

    def leg(self, made: list[tuple[str, frozenset[str]]]) -> Subject:
        """Return the leg with trials that were made, each with its channels."""
        stated, counts, kept = self.lab.subject(self.case, "loading", ()), dict.fromkeys(self.trials, 0), []
        assert stated is not None
        for number, (kind, channels) in enumerate(made):
            one = self.trials[kind][counts[kind] % len(self.trials[kind])]
            counts[kind] += 1
            own = tuple(c for c in one.channels if c.name in channels)
            kept.append(replace(one, trial=f"trial{number + 1}", channels=own))
        return replace(stated, recordings=tuple(kept))

    def answer(self, leg: Subject) -> tuple[Answer, Diagnosis]:
        """Diagnose what was recorded so far, as `legfem live` does."""
        found = Diagnoser(self.folder, self.lab.correction).diagnose(leg, Silent())
        given, percent, held = answer_of(found), np.inf, True
        c10 = given.values.get(DEEP_C10)
        if c10 is not None and c10.ci95 is not None:
            low, high = c10.ci95
            percent = 100 * (high - low) / (high + low)
            held = low <= self.case.c10_kpa <= high
        first, truths = found.models[0].names if found.models else (), truths_of(self.case)
        right = (
            found.verdict == "consistent" if self.case.kind == "none" else set(first) == set(truths) and bool(truths)
        )
        seconds = sum(float(one.time[-1]) + BETWEEN_S for one in leg.recordings)
        return Answer(len(leg.recordings), seconds / 60, percent, held, right, headline_of(given).said), found

    def advised(self) -> Iterator[Answer]:
        """Yield what is known after each trial of a lab that follows the advice."""
        made = [("press again", frozenset[str]())]
        while True:
            leg = self.leg(made)
            one, found = self.answer(leg)
            yield one
            if one.percent <= WANTED_PERCENT or len(made) == MOST:
                return
            name = next(iter(bought_in_visit(found, leg, CAN)))
            seen = made[-1][1] | self.channels_of(name, found, leg)
            made.append((next((k for k in ("hold", "rates") if name.startswith(HOW[k])), "press again"), seen))
            print(f"    {name}", flush=True)

    def channels_of(self, name: str, found: Diagnosis, leg: Subject) -> frozenset[str]:
        """Return what an advised test records."""
        observed = found.observed
        same = Protocol.ramp(observed.depth, observed.rates[0])
        tests = with_channels(same, Site(leg.section, leg.indenter), 1)
        return frozenset(one.name for test in tests if test.name == name for one in test.channels)

    def plain(self) -> Iterator[Answer]:
        """Yield what is known after each of some loadings by force alone."""
        for trials in range(1, PLAIN + 1):
            yield self.answer(self.leg([("press again", frozenset())] * trials))[0]


def main(seed: int, first: int, last: int) -> None:
    """Print what each visit came to."""
    legs = last // A_LEG + 1
    cases = [one for one in channel_cases(legs, seed) if one.number % 21 < A_LEG][first : last + 1]
    with TemporaryDirectory() as folder:
        lab = Lab(Path(folder), read_correction(REFERENCE), seed)
        for case in cases:
            hidden = "+".join(name for name, _ in (*case.effects, *case.outside)) or "nothing"
            print(f"{case.number}: {case.kind}, {hidden}, {case.code}, C10 {case.c10_kpa:.3g} kPa", flush=True)
            visit = Visited(lab, case, Path(folder) / f"solved-{case.number}")
            try:
                for way, answers in (("advised", visit.advised()), ("plain", visit.plain())):
                    for one in answers:
                        print(
                            f"  {way}: {one.trials} trials, {one.minutes:.1f} min: ± {one.percent:.0f} %, "
                            f"{'held' if one.held else 'MISSED'}, {'named' if one.named else '-'}: {one.says}",
                            flush=True,
                        )
            except (UnsolvedError, SearchError) as error:
                print(f"  left out: {error}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
