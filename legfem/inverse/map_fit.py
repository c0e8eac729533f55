"""Maximum a posteriori fits of a tabulated model, with the derivatives about them that evidence needs.

The base model is fitted by its errors' covariance, and by ordinary least squares: weighted by the covariance, a wrong
model's best fit may lie far from all data, gains and outlines taking up what it misses (Peelle's puzzle: S. Chiba,
D. L. Smith, ANL/NDM-121 (1991)). Equal weights know no such trade. About the ordinary fit errors that are shares of the
force are found, searches begin there, and it is shown of a model that the recordings contradict.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from legfem.common.units import FloatArray
from legfem.inverse.least_squares import Residual
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.mechanism import Mechanism, Solution, TissueMechanism, null_of, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.inverse.predictor import Responses, onset_name, values_of
from legfem.inverse.responses import SolvedResponses

_FEW, _MANY = 6, 40
"""Evaluations of a search from each of several starts, and from the best of them."""
_STEP = 1e-3
"""Step of differences, in standard deviations of what is known beforehand."""


def fit(
    problem: LinearisedProblem,
    mechanisms: Sequence[Mechanism],
    start: Mapping[str, float] | Sequence[Mapping[str, float]],
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
        Of the search, or several, of which the best is gone on from; mechanisms whose strength it has begin there
        alone.
    held
        Full names of parameters that stay at ``start``.
    evaluations
        Most of the search from the best start, which is kept where there is none; as many as a fit takes without it.
    """
    starts = [start] if isinstance(start, Mapping) else list(start)
    for mechanism in mechanisms:
        if mechanism.strength_name not in starts[0]:
            own = list(map(mechanism.by_full_name, mechanism.starts(problem.predictor.observed)))
            starts = [{**before, **mine} for before in starts for mine in own]
    if len(starts) > 1:
        tried = [_search(problem, mechanisms, values, held, _FEW) for values in starts]
        starts = [min(tried, key=lambda one: one.cost).values]
    return _search(problem, mechanisms, starts[0], held, _MANY if evaluations is None else evaluations).made()


def refitted_beside(fitted: LinearisedFit) -> LinearisedFit:
    """Return the refit with what nuisances do beside a fit's mechanisms, if that is something else."""
    beside = fitted.problem.beside(fitted)
    return fitted if beside is fitted.problem else fit(beside, fitted.mechanisms, fitted.values)


class _Found(NamedTuple):
    """Where a search ended."""

    cost: float
    values: Mapping[str, float]
    made: Callable[[], LinearisedFit]
    """Returns the fit there, whose derivatives cost a prediction for each parameter."""


def _search(
    problem: LinearisedProblem,
    mechanisms: Sequence[Mechanism],
    start: Mapping[str, float],
    held: Collection[str],
    evaluations: int,
) -> _Found:
    observed = problem.predictor.observed
    every = problem.parameters(mechanisms)
    free = tuple(p for p in every if p.name not in held)
    fixed = {p.name: start.get(p.name, null_of(p)) for p in every if p.name in held}
    ends, at = _begun(free, start)

    def values_at(z: Iterable[float]) -> dict[str, float]:
        return {**fixed, **{p.name: prior_of(p).value_at(float(x)) for p, x in zip(free, z, strict=True)}}

    # A search asks for derivatives where it has just predicted, and the fit for both where the search ended.
    @cache
    def predicted(*z: float) -> FloatArray:
        return problem.predictor(values_at(z), mechanisms)

    @cache
    def misfit(*z: float) -> FloatArray:
        return np.concatenate([problem.whitened(observed.values - predicted(*z)), z])

    @cache
    def slopes(*z: float) -> tuple[FloatArray, FloatArray]:
        change = _change(predicted, np.array(z), ends, [p.name for p in free], observed)
        return change, np.vstack([-problem.whitened(change), np.eye(len(z))])

    converged = True
    for _ in range(_SEARCHES if evaluations else 0):
        known = _Secants(lambda z: misfit(*z), at, slopes(*at)[1])
        found = least_squares(known.misfit, at, known.at, tuple(ends.T), max_nfev=evaluations, **_CLOSELY)
        at, converged = found.x, found.status > 0
        if evaluations < _MANY or _still_falls(misfit(*at), slopes(*at)[1], at, ends) < _LEAST_FALL:
            break

    def made() -> LinearisedFit:
        prediction, (change, by) = predicted(*at), slopes(*at)
        fitted = len(by) - len(free)
        found = observed.values - prediction, change, misfit(*at)[:fitted], -by[:fitted]
        return LinearisedFit(problem, tuple(mechanisms), values_at(at), free, at, prediction, *found, converged)

    return _Found(float(misfit(*at) @ misfit(*at)), values_at(at), made)


def _begun(free: Sequence[Parameter], start: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Return between which departures parameters may be (p, 2), and where a search begins (p,)."""
    priors = [prior_of(p) for p in free]
    ends = np.array([[q.departure(end) for end in p.bounds] for p, q in zip(free, priors, strict=True)])
    ends = np.clip(ends, -40.0, 40.0)
    inside = 1e-9 * (ends[:, 1] - ends[:, 0])
    at = np.array([q.departure(start.get(p.name, q.centre)) for p, q in zip(free, priors, strict=True)])
    return ends, np.clip(at, ends[:, 0] + inside, ends[:, 1] - inside)


class _Secants:
    """Derivatives (n, p) along a search: by differences where it begins, then by Broyden's update of the last ones.

    C. G. Broyden, Math. Comput. 19 (1965) 577. Differences cost a prediction for each parameter.
    """

    def __init__(self, misfit: Residual, z: FloatArray, slopes: FloatArray) -> None:
        self.misfit, self._z, self._slopes = misfit, z, slopes

    def at(self, z: FloatArray) -> FloatArray:
        """Return the derivatives where a search has come to."""
        step = z - self._z
        if step @ step > 0.0:
            missed = self.misfit(z) - self.misfit(self._z) - self._slopes @ step
            self._slopes = self._slopes + np.outer(missed, step) / (step @ step)
            self._z = z.copy()
        return self._slopes


_CLOSELY = {"xtol": 1e-7, "ftol": 1e-8, "gtol": 1e-9}
"""When a search ends."""
_SEARCHES = 4
_LEAST_FALL = 1e-2
"""Of a cost: what a search may leave, which begins anew with derivatives by differences elsewhere."""


def _still_falls(misfit: FloatArray, slopes: FloatArray, z: FloatArray, ends: FloatArray) -> float:
    """Return by how much a step of Gauss and Newton would make the cost less; none beyond the bounds."""
    gradient, close = slopes.T @ misfit, 1e-6 * (ends[:, 1] - ends[:, 0])
    held = ((z < ends[:, 0] + close) & (gradient > 0)) | ((z > ends[:, 1] - close) & (gradient < 0))
    return float(gradient[~held] @ np.linalg.lstsq(slopes[:, ~held], misfit)[0])


def _change(
    predicted: Callable[..., FloatArray], z: FloatArray, ends: FloatArray, names: Sequence[str], observed: Observations
) -> FloatArray:
    """Return the prediction's derivatives (n, p) by the departures, by differences.

    Parameters
    ----------
    predicted
        The readings (n,) at departures.
    z, ends, names
        (p,), (p, 2) and (p,): departures, between which they may be, and of what.
    observed
        Whose trials' first contacts each move their trial's readings alone, so that all are moved at once.
    """
    here, trial_of = predicted(*z), observed.trial[observed.nearest]
    numbers = {onset_name(trial): trial for trial in range(len(observed.trials))}
    onsets = {k: numbers[name] for k, name in enumerate(names) if name in numbers}
    moved = np.where(z + _STEP < ends[:, 1], z + _STEP, z - _STEP)
    columns = np.zeros((len(here), len(z)))
    if onsets:
        together = z.copy()
        together[list(onsets)] = moved[list(onsets)]
        change = predicted(*together) - here
        for k, trial in onsets.items():
            columns[trial_of == trial, k] = change[trial_of == trial] / (moved[k] - z[k])
    for k in range(len(z)):
        if k not in onsets:
            one = z.copy()
            one[k] = moved[k]
            columns[:, k] = (predicted(*one) - here) / (moved[k] - z[k])
    return columns


_ROUNDS = 4
_FIRST_SHARE = 0.2
"""Share of a further channel's range that counts as its misfit to begin with."""


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
    force, scales = data.spans[0], data.sizes_by_range(_FIRST_SHARE)
    scales[force] = 0.05 * data.values[force]
    begun = equally_weighted(problem, scales)
    found = min((fit(begun, (), start) for start in starts), key=lambda f: f.cost)
    for _ in range(_ROUNDS):
        found = fit(equally_weighted(problem, found.residual), (), found.values)
    return found


def equally_weighted(problem: LinearisedProblem, misfit: FloatArray) -> LinearisedProblem:
    """Return a problem whose weights are equal within each channel, and its misfit's beside what is known."""
    errors = problem.errors
    sizes = problem.predictor.observed.data.equal_sizes(misfit, problem.counted, errors.trial_sd)
    equal = replace(
        errors, dense=np.diag(sizes**2), known=0.0 * errors.known, gains=0.0 * errors.gains, zeros=0.0 * errors.zeros
    )
    return replace(problem, errors=equal if problem.aside is None else equal.without_bounds(problem.aside))


REFITS = 8
"""About full solutions, at most."""
_STAYS = 0.25
"""Share of a trial's noise: a refit that moves the prediction by less stays."""


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
    offset = None if solved is None else _offset(base, solved)
    if offset is None:
        return problem, base, float("nan")
    problem = problem.corrected(offset)
    forces = slice(len(problem.predictor.observed.force))
    error = float(np.abs(offset[forces]).max() / np.abs(base.prediction[forces]).max())
    return problem, ordinary_fit(problem, [base.values]), error


def refitted_about_solutions(solved: Responses, fitted: LinearisedFit) -> LinearisedFit | None:
    """Refit about full solutions until the refit stays; return None where there was none.

    Fat that slides folds in one way or in another, so that a model may have solutions on several
    branches at about the same stiffness, and a refit need not stay: then that stands which leaves
    least.

    Parameters
    ----------
    solved
        Full solutions.
    fitted
        What is to be refitted.
    """
    made: list[LinearisedFit] = []
    for _ in range(REFITS):
        offset = _offset(fitted, solved)
        if offset is None:
            break
        before, problem = fitted.prediction, fitted.problem.corrected(offset).beside(fitted)
        fitted = fit(problem, fitted.mechanisms, fitted.values)
        made.append(fitted)
        moved, spread = np.abs(fitted.prediction - before), problem.errors.trial_sd
        spans = problem.predictor.observed.data.spans
        if all(moved[span].max() < _STAYS * np.median(spread[span]) for span in spans):
            return fitted
    return min(made, key=lambda one: one.cost, default=None)


def _offset(fitted: LinearisedFit, solved: Responses) -> FloatArray | None:
    """Return the full prediction less the emulated one (N,), 0 of channels that it hasn't; None where it stopped."""
    plain = replace(fitted.problem.predictor, offset=0.0)
    if isinstance(solved, SolvedResponses) and _elastic_cancels(fitted):
        solved = replace(solved, elastic_courses=plain.library.elastic_courses)
    full = replace(plain, responses=solved)
    difference = full(fitted.values, fitted.mechanisms) - plain(fitted.values, fitted.mechanisms)
    if np.isnan(difference[: len(plain.observed.force)]).any():
        return None
    return np.nan_to_num(difference, nan=0.0)


def _elastic_cancels(fitted: LinearisedFit) -> bool:
    """Whether the tissue's force is the solution of one mechanism, which is told as a share of the elastic one."""
    acting = [m for m in fitted.mechanisms if isinstance(m, TissueMechanism)]
    if len(acting) != 1 or acting[0].null_variant != Solution.variant or acting[0].formulation is not None:
        return False
    return acting[0].share(values_of(fitted.values, acting[0])) == 1.0
