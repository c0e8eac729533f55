"""What ``python -m studies.next_test`` does and writes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from legfem.common.documents import write_atomically, write_document
from legfem.common.errors import InputError
from legfem.common.progress import Progress
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from studies.concealed.running import asked, case_folders, diagnoses
from studies.next_test.page import page, tried_document
from studies.next_test.trying import Lab, Tried, try_case


@dataclass(frozen=True)
class NextTestOptions:
    """What is asked for."""

    cases: Path
    out: Path
    library: Path
    most: int
    seed: int
    jobs: int


def run(options: NextTestOptions, progress: Progress) -> list[str]:
    """Try the ambiguous cases; return lines for the terminal.

    Raises
    ------
    InputError
        If no case was called ambiguous by this code.
    """
    correction = read_correction(REFERENCE)
    diagnoser = Diagnoser(options.library, correction, 1)
    folders = _ambiguous(options.cases, diagnoser)[: options.most]
    if not folders:
        raise InputError(
            options.cases,
            "diagnoses",
            "none by this code is ambiguous",
            "run python -m studies.concealed --run on this folder first",
        )
    lab = Lab(options.cases, options.out / "work", diagnoser, options.seed)
    store = Store(
        options.out / "tried",
        Tried,
        (correction, options.seed),
        ("studies.next_test.trying", "legfem.legs.diagnosis"),
        named=lambda one: one[0],
    )
    with Workers(try_case, lab, options.jobs) as workers:
        tried = finish(workers, folders, store, progress, "trying the next test", _line, asked)
    path = write_document(options.out / "result.json", tried_document(tried))
    text = page(tried)
    write_atomically(options.out / "report.md", text)
    return [text, f"result: {path}"]


def _ambiguous(cases: Path, diagnoser: Diagnoser) -> list[Path]:
    """Return the folders of cases that were called ambiguous, in the order of their numbers."""
    store = diagnoses(cases, diagnoser)
    known = ((folder, store.get(asked(folder))) for folder in case_folders(cases))
    return [folder for folder, found in known if found is not None and found["verdict"] == "ambiguous"]


def _line(folder: Path, tried: Tried) -> str:
    if tried.proposed is None or tried.random is None:
        return f"{folder.name}: {tried.why}"
    return f"{folder.name}: {tried.proposed.line}; at random {tried.random.line}"
