"""Diagnosing null recordings: clean curves of another code, what they err by, each kept as soon as it is done."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

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
from studies.lab.recording import INSTRUMENT, Course, LabErrors, clean_courses, record
from studies.lab.stated import Misstated, drawn_errors, drawn_misstatement, misstated

_NONE, _EXACT = LabErrors(), Misstated()


@dataclass(frozen=True)
class Condition:
    """One kind of errors.

    Parameters
    ----------
    name
        What the page calls it.
    recording
        Errors of the recordings; None draws all of them.
    stated
        Errors of what is stated of the leg; None draws all of them.
    """

    name: str
    recording: LabErrors | None = _NONE
    stated: Misstated | None = _EXACT

    @property
    def exact(self) -> bool:
        """Whether the leg is stated as it is, so that one library serves all recordings."""
        return self.stated == _EXACT


CONDITIONS = (
    Condition("instruments alone"),
    *(Condition(f"scatter {100 * g:g} %", LabErrors(gain_sd=g)) for g in (0.003, 0.01, 0.03)),
    *(Condition(f"air to {a:g} mm", LabErrors(air=a)) for a in (1.0, 2.0, 4.0)),
    *(Condition(f"outlines {c:g} mm", stated=Misstated(contour=c)) for c in (0.3, 0.6, 1.0)),
    Condition("all", None, None),
)
ALL = CONDITIONS[-1]


@dataclass(frozen=True)
class NullTask:
    """One set of recordings."""

    condition: str
    curve: str
    """Name of the clean curve."""
    leg: int
    """Number of the misstated leg; 0 where the leg is stated as it is."""
    turn: int
    """Number of the set within its condition."""
    seed: int

    @property
    def key(self) -> str:
        """Of its condition, curve and leg, whose recordings share a library."""
        return f"{self.condition}/{self.curve}/{self.leg}"


def condition_named(name: str) -> Condition:
    """Return a condition."""
    return next(c for c in CONDITIONS if c.name == name)


def null_tasks(number: int, curves: tuple[str, ...], legs: int, seed: int) -> list[NullTask]:
    """Return so many sets of recordings, conditions and curves in turn.

    Parameters
    ----------
    number
        Of sets; those with all errors are three times as many as those of another condition.
    curves
        Names of the clean curves.
    legs
        Misstated legs of a condition (four times as many where all errors are drawn).
    seed
        Of all draws.
    """
    turns = (*CONDITIONS, ALL, ALL)
    tasks = []
    counts = dict.fromkeys((c.name for c in CONDITIONS), 0)
    for k in range(number):
        condition = turns[k % len(turns)]
        turn = counts[condition.name]
        counts[condition.name] += 1
        if condition.exact:
            tasks.append(NullTask(condition.name, curves[turn % len(curves)], 0, turn, seed))
            continue
        leg = turn % (4 * legs if condition == ALL else legs)
        # Levels of outline error begin with different curves.
        curve = curves[(leg + CONDITIONS.index(condition)) % len(curves)]
        tasks.append(NullTask(condition.name, curve, leg + 1, turn, seed))
    return tasks


TRIALS = 3
C10_KPA = {"neo-hookean": 1.50, "reduced-polynomial": 0.72, "case-30": 1.45, "case-06": 1.25}
"""By the folder; `clean.csv` lies in it."""


@dataclass(frozen=True, eq=False)
class CleanCurve:
    """A leg, its true course, and its true stiffness (kPa)."""

    subject: Subject
    course: Course
    c10: float


def clean_curve(folder: Path) -> CleanCurve:
    """Return what another code computed.

    Raises
    ------
    InputError
        If there is no such curve.
    """
    path = folder / "clean.csv"
    if not path.is_file() or folder.name not in C10_KPA:
        raise InputError(
            path, "clean curve", "is none of a leg without effect", f"give folders of {', '.join(C10_KPA)}"
        )
    subject = load_subject(folder, need_recordings=False)
    return CleanCurve(subject, clean_courses(path)[0], C10_KPA[folder.name])


def clean_folders(crosscheck: Path, foreign: Path | None) -> list[Path]:
    """Return the folders of clean curves that are there.

    Raises
    ------
    InputError
        If there are none.
    """
    asked = [crosscheck / name for name in ("neo-hookean", "reduced-polynomial")]
    if foreign is not None:
        asked += [foreign / name for name in ("case-30", "case-06")]
    found = [folder for folder in asked if folder.is_dir()]
    if not found:
        raise InputError(crosscheck, "clean curves", "there are none", "give --crosscheck FOLDER")
    return found


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
            mpa_to_kpa(found.best.value(DEEP_C10)),
            found.shown_interval(DEEP_C10),
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
