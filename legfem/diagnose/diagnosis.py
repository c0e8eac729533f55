"""A diagnosis: the six steps from recordings to a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from legfem.diagnose.choose import Candidate, Choice, HeldOut, choose, held_out
from legfem.diagnose.fit import Fit, Problem, fit, fit_base
from legfem.diagnose.library import Library, tested_mechanisms
from legfem.diagnose.mechanisms import MECHANISMS, Mechanism
from legfem.diagnose.noise import ErrorModel, estimate_noise
from legfem.diagnose.observations import Observations
from legfem.diagnose.predict import LawName, Predictor
from legfem.diagnose.solved import SolvedResponses
from legfem.progress import Progress
from legfem.recording import Instrument

Verdict = Literal["consistent", "named", "ambiguous", "unexplained"]
_STARTS_KPA = ((0.4, 0.2), (1.0, 0.8), (2.0, 3.0))
_CONFIRMATIONS = 3


@dataclass(frozen=True, eq=False)
class Repaired:
    """A model with mechanisms that describes the recordings, confirmed by a full solution."""

    candidate: Candidate
    held_out: HeldOut

    @property
    def confirmed(self) -> bool:
        """Whether finite elements have confirmed the emulated prediction."""
        return self.candidate.confirmed

    @property
    def fit(self) -> Fit:
        """The refit."""
        return self.candidate.fit


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found in a leg's recordings."""

    verdict: Verdict
    law: LawName
    observed: Observations
    errors: ErrorModel
    base: Candidate
    base_held_out: HeldOut
    models: tuple[Repaired, ...]
    """Models with mechanisms that suit, the best first; none if consistent or unexplained."""
    closest: Fit
    """The best refit of all, whether it suits or not."""
    tried: tuple[Fit, ...]
    untested: dict[str, str]
    """Mechanisms that the recordings can't show, and why."""
    located: NDArray[np.bool_]
    """(n,): observations at which the base model is wrong by more than a trial's noise."""
    solutions: int
    """Finite-element solutions made for it, beside the library's."""
    emulator_error: float
    """Greatest difference of the base model's emulated and full forces, over the largest force."""


def diagnose(
    observed: Observations,
    instrument: Instrument,
    law: LawName,
    library: Library,
    solved: SolvedResponses | None,
    progress: Progress,
    seed: int = 0,
) -> Diagnosis:
    """Diagnose recordings: noise, base fit, location, names, refits, verdict.

    Parameters
    ----------
    observed
        The recordings at their stations.
    instrument
        Stated errors.
    law
        Of the deep tissue in the base model.
    library
        Of the leg's responses.
    solved
        Full solutions, to confirm what is reported; emulated ones stand without it.
    progress
        Told of the steps.
    seed
        Of the draws behind p-values.
    """
    able, untested = tested_mechanisms(observed, library)
    progress.stage("fitting the base model")
    made = solved.solutions if solved is not None else 0
    noise, possible = estimate_noise(observed, instrument)
    problem, base = fit_base(Predictor(observed, library, law), noise, possible, starts(law))
    base, problem, error = _about_solution(problem, base, solved)
    progress.stage(f"testing {len(able)} mechanisms")
    choice = choose(problem, base, able, seed, partial(_confirmed, solved))
    models = _repaired(choice)
    verdict = _verdict(choice, models)
    best = models[0].fit if models else choice.best.fit
    return Diagnosis(
        verdict,
        law,
        observed,
        problem.errors,
        choice.base,
        held_out(problem, choice.base.fit),
        models,
        best,
        choice.tried,
        untested,
        _located(choice, models, problem.errors),
        (solved.solutions if solved is not None else 0) - made,
        error,
    )


def starts(law: LawName) -> list[dict[str, float]]:
    """Return where searches for the base parameters begin, kPa."""
    if law == "neo-hookean":
        return [{"C10": c10, "C20": 0.0} for c10, _ in _STARTS_KPA]
    return [{"C10": c10, "C20": c20} for c10, c20 in _STARTS_KPA]


def _about_solution(
    problem: Problem, base: Fit, solved: SolvedResponses | None
) -> tuple[Fit, Problem, float]:
    """Refit the base model about a full solution; return also the emulator's error there."""
    if solved is None:
        return base, problem, 0.0
    offset = _offset(problem.predictor, base, solved)
    if offset is None:
        return base, problem, float("nan")
    problem = problem.corrected(offset)
    error = float(np.abs(offset).max() / np.abs(base.prediction).max())
    return fit(problem, (), base.values), problem, error


def _offset(predictor: Predictor, fitted: Fit, solved: SolvedResponses) -> np.ndarray | None:  # type: ignore[type-arg]
    """Return the full prediction less the emulated one (n,), N; None where it stopped."""
    plain = replace(predictor, offset=0.0)
    full = replace(plain, responses=solved)
    difference = full(fitted.values, fitted.mechanisms) - plain(fitted.values, fitted.mechanisms)
    return None if np.isnan(difference).any() else difference


def _confirmed(
    solved: SolvedResponses | None, problem: Problem, fitted: Fit, limit: float
) -> tuple[Problem, Fit, bool]:
    """Refit about full solutions, until the refit stays or its criterion is hopeless."""
    if solved is None:
        return problem, fitted, False
    confirmed = False
    for _ in range(_CONFIRMATIONS):
        offset = _offset(problem.predictor, fitted, solved)
        if offset is None:
            break
        problem = problem.corrected(offset)
        before = fitted.prediction
        fitted = fit(problem, fitted.mechanisms, fitted.values)
        confirmed = True
        if fitted.bic > limit:
            break
        if np.abs(fitted.prediction - before).max() < 0.25 * np.median(problem.errors.trial_sd):
            break
    return problem, fitted, confirmed


def _repaired(choice: Choice) -> tuple[Repaired, ...]:
    if not (choice.mismatch and choice.best.adequate):
        return ()
    return tuple(
        Repaired(candidate, held_out(candidate.problem, candidate.fit))
        for candidate in (choice.best, *choice.alternatives)
    )


def _verdict(choice: Choice, models: Sequence[Repaired]) -> Verdict:
    if not choice.mismatch:
        return "consistent"
    if not models:
        return "unexplained"
    return "named" if len(models) == 1 else "ambiguous"


def _located(choice: Choice, models: Sequence[Repaired], errors: ErrorModel) -> NDArray[np.bool_]:
    """Return where the base model errs by more than a trial's noise.

    Where a model suits, it tells what the base model misses without the noise; else the windows do.
    """
    base = choice.base
    located = np.zeros(len(base.fit.residual), dtype=bool)
    if not choice.mismatch:
        return located
    if models:
        return np.asarray(np.abs(models[0].fit.prediction - base.fit.prediction) > errors.trial_sd)
    for window in base.assessment.windows:
        located[list(window.stations)] = True
    return located


def mechanism_named(name: str) -> Mechanism:
    """Return the mechanism of a name."""
    return next(m for m in MECHANISMS if m.name == name)
