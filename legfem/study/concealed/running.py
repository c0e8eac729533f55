"""Diagnosing sealed cases, blind: only their folders are read."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from legfem.diagnose.document import document
from legfem.diagnose.run import Diagnoser
from legfem.documents import write_document
from legfem.errors import InputError
from legfem.progress import Progress, Silent
from legfem.subject import load_subject
from legfem.workers import Workers


def case_folders(out: Path) -> list[Path]:
    """Return the cases' folders.

    Raises
    ------
    InputError
        If there are none.
    """
    folders = sorted(p for p in (out / "cases").glob("case*") if p.is_dir())
    if not folders:
        raise InputError(out, "cases", "there are none", "make them with --make N --seed S")
    return folders


def diagnosis_file(out: Path, folder: Path) -> Path:
    """Return where a case's diagnosis is kept."""
    return out / "diagnoses" / f"{folder.name}.json"


def run_cases(
    out: Path, diagnoser: Diagnoser, jobs: int, progress: Progress, seed: int = 0
) -> None:
    """Diagnose all cases that aren't diagnosed yet, each in one process."""
    folders = [f for f in case_folders(out) if not diagnosis_file(out, f).is_file()]
    for folder in _one_a_library(folders, diagnoser):
        subject = load_subject(folder)
        diagnoser.library(subject, diagnoser.observations(subject), progress)
    progress.stage("diagnosing sealed cases", len(folders))
    alone = Diagnoser(diagnoser.folder, diagnoser.correction, 1)
    with Workers(_diagnose, (alone, out, seed), jobs) as workers:
        for folder, line in workers.run(_by_leg(folders)):
            progress.advance(f"{folder.name}: {line}")


def _one_a_library(folders: Sequence[Path], diagnoser: Diagnoser) -> list[Path]:
    """Return a case of every leg and protocol, so that their libraries are built first."""
    first: dict[str, Path] = {}
    for folder in folders:
        subject = load_subject(folder)
        keys = sorted(s.key for s in diagnoser.observations(subject).protocols)
        first.setdefault(_contours(folder) + "".join(keys), folder)
    return list(first.values())


def _by_leg(folders: Sequence[Path]) -> list[Path]:
    return sorted(folders, key=lambda folder: (_contours(folder), folder.name))


def _contours(folder: Path) -> str:
    return (folder / "contours.csv").read_text()


def _diagnose(context: tuple[Diagnoser, Path, int], folder: Path) -> str:
    diagnoser, out, seed = context
    begun = time.perf_counter(), time.process_time()
    subject = load_subject(folder)
    found = diagnoser.diagnose(subject, Silent(), seed)
    seconds = time.perf_counter() - begun[0]
    processor = time.process_time() - begun[1]
    content = {**document(found, subject, seed, seconds), "processor_s": processor}
    write_document(diagnosis_file(out, folder), content)
    names = " | ".join("+".join(model.fit.names) for model in found.models)
    return (
        f"{found.verdict} {names} ({seconds:.0f} s, of a processor {processor:.0f} s, "
        f"{found.solutions} full solutions)"
    )
