"""Making sealed cases: one subject folder each, and its key."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from legfem.correction import TabulatedCorrection
from legfem.diagnose.diagnosis import starts
from legfem.diagnose.fit import fit_base
from legfem.diagnose.library import Library
from legfem.diagnose.noise import estimate_noise
from legfem.diagnose.observations import observe
from legfem.diagnose.predict import LawName, Predictor
from legfem.diagnose.run import Diagnoser
from legfem.diagnose.solved import SolvedResponses
from legfem.geometry.subject_folder import write_subject_folder
from legfem.progress import Progress, Silent
from legfem.study.concealed.cases import (
    DEPTH_MM,
    INSTRUMENT,
    LAWS,
    Case,
    ProtocolName,
    protocols_of,
    weakened,
)
from legfem.study.concealed.seal import write_sealed
from legfem.study.concealed.truth import (
    Truth,
    blank_observations,
    record,
    simulate,
    truth_responses,
)
from legfem.subject import SUBJECTS, Subject, load_subject
from legfem.workers import Workers

_UNEXPLAINED, _AIM, _WEAKENINGS = 0.01, 0.8, 8
"""Share of the forces' variation that a concealed effect may leave to the base model, the part of
that aimed at, and so many attempts at most."""


@dataclass(eq=False)
class Maker:
    """Simulates cases; sections are meshed once a process."""

    out: Path
    folder: Path
    """Of the truth's solutions."""
    seed: int
    correction: TabulatedCorrection
    diagnoser: Diagnoser
    """Of the legs' libraries, to see how good the base model looks."""
    _legs: dict[tuple[str, str], tuple[Subject, SolvedResponses]] = field(
        default_factory=dict, repr=False
    )

    def __getstate__(self) -> dict[str, Any]:
        """Leave finite-element models out."""
        return {**self.__dict__, "_legs": {}}

    def make(self, case: Case) -> str:
        """Write a case's folder and key; return what happened in a word."""
        folder = self.out / "cases" / case.name
        if (self.out / "keys" / f"{case.name}.json").is_file() and folder.is_dir():
            return "made before"
        subject, responses = self._leg(case)
        case, truth = self._concealed(case, subject, responses)
        if np.isnan(truth.force).any():
            return "LEFT OUT: a finite-element solution stopped"
        if not folder.is_dir():
            write_subject_folder(
                subject.section,
                folder,
                f"Sealed case {case.number} (simulated)",
                subject.indenter.aim,
                subject.indenter.direction_deg,
                origin="simulated",
                recordings=record(truth, case),
                starts_at_contact=True,
                instrument=INSTRUMENT,
                deep_law=case.law,
            )
        key = {
            "case": case.document(),
            "time_s": truth.observed.time.tolist(),
            "force_N": truth.force.tolist(),
        }
        write_sealed(self.out / "keys" / f"{case.name}.json", key, self.seed)
        return "made"

    def _concealed(
        self, case: Case, subject: Subject, responses: SolvedResponses
    ) -> tuple[Case, Truth]:
        """Return a case weakened until a refit of the base model looks good, and its truth."""
        for _ in range(_WEAKENINGS):
            truth = simulate(case, responses, case.law)
            if np.isnan(truth.force).any():
                break
            unexplained = 1.0 - self._base_r_squared(case, subject, truth)
            if unexplained < _UNEXPLAINED:
                break
            # A small effect's misfit grows with it, the unexplained share with its square.
            factor = float(np.sqrt(_AIM * _UNEXPLAINED / unexplained))
            case = weakened(case, max(factor, 0.4))
        return case, truth

    def _base_r_squared(self, case: Case, subject: Subject, truth: Truth) -> float:
        """Return R2 of the base model fitted to what is recorded; twins have the same errors."""
        recorded = record(truth, replace(case, noise_seed=0))
        observed = observe(recorded, INSTRUMENT, starts_at_contact=True)
        library, _ = self.diagnoser.library(subject, observed, Silent())
        law: LawName = "neo-hookean" if case.law == "neo-hookean" else "reduced-polynomial"
        predictor = Predictor(observed, library, law)
        _, base = fit_base(predictor, *estimate_noise(observed, INSTRUMENT), starts(law))
        away = observed.force - observed.force.mean()
        return 1.0 - float(np.sum(base.residual**2) / np.sum(away**2))

    def _leg(self, case: Case) -> tuple[Subject, SolvedResponses]:
        key = case.subject, case.law
        if key not in self._legs:
            subject = load_subject(SUBJECTS.find(case.subject), need_recordings=False)
            subject = with_deep_law(subject, case.law)
            responses = truth_responses(subject, DEPTH_MM, self.folder, self.correction)
            self._legs[key] = subject, responses
        return self._legs[key]


def with_deep_law(subject: Subject, law: str) -> Subject:
    """Return the subject with another law of the deep tissue, its volumetric part fitting."""
    from types import MappingProxyType

    deep = subject.tissues["deep"]
    second = deep.D1 if law == "reduced-polynomial" else None
    tissue = replace(deep, law=law, C20=None, D2=second)  # type: ignore[arg-type]
    return replace(subject, tissues=MappingProxyType({**subject.tissues, "deep": tissue}))


def leg_library(
    name: str, protocol: ProtocolName, diagnoser: Diagnoser, progress: Progress
) -> Library:
    """Return the library of a leg and protocol of the study, solved where it isn't kept."""
    subject = load_subject(SUBJECTS.find(name), need_recordings=False)
    blank = blank_observations(protocols_of(protocol))
    # The stations follow from the displacements alone.
    case = Case(0, "none", name, LAWS[name], protocol, 1.0, 0.0, (), (), 0)
    pressed = record(Truth(blank, blank.displacement), case)
    observed = observe(pressed, INSTRUMENT, starts_at_contact=True)
    library, _ = diagnoser.library(with_deep_law(subject, LAWS[name]), observed, progress)
    return library


def make(cases: Sequence[Case], maker: Maker, jobs: int, progress: Progress) -> None:
    """Make cases that aren't made yet, on several processes."""
    progress.stage("simulating sealed cases", len(cases))
    # In the order of their numbers, which is random: whoever stops early has a fair sample.
    order = sorted(
        cases, key=lambda case: (case.number if case.twin_of is None else case.twin_of, case.number)
    )
    with Workers(_make, maker, jobs) as workers:
        for case, what in workers.run(order):
            progress.advance(f"{case.name}: {what}")


def _make(maker: Maker, case: Case) -> str:
    return maker.make(case)
