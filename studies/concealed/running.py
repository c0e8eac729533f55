"""Diagnosing sealed cases, blind: only their folders are read."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent
from legfem.common.units import FloatArray
from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.document import document
from legfem.diagnose.run import Diagnoser
from legfem.jobs.arrays import write_arrays
from legfem.jobs.key import Contents
from legfem.jobs.pool import Workers
from legfem.jobs.resume import finish
from legfem.jobs.store import Store
from legfem.subjects.loading import load_subject


@dataclass(frozen=True, eq=False)
class Metric:
    """What scoring needs of a diagnosis to tell how large an effect is in it; n observations.

    Parameters
    ----------
    trial, time
        (n,): number, and s since first contact.
    covariance
        (n, n), N^2: of everything that the base model may be off by.
    jacobian
        (n, p), N: of the base model.
    shown_covariance, shown_jacobian
        Of the base model as it is shown: by equal weights where it is wrong.
    trial_sd
        (n,), N: of a trial's noise.
    located
        (n,): where the base model is said to be wrong.
    rivals, rival_names
        (k, n), N, and (k,): what each mechanism alone changes of the base model, fitted.
    """

    trial: NDArray[np.int_]
    time: FloatArray
    covariance: FloatArray
    jacobian: FloatArray
    shown_covariance: FloatArray
    shown_jacobian: FloatArray
    trial_sd: FloatArray
    located: NDArray[np.bool_]
    rivals: FloatArray
    rival_names: NDArray[np.str_]

    @classmethod
    def of(cls, found: Diagnosis) -> Metric:
        """Return a diagnosis' metric."""
        observed, errors = found.observed, found.errors
        alone = [e.fit for e in found.explained.every if len(e.names) == 1]
        rivals = [fitted.prediction - found.alone.fit.prediction for fitted in alone]
        return cls(
            observed.trial, observed.time, errors.covariance, found.alone.fit.change,
            found.base.problem.errors.covariance, found.base.fit.change,
            errors.trial_sd, found.located,
            np.reshape(rivals, (-1, len(observed.trial))),
            np.array([fitted.names[0] for fitted in alone], dtype=np.str_),
        )  # fmt: skip

    def shown(self, change: FloatArray) -> tuple[float, FloatArray]:
        """Return a change's size over all errors, and what of it a refit leaves (n,), N.

        The size is the length of the whitened change beyond the base model's parameters: how many
        standard deviations it is away from nothing, were its shape known.
        """
        white, _ = _beyond(self.covariance, self.jacobian, change)
        _, rest = _beyond(self.shown_covariance, self.shown_jacobian, change)
        return float(np.linalg.norm(white)), rest

    def beside(self, change: FloatArray, other: FloatArray) -> float:
        """Return a change's size over all errors beyond the base model and another change (n,), N.

        What a second effect adds to a first one of any strength.
        """
        white, _ = _beyond(self.covariance, np.column_stack([self.jacobian, other]), change)
        return float(np.linalg.norm(white))

    def told_apart(self, change: FloatArray, names: Collection[str]) -> float:
        """Return a change's size beyond the base model and the nearest mechanism but its own.

        However strong that one is: below some standard deviations no reading of the recordings
        tells the two apart. NaN without another mechanism.
        """
        others = [
            rival
            for rival, name in zip(self.rivals, self.rival_names, strict=True)
            if name not in names
        ]
        return min((self.beside(change, other) for other in others), default=float("nan"))

    def write(self, path: Path) -> None:
        """Write it, whole or not at all."""
        write_arrays(path, vars(self), compressed=True)

    @classmethod
    def read(cls, path: Path) -> Metric:
        """Read it."""
        with np.load(path) as kept:
            return cls(**dict(kept))


def _beyond(
    covariance: FloatArray, jacobian: FloatArray, change: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what parameters leave of a change, whitened and in N."""
    lower = cholesky(covariance, lower=True)
    white = solve_triangular(lower, change, lower=True)
    basis = np.linalg.qr(solve_triangular(lower, jacobian, lower=True))[0]
    rest = white - basis @ (basis.T @ white)
    return rest, np.asarray(lower @ rest)


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
        out / "diagnoses", dict[str, Any], (diagnoser.correction, seed),
        ("legfem.diagnose.run", "legfem.diagnose.document"), named=lambda one: one[0],
    )  # fmt: skip


def asked(folder: Path) -> tuple[str, Contents]:
    """Return what a diagnosis depends on."""
    return folder.name, Contents(folder)


def metric_file(out: Path, folder: Path) -> Path:
    """Return where a diagnosis' metric is kept."""
    return out / "diagnoses" / f"{folder.name}.npz"


def run_cases(
    out: Path, diagnoser: Diagnoser, jobs: int, progress: Progress, seed: int = 0
) -> None:
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
