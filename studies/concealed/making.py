"""Making sealed cases: one subject folder each, its key, and what the concealed effects change of what is recorded."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.documents import write_atomically, write_document
from legfem.common.errors import InputError
from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.data import Recording, segment
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.observations import Observations
from legfem.inverse.stations import read_at
from legfem.jobs.pool import Workers
from legfem.legs.folder import write_subject_folder
from legfem.legs.subject import Subject
from studies.concealed.cases import SealedCase, sealed_leg
from studies.concealed.truth import SealedTruth, Truths
from studies.lab.recording import INSTRUMENT, Course, record
from studies.lab.stated import drawn_errors


def recorded(courses: Sequence[Course], noise_seed: int) -> list[Recording]:
    """Return what a lab records of trials, its errors drawn by a seed."""
    generator = np.random.default_rng(noise_seed)
    return record(courses, drawn_errors(generator), generator)


def recorded_change(courses: Sequence[Course], others: Sequence[Course], noise_seed: int) -> list[list[float]]:
    """Return how far a lab's readings of trials are from those it would have of others (N).

    Both by the same air, gains, zeros and noise, sample by sample.
    """
    pairs = zip(recorded(courses, noise_seed), recorded(others, noise_seed), strict=True)
    return [[float(v) for v in one.force - other.force] for one, other in pairs]


def change_at_stations(
    recordings: Sequence[Recording], changes: Sequence[Sequence[float]], observed: Observations
) -> FloatArray:
    """Return what changes of the recordings are at a diagnosis' stations (n,), N.

    Trials are cut at the first contacts that the diagnosis found, so that a change is looked up
    where it was recorded, however wrong these are.
    """
    parts = []
    for k, (recording, change) in enumerate(zip(recordings, changes, strict=True)):
        less = replace(recording, force=recording.force - np.asarray(change))
        trial = segment(less, starts_at_contact=True).touching(observed.contacts[k])
        parts.append(read_at(trial, observed.protocols[observed.protocol_of[k]]).force)
    return np.asarray(observed.force - np.concatenate(parts))


def write_sealed(path: Path, content: Mapping[str, Any], seed: int) -> None:
    """Write a key's salted hash and its enciphered content."""
    text = json.dumps(content, sort_keys=True).encode()
    salt = secrets.token_hex(16)
    write_document(
        path,
        {
            "sha256": hashlib.sha256(salt.encode() + text).hexdigest(),
            "salt": salt,
            "content": _enciphered(text, seed, salt).hex(),
        },
    )


def read_sealed(path: Path, seed: int) -> dict[str, Any]:
    """Open a key.

    Raises
    ------
    InputError
        If it isn't there, the seed is another, or its content isn't what was sealed.
    """
    try:
        sealed = json.loads(path.read_text())
        salt = sealed["salt"]
        text = _enciphered(bytes.fromhex(sealed["content"]), seed, salt)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(path, "key", f"can't be read ({error})", "make the cases again") from None
    if hashlib.sha256(salt.encode() + text).hexdigest() != sealed["sha256"]:
        raise InputError(path, "--seed", "does not open this key", "give the seed the cases were made with")
    return dict(json.loads(text))


def _enciphered(text: bytes, seed: int, salt: str) -> bytes:
    blocks = (hashlib.sha256(f"{seed}/{salt}/{k}".encode()).digest() for k in range(len(text) // 32 + 1))
    return bytes(a ^ b for a, b in zip(text, b"".join(blocks), strict=False))


@dataclass(eq=False)
class Maker:
    """Simulates cases; sections are meshed once a process."""

    out: Path
    folder: Path
    """Of the truth's solutions."""
    seed: int
    correction: TabulatedCorrection
    _legs: dict[int, tuple[Subject, Truths]] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave finite-element models out."""
        return {**self.__dict__, "_legs": {}}

    def make(self, case: SealedCase) -> str:
        """Write a case's folder and key; return what happened in a word."""
        folder = self.out / "cases" / case.name
        if (self.out / "keys" / f"{case.name}.json").is_file() and folder.is_dir():
            return "made before"
        stated, truths = self._leg(case.leg)
        truth, parts = truths.of(case), truths.without_each(case)
        if truth is None or parts is None:
            return "LEFT OUT: a finite-element solution stopped"
        if not folder.is_dir():
            recordings = recorded(truth.trials, case.noise_seed)
            write_case(folder, f"Sealed case {case.number} (simulated)", case, stated, recordings)
        key = key_of_case(case, truth, parts)
        write_sealed(self.out / "keys" / f"{case.name}.json", key, self.seed)
        return "made"

    def _leg(self, number: int) -> tuple[Subject, Truths]:
        if number not in self._legs:
            leg = sealed_leg(number, self.seed)
            truths = Truths(leg.true, self.folder, self.correction)
            self._legs[number] = leg.stated, truths
        return self._legs[number]


def write_case(folder: Path, title: str, case: SealedCase, stated: Subject, recordings: Sequence[Recording]) -> None:
    """Write a case's recordings with what the lab believes of the leg."""
    write_subject_folder(
        stated.section,
        folder,
        title,
        stated.indenter.aim,
        stated.indenter.direction_deg,
        origin="simulated",
        recordings=recordings,
        instrument=INSTRUMENT,
        deep_law=case.law,
    )
    _state_accuracy(folder / "subject.toml", stated)


def _state_accuracy(path: Path, stated: Subject) -> None:
    """Add to a subject's file how well its leg is known, as the lab believes."""
    own = stated.accuracy
    write_atomically(
        path,
        f"{path.read_text()}\n[accuracy]\ncontour_sd_mm = {own.contour_sd}\n"
        f"aim_sd_mm = {own.aim_sd}\ndirection_sd_deg = {own.direction_sd}\n",
    )


def key_of_case(case: SealedCase, truth: SealedTruth, parts: Mapping[str, SealedTruth]) -> dict[str, Any]:
    """Return what is sealed: the case, and what its effects change of the recorded force.

    Parameters
    ----------
    case
        The case.
    truth
        What its leg did.
    parts
        What it did without one of two effects, by that one's name.
    """
    return {
        "case": case.document(),
        "recorded_change_N": recorded_change(truth.trials, truth.without, case.noise_seed),
        "recorded_part_change_N": {
            name: recorded_change(truth.trials, less.trials, case.noise_seed) for name, less in parts.items()
        },
        "greatest_force_N": max(float(course.force.max()) for course in truth.without),
    }


def make(cases: Sequence[SealedCase], maker: Maker, jobs: int, progress: Progress) -> None:
    """Make cases that aren't made yet, on several processes."""
    progress.stage("simulating sealed cases", len(cases))
    # In the order of their numbers, which is random: whoever stops early has a fair sample.
    order = sorted(cases, key=lambda case: (case.number if case.twin_of is None else case.twin_of, case.number))
    with Workers(_make, maker, jobs) as workers:
        for case, what in workers.run(order):
            progress.advance(f"{case.name}: {what}")


def _make(maker: Maker, case: SealedCase) -> str:
    return maker.make(case)
