"""Diagnosing sealed cases, blind, and how large an effect is in a diagnosis: what no refit takes up."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import least_squares

from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.explanation import Explanation
from legfem.inverse.mechanism import null_of
from legfem.inverse.parameter import Parameter
from legfem.inverse.verdict import Diagnosis
from legfem.jobs.pool import Workers
from legfem.jobs.store import Contents, Store, finish, write_arrays
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject
from legfem.report.diagnosis_document import document

_STIFFNESSES = {DEEP_C10: 33, DEEP_C20: 17}
"""Steps."""
_FACTOR = 8.0
"""Of C10 to either side of the fitted one."""


@dataclass(frozen=True, eq=False)
class Metric:
    """What scoring needs of a diagnosis to tell how large an effect is in it; n observations.

    Parameters
    ----------
    force
        (n,), N: recorded.
    covariance
        (n, n), N^2: of everything that the base model may be off by.
    family
        (a, n) or (a, b, n), N: of the base model, over C10 and, where it has one, C20.
    onsets
        (n, t), N: what first contacts change of the base model.
    shown_covariance, shown_jacobian
        Of the base model as it is shown: by equal weights where it is wrong.
    trial_sd
        (n,), N: of a trial's noise.
    located
        (n,): where the base model is said to be wrong.
    rivals, rival_names
        (k, n), N, and (k,): what each mechanism alone adds to the force, fitted.
    """

    force: FloatArray
    covariance: FloatArray
    family: FloatArray
    onsets: FloatArray
    shown_covariance: FloatArray
    shown_jacobian: FloatArray
    trial_sd: FloatArray
    located: NDArray[np.bool_]
    rivals: FloatArray
    rival_names: NDArray[np.str_]

    @classmethod
    def of(cls, found: Diagnosis) -> Metric:
        """Return a diagnosis' metric."""
        observed, errors, base = found.observed, found.errors, found.weighted_base.fit
        alone = [e for e in found.explained.every if len(e.names) == 1]
        of = observed.data.spans[0]
        return cls(
            observed.force,
            errors.covariance[of, of],
            _family(found.weighted_base)[..., of],
            base.sensitivities[of, len(base.stiffness) :],
            found.base.problem.errors.covariance[of, of],
            found.base.fit.sensitivities[of],
            errors.trial_sd[of],
            found.located,
            np.reshape([_added(e)[of] for e in alone], (-1, len(observed.trial))),
            np.array([e.names[0] for e in alone], dtype=np.str_),
        )

    def size(self, change: FloatArray, *beside: FloatArray) -> float:
        """Return how many standard deviations an effect is away from what could stand for it.

        The leg without it is the base model fitted to the recording less the change. Then the base
        model is fitted to that leg with the change, together with any share of other changes: what
        is left is told in standard deviations of all errors.

        Parameters
        ----------
        change
            (n,), N: of the force.
        beside
            (n,), N, each: what else may stand for it, however strong.
        """
        return self._nearest(self._shown_by_a_leg(change), *beside)[1]

    def told_apart(self, change: FloatArray, names: Collection[str]) -> float:
        """Return an effect's size beside the nearest mechanism but its own.

        Below some standard deviations no reading of the recordings tells the two apart. NaN without
        another mechanism.
        """
        pairs = zip(self.rivals, self.rival_names, strict=True)
        others = [rival for rival, name in pairs if name not in names]
        force = self._shown_by_a_leg(change)
        return min((self._nearest(force, other)[1] for other in others), default=float("nan"))

    def _shown_by_a_leg(self, change: FloatArray) -> FloatArray:
        """Return the force (n,), N, of the base model's leg with a change."""
        return self._nearest(self.force - change)[0] + change

    def shown(self, change: FloatArray) -> FloatArray:
        """Return what the base model as it is shown leaves of a change (n,), N."""
        lower = cholesky(self.shown_covariance, lower=True)
        basis = _basis(solve_triangular(lower, self.shown_jacobian, lower=True))
        return np.asarray(lower @ _off(basis, solve_triangular(lower, change, lower=True)))

    @cached_property
    def _lower(self) -> FloatArray:
        return np.asarray(cholesky(self.covariance, lower=True))

    @cached_property
    def _white_family(self) -> FloatArray:
        shape = self.family.shape
        flat = solve_triangular(self._lower, self.family.reshape(-1, shape[-1]).T, lower=True)
        return np.asarray(flat.T.reshape(shape))

    @cached_property
    def _at(self) -> RegularGridInterpolator:
        axes = [np.arange(count, dtype=float) for count in self.family.shape[:-1]]
        return RegularGridInterpolator(axes, self._white_family, method="cubic")

    def _nearest(self, force: FloatArray, *beside: FloatArray) -> tuple[FloatArray, float]:
        """Return the base model nearest to a force (n,), N, and how far that is, whitened."""
        free = np.column_stack([self.onsets, *beside])
        basis = _basis(solve_triangular(self._lower, free, lower=True))
        target = solve_triangular(self._lower, force, lower=True)
        counts = self.family.shape[:-1]
        each = _off(basis, target[:, None] - self._white_family.reshape(-1, len(force)).T)
        first = np.unravel_index(int(np.argmin(np.sum(each**2, axis=0))), counts)
        ends = np.array(counts) - 1.0
        found = least_squares(
            lambda x: _off(basis, target - self._at(x)[0]),
            np.clip(first, 1e-3, ends - 1e-3),
            bounds=(np.zeros(len(ends)), ends),
        )
        return self._lower @ self._at(found.x)[0], float(np.linalg.norm(found.fun))

    def write(self, path: Path) -> None:
        """Write it, whole or not at all."""
        write_arrays(path, {f.name: getattr(self, f.name) for f in fields(self)}, compressed=True)

    @classmethod
    def read(cls, path: Path) -> Metric:
        """Read it."""
        with np.load(path) as kept:
            return cls(**{f.name: kept[f.name] for f in fields(cls)})


def _basis(columns: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.qr(columns)[0])


def _off(basis: FloatArray, values: FloatArray) -> FloatArray:
    """Return vectors (n,) or (n, k) without what a basis spans."""
    return np.asarray(values - basis @ (basis.T @ values))


def _family(base: Explanation) -> FloatArray:
    """Return the base model's forces over its stiffness; see `Metric.family`."""
    fitted, predictor = base.fit, base.problem.predictor
    sought = [p for p in fitted.parameters if p.name in fitted.stiffness]
    axes = [_steps(p, fitted.values[p.name]) for p in sought]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    names = [p.name for p in sought]
    forces = [
        predictor({**fitted.values, **dict(zip(names, point, strict=True))}) for point in points.reshape(-1, len(names))
    ]
    return np.reshape(forces, (*points.shape[:-1], -1))


def _steps(one: Parameter, value: float) -> FloatArray:
    """Return values of a stiffness, MPa; those of C20 closer together where it is small."""
    (low, high), count = one.bounds, _STIFFNESSES[one.name]
    if one.scale == "log":
        return np.geomspace(max(low, value / _FACTOR), min(high, value * _FACTOR), count)
    return low + (high - low) * np.linspace(0.0, 1.0, count) ** 2


def _added(one: Explanation) -> FloatArray:
    """Return what a mechanism adds to the readings (N,)."""
    (mechanism,) = one.fit.mechanisms
    strength = mechanism.parameters[0]
    without = {**one.fit.values, f"{mechanism.name}.{strength.name}": null_of(strength)}
    return np.asarray(one.fit.prediction - one.problem.predictor(without, one.fit.mechanisms))


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
