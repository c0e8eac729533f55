"""Generalised least squares of a model's parameters to the observations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from legfem.diagnose.mechanisms import Mechanism, Values
from legfem.diagnose.noise import ErrorModel, Noise, error_model
from legfem.diagnose.observations import Observations
from legfem.diagnose.predict import Predictor
from legfem.units import FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to the observations, or to a part of them."""

    mechanisms: tuple[Mechanism, ...]
    values: Mapping[str, float]
    """All parameters: kPa and the mechanisms' units."""
    free: tuple[str, ...]
    """Those that were fitted."""
    prediction: FloatArray
    """(n,), N: at all observations, fitted or not."""
    residual: FloatArray
    """(n,), N: observed less predicted."""
    whitened: FloatArray
    """(k,): the fitted part's residual over its errors' Cholesky factor."""
    jacobian: FloatArray
    """(k, p): whitened derivatives of the prediction by the free parameters."""
    effective_samples: float
    at_bound: tuple[str, ...] = ()
    known_to: tuple[float, ...] = ()
    """(p,): standard deviations of what was known of the free parameters beforehand; infinite where
    nothing was."""
    departure: float = 0.0
    """Sum of squares of their departures from that, over its standard deviations."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the mechanisms."""
        return tuple(m.name for m in self.mechanisms)

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual."""
        return float(self.whitened @ self.whitened)

    @property
    def degrees_of_freedom(self) -> int:
        """Observations less parameters."""
        return len(self.whitened) - len(self.free)

    @property
    def lack_of_fit(self) -> float:
        """Probability of so much misfit by errors alone."""
        return float(chi2.sf(self.chi2, self.degrees_of_freedom))

    @cached_property
    def bic(self) -> float:
        """Schwarz' criterion with the effective number of observations.

        A parameter of which something was known beforehand costs what the data add to that, not
        the logarithm of their number (Laplace's approximation of the evidence).
        """
        known = np.isfinite(self._known_to)
        penalty = float((~known).sum() * np.log(self.effective_samples))
        if known.any():
            basis = np.linalg.qr(self.jacobian[:, ~known])[0]
            told = self.jacobian[:, known] * self._known_to[known]
            told = told - basis @ (basis.T @ told)
            penalty += float(np.linalg.slogdet(np.eye(int(known.sum())) + told.T @ told)[1])
        return self.chi2 + self.departure + penalty

    @cached_property
    def _known_to(self) -> FloatArray:
        return np.array(self.known_to or [np.inf] * len(self.free))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (p, p) of the free parameters."""
        scale = np.linalg.norm(self.jacobian, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        scaled = self.jacobian / scale
        known = np.diag((self._known_to * scale) ** -2.0)
        return np.asarray(np.linalg.pinv(scaled.T @ scaled + known) / np.outer(scale, scale))

    def sd(self, name: str) -> float:
        """Return the standard error of a parameter; infinite where the data don't see it."""
        if name not in self.free:
            return float("nan")
        k = self.free.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a free parameter, by its standard error."""
        half = 1.96 * self.sd(name)
        return self.values[name] - half, self.values[name] + half


@dataclass(frozen=True, eq=False)
class Problem:
    """Observations with their errors and the model's predictions: what fits need."""

    predictor: Predictor
    errors: ErrorModel
    kept: NDArray[np.bool_] | None = None
    """(n,): the observations that are fitted; all without it."""
    _sub: dict[str, ErrorModel] = field(default_factory=dict)

    def without(self, left_out: NDArray[np.bool_]) -> Problem:
        """Return the problem with observations left out."""
        return Problem(self.predictor, self.errors, ~left_out)

    def corrected(self, offset: FloatArray) -> Problem:
        """Return the problem with the predictor shifted to a full solution."""
        return Problem(self.predictor.corrected(offset), self.errors, self.kept)

    def with_errors(self, errors: ErrorModel) -> Problem:
        """Return the problem with other errors."""
        return Problem(self.predictor, errors, self.kept)

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return the kept part of vectors (n,) or (n, k), whitened."""
        if self.kept is None:
            return self.errors.whitened(values)
        if "kept" not in self._sub:
            block = self.errors.covariance[np.ix_(self.kept, self.kept)]
            self._sub["kept"] = ErrorModel(
                self.errors.noise, block, self.errors.trial_sd[self.kept]
            )
        return self._sub["kept"].whitened(values[self.kept])

    def bounds(self, name: str, mechanisms: Sequence[Mechanism]) -> tuple[float, float]:
        """Return what a parameter lies between."""
        if name == "C10":
            return self.predictor.responses.c10_bounds
        if name == "C20":
            return self.predictor.responses.c20_bounds
        for mechanism in mechanisms:
            for p in mechanism.parameters:
                if name == f"{mechanism.name}.{p.name}":
                    return p.low, p.high
        raise KeyError(name)


def fit(
    problem: Problem,
    mechanisms: Sequence[Mechanism],
    start: Mapping[str, float],
    free_shapes: bool = True,
) -> Fit:
    """Fit the base parameters and the mechanisms', trying each mechanism's shapes.

    Parameters
    ----------
    problem
        The observations.
    mechanisms
        Beyond the base model.
    start
        Of the search; base parameters in kPa, and others where known.
    free_shapes
        Whether parameters beyond a mechanism's first are refined from the best of its shapes.
    """
    best: Fit | None = None
    for values in _starts(problem, mechanisms, start):
        found = _fit_from(problem, mechanisms, values, shapes=False)
        if best is None or found.chi2 < best.chi2:
            best = found
    assert best is not None
    if free_shapes and any(len(m.parameters) > 1 for m in mechanisms):
        best = _fit_from(problem, mechanisms, best.values, shapes=True)
    return best


def fit_base(
    predictor: Predictor, noise: Noise, possible: Sequence[Noise], starts: Sequence[Values]
) -> tuple[Problem, Fit]:
    """Fit the base model from several starts, with errors that are shares of its own force."""
    observed = predictor.observed
    problem = Problem(predictor, error_model(observed, noise))
    base = min((fit(problem, (), start) for start in starts), key=lambda f: f.chi2)
    for others in ((), possible):
        errors = error_model(observed, noise, others, force=base.prediction)
        problem = problem.with_errors(errors)
        base = fit(problem, (), base.values)
    return problem, base


def _starts(
    problem: Problem, mechanisms: Sequence[Mechanism], start: Mapping[str, float]
) -> list[dict[str, float]]:
    starts = [dict(start)]
    for mechanism in mechanisms:
        own = _own_starts(mechanism, problem.predictor.observed, start)
        starts = [{**mine, **before} for before in starts for mine in own]
    return starts


def _own_starts(
    mechanism: Mechanism, observed: Observations, start: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return values of a mechanism's own parameters to search from; one where it is known."""
    strength = f"{mechanism.name}.{mechanism.parameters[0].name}"
    if strength in start:
        return [{}]
    return [
        {strength: size} | {f"{mechanism.name}.{key}": value for key, value in shape.items()}
        for shape in mechanism.shape_choices(observed)
        for size in mechanism.starting_strengths
    ]


def _fit_from(
    problem: Problem,
    mechanisms: Sequence[Mechanism],
    start: Mapping[str, float],
    shapes: bool,
) -> Fit:
    predictor = problem.predictor
    free = list(predictor.base_parameters)
    for mechanism in mechanisms:
        chosen = mechanism.parameters if shapes else mechanism.parameters[:1]
        free += [f"{mechanism.name}.{p.name}" for p in chosen]
    limits = np.array([problem.bounds(name, mechanisms) for name in free])
    scale = np.array([_scale(name, mechanisms, start) for name in free])
    low, high = limits[:, 0] / scale, limits[:, 1] / scale
    inside = 1e-9 * (high - low)
    x0 = np.clip(np.array([start[name] for name in free]) / scale, low + inside, high - inside)
    fixed = {name: value for name, value in start.items() if name not in free}

    def values_at(x: FloatArray) -> dict[str, float]:
        return {**fixed, **dict(zip(free, (x * scale).tolist(), strict=True))}

    beliefs = [_belief(name, mechanisms) for name in free]
    null, known = np.array(beliefs).T
    held = np.isfinite(known)

    def misfit(x: FloatArray) -> FloatArray:
        left = predictor.observed.force - predictor(values_at(x), mechanisms)
        return np.concatenate([problem.whitened(left), ((x * scale - null) / known)[held]])

    found = least_squares(
        misfit, x0, bounds=(low, high), x_scale="jac", xtol=1e-8, ftol=1e-9, gtol=1e-10,
        max_nfev=60, diff_step=1e-5,
    )  # fmt: skip
    data = len(found.fun) - int(held.sum())
    values = values_at(found.x)
    prediction = predictor(values, mechanisms)
    close = 1e-4 * (high - low)
    edge = (found.x < low + close) | (found.x > high - close)
    return Fit(
        tuple(mechanisms),
        values,
        tuple(free),
        prediction,
        predictor.observed.force - prediction,
        found.fun[:data],
        -found.jac[:data] / scale,
        problem.errors.effective_samples,
        tuple(np.array(free)[edge].tolist()),
        tuple(known.tolist()),
        float(np.sum(found.fun[data:] ** 2)),
    )


def _belief(name: str, mechanisms: Sequence[Mechanism]) -> tuple[float, float]:
    """Return what is known of a parameter beforehand: its value and the standard deviation."""
    for mechanism in mechanisms:
        for p in mechanism.parameters:
            if name == f"{mechanism.name}.{p.name}" and p.known_to is not None:
                return p.null, p.known_to
    return 0.0, np.inf


def _scale(name: str, mechanisms: Sequence[Mechanism], start: Mapping[str, float]) -> float:
    for mechanism in mechanisms:
        for p in mechanism.parameters:
            if name == f"{mechanism.name}.{p.name}":
                return (
                    max(abs(p.typical), 1e-6)
                    if p is mechanism.parameters[0]
                    else abs(start.get(name, 1.0)) or abs(p.typical)
                )
    return 1.0
