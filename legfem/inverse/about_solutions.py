"""Fits about full finite-element solutions: the emulator's error there, and refits until they stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem, fit, ordinary_fit
from legfem.inverse.predictor import Predictor, Responses

_MOST = 3
_STAYS = 0.25
"""Of a trial's noise: a refit that moves the prediction by less stays."""


def base_about_solution(
    problem: LinearisedProblem, base: LinearisedFit, solved: Responses | None
) -> tuple[LinearisedProblem, LinearisedFit, float]:
    """Refit the base model about a full solution; return also the emulator's error there.

    Parameters
    ----------
    problem
        The observations.
    base
        The base model's fit.
    solved
        Full solutions; the fit stands without them.
    """
    if solved is None:
        return problem, base, float("nan")
    offset = _offset(problem.predictor, base, solved)
    if offset is None:
        return problem, base, float("nan")
    problem = problem.corrected(offset)
    forces = slice(len(problem.predictor.observed.force))
    error = float(np.abs(offset[forces]).max() / np.abs(base.prediction[forces]).max())
    return problem, ordinary_fit(problem, [base.values]), error


def refitted_about_solutions(
    solved: Responses, problem: LinearisedProblem, fitted: LinearisedFit
) -> tuple[LinearisedProblem, LinearisedFit, bool]:
    """Refit about full solutions until the refit stays; return also whether there was one.

    Fat that slides folds in one way or in another, so that a model may have solutions on several
    branches at about the same stiffness, and a refit need not stay: then that stands which leaves
    least.

    Parameters
    ----------
    solved
        Full solutions.
    problem
        The observations.
    fitted
        What is to be refitted.
    """
    made: list[tuple[LinearisedProblem, LinearisedFit]] = []
    for _ in range(_MOST):
        offset = _offset(problem.predictor, fitted, solved)
        if offset is None:
            break
        before = fitted.prediction
        problem = problem.corrected(offset)
        fitted = fit(problem, fitted.mechanisms, fitted.values)
        made.append((problem, fitted))
        moved, spread = np.abs(fitted.prediction - before), problem.errors.trial_sd
        spans = problem.predictor.observed.data.spans
        if all(moved[span].max() < _STAYS * np.median(spread[span]) for span in spans):
            return *made[-1], True
    if not made:
        return problem, fitted, False
    return *min(made, key=lambda one: one[1].cost), True


def _offset(predictor: Predictor, fitted: LinearisedFit, solved: Responses) -> FloatArray | None:
    """Return the full prediction less the emulated one (N,), 0 of channels that it hasn't; None where it stopped."""
    plain = replace(predictor, offset=0.0)
    full = replace(plain, responses=solved)
    difference = full(fitted.values, fitted.mechanisms, True) - plain(fitted.values, fitted.mechanisms)
    if np.isnan(difference[: len(predictor.observed.force)]).any():
        return None
    return np.nan_to_num(difference, nan=0.0)
