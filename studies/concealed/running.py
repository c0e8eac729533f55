"""Diagnosing sealed cases, blind: only their folders are read."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent
from legfem.jobs.key import Contents
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject
from legfem.report.diagnosis_document import document
from studies.concealed.metric import Metric


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


def diagnoses(out: Path, diagnoser: Diagnoser, seed: int = 0) -> Store[dict[str, Any]]:
    """Return the cases' diagnoses, by `asked`."""
    return Store(
        out / "diagnoses",
        dict[str, Any],
        (diagnoser.correction, seed),
        ("legfem.legs.diagnosis", "legfem.report.diagnosis_document"),
        named=lambda one: one[0],
    )


def asked(folder: Path) -> tuple[str, Contents]:
    """Return what a diagnosis depends on."""
    return folder.name, Contents(folder)


def metric_file(out: Path, folder: Path) -> Path:
    """Return where a diagnosis' metric is kept."""
    return out / "diagnoses" / f"{folder.name}.npz"


def run_cases(out: Path, diagnoser: Diagnoser, jobs: int, progress: Progress, seed: int = 0) -> None:
    """Diagnose all cases that aren't diagnosed yet, each in one process."""
    store = diagnoses(out, diagnoser, seed)
    folders = case_folders(out)
    store.folder.mkdir(parents=True, exist_ok=True)
    waiting = [folder for folder in folders if store.get(asked(folder)) is None]
    for folder in _one_a_leg(waiting):
        subject = load_subject(folder)
        diagnoser.library(subject, diagnoser.observations(subject), progress)
    alone = Diagnoser(diagnoser.folder, diagnoser.correction, 1)
    with Workers(_diagnose, (alone, out, seed), jobs) as workers:
        finish(workers, folders, store, progress, "diagnosing sealed cases", _line, asked)


def _one_a_leg(folders: Sequence[Path]) -> list[Path]:
    """Return a case of every leg, so that their libraries are built first, in all processes."""
    first: dict[str, Path] = {}
    for folder in folders:
        first.setdefault((folder / "contours.csv").read_text(), folder)
    return list(first.values())


def _diagnose(context: tuple[Diagnoser, Path, int], folder: Path) -> dict[str, Any]:
    diagnoser, out, seed = context
    begun = time.perf_counter(), time.process_time()
    subject = load_subject(folder)
    found = diagnoser.diagnose(subject, Silent(), seed)
    seconds = time.perf_counter() - begun[0]
    processor = time.process_time() - begun[1]
    Metric.of(found).write(metric_file(out, folder))
    return {**document(found, subject, seed, seconds), "processor_s": processor}


def _line(folder: Path, found: dict[str, Any]) -> str:
    names = " | ".join("+".join(model["mechanisms"]) for model in found["models"])
    return (
        f"{folder.name}: {found['verdict']} {names} ({found['wall_s']:.0f} s, of a processor "
        f"{found['processor_s']:.0f} s, {found['full_solutions']} full solutions)"
    )
