"""Another code's cases, recorded anew and diagnosed, each kept as soon as it is done."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent
from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from studies.lab.outcomes import said_line
from studies.lab.recording import INSTRUMENT, Course, clean_courses, record
from studies.lab.stated import drawn_errors

AIR, NONE = "contact-onset", "none"
"""What truths call air before the skin, which every set of recordings has here, and no effect."""


@dataclass(frozen=True, eq=False)
class ForeignCase:
    """A leg that another code pressed."""

    name: str
    subject: Subject
    courses: tuple[Course, ...]
    """One a trial, from first touch on."""
    effects: tuple[str, ...]
    """By the names of the diagnosis' mechanisms."""
    c10: float
    """kPa."""


def cases_in(folder: Path) -> dict[str, Any]:
    """Return the truths of a folder's cases that have a clean course, by name.

    Raises
    ------
    InputError
        If there are none.
    """
    path = folder / "truth.json"
    if not path.is_file():
        raise InputError(path, "truth", "is missing", "give the folder of another code's cases")
    every = json.loads(path.read_text(encoding="utf-8"))["cases"]
    return {name: own for name, own in every.items() if (folder / name / "clean.csv").is_file()}


def foreign_case(folder: Path, name: str) -> ForeignCase:
    """Return a case of a folder."""
    truth, path = cases_in(folder)[name], folder / name / "clean.csv"
    effects = tuple(effect for effect in truth["effects"] if effect not in (AIR, NONE))
    subject = load_subject(folder / name, need_recordings=False)
    return ForeignCase(name, subject, clean_courses(path), effects, float(truth["true_C10_kPa"]))


MODULES = ("legfem.legs.diagnosis", "studies.redrawn.drawing")


@dataclass(frozen=True)
class RedrawnTask:
    """One set of recordings of a case."""

    case: str
    turn: int
    seed: int


@dataclass(frozen=True)
class RedrawnOutcome:
    """What was said of a set; stiffness in kPa."""

    case: str
    effects: tuple[str, ...]
    verdict: str
    models: tuple[tuple[str, ...], ...]
    statements: tuple[tuple[tuple[str, ...], bool, float], ...]
    """Names, whether something unknown, and probability; the most probable first."""
    base_c10: float
    c10: float
    interval: tuple[float, float]
    true_c10: float
    gain_sd: float
    """That the recordings were drawn with."""
    seconds: float
    """Of a processor."""

    @property
    def first(self) -> bool:
        """Whether what is there, or that nothing shows, is said first."""
        return self.statements[0][:2] == (self.effects, False)

    @property
    def listed(self) -> bool:
        """Whether it is among the explanations that hold 90 %."""
        return self.effects in self.models if self.effects else self.verdict == "consistent"

    @property
    def covered(self) -> bool:
        """Whether C10's 95 % interval holds the truth."""
        return self.interval[0] <= self.true_c10 <= self.interval[1]


@dataclass(eq=False)
class Redrawer:
    """Diagnoses cases recorded anew; legs are read once a process."""

    folder: Path
    diagnoser: Diagnoser
    _cases: dict[str, ForeignCase] = field(default_factory=dict, repr=False)

    def subject(self, task: RedrawnTask) -> tuple[Subject, ForeignCase, float]:
        """Return a leg as it is stated with recordings, its case, and the gains' sd drawn."""
        if task.case not in self._cases:
            self._cases[task.case] = foreign_case(self.folder, task.case)
        case = self._cases[task.case]
        generator = np.random.default_rng([task.seed, 31, task.turn, *task.case.encode()])
        errors = drawn_errors(generator)
        trials = tuple(record(case.courses, errors, generator))
        recorded = replace(case.subject, recordings=trials, instrument=INSTRUMENT, starts_at_contact=False)
        return recorded, case, errors.gain_sd

    def outcome(self, task: RedrawnTask) -> RedrawnOutcome:
        """Return what the diagnosis says of a set."""
        subject, case, gain = self.subject(task)
        begun = time.process_time()
        found = self.diagnoser.diagnose(subject, Silent(), 0)
        return RedrawnOutcome(
            task.case,
            case.effects,
            found.verdict,
            tuple(model.names for model in found.models),
            tuple((s.names, s.unnamed, s.probability) for s in found.explained.statements()),
            mpa_to_kpa(found.base.value(DEEP_C10)),
            mpa_to_kpa(found.best.value(DEEP_C10)),
            found.shown_interval(DEEP_C10),
            case.c10,
            gain,
            time.process_time() - begun,
        )

    def __getstate__(self) -> dict[str, object]:
        """Leave the legs out."""
        return {**self.__dict__, "_cases": {}}


def diagnose_each(
    tasks: Sequence[RedrawnTask], redrawer: Redrawer, out: Path, jobs: int, progress: Progress
) -> list[RedrawnOutcome]:
    """Return the tasks' outcomes; those that are kept aren't diagnosed again."""
    store = Store(out / "kept", RedrawnOutcome, "redrawn", MODULES)
    with Workers(_outcome, redrawer, jobs) as workers:
        return finish(workers, tasks, store, progress, "redrawn recordings", _line)


def _line(task: RedrawnTask, found: RedrawnOutcome) -> str:
    return said_line(f"{task.case}/{task.turn}", found.verdict, found.models, found.seconds)


def _outcome(redrawer: Redrawer, task: RedrawnTask) -> RedrawnOutcome:
    return redrawer.outcome(task)
