"""A model of a diagnosis as the result of a fit, as an identification has it, and what each trial says by itself."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C20
from legfem.inverse.explanation import Explanation
from legfem.inverse.fit import (
    EXACT,
    ChannelFit,
    Cost,
    Fit,
    Goodness,
    Identity,
    OwnEstimate,
    TestFit,
    r_squared,
    versions,
)
from legfem.inverse.map_fit import fit
from legfem.inverse.notice import FitNotice, Notice
from legfem.inverse.predictor import onset_name
from legfem.inverse.readings import Data, MeasuredTest
from legfem.inverse.trial import SearchLog
from legfem.inverse.verdict import Diagnosis

_LEAST = 1e-3
"""Of a trial's own standard error: that of its difference from the joint value at least."""


def base_fit(found: Diagnosis, subject: Identity, kind: str, seed: int) -> Fit[None]:
    """Return the base model's fit to all that was recorded, by itself.

    Parameters
    ----------
    found
        The diagnosis.
    subject
        Whose recordings they are.
    kind
        ``leg`` or ``specimens``.
    seed
        Of the diagnosis' draws.
    """
    return _fit_of(found, found.base_model, subject, kind, seed, False)


def best_fit(found: Diagnosis, subject: Identity, kind: str, seed: int) -> Fit[None]:
    """Return the fit of the best model, the stiffness with its interval over all explanations; see `base_fit`."""
    return _fit_of(found, found.best, subject, kind, seed, True)


def _fit_of(found: Diagnosis, model: Explanation, subject: Identity, kind: str, seed: int, over_all: bool) -> Fit[None]:
    fitted, problem = model.fit, model.problem
    observed = problem.predictor.observed
    known = found.estimates_of(model, over_all)
    by_itself, agreement = [dict[str, OwnEstimate]() for _ in observed.trials], EXACT
    if not model.names:
        by_itself, agreement = _each_trial(found.weighted_base)
    force = observed.data.spans[0]
    squares = float(np.sum(fitted.residual[force] ** 2))
    equal = model is found.ordinary_base
    return Fit(
        kind=kind,
        subject=subject,
        law=found.law,
        estimates=known,
        correlations=_correlations(model, tuple(known)),
        values=dict(fitted.values),
        assumed={},
        goodness=Goodness(fitted.cost, len(fitted.whitened), fitted.lack_of_fit),
        cost=Cost(
            value=squares,
            points=force.stop,
            per_length=math.nan,
            r_squared=r_squared(squares, observed.force),
            minimised="the sum with equal weights within each channel"
            if equal
            else "the sum weighted with the inverse covariance (dimensionless), and the priors' squared departures",
            minimised_value=fitted.cost,
            minimised_unit="1",
            definition="sum over the stations of all trials of (F_simulated - F_measured)^2",
        ),
        agreement=agreement,
        tests=tuple(_trial_fits(model, by_itself)),
        log=SearchLog(
            names=fitted.free,
            solves=(),
            generations=(),
            cost_map=None,
            converged=fitted.converged,
            seed=seed,
            wall_s=math.nan,
            emulator_error=found.emulator_error * float(np.abs(observed.force).max()),
            forward_solves=found.solutions,
            failed_solves=0,
            reused_solves=0,
            factorisations=0,
            compromise="",
        ),
        neo_hookean_limit=DEEP_C20 in known and known[DEEP_C20].at_bound == "lower",
        weighting="paper" if equal else "covariance",
        settings={"mechanisms": list(model.names), "cylinder_ends": found.with_ends},
        versions=versions(),
        details=None,
    )


def _correlations(model: Explanation, names: tuple[str, ...]) -> FloatArray:
    """Return the correlations (p, p) of parameters' departures."""
    at = [model.fit.free.index(name) for name in names]
    covariance = model.posterior.covariance[np.ix_(at, at)]
    sd = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(sd, sd))


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
    aside = np.zeros(len(trial_of), dtype=bool) if model.problem.aside is None else model.problem.aside
    for trial, name in enumerate(observed.trials):
        channels = []
        for channel, span in zip(observed.data.channels, observed.data.spans, strict=True):
            mine = np.flatnonzero(trial_of[span] == trial)
            if len(mine):
                own = replace(channel, station=channel.station[mine], values=channel.values[mine], sd=channel.sd[mine])
                channels.append(ChannelFit(own, fitted.prediction[span][mine]))
        here = np.flatnonzero((trial_of == trial) & ~aside)
        left = fitted.residual[here]
        square = float(left @ np.linalg.solve(total[np.ix_(here, here)], left)) if len(here) else 0.0
        yield TestFit(
            MeasuredTest(name, Data(tuple(one.channel for one in channels))),
            tuple(channels),
            Goodness.of(square, len(here)),
            fitted=bool(len(here)),
            by_itself=by_itself[trial],
        )


def solution_notices(found: Diagnosis) -> Iterator[Notice]:
    """Yield which parameters stand at the ends of what was searched, and whether no solution confirmed the forces."""
    for model in (found.base_model, *found.models):
        for name in model.fit.at_bound:
            shown = model.shown(name)
            value = (shown.value, (shown.ci95[1] - shown.ci95[0]) / 4)
            yield Notice.of(FitNotice.MODEL_AT_BOUND, name=name, value=value, mechanisms=model.names)
    if not found.solutions and not found.emulator_error > 0:
        yield Notice.of(FitNotice.UNCONFIRMED)
