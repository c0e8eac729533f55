"""One ambiguous case: what is proposed, what a lab reads that measures an effect by itself, and what both end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.progress import Silent
from legfem.data import Recording
from legfem.inverse.library_build import build_library
from legfem.inverse.mechanism import null_of, prior_of
from legfem.inverse.plan import Design, DesignValue, DirectReadings
from legfem.inverse.verdict import Diagnosis
from legfem.legs.correction_of_leg import choose_correction
from legfem.legs.diagnosis import STIFFENING, Diagnoser, accuracy_of, diagnose_body, ruled_out_of
from legfem.legs.finite_element_models import solved_responses
from legfem.legs.loading import load_subject
from legfem.legs.plan import plan_after
from legfem.legs.subject import MeasuredEffect, Subject
from legfem.mechanisms import Mechanism
from legfem.solve.protocol import Protocol
from studies.concealed.cases import DEPTH_MM, TRIALS, SealedCase, SealedLeg, sealed_leg
from studies.concealed.making import read_sealed, write_case
from studies.concealed.truth import Truths
from studies.lab.recording import record
from studies.lab.stated import drawn_errors

_NO_STRENGTH = ("contact-slip", "leg-movement")
"""Whose concealed forms have no number that is the mechanism's."""
_TAILS = 3.0
"""Degrees of freedom of a reading's error."""
_USUAL_N = 10.0
"""Force at which a hardening support is read."""


def can_be_read(mechanism: Mechanism, case: SealedCase) -> bool:
    """Tell whether the study knows what a lab would read."""
    return mechanism.measured_sd is not None and not (mechanism.name in _NO_STRENGTH and mechanism.name in case.names)


def true_strength(mechanism: Mechanism, case: SealedCase, leg: SealedLeg) -> float:
    """Return a mechanism's strength in a case, in its unit: what the leg is, over what is stated.

    Parameters
    ----------
    mechanism
        Which.
    case
        The case.
    leg
        Its leg: fat, fascia and direction aren't as they are stated without any effect, too.
    """
    strength = null_of(mechanism.parameters[0])
    effects = {name: dict(values) for name, values in case.effects}
    if mechanism.name in effects:
        strength = _of_form(mechanism.name, effects[mechanism.name], case)
    tissue = {"superficial-stiffness": "superficial", "fascia-stiffness": "fascia"}
    if mechanism.name in tissue:
        true, stated = (one.tissues[tissue[mechanism.name]].C10 for one in (leg.true, leg.stated))
        assert true is not None and stated is not None
        strength *= true / stated
    if mechanism.name == "indenter-tilt":
        strength += leg.true.indenter.direction_deg - leg.stated.indenter.direction_deg
    return mechanism.parameters[0].inside(strength)


def _of_form(name: str, values: dict[str, float], case: SealedCase) -> float:
    strength = values["strength"]
    if name == "support-compliance" and case.code == "legfem":
        return strength / (1.0 + values["hardening"] * _USUAL_N)
    if name == "force-drift":
        duration = case.protocol_of_trials.duration
        return strength * (1.0 - math.exp(-duration / values["time"])) / duration
    return strength


def readings_of(
    mechanisms: Sequence[Mechanism], case: SealedCase, leg: SealedLeg, generator: np.random.Generator
) -> list[MeasuredEffect]:
    """Return what a lab reads of mechanisms."""
    found = []
    for mechanism in mechanisms:
        assert mechanism.measured_sd is not None
        first, stated = mechanism.parameters[0], mechanism.measured_sd
        wider = generator.uniform(0.5, 2.0) * math.sqrt((_TAILS - 2) / _TAILS)
        error = stated * wider * float(generator.standard_t(_TAILS))
        true, factor = true_strength(mechanism, case, leg), prior_of(first).scale == "log"
        value = first.inside(true * math.exp(error) if factor else true + error)
        sd = stated * value if factor else stated
        found.append(MeasuredEffect(mechanism.name, value, sd, "read in the study (simulated)"))
    return found


_SLACK_MM = 2.0
"""By which a recorded depth may be beyond the drive's: where first contact is found too early."""


@dataclass(frozen=True)
class Outcome:
    """What a new test led to."""

    design: str
    chance: float
    """That it tells all explanations apart, as the plan reckoned it."""
    verdict: str
    models: list[list[str]]
    """Named models' mechanisms, the most probable first."""
    right: bool
    """Whether one explanation is left, and it is what was concealed."""

    @property
    def ended(self) -> bool:
        """Whether one explanation is left."""
        return self.verdict == "named"

    @property
    def line(self) -> str:
        """What progress says."""
        names = " | ".join("+".join(names) for names in self.models)
        return f"{self.design} ({self.chance:.0%}): {self.verdict} {names}"


@dataclass(frozen=True)
class Tried:
    """One case."""

    number: int
    concealed: list[str]
    code: str
    before: list[list[str]]
    """Explanations that were left."""
    ranked: list[tuple[str, float]]
    """All tests with their chances, the best first."""
    able: list[str]
    """Those that the study can make."""
    proposed: Outcome | None
    random: Outcome | None
    why: str = ""
    """Why nothing was tried, if so."""


@dataclass(eq=False)
class Lab:
    """Where new tests are made.

    Parameters
    ----------
    cases
        Folder of the sealed cases.
    work
        Of the subjects with all recordings.
    diagnoser
        Of the old recordings and of all.
    seed
        Of the cases, and of what is drawn here.
    """

    cases: Path
    work: Path
    diagnoser: Diagnoser
    seed: int
    _legs: dict[int, tuple[SealedLeg, Truths]] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave finite-element models out."""
        return {**self.__dict__, "_legs": {}}

    def leg(self, number: int) -> tuple[SealedLeg, Truths]:
        """Return a leg of the study and what simulates it."""
        if number not in self._legs:
            assert self.diagnoser.correction is not None
            leg = sealed_leg(number, self.seed)
            truths = Truths(leg.true, self.diagnoser.folder / "truth", self.diagnoser.correction)
            self._legs[number] = leg, truths
        return self._legs[number]

    def recorded(self, case: SealedCase, design: Design) -> list[Recording] | None:
        """Return a new test's recordings; None where a solution stopped."""
        driven = [as_driven(protocol) for protocol in design.protocols]
        truth = self.leg(case.leg)[1].of(case, driven, TRIALS)
        if truth is None:
            return None
        errors = drawn_errors(np.random.default_rng(case.noise_seed))
        generator = np.random.default_rng([case.noise_seed, 22])
        return record(truth.trials, errors, generator)


def as_driven(protocol: Protocol) -> Protocol:
    """Return what a drive is told where a depth as recorded is asked for."""
    return Protocol(protocol.time, tuple(min(d, DEPTH_MM) for d in protocol.displacement))


def can_be_made(design: Design | DirectReadings, case: SealedCase) -> bool:
    """Tell whether the study knows what the leg does in a test.

    Truths go to the depth of the cases, under their cylinder, on the outlines that are stated; the
    other code's friction is known in loading alone. Some concealed forms have no strength that
    could be read.
    """
    if isinstance(design, DirectReadings):
        return all(can_be_read(m, case) for m in design.mechanisms)
    if design.length_factor != 1.0 or design.outlines_known or design.contact_known or design.channels:
        return False
    if max(p.depth for p in design.protocols) > DEPTH_MM + _SLACK_MM:
        return False
    loading = all(s.phase == "loading" for p in design.protocols for s in p.segments)
    return loading or not (case.code == "felupe" and "contact-slip" in case.names)


def try_case(lab: Lab, folder: Path) -> Tried:
    """Return what the proposed test, and one drawn, say of an ambiguous case."""
    case = SealedCase.of(read_sealed(lab.cases / "keys" / f"{folder.name}.json", lab.seed)["case"])
    subject = load_subject(folder)
    found = lab.diagnoser.diagnose(subject, Silent())
    ranked = plan_after(found, subject, lab.diagnoser, Silent())
    open_ = [one for one in ranked if can_be_made(one.design, case)]
    told = Tried(
        case.number,
        list(case.names or ("nothing",)),
        case.code,
        _names(found),
        [(one.design.name, one.chance) for one in ranked],
        [one.design.name for one in open_],
        None,
        None,
        "no test that can be made was proposed",
    )
    if not open_:
        return told
    drawn = np.random.default_rng([lab.seed, 23, case.number]).integers(len(open_))
    outcomes: dict[str, Outcome | None] = {}
    for one in (open_[0], open_[drawn]):
        name = one.design.name
        if name not in outcomes:
            outcomes[name] = _outcome(lab, case, subject, found, one)
    proposed, random = outcomes[open_[0].design.name], outcomes[open_[drawn].design.name]
    if proposed is None or random is None:
        return replace(told, why="a finite-element solution of the new test stopped")
    return replace(told, proposed=proposed, random=random, why="")


def _outcome(lab: Lab, case: SealedCase, subject: Subject, before: Diagnosis, asked: DesignValue) -> Outcome | None:
    """Make a test, and diagnose all that is known then."""
    design = asked.design
    if isinstance(design, DirectReadings):
        found = lab.diagnoser.diagnose(_read(lab, case, subject, design), Silent())
    else:
        new = lab.recorded(case, design)
        if new is None:
            return None
        both = _numbered([*subject.recordings, *new])
        folder = lab.work / f"{case.name}-{_slug(design.name)}"
        if not folder.is_dir():
            title = f"Sealed case {case.number} with another test (simulated)"
            write_case(folder, title, case, lab.leg(case.leg)[0].stated, both)
        left = list(dict.fromkeys(m for model in before.models for m in model.fit.mechanisms))
        found = weigh_again(lab.diagnoser, load_subject(folder), left)
    models = _names(found)
    right = found.verdict == "named" and set(models[0]) == set(case.names)
    return Outcome(design.name, asked.chance, found.verdict, models, right)


def _read(lab: Lab, case: SealedCase, subject: Subject, asked: DirectReadings) -> Subject:
    """Return a subject with readings of effects in its folder's ``[[measured]]``."""
    seeds = [case.noise_seed, 24]
    found = readings_of(asked.mechanisms, case, lab.leg(case.leg)[0], np.random.default_rng(seeds))
    return replace(subject, measured=(*subject.measured, *found))


def weigh_again(diagnoser: Diagnoser, subject: Subject, left: Sequence[Mechanism]) -> Diagnosis:
    """Return a subject's diagnosis among some mechanisms."""
    observed = diagnoser.observations(subject)
    fine, coarse = solved_responses(subject, observed, diagnoser.folder)
    law = subject.tissues["deep"].law
    library = build_library(fine, coarse, observed, left, 1, Silent(), STIFFENING[law])
    ends = choose_correction("auto", subject)
    return diagnose_body(
        observed,
        subject.instrument,
        law,
        library,
        fine,
        Silent(),
        accuracy_of(subject),
        ends,
        ruled_out=ruled_out_of(subject, ends),
        every=left,
    )


def _names(found: Diagnosis) -> list[list[str]]:
    return [list(model.names) for model in found.models]


def _numbered(recordings: Sequence[Recording]) -> list[Recording]:
    return [replace(one, trial=f"trial{k + 1}") for k, one in enumerate(recordings)]


def _slug(name: str) -> str:
    words = "".join(c if c.isalnum() else " " for c in name).split()
    return "-".join(words)[:40].lower()
