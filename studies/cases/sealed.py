"""One diagnosis of a sealed recording with some of its channels, and what it says beside the truth."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from legfem.channels.kinds.layer_thickness import MUSCLE, TISSUE
from legfem.common.progress import Deadline, Progress, Silent
from legfem.common.units import mpa_to_kpa
from legfem.data import Recording
from legfem.geometry.section import layer_thicknesses
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.diagnose import diagnose
from legfem.inverse.library_tasks import rounded
from legfem.inverse.mechanism import TissueMechanism, shown_mechanisms
from legfem.inverse.responses import SolvedResponses
from legfem.inverse.screening import Complete
from legfem.inverse.search import SearchError
from legfem.inverse.verdict import Diagnosis
from legfem.legs.diagnosis import WITHOUT_ENDS, Diagnoser
from legfem.legs.plausibility import room_before
from legfem.legs.plausible_recordings import doubts_about_recordings
from legfem.legs.subject import Subject
from legfem.report.diagnosis_headline import headline
from studies.cases.instruments import recorded
from studies.cases.sealed_case import DEPTH_MM, SealedCase, sealed_leg
from studies.cases.sealed_draw import PROGRAMMES, SUBSETS, subsets_of, true_sights, truths_of
from studies.cases.truth import Truths
from studies.making.recording import INSTRUMENT

DEEPEST_MM = DEPTH_MM + 1.6
"""Of a library: with an error of first contact."""
AIR_MM, AT_TOUCH_MM = 4.0, 0.04
"""Greatest travel before first touch of loadings alone, and of tests that are stated to begin at touch."""
WRONG = 0.15
"""Of C10: a "yes" beside a value that is further off is what may not be."""
SURE = 0.8
BY_TIME, FIRST_S = "force alone", 15.0
"""What provisional answers are by; and the processor's time from the first to the second, which doubles then."""


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
    final: bool = True
    """Whether it isn't provisional, ..."""
    weighed: tuple[int, int] = (0, 0)
    """... and how many effects were weighed, of how many; not counted where it is."""
    doubted: bool = False
    """Whether the page would begin with a doubt about the recordings, whatever the diagnosis says."""

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
        """Whether what is said with `SURE` or more is right; None where nothing is, or that nothing shows."""
        if self.probability < SURE or (self.verdict == "consistent" and self.kind != "none"):
            return None
        if self.verdict == "consistent":
            return True
        if not self.stated:
            return not self.truth or self.kind == "outside"
        return set(self.stated) <= set(self.truth)

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
        case.c10_kpa,
        seconds,
    )


@dataclass(eq=False)
class Lab:
    """Records cases, and diagnoses them.

    Parameters
    ----------
    folder
        Of solutions.
    correction
        Of a cylinder's ends.
    seed
        Of legs and errors.
    confirms
        Whether full solutions confirm the leading explanations, as in a user's diagnosis; else a leg's library alone
        is asked, which takes a fraction of the time.
    subsets
        Of channels, by which cases are diagnosed.
    whole
        Whether everything is solved beforehand, and not what an answer rests on alone.
    by_time
        Whether answers are recorded as time goes by, from nothing kept on, and not by a leg's library.
    """

    folder: Path
    correction: TabulatedCorrection
    seed: int
    confirms: bool = False
    subsets: tuple[str, ...] = tuple(SUBSETS)
    whole: bool = False
    by_time: bool = False
    _libraries: dict[str, tuple[Complete, SolvedResponses]] = field(default_factory=dict, repr=False)
    _middles: dict[int, float] = field(default_factory=dict, repr=False)
    _recorded: dict[tuple[int, str], list[Recording] | None] = field(default_factory=dict, repr=False)
    _truths: dict[int, Truths] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave libraries and models out: every process has its own."""
        return {**self.__dict__, "_libraries": {}, "_recorded": {}, "_truths": {}}

    def recordings(self, case: SealedCase, programme: str) -> list[Recording] | None:
        """Return a case's recordings with all channels; None where a solution stopped."""
        if case.leg not in self._truths:
            true, sights = sealed_leg(case.leg, self.seed).true, true_sights(case.leg, self.seed)
            self._truths = {case.leg: Truths(true, self.folder / "truth", sights)}
        truth = self._truths[case.leg].of(case, PROGRAMMES[programme])
        if truth is None:
            return None
        return recorded(case, self.seed, truth, AIR_MM if programme == "loading" else AT_TOUCH_MM)

    def subject(self, case: SealedCase, programme: str, names: Sequence[str]) -> Subject | None:
        """Return the leg as the lab states it, with some channels of its recordings; None where a solution stopped."""
        key = case.number, programme
        if key not in self._recorded:
            # Of one case at a time, in its two programmes.
            self._recorded = {one: kept for one, kept in self._recorded.items() if one[0] == case.number}
            self._recorded[key] = self.recordings(case, programme)
        recordings = self._recorded[key]
        if recordings is None:
            return None
        leg = sealed_leg(case.leg, self.seed).stated
        # A reader refuses a thickness to a bone that isn't there.
        unseen = {MUSCLE.name, TISSUE.name} - {
            *layer_thicknesses(leg.section, leg.indenter.aim, leg.indenter.direction)
        }
        kept = {*names} - unseen
        return replace(
            leg,
            recordings=tuple(replace(r, channels=tuple(c for c in r.channels if c.name in kept)) for r in recordings),
            instrument=INSTRUMENT,
            starts_at_contact=programme == "holds",
            accuracy=replace(leg.accuracy, contact_sd=0.0),
            plane_strain=True,
            plane_strain_stated=True,
        )

    def tabulating(
        self, case: SealedCase, programme: str, progress: Progress
    ) -> tuple[Complete, SolvedResponses] | None:
        """Return what solves a leg's library for a case's recordings, and its full solutions.

        They are about one stiffness and to one depth, whatever the case; nothing where a solution stopped.
        """
        subject = self.subject(case, programme, SUBSETS["all"][1])
        if subject is None:
            return None
        diagnoser = Diagnoser(self.folder, self.correction)
        observed = diagnoser.observations(subject)
        able, _ = shown_mechanisms(diagnoser.mechanisms_of(subject), observed, WITHOUT_ENDS)
        follows = any(isinstance(one, TissueMechanism) and one.along_path for one in able)
        keys = [stations.key for stations in observed.protocols] if follows else []
        key = repr((case.leg, sorted(keys)))
        if key not in self._libraries:
            deeper = replace(observed, depths=(*observed.depths, DEEPEST_MM))
            if case.leg not in self._middles:
                self._middles[case.leg] = rounded(diagnoser.identified(subject, progress).fit.values[DEEP_C10])
            solve, fine = diagnoser.tabulating(subject, deeper, self._middles[case.leg], progress, able)
            every = solve() if self.whole else None
            self._libraries[key] = (solve if every is None else lambda _: every), fine
        return self._libraries[key]

    def diagnose(self, subject: Subject, complete: Complete, solved: SolvedResponses | None) -> Diagnosis:
        """Diagnose recordings by a library, and by full solutions where there are any."""
        diagnoser = Diagnoser(self.folder, self.correction)
        identified = diagnoser.identified(subject, Silent())
        given = diagnoser.given(subject, diagnoser.observations(subject), complete, identified)
        return diagnose(replace(given, instrument=INSTRUMENT), solved, Silent())

    def said(self, case: SealedCase, subset: str) -> Said | None:
        """Return what a diagnosis of some of a recording's channels says; None where a solution or a search stopped."""
        programme, names = SUBSETS[subset]
        subject, known = self.subject(case, programme, names), self.tabulating(case, programme, Silent())
        if subject is None or known is None:
            return None
        complete, solved = known
        begun = time.process_time()
        try:
            found = self.diagnose(subject, complete, solved if self.confirms else None)
        except SearchError:
            return None
        doubted = any(doubts_about_recordings(subject, Path("subject.toml"), room_before(subject)))
        return replace(say(found, case, subset, time.process_time() - begun), doubted=doubted)

    def said_by_time(self, case: SealedCase) -> list[Said]:
        """Return what is said by force alone at once, then after ever more seconds of the processor, the last in full.

        As `legfem live` asks: a later answer goes on from what was solved before.
        """
        subject, found, wait = self.subject(case, *SUBSETS[BY_TIME]), list[Said](), 0.0
        diagnoser = Diagnoser(self.folder / "by-time" / f"{self.seed}-{case.number}", self.correction)
        begun = time.process_time()
        while subject is not None and not (found and found[-1].final):
            diagnoser.deadline = Deadline.after(wait, time.process_time)
            one = diagnoser.diagnose(subject, Silent())
            said = say(one, case, BY_TIME, time.process_time() - begun)
            found.append(replace(said, final=not one.provisional, weighed=one.weighed))
            wait = 2.0 * wait or FIRST_S
        return found


def said_each(lab: Lab, case: SealedCase) -> list[Said]:
    """Return what is said of a case, by the lab's subsets of channels; nothing where a solution stopped."""
    if lab.by_time:
        return lab.said_by_time(case)
    found = (lab.said(case, subset) for subset in subsets_of(case) if subset in lab.subsets)
    return [one for one in found if one is not None]
