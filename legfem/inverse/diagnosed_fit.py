"""A model of a diagnosis as the result of a fit, as an identification has it, and what each trial says by itself."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from legfem.inverse.explanation import Explanation
from legfem.inverse.fit import EXACT, ChannelFit, Cost, Goodness, OwnEstimate, TestFit, r_squared
from legfem.inverse.map_fit import fit
from legfem.inverse.predictor import onset_name
from legfem.inverse.trial import SearchLog

_LEAST = 1e-3
"""Of a trial's own standard error: that of its difference from the joint value at least."""


def cost_of_model(model: Explanation, equal: bool) -> Cost:
    """Return what was minimised, by equal weights or by errors, and the squares of the force."""
    fitted, observed = model.fit, model.problem.predictor.observed
    force = observed.data.spans[0]
    squares = float(np.sum(fitted.residual[force] ** 2))
    by_errors = "the sum weighted with the inverse covariance (dimensionless), and the priors' squared departures"
    return Cost(
        value=squares,
        points=force.stop,
        r_squared=r_squared(squares, observed.force),
        minimised="the sum with equal weights within each channel" if equal else by_errors,
        minimised_value=fitted.cost,
        minimised_unit="1",
        definition="sum over the stations of all trials of (F_simulated - F_measured)^2",
    )


def log_of_solutions(model: Explanation, seed: int, emulator_error: float, solutions: int) -> SearchLog:
    """Return the course of a fit by tabulated responses, whose emulator's error (over the largest force) is known."""
    fitted = model.fit
    largest = float(np.abs(model.problem.predictor.observed.force).max())
    return SearchLog(
        names=fitted.free,
        converged=fitted.converged,
        seed=seed,
        emulator_error=emulator_error * largest,
        forward_solves=solutions,
    )


def fits_of_trials(model: Explanation, weighted: Explanation | None) -> tuple[tuple[TestFit, ...], Goodness]:
    """Return every trial beside a model, the force first, and whether trials by themselves agree on its stiffness.

    Parameters
    ----------
    model
        The explanation.
    weighted
        The base model by its errors, which each trial is fitted with by itself; none of them without it.
    """
    by_itself, agreement = [dict[str, OwnEstimate]() for _ in model.problem.predictor.observed.trials], EXACT
    if weighted is not None:
        by_itself, agreement = _each_trial(weighted)
    return tuple(_trial_fits(model, by_itself)), agreement


def _each_trial(base: Explanation) -> tuple[list[dict[str, OwnEstimate]], Goodness]:
    """Return the stiffness that each trial asks for by itself, and whether trials agree on the first of it.

    The estimate from all trials is the most certain one, so that the variance of a trial's difference from it is the
    difference of the variances (J. A. Hausman, Econometrica 46 (1978) 1251); of K trials as certain as each other that
    is (K - 1) / K of the variance that a trial has of its own. Trials are compared with their mean, since the joint
    value isn't it where the model is wrong.
    """
    joint, observed = base.fit, base.problem.predictor.observed
    count = len(observed.trials)
    if count == 1:
        return [{}], EXACT
    trial_of = observed.trial[observed.nearest]
    onsets = set(map(onset_name, range(count))) & set(joint.free)
    found, variances = [], []
    for trial in range(count):
        alone = fit(base.problem.without(trial_of != trial), (), joint.values, onsets - {onset_name(trial)})
        own = {}
        for name in joint.stiffness:
            value, sd = float(alone.values[name]), alone.sd(name)
            apart = math.sqrt(max(sd**2 - joint.sd(name) ** 2, (_LEAST * sd) ** 2))
            own[name] = OwnEstimate(value, sd, float(value - joint.values[name]) / apart)
            if name == joint.stiffness[0]:
                variances.append(apart**2 * count / (count - 1))
        found.append(own)
    if not variances:
        return found, EXACT
    values = np.array([own[joint.stiffness[0]].value for own in found])
    left = values - np.average(values, weights=1 / np.array(variances))
    return found, Goodness.of(float(np.sum(left**2 / variances)), count - 1)


def _trial_fits(model: Explanation, by_itself: Sequence[Mapping[str, OwnEstimate]]) -> Iterator[TestFit]:
    """Yield every trial beside a model, the force first."""
    observed, fitted, total = model.problem.predictor.observed, model.fit, model.problem.errors.covariance
    trial_of = observed.trial[observed.nearest]
    for trial, name in enumerate(observed.trials):
        channels = []
        for channel, span in zip(observed.data.channels, observed.data.spans, strict=True):
            mine = np.flatnonzero(trial_of[span] == trial)
            if len(mine):
                channels.append(ChannelFit(channel.part(mine), fitted.prediction[span][mine]))
        here = np.flatnonzero((trial_of == trial) & model.problem.counted)
        left = fitted.residual[here]
        square = float(left @ np.linalg.solve(total[np.ix_(here, here)], left)) if len(here) else 0.0
        yield TestFit(
            name, tuple(channels), Goodness.of(square, len(here)), fitted=bool(len(here)), by_itself=by_itself[trial]
        )
