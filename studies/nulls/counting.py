"""Diagnosing null recordings, each kept as soon as it is done."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from legfem.common.progress import Progress, Silent
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.subject import Subject
from studies.lab.conditions import drawn_errors, drawn_misstatement
from studies.lab.outcomes import said_line
from studies.lab.recording import INSTRUMENT, record
from studies.lab.stated import misstated
from studies.nulls.conditions import NullTask, condition_named
from studies.nulls.curves import TRIALS, CleanCurve, clean_curve

MODULES = ("legfem.legs.diagnosis", "studies.nulls.counting")


@dataclass(frozen=True)
class NullOutcome:
    """What was said of recordings without effect; stiffness in kPa."""

    condition: str
    curve: str
    leg: int
    verdict: str
    models: tuple[tuple[str, ...], ...]
    soundness: float
    """Probability that nothing was left out that shows."""
    c10: float
    interval: tuple[float, float]
    true_c10: float
    gain_sd: float
    """That the recordings were drawn with."""
    air: float
    seconds: float
    """Of a processor."""

    @property
    def false_alarm(self) -> bool:
        """Whether anything but "consistent" was said."""
        return self.verdict != "consistent"

    @property
    def covered(self) -> bool:
        """Whether C10's 95 % interval holds the truth."""
        return self.interval[0] <= self.true_c10 <= self.interval[1]


@dataclass(eq=False)
class NullCounter:
    """Diagnoses null recordings; curves are read once a process."""

    folders: Sequence[Path]
    diagnoser: Diagnoser
    _curves: dict[str, CleanCurve] = field(default_factory=dict, repr=False)

    def subject(self, task: NullTask) -> tuple[Subject, float, float, float]:
        """Return a stated leg with its recordings, its true C10, and the gain and air drawn."""
        curve = self._curve(task.curve)
        condition = condition_named(task.condition)
        own = _generator(task.key, task.seed)
        stated = condition.stated if condition.stated is not None else drawn_misstatement(own)
        leg = curve.subject if condition.exact else misstated(curve.subject, stated, own)
        drawn = _generator(f"{task.key}/{task.turn}", task.seed)
        errors = condition.recording if condition.recording is not None else drawn_errors(drawn)
        if curve.course.displacement[-1] < curve.course.displacement.max():
            errors = replace(errors, same_travel=False)
        trials = record([curve.course] * TRIALS, errors, drawn)
        recorded = replace(leg, recordings=tuple(trials), instrument=INSTRUMENT)
        return recorded, curve.c10, errors.gain_sd, errors.air

    def outcome(self, task: NullTask) -> NullOutcome:
        """Return what the diagnosis says of a set of recordings."""
        subject, true, gain, air = self.subject(task)
        begun = time.process_time()
        found = self.diagnoser.diagnose(subject, Silent(), 0)
        return NullOutcome(
            task.condition,
            task.curve,
            task.leg,
            found.verdict,
            tuple(tuple(model.names) for model in found.models),
            float(found.explained.adequacy),
            found.best.value("C10"),
            found.intervals["C10"],
            true,
            gain,
            air,
            time.process_time() - begun,
        )

    def _curve(self, name: str) -> CleanCurve:
        if name not in self._curves:
            folder = next(folder for folder in self.folders if folder.name == name)
            self._curves[name] = clean_curve(folder)
        return self._curves[name]

    def __getstate__(self) -> dict[str, object]:
        """Leave the curves out."""
        return {**self.__dict__, "_curves": {}}


def count(tasks: Sequence[NullTask], counter: NullCounter, out: Path, jobs: int, progress: Progress) -> None:
    """Diagnose the tasks that aren't kept yet."""
    # A process that keeps to one leg makes its library once.
    order = sorted(tasks, key=lambda task: (task.turn // 4, task.key))
    with Workers(_outcome, counter, jobs) as workers:
        finish(workers, order, _store(out), progress, "recordings without effect", _line)


def _line(task: NullTask, found: NullOutcome) -> str:
    return said_line(task.key, found.verdict, found.models, found.seconds)


def kept(tasks: Sequence[NullTask], out: Path) -> list[NullOutcome]:
    """Return the outcomes of the tasks that are done."""
    found = [_store(out).get(task) for task in tasks]
    return [outcome for outcome in found if outcome is not None]


def _store(out: Path) -> Store[NullOutcome]:
    return Store(out / "kept", NullOutcome, "nulls", MODULES)


def _outcome(counter: NullCounter, task: NullTask) -> NullOutcome:
    return counter.outcome(task)


def _generator(name: str, seed: int) -> np.random.Generator:
    digest = hashlib.sha256(name.encode()).digest()
    return np.random.default_rng([seed, int.from_bytes(digest[:8], "big")])
