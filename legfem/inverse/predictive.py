"""How well a model predicts what it wasn't fitted to, how far it misses, and what it leaves in each phase.

With the residual r of a phase about the model's fit and S the covariance there of all errors that the model knows of,
nuisances included, :math:`r^T S^{-1} r` is as large or larger in a share of replicated recordings: the upper tail of a
chi-square with as many degrees as readings (A. Gelman, X.-L. Meng, H. Stern, Stat. Sinica 6 (1996) 733). The parameters
were fitted to the same readings, so that the share is on the high side, and a small one says more.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.errors import ErrorModel
from legfem.inverse.explanation import Explanation
from legfem.inverse.intervals import THIRDS, third_of
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import equally_weighted, fit
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
            how = "each protocol in turn, except the first trial"
            each = (later & (observed.protocol == p) for p in range(len(observed.protocols)))
            folds = [fold for fold in each if fold.any()]
        else:
            how = "each trial in turn, except the first"
            folds = [observed.trial == k for k in range(1, len(observed.trials))]
    elif len(observed.protocols) > 1:
        how, folds = "each protocol in turn", [observed.protocol == p for p in range(len(observed.protocols))]
    elif len(observed.phases) > 1:
        how, folds = "hold and unloading", [observed.phase != "loading"]
    else:
        how, folds = "the deepest third", [observed.displacement > 2 / 3 * observed.depth]
    return how, folds


def held_out(fitted: LinearisedFit, errors: ErrorModel | None = None) -> HeldOut:
    """Return the error of predicting each fold from the others.

    Parameters
    ----------
    fitted
        The model.
    errors
        Of the observations, if others than it is fitted by.
    """
    problem = fitted.problem
    observed, errors = problem.predictor.observed, errors or problem.errors
    # What differs from trial to trial.
    variance = errors.trial_sd**2 + errors.gain_sd**2 * np.sum(errors.gains**2, axis=1) + errors.zero_sd**2
    how, folds = folds_of(observed)
    squares, noise, count = 0.0, 0.0, 0
    for fold in folds:
        shapes = {f"{m.name}.{p.name}" for m in fitted.mechanisms for p in m.parameters[1:]}
        # Where a trial is touched is its own, and no other trial tells of it.
        onsets = {onset_name(int(k)) for k in np.unique(observed.trial[fold])}
        refit = fit(problem.without(fold[observed.nearest]), fitted.mechanisms, fitted.values, shapes | onsets)
        forces = np.flatnonzero(fold)
        squares += float(np.sum(refit.residual[forces] ** 2))
        noise += float(np.sum(variance[forces]))
        count += int(fold.sum())
    return HeldOut(how, float(np.sqrt(squares / count)), float(np.sqrt(noise / count)))


@dataclass(frozen=True)
class PhaseCheck:
    """What is left in a phase over all trials, root mean square; N."""

    phase: str
    left: float
    errors: float
    """Of all that the model knows may be off there."""
    p_value: float
    """Share of replicated recordings in which as much is left."""


def checks_by_phase(model: Explanation) -> Iterator[PhaseCheck]:
    """Yield the checks of a model's force in each phase, in the order in which phases are recorded."""
    problem = model.problem
    observed = problem.predictor.observed
    forces = len(observed.force)
    residual, total = model.fit.residual[:forces], problem.errors.covariance[:forces, :forces]
    for phase in dict.fromkeys(observed.phase):
        here = np.flatnonzero((observed.phase == phase) & problem.counted[:forces])
        if len(here):
            own = residual[here]
            square = float(own @ cho_solve(cho_factor(total[np.ix_(here, here)], lower=True), own))
            left, errors = np.sqrt(np.mean(own**2)), np.sqrt(np.mean(np.diag(total)[here]))
            yield PhaseCheck(str(phase), float(left), float(errors), float(chi2.sf(square, len(here))))


_KEPT = 0.3
"""Of the readings, at least, without a part."""


def nearest_fit(fitted: LinearisedFit) -> LinearisedFit:
    """Return a model as near to the recordings as it gets: by equal weights, its mechanisms' numbers held.

    What a weighted fit leaves may lie in errors that trials share, and isn't what the model can't follow.
    """
    held = {f"{m.name}.{p.name}" for m in fitted.mechanisms for p in m.parameters}
    return fit(equally_weighted(fitted.problem, fitted.residual), fitted.mechanisms, fitted.values, held)


@dataclass(frozen=True)
class Misfit:
    """A misfit's size."""

    size: float
    """Root mean square over the largest force."""
    moves: float
    """Greatest change of C10, over itself, by leaving out a phase or a third of the depth; nothing without C10."""


def misfit_of(problem: LinearisedProblem, ordinary: LinearisedFit) -> Misfit:
    """Return the size of what an ordinary fit leaves of the force.

    Parameters
    ----------
    problem
        The observations.
    ordinary
        The model's fit with equal weights.
    """
    observed = problem.predictor.observed
    forces = observed.data.spans[0]
    left = ordinary.residual[forces][problem.counted[forces]]
    size = float(np.sqrt(np.mean(left**2)) / np.abs(observed.force).max())
    if DEEP_C10 not in ordinary.free:
        return Misfit(size, 0.0)
    equal, c10 = equally_weighted(problem, ordinary.residual), ordinary.values[DEEP_C10]
    without = [fit(equal.without(part), (), ordinary.values).values[DEEP_C10] for part in _parts(observed)]
    return Misfit(size, max((abs(value / c10 - 1.0) for value in without), default=0.0))


def _parts(observed: Observations) -> Iterator[NDArray[np.bool_]]:
    """Yield phases and thirds of the depth, those beside which enough is left."""
    third = third_of(observed.displacement, observed.depth)
    parts = [observed.phase == name for name in sorted(observed.phases)] + [third == k for k in range(len(THIRDS))]
    for part in parts:
        if part.any() and np.mean(~part) > _KEPT:
            yield part[observed.nearest]
