"""A leg while it is in the rig: each trial is judged as an instrument writes it, and all so far are diagnosed."""

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any

from legfem.api.diagnosed import Diagnosed
from legfem.api.loading import Given, folder_of
from legfem.common.errors import InputError, doubt_lines
from legfem.data.quality import WORST_GRADE, quality_of
from legfem.data.watched import STALLED_S, FileState, Watched, changes, is_cut, looked, stamps_of
from legfem.inverse.answer import Finding
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.verdict import answer_of
from legfem.legs.diagnosis import doubts_of
from legfem.legs.loading import load_subject, read_recordings, trial_files, with_trials
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import RECORDINGS, SUBJECTS, SubjectEntry, WantedEntry, subject_entry
from legfem.legs.subject import Subject
from legfem.report.answers import headline_of
from legfem.report.diagnosis_headline import to_do
from legfem.report.instrument_file import contact_text
from legfem.report.words import number

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

    def look(self, now: float) -> list[str]:
        """Look at the folder at a time (s); return what is new to be said."""
        before, told, subject = self.files, self.told, None
        there = stamps_of(trial_files(self.leg.directory, self.entry))
        self.files = looked(before, there, now, self._read)
        if changes(before, self.files):
            self.told = {}
            for path, file in sorted(self.files.items(), key=lambda one: one[1].since):
                if file.state == "complete":
                    self.told[path], subject = self._judged(path, subject)
                elif file.state in _STATES:
                    self.told[path] = [f"{path.name} {_STATES[file.state]}{file.trouble}"]
            if _used(subject) != _used(self.subject):
                self.subject = subject
        self.settled = not any(one.open for one in self.files.values())
        return [line for path, lines in self.told.items() if lines != told.get(path) for line in lines]

    def _read(self, path: Path) -> None:
        if is_cut(path):
            raise InputError(path, "rows", "the last one isn't whole", "save the file anew if nothing more comes")
        read_recordings(self.folder, [path], self.entry.given.recordings.channels())

    def _judged(self, path: Path, before: Subject | None) -> tuple[list[str], Subject | None]:
        """Return what is to be said of a trial beside those before it, and the leg with those that can be used."""
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


def answer_lines(found: Diagnosed, leg: Subject, wanted: WantedEntry | None = None) -> list[str]:
    """Return what all trials so far say, how well C10 is known beside what is wanted, and what to do next."""
    answer, known = answer_of(found.diagnosis), doubts_about(leg)
    lines = [f"by {', '.join(one.trial for one in leg.recordings)}: {headline_of(answer).said}"]
    lines += doubt_lines(one for one in doubts_of(found.diagnosis, leg) if one not in known)
    so_far, enough = answer.finding is Finding.PROVISIONAL, False
    if wanted is not None and (c10 := answer.values.get(DEEP_C10)) is not None and c10.ci95 is not None:
        low, high = c10.ci95
        value = (low + high) / 2 if c10.value is None else c10.value
        percent = 50 * (high - low) / value
        enough = percent <= wanted.C10_percent
        # No error is said to be less than it is.
        error = f"± {math.ceil(percent)} %"
        shown = f"{'so far ' * so_far}enough: C10 {number(value, (high - low) / 4)} kPa {error}"
        lines.append(shown if enough else f"{error} of {wanted.C10_percent:g} % wanted")
    again = "Press again at the same place. Then: " * (len(leg.trials) == 1)
    asked = [] if enough and not so_far else [f"next: {again}{to_do(found.diagnosis, found.next_tests)}"]
    return [*lines, *asked]


def follow(
    visit: Visit,
    diagnose: Callable[[Subject], Any],
    tell: Callable[[list[str]], None],
    answered: Callable[[Diagnosed], object],
    once: bool = False,
) -> None:
    """Watch a leg's folder, and tell of each trial, and of all of them together, until it is interrupted.

    A provisional answer is sought on as long as that brings something new, or another trial comes.

    Parameters
    ----------
    visit
        The leg.
    diagnose
        Returns what is diagnosed by its trials so far; goes on from what was solved before.
    tell
        Shows lines, if there are any.
    answered
        Takes each answer, once it was told.
    once
        Whether to end when what is there was answered.

    Raises
    ------
    InputError
        If that is nothing that can be used.
    """
    stop = Event()

    def watch() -> None:
        while not stop.wait(LOOK_S):
            tell(visit.look(time.monotonic()))

    tell([f"waiting for recordings in {visit.folder}"])
    leg: Subject | None = None
    open_, last = False, list[str]()
    with ThreadPoolExecutor(1) as threads:  # solutions and Ctrl-C are the main thread's
        watching = threads.submit(watch)
        try:
            while not watching.done():
                ends, before, leg = once and visit.settled, leg, visit.subject
                if leg is not None and (open_ or leg is not before):
                    found: Diagnosed = diagnose(leg)
                    lines = answer_lines(found, leg, visit.entry.given.wanted)
                    counts = set(_used(leg)) <= set(_used(visit.subject))
                    if new := counts and (leg is not before or lines != last):
                        tell(lines)
                        answered(found)
                    open_, last = new and found.diagnosis.provisional and not once, lines
                elif ends:
                    break
                else:
                    time.sleep(LOOK_S)
        finally:
            stop.set()
        watching.result()
    if leg is None:
        raise InputError(visit.folder, RECORDINGS, "there is none that can be used", "press the leg, and run it again")
