r"""Maximum a posteriori fits of a tabulated model, with the derivatives about them that evidence needs.

The base model is fitted by its errors' covariance, and by ordinary least squares: weighted by the covariance, a wrong
model's best fit may lie far from all data, gains and outlines taking up what it misses (Peelle's puzzle: S. Chiba,
D. L. Smith, ANL/NDM-121 (1991)). Equal weights know no such trade. About the ordinary fit errors that are shares of the
force are found, searches begin there, and it is shown of a model that the recordings contradict.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.errors import ErrorModel, error_model
from legfem.inverse.evidence import Linearisation
from legfem.inverse.intervals import effective_degrees
from legfem.inverse.mechanism import MeasuredStrength, Mechanism, Occurrence, null_of, prior_of
from legfem.inverse.parameter import Parameter
from legfem.inverse.predictor import Predictor, onset_name
from legfem.inverse.trial_noise import Noise

_FEW, _MANY = 6, 40
"""Evaluations of a search from each of several starts, and from the best of them."""
_STEP = 1e-3
"""Of differences, in standard deviations of what is known beforehand."""


@dataclass(frozen=True)
class Cause:
    """Where the standard deviation of a nuisance parameter comes from, and its degrees of freedom.

    Effects of one cause are off by one factor together.
    """

    name: str
    degrees_of_freedom: float = math.inf


@dataclass(frozen=True, eq=False)
class NuisanceEffect:
    """What one standard deviation of a nuisance parameter does to the prediction."""

    name: str
    effect: FloatArray
    """Change of the readings (N,), in their units."""
    cause: Cause


def variance_degrees(
    covariance: FloatArray, estimator: FloatArray, errors: ErrorModel, causes: Mapping[str, Cause]
) -> FloatArray:
    """Return the degrees of freedom (p,) of the variances of estimates, by Welch and Satterthwaite.

    Parameters
    ----------
    covariance
        Of the estimates, (p, p).
    estimator
        (p, n), 1/N: what an error of the observations adds to them.
    errors
        Of the observations.
    causes
        Of the errors' known effects, by their names; those without one have a known size.

    See `legfem.inverse.intervals.effective_degrees`.
    """
    by_cause: dict[Cause, FloatArray] = {}
    for name, effect in zip(errors.names, errors.known.T, strict=True):
        cause = causes.get(name, Cause(name))
        by_cause[cause] = by_cause.get(cause, np.zeros(len(covariance))) + (estimator @ effect) ** 2
    return np.array(
        [
            effective_degrees(whole, [(part[k], cause.degrees_of_freedom) for cause, part in by_cause.items()])
            for k, whole in enumerate(np.diag(covariance))
        ]
    )


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """A model fitted to the observations, or to a part of them."""

    mechanisms: tuple[Mechanism, ...]
    values: Mapping[str, float]
    """All parameters: MPa, mm and the mechanisms' units."""
    parameters: tuple[Parameter, ...]
    """Those that were fitted, by full name."""
    prior_z: FloatArray
    """(p,): of those from what was known, in its standard deviations."""
    prediction: FloatArray
    """(N,): all readings, fitted or not: the forces first."""
    residual: FloatArray
    """(N,): observed less predicted."""
    sensitivities: FloatArray
    """(N, p): of the prediction by one standard deviation of each parameter."""
    whitened: FloatArray
    """(k,): the fitted part's residual over its errors' Cholesky factor."""
    jacobian: FloatArray
    """(k, p): ``change`` of the fitted part, whitened."""
    converged: bool = True
    """Whether the search ended by itself."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the mechanisms."""
        return tuple(m.name for m in self.mechanisms)

    @property
    def stiffness(self) -> tuple[str, ...]:
        """Of C10 and C20 those that it has: a neo-Hookean tissue has no C20."""
        return tuple(name for name in (DEEP_C10, DEEP_C20) if name in self.free)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that were fitted."""
        return tuple(p.name for p in self.parameters)

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual."""
        return float(self.whitened @ self.whitened)

    @property
    def cost(self) -> float:
        """The same with the departures from what was known: what a fit minimises."""
        return self.chi2 + float(self.prior_z @ self.prior_z)

    @property
    def excess_misfit(self) -> float:
        """What is more in the cost than noise makes, which is one a value."""
        return max(self.cost - len(self.residual), 0.0)

    @property
    def augmented_residual(self) -> FloatArray:
        """What is left (k + p,): the whitened residual, and departures from what was known."""
        return np.concatenate([self.whitened, -self.prior_z])

    @property
    def augmented_jacobian(self) -> FloatArray:
        """What the parameters move of that, (k + p, p)."""
        return np.vstack([self.jacobian, np.eye(len(self.free))])

    @property
    def degrees_of_freedom(self) -> int:
        """Observations less parameters."""
        return len(self.whitened) - len(self.free)

    @property
    def lack_of_fit(self) -> float:
        """Probability of so much misfit by errors alone."""
        return float(chi2.sf(self.cost, len(self.whitened)))

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters at the ends of what they may be, their nulls excepted."""
        found = []
        for p in self.parameters:
            low, high = p.bounds
            value, close = self.values[p.name], 1e-4 * (high - low)
            at_null = p.prior is not None and abs(value - p.prior.centre) < close
            if not at_null and not low + close < value < high - close:
                found.append(p.name)
        return tuple(found)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (p, p) of the departures."""
        information = self.jacobian.T @ self.jacobian + np.eye(len(self.free))
        return np.asarray(np.linalg.inv(information))

    def sd(self, name: str) -> float:
        """Return the standard error of a parameter in its unit; NaN if it wasn't fitted."""
        if name not in self.free:
            return float("nan")
        k = self.free.index(name)
        low, high = (self._at(k, side) for side in (-1.0, 1.0))
        return 0.5 * abs(high - low)

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a fitted parameter, symmetric where what is known of it is."""
        k = self.free.index(name)
        low, high = (self.parameters[k].inside(self._at(k, side)) for side in (-1.96, 1.96))
        return min(low, high), max(low, high)

    def _at(self, k: int, deviations: float) -> float:
        sd = float(np.sqrt(self.covariance[k, k]))
        return prior_of(self.parameters[k]).value_at(self.prior_z[k] + deviations * sd)

    @property
    def linearised(self) -> Linearisation:
        """The fit as the evidence sees it."""
        ends = np.array([[prior_of(p).departure(end) for end in p.bounds] for p in self.parameters])
        return Linearisation(self.residual, self.sensitivities, self.prior_z, ends[:, 0], ends[:, 1])

    def moved(self, departure: FloatArray) -> dict[str, float]:
        """Return all values with the fitted ones at other departures."""
        at = zip(self.parameters, departure, strict=True)
        return {**self.values, **{p.name: p.inside(prior_of(p).value_at(z)) for p, z in at}}


@dataclass(frozen=True, eq=False)
class LinearisedProblem:
    """Observations with their errors and the model's predictions: what fits need."""

    predictor: Predictor
    errors: ErrorModel
    kept: NDArray[np.bool_] | None = None
    """(n,): the observations that are fitted; all without it."""
    measured: tuple[MeasuredStrength, ...] = ()
    """Strengths that were measured by themselves: they count in a fit's posterior."""
    causes: Mapping[str, Cause] = field(default_factory=dict)
    """By the names of the errors' known effects."""
    possible: Mapping[str, Occurrence] = field(default_factory=dict)
    """Which strengths mechanisms may have, by their names; within their bounds without it."""
    aside: NDArray[np.bool_] | None = None
    """(N,): readings that are set aside, whose errors have no bounds; none without it."""

    def without(self, left_out: NDArray[np.bool_]) -> LinearisedProblem:
        """Return the problem with observations left out."""
        return replace(self, kept=~left_out)

    def setting_aside(self, readings: NDArray[np.bool_]) -> LinearisedProblem:
        """Return the problem with readings (N,) set aside: their errors are a thousand times as large."""
        return replace(self, errors=_without_bounds(self.errors, readings), aside=readings)

    def corrected(self, offset: FloatArray) -> LinearisedProblem:
        """Return the problem with the predictor shifted to a full solution."""
        return replace(self, predictor=self.predictor.corrected(offset))

    def with_errors(self, errors: ErrorModel) -> LinearisedProblem:
        """Return the problem with other errors."""
        return replace(self, errors=errors)

    def with_nuisances(
        self, noise: Noise, prediction: FloatArray, effects: Sequence[NuisanceEffect]
    ) -> LinearisedProblem:
        """Return the problem with the errors of noise and nuisance parameters about a prediction (N,)."""
        known = [(one.name, one.effect) for one in effects]
        errors = error_model(self.predictor.observed, noise, prediction, known)
        return replace(self, errors=errors, causes={one.name: one.cause for one in effects})

    @cached_property
    def _part(self) -> ErrorModel:
        return self.errors if self.kept is None else self.errors.part(self.kept)

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return the kept part of vectors (n,) or (n, k), whitened."""
        return self._part.whitened(values if self.kept is None else values[self.kept])

    def parameters(self, mechanisms: Sequence[Mechanism]) -> tuple[Parameter, ...]:
        """Return what is fitted: the base model's parameters and the mechanisms'."""
        own = [replace(p, name=f"{mechanism.name}.{p.name}") for mechanism in mechanisms for p in mechanism.parameters]
        return (*self.predictor.parameters, *own)


def fit(
    problem: LinearisedProblem,
    mechanisms: Sequence[Mechanism],
    start: Mapping[str, float],
    held: Collection[str] = (),
    evaluations: int | None = None,
) -> LinearisedFit:
    """Fit the base parameters and the mechanisms', from each of the mechanisms' starts.

    Parameters
    ----------
    problem
        The observations.
    mechanisms
        Beyond the base model.
    start
        Of the search; mechanisms whose strength it has begin there alone.
    held
        Full names of parameters that stay at ``start``.
    evaluations
        Most of the search from the best start; as many as a fit takes without it.
    """
    starts = [dict(start)]
    for mechanism in mechanisms:
        if f"{mechanism.name}.{mechanism.parameters[0].name}" in start:
            continue
        own = mechanism.starts(problem.predictor.observed)
        starts = [
            {**before, **{f"{mechanism.name}.{key}": value for key, value in mine.items()}}
            for before in starts
            for mine in own
        ]
    if len(starts) > 1:
        tried = [_fit_from(problem, mechanisms, values, held, _FEW) for values in starts]
        best = min(tried, key=lambda f: f.cost)
        starts = [dict(best.values)]
    return _fit_from(problem, mechanisms, starts[0], held, evaluations or _MANY)


def fit_base(problem: LinearisedProblem, starts: Sequence[Mapping[str, float]]) -> LinearisedFit:
    """Fit the base model from several starts."""
    return min((fit(problem, (), start) for start in starts), key=lambda f: f.cost)


def _fit_from(
    problem: LinearisedProblem,
    mechanisms: Sequence[Mechanism],
    start: Mapping[str, float],
    held: Collection[str],
    evaluations: int,
) -> LinearisedFit:
    predictor = problem.predictor
    every = problem.parameters(mechanisms)
    free = tuple(p for p in every if p.name not in held)
    fixed = {p.name: start.get(p.name, null_of(p)) for p in every if p.name in held}
    priors = [prior_of(p) for p in free]
    ends = np.array([[q.departure(end) for end in p.bounds] for p, q in zip(free, priors, strict=True)])
    ends = np.clip(ends, -40.0, 40.0)
    inside = 1e-9 * (ends[:, 1] - ends[:, 0])
    at = np.array([q.departure(start.get(p.name, q.centre)) for p, q in zip(free, priors, strict=True)])
    at = np.clip(at, ends[:, 0] + inside, ends[:, 1] - inside)

    def values_at(z: FloatArray) -> dict[str, float]:
        return {**fixed, **{p.name: q.value_at(float(x)) for p, q, x in zip(free, priors, z, strict=True)}}

    numbers = {onset_name(trial): trial for trial in range(len(predictor.observed.trials))}
    onsets = {k: numbers[p.name] for k, p in enumerate(free) if p.name in numbers}
    trial_of = predictor.observed.trial[predictor.observed.nearest]

    # A search asks for derivatives where it has just predicted, and the fit for both where the search ended.
    @lru_cache(maxsize=2)
    def predicted(z: tuple[float, ...]) -> FloatArray:
        return predictor(values_at(np.array(z)), mechanisms)

    @lru_cache(maxsize=2)
    def change_at(z: tuple[float, ...]) -> FloatArray:
        return _change(predicted, np.array(z), ends, onsets, trial_of)

    def misfit(z: FloatArray) -> FloatArray:
        return np.concatenate([problem.whitened(predictor.observed.values - predicted(tuple(z))), z])

    def slopes_by(known: _Secants, z: FloatArray) -> FloatArray:
        return np.vstack([-problem.whitened(known.at(z, predicted(tuple(z)))), np.eye(len(z))])

    for _ in range(_SEARCHES):
        begun = _Secants(at, predicted(tuple(at)), change_at(tuple(at)))
        found = least_squares(
            misfit,
            at,
            jac=partial(slopes_by, begun),
            bounds=(ends[:, 0], ends[:, 1]),
            xtol=1e-7,
            ftol=1e-8,
            gtol=1e-9,
            max_nfev=evaluations,
        )
        at = found.x
        there = slopes_by(_Secants(at, predicted(tuple(at)), change_at(tuple(at))), at)
        if evaluations < _MANY or _still_falls(found.fun, there, at, ends) < _LEAST_FALL:
            break
    values = values_at(found.x)
    prediction, change = predicted(tuple(found.x)), change_at(tuple(found.x))
    count = len(found.fun) - len(free)
    return LinearisedFit(
        tuple(mechanisms),
        values,
        free,
        np.asarray(found.x),
        prediction,
        predictor.observed.values - prediction,
        change,
        np.asarray(found.fun[:count]),
        problem.whitened(change),
        found.status > 0,
    )


class _Secants:
    """Derivatives (n, p) along a search: by differences where it begins, then by Broyden's update of the last ones.

    C. G. Broyden, Math. Comput. 19 (1965) 577. Differences cost a prediction for each parameter.
    """

    def __init__(self, z: FloatArray, prediction: FloatArray, slopes: FloatArray) -> None:
        self._z, self._prediction, self._slopes = z, prediction, slopes

    def at(self, z: FloatArray, prediction: FloatArray) -> FloatArray:
        """Return the derivatives where a search has come to."""
        step = z - self._z
        if step @ step > 0.0:
            missed = prediction - self._prediction - self._slopes @ step
            self._slopes = self._slopes + np.outer(missed, step) / (step @ step)
            self._z, self._prediction = z.copy(), prediction
        return self._slopes


_SEARCHES = 4
_LEAST_FALL = 1e-2
"""Of a cost: what a search may leave, which begins anew with derivatives by differences elsewhere."""


def _still_falls(misfit: FloatArray, slopes: FloatArray, z: FloatArray, ends: FloatArray) -> float:
    """Return by how much a step of Gauss and Newton would make the cost less; none beyond the bounds."""
    gradient, close = slopes.T @ misfit, 1e-6 * (ends[:, 1] - ends[:, 0])
    held = ((z < ends[:, 0] + close) & (gradient > 0)) | ((z > ends[:, 1] - close) & (gradient < 0))
    own = slopes[:, ~held]
    return float(gradient[~held] @ np.linalg.solve(own.T @ own, gradient[~held]))


def _change(
    predicted: Callable[[tuple[float, ...]], FloatArray],
    z: FloatArray,
    ends: FloatArray,
    onsets: Mapping[int, int],
    trial_of: NDArray[np.int_],
) -> FloatArray:
    """Return the prediction's derivatives (n, p) by the departures, by differences.

    Parameters
    ----------
    predicted
        The readings (n,) at departures.
    z, ends
        (p,) and (p, 2): departures, and between which they may be.
    onsets
        The trials whose first contacts departures are, by their places: each moves its trial's readings alone, so
        that all are moved at once.
    trial_of
        Trial of each reading, (n,).
    """
    here = predicted(tuple(z))
    moved = np.where(z + _STEP < ends[:, 1], z + _STEP, z - _STEP)
    columns = np.zeros((len(here), len(z)))
    if onsets:
        together = z.copy()
        together[list(onsets)] = moved[list(onsets)]
        change = predicted(tuple(together)) - here
        for k, trial in onsets.items():
            columns[trial_of == trial, k] = change[trial_of == trial] / (moved[k] - z[k])
    for k in range(len(z)):
        if k not in onsets:
            one = z.copy()
            one[k] = moved[k]
            columns[:, k] = (predicted(tuple(one)) - here) / (moved[k] - z[k])
    return columns


_ROUNDS = 4
_FIRST_SHARE = 0.2
"""Of a further channel's range: its misfit to begin with."""


def ordinary_fit(problem: LinearisedProblem, starts: Sequence[Mapping[str, float]]) -> LinearisedFit:
    """Return the base model's fit with equal weights within each channel.

    Parameters
    ----------
    problem
        The observations.
    starts
        Where searches begin.
    """
    data = problem.predictor.observed.data
    force, *others = data.channels
    sizes = [max(_FIRST_SHARE * float(np.ptp(one.values)), float(one.sd.max())) for one in others]
    scales = [0.05 * force.values, *(np.full(len(one), size) for one, size in zip(others, sizes, strict=True))]
    found = fit_base(equally_weighted(problem, np.concatenate(scales)), starts)
    for _ in range(_ROUNDS):
        found = fit(equally_weighted(problem, found.residual), (), found.values)
    return found


def equally_weighted(problem: LinearisedProblem, misfit: FloatArray) -> LinearisedProblem:
    """Return a problem whose weights are equal within each channel, and its misfit's beside what is known."""
    errors = problem.errors
    sizes = np.empty(len(errors.trial_sd))
    for span in problem.predictor.observed.data.spans:
        counted = misfit[span] if problem.aside is None else misfit[span][~problem.aside[span]]
        sizes[span] = max(float(np.sqrt(np.mean(counted**2))), float(np.median(errors.trial_sd[span])))
    equal = replace(
        errors, dense=np.diag(sizes**2), known=0.0 * errors.known, gains=0.0 * errors.gains, zeros=0.0 * errors.zeros
    )
    return problem.with_errors(equal if problem.aside is None else _without_bounds(equal, problem.aside))


_UNBOUNDED = 1e6
"""Of a variance."""


def _without_bounds(errors: ErrorModel, readings: NDArray[np.bool_]) -> ErrorModel:
    more = np.where(readings, _UNBOUNDED * np.diag(errors.covariance), 0.0)
    return replace(errors, dense=errors.dense + np.diag(more))
