"""Making sealed cases: one subject folder each, and its key."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from legfem.correction import TabulatedCorrection
from legfem.diagnose.solved import SolvedResponses
from legfem.diagnose.variants import SolutionStoppedError
from legfem.geometry.subject_folder import write_subject_folder
from legfem.progress import Progress
from legfem.study.concealed.cases import DEPTH_MM, INSTRUMENT, Case
from legfem.study.concealed.seal import write_sealed
from legfem.study.concealed.truth import record, simulate, truth_responses
from legfem.subject import Subject, find_subject, load_subject
from legfem.workers import Workers


@dataclass(eq=False)
class Maker:
    """Simulates cases; sections are meshed once a process."""

    out: Path
    folder: Path
    """Of the truth's solutions."""
    seed: int
    correction: TabulatedCorrection
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
        try:
            truth = simulate(case, responses, case.law)
        except SolutionStoppedError as stopped:
            return f"LEFT OUT: {stopped}"
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

    def _leg(self, case: Case) -> tuple[Subject, SolvedResponses]:
        key = case.subject, case.law
        if key not in self._legs:
            subject = load_subject(find_subject(case.subject), need_recordings=False)
            subject = with_deep_law(subject, case.law)
            responses = truth_responses(subject, DEPTH_MM, self.folder, self.correction)
            self._legs[key] = subject, responses
        return self._legs[key]


def with_deep_law(subject: Subject, law: str) -> Subject:
    """Return the subject with another law of the deep tissue, its volumetric part fitting."""
    from dataclasses import replace
    from types import MappingProxyType

    deep = subject.tissues["deep"]
    second = deep.D1 if law == "reduced-polynomial" else None
    tissue = replace(deep, law=law, C20=None, D2=second)  # type: ignore[arg-type]
    return replace(subject, tissues=MappingProxyType({**subject.tissues, "deep": tissue}))


def make(cases: Sequence[Case], maker: Maker, jobs: int, progress: Progress) -> None:
    """Make cases that aren't made yet, on several processes."""
    progress.stage("simulating sealed cases", len(cases))
    # Cases of one leg follow each other, so that a process meshes few.
    order = sorted(cases, key=lambda case: (case.subject, case.law, case.number))
    with Workers(_make, maker, jobs) as workers:
        for case, what in workers.run(order):
            progress.advance(f"{case.name}: {what}")


def _make(maker: Maker, case: Case) -> str:
    return maker.make(case)
