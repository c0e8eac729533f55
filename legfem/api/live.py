"""A leg while it is in the rig: each trial is judged as an instrument writes it, and all so far are diagnosed."""

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from threading import Event
from typing import Any

from legfem.api.loading import Given, folder_of
from legfem.api.results import Diagnosed
from legfem.common.errors import InputError, UnsolvedError, doubt_lines
from legfem.common.numbers import number
from legfem.common.progress import Deadline
from legfem.data.quality import WORST_GRADE, quality_of
from legfem.data.reader import STALLED_S, FileState, Stamp, Watched, changes, is_cut, looked, stamps_of
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.verdict import answer_of
from legfem.legs.diagnosis import doubts_of
from legfem.legs.loading import load_subject, read_recordings, trial_files, with_trials
from legfem.legs.plan import bought_in_visit
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import RECORDINGS, SUBJECTS, SubjectEntry, SubjectFile, subject_entry
from legfem.legs.subject import Subject
from legfem.report.answers import headline_of
from legfem.report.diagnosis_sentences import next_experiments
from legfem.report.instrument_file import contact_text

LOOK_S = 0.5
"""Between two looks at the folder."""
_STATES: dict[FileState, str] = {
    "stalled": f"has stood still for {STALLED_S:g} s and can't be read; does the instrument still write? ",
    "replaced": "is written again: the answer is made anew once it is whole",
    "gone": "was deleted: the answer is made without it",
}
"""What is said of a file that isn't complete; nothing of one that is being written."""


@dataclass(eq=False)
class Visit:
    """A leg and its trials so far.

    Parameters
    ----------
    leg
        Without recordings.
    entry
        Of its file.
    """

    leg: Subject
    entry: SubjectEntry
    files: Watched = field(default_factory=dict)
    """As of the last look."""
    told: dict[Path, list[str]] = field(default_factory=dict)
    """What was said of each."""
    subject: Subject | None = None
    """The leg with the trials that can be used, another one when they change; None without any."""
    settled: bool = False
    """Whether no file was being written at the last look."""

    @property
    def folder(self) -> Path:
        """Where recordings are looked for."""
        return self.leg.directory / self.entry.recordings

    def time(self, leg: Subject) -> float:
        """Return the time (s) while the trials are a leg's; it is over once they are others."""
        return time.monotonic() if self.subject is leg else math.inf

    def look(self, now: float) -> list[str]:
        """Look at the folder at a time (s); return what is new to be said."""
        before, told, subject = self.files, self.told, None
        self.files = looked(before, stamps_of(trial_files(self.leg.directory, self.entry)), now, self._read)
        if changes(before, self.files):
            self.told = {}
            for path, file in sorted(self.files.items(), key=lambda one: one[1].since):
                if file.state == "complete":
                    self.told[path], subject = self._judged(path, file.stamp, subject)
                elif file.state in _STATES:
                    self.told[path] = [f"{path.name} {_STATES[file.state]}{file.trouble}"]
            self.subject = subject
        self.settled = not any(one.open for one in self.files.values())
        return [line for path, lines in self.told.items() if lines != told.get(path) for line in lines]

    def _read(self, path: Path) -> None:
        if is_cut(path):
            raise InputError(path, "rows", "the last one isn't whole", "save the file anew if nothing more comes")
        read_recordings(self.folder, [path], self.entry.given.recordings.channels())

    @cache  # noqa: B019 - a visit ends with the program
    def _judged(self, path: Path, stamp: Stamp, before: Subject | None) -> tuple[list[str], Subject | None]:
        """Return what is to be said of a file as it is beside those before it, and the leg with those of use."""
        try:
            subject = with_trials(self.leg, self.entry, sorted([*_used(before), path]))
        except (InputError, OSError) as error:
            return [f"{path.name}: NOT USABLE: {error}"], before
        trial = next(one for one in subject.trials if one.recording.source == path)
        quality, known = quality_of(trial), () if before is None else doubts_about(before)
        usable = quality.grade != WORST_GRADE
        facts = f"first contact {contact_text(quality)}; {trial.loading.depth:.1f} mm deep"
        if before is not None:
            at = min(one.loading.depth for one in subject.trials)
            others = [one for one in subject.trials if one is not trial]
            mean = sum(one.loading.force_near(at) for one in others) / len(others)
            facts += f"; at {at:.3g} mm {trial.loading.force_near(at) / mean:.3g} times the force of those before"
        # A file that isn't read is told of by itself.
        new = [one for one in doubts_about(subject) if one not in known and one.field != RECORDINGS]
        lines = (facts, *quality.reasons, *doubt_lines(new))
        head = f"{path.name}: {'usable' if usable else 'NOT USABLE'}, grade {quality.grade}"
        return [head, *(f"  {line}" for line in lines)], subject if usable else before


def _used(leg: Subject | None) -> list[Path]:
    """Return the files of a leg's trials."""
    return [] if leg is None else [one.source for one in leg.recordings if one.source is not None]


def visit_of(folder: Given, site: str = "") -> Visit:
    """Return a leg's folder before it is looked at.

    Raises
    ------
    InputError
        If there is no such folder, or anything in it but the recordings is missing or wrong.
    """
    found = folder_of(folder, SUBJECTS)
    leg = load_subject(found, need_recordings=False, need_instrument=False, site=site)
    return Visit(leg, subject_entry(found / SUBJECTS.file, site))


def answer_lines(found: Diagnosed, leg: Subject, given: SubjectFile) -> list[str]:
    """Return what all trials so far say, how well C10 is known beside what is wanted, and what one more would buy."""
    answer, known = answer_of(found.diagnosis), doubts_about(leg)
    lines = [f"by {', '.join(one.trial for one in leg.recordings)}: {headline_of(answer).said}"]
    lines += doubt_lines(one for one in doubts_of(found.diagnosis, leg) if one not in known)
    c10, so_far = answer.values.get(DEEP_C10), found.diagnosis.provisional
    if c10 is None or c10.ci95 is None:
        return [*lines, *(f"next: {one}" for one in next_experiments(found.diagnosis)[:1])]
    low, high = c10.ci95
    value = (low + high) / 2 if c10.value is None else c10.value
    percent = 50 * (high - low) / value
    # No error is said to be less than it is.
    error = f"± {math.ceil(percent)} %"
    if given.wanted is not None:
        enough = percent <= given.wanted.C10_percent
        shown = f"{'so far ' * so_far}enough: C10 {number(value, (high - low) / 4)} kPa {error}"
        lines.append(shown if enough else f"{error} of {given.wanted.C10_percent:g} % wanted")
        if enough and not so_far:
            return lines
    bought = bought_in_visit(found.diagnosis, leg, given.can or ())
    lines += [f"next: {test}: C10 {error} -> ± {math.ceil(percent * by)} %" for test, by in bought.items()]
    return [*lines, f"  these leave out how tissue relaxes and drains{', and what is not weighed yet' * so_far}"]


@contextmanager
def _watched(visit: Visit, tell: Callable[[list[str]], None]) -> Iterator[Future[None]]:
    """Look at a folder in a thread, and tell of it: solutions and Ctrl-C are the main thread's."""
    stop = Event()

    def watch() -> None:
        while not stop.wait(LOOK_S):
            tell(visit.look(time.monotonic()))

    with ThreadPoolExecutor(1) as threads:
        watching = threads.submit(watch)
        try:
            yield watching
        finally:
            stop.set()
    watching.result()


def follow(
    visit: Visit,
    diagnose: Callable[..., Any],
    tell: Callable[[list[str]], None],
    answered: Callable[[Diagnosed], object],
    seconds: float,
    once: bool = False,
) -> None:
    """Watch a leg's folder, and tell of each trial, and of all of them together, until it is interrupted.

    By the base model at once, then by what can be weighed, until it is all or another trial comes.

    Parameters
    ----------
    visit
        The leg.
    diagnose
        Returns what is diagnosed by its trials so far ``within`` a deadline; goes on from what was solved before.
    tell, answered
        Shows lines, if there are any; takes each answer, once it was told.
    seconds
        Until the second answer by the same trials.
    once
        Whether to end when what is there was answered.

    Raises
    ------
    InputError, UnsolvedError
        If that is nothing that can be used, or no answer to it is found.
    """
    tell([f"waiting for recordings in {visit.folder}"])
    leg: Subject | None = None
    wait, last = None, list[str]()
    with _watched(visit, tell) as watching:
        while not watching.done():
            ends, before, leg = once and visit.settled, leg, visit.subject
            wait = wait if leg is before else seconds if once else 0.0
            if leg is None or wait is None:
                if ends:
                    break
                time.sleep(LOOK_S)
                continue
            try:
                found = diagnose(leg, within=Deadline.after(wait, partial(visit.time, leg)))
            except UnsolvedError as error:
                if once:
                    raise
                tell([f"no answer by these trials: {error}"])
                wait = None
                continue
            # What was solved before is judged again, so that answers become rarer.
            wait = (2.0 * wait or seconds) if found.diagnosis.provisional and not once else None
            lines = answer_lines(found, leg, visit.entry.given)
            if set(_used(leg)) <= set(_used(visit.subject)) and lines != last:
                tell(lines)
                answered(found)
                last = lines
    if leg is None:
        raise InputError(visit.folder, RECORDINGS, "there is none that can be used", "press the leg, and run it again")
