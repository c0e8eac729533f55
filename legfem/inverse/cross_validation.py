"""How well a model predicts what it wasn't fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.inverse.errors import ErrorModel
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem, fit
from legfem.inverse.observations import Observations
from legfem.inverse.predictor import onset_name


@dataclass(frozen=True)
class HeldOut:
    """Errors of predicting forces that a fit didn't see."""

    how: str
    rmse: float
    """N."""
    noise: float
    """N: what the errors between trials alone would make."""


def folds_of(observed: Observations) -> tuple[str, list[NDArray[np.bool_]]]:
    """Return what is held out in turn: protocols, else trials, else later phases, else depth.

    Of repeats the first trial is always seen: it alone tells how the leg was before it was pressed,
    which can't be predicted from later trials.
    """
    if observed.repeats > 1:
        later = observed.trial > 0
        if len(observed.protocols) > 1:
            how = "each protocol in turn, but for the first trial"
            each = (later & (observed.protocol == p) for p in range(len(observed.protocols)))
            folds = [fold for fold in each if fold.any()]
        else:
            how = "each trial in turn, but for the first"
            folds = [observed.trial == k for k in range(1, len(observed.trials))]
    elif len(observed.protocols) > 1:
        how, folds = "each protocol in turn", [observed.protocol == p for p in range(len(observed.protocols))]
    elif len(observed.phases) > 1:
        how, folds = "hold and unloading", [observed.phase != "loading"]
    else:
        how, folds = "the deepest third", [observed.displacement > 2 / 3 * observed.depth]
    return how, folds


def held_out(problem: LinearisedProblem, fitted: LinearisedFit, errors: ErrorModel | None = None) -> HeldOut:
    """Return the error of predicting each fold from the others.

    Parameters
    ----------
    problem, fitted
        The model, with the errors that it is fitted by.
    errors
        Of the observations, if others.
    """
    observed = problem.predictor.observed
    how, folds = folds_of(observed)
    squares, noise, count = 0.0, 0.0, 0
    for fold in folds:
        shapes = {f"{m.name}.{p.name}" for m in fitted.mechanisms for p in m.parameters[1:]}
        # Where a trial is touched is its own, and no other trial tells of it.
        onsets = {onset_name(int(k)) for k in np.unique(observed.trial[fold])}
        refit = fit(problem.without(fold[observed.nearest]), fitted.mechanisms, fitted.values, shapes | onsets)
        forces = np.flatnonzero(fold)
        squares += float(np.sum(refit.residual[forces] ** 2))
        noise += float(np.sum(_between_trials(errors or problem.errors)[forces]))
        count += int(fold.sum())
    return HeldOut(how, float(np.sqrt(squares / count)), float(np.sqrt(noise / count)))


def _between_trials(errors: ErrorModel) -> NDArray[np.float64]:
    """Return the variance (N,) of what differs from trial to trial."""
    return np.asarray(errors.trial_sd**2 + errors.gain_sd**2 * np.sum(errors.gains**2, axis=1) + errors.zero_sd**2)
