"""Estimates of a fit's parameters: values, intervals, what causes their errors, and whether they can be relied on."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray, readable_unit
from legfem.inverse.comparison import Covariances, ErrorSource, total_of
from legfem.inverse.intervals import (
    NO_DEPARTURE,
    Estimated,
    Identifiability,
    PartDeparture,
    SquaresProfile,
    bound_of,
    departure_of,
    with_further,
)
from legfem.inverse.least_squares import inverse_in_units, sandwich
from legfem.inverse.parameter import Domain, Parameter
from legfem.inverse.searches import Found
from legfem.inverse.trial import Linearised


@dataclass(frozen=True)
class Shown:
    """A number with its error and 95 % interval, in the unit in which people read it."""

    value: float
    standard_error: float
    ci95: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class Estimate(Estimated):
    """One parameter that was free; numbers in its unit, which is the model's (MPa, not kPa).

    Its standard error is from the errors of the recordings and of the model, and the priors; of a profile that is
    closed, half its width over the quantile behind the 95 % interval, which isn't always symmetric.
    """

    identifiability: Identifiability
    moves: Mapping[str, float] = field(default_factory=dict)
    """Relative change of the value if an assumed stiffness, by full name, or all forces or
    displacements (``force_N``, ``displacement_mm``) were 10 % higher."""
    error_shares: Mapping[ErrorSource, float] = field(default_factory=dict)
    """Shares of the square of the standard error, by what causes it."""
    information_shares: Mapping[str, float] = field(default_factory=dict)
    """Of what determines the value, by channel, and ``priors``; empty where there is but the force."""
    departure: PartDeparture = NO_DEPARTURE
    """Which part of the recordings departs most from a law that misses them, by which the interval is widened."""

    @property
    def unit(self) -> str:
        """Unit of the numbers."""
        return self.parameter.unit

    @property
    def shown(self) -> Shown:
        """The numbers as people read them: stresses in kPa."""
        unit, factor = readable_unit(self.unit)
        low, high = self.ci95
        return Shown(factor * self.value, factor * self.standard_error, (factor * low, factor * high), unit)


_TENTH = 0.1
FORCE, DISPLACEMENT = "force_N", "displacement_mm"


@dataclass(frozen=True, eq=False)
class Optimum:
    """The optimum and what its intervals are drawn from.

    Parameters
    ----------
    found : Found
        The finished search; its law has p free parameters.
    covariances : mapping
        Of the readings' differences, by source, correction included.
    times : float
        Standard errors that half a 95 % interval holds.
    law_fits : bool
        Whether the law describes the recordings within their errors.
    assumed : Mapping[str, float]
        Stiffnesses that were held, whose effect is told.
    intervals : sequence of tuple of float
        95 % intervals, infinite or 0 at an open end; none where profiles of the cost say them.
    beside : mapping
        Covariances of what the readings say nothing of: no profile shows them, and they are added to its ends.
    """

    found: Found[Any]
    covariances: Covariances
    times: float
    law_fits: bool
    assumed: Mapping[str, float] = field(default_factory=dict)
    intervals: Sequence[tuple[float, float]] = ()
    beside: Covariances = field(default_factory=dict)

    @cached_property
    def spread(self) -> FloatArray:
        """Covariance (p, p) of the parameters' errors."""
        return self.found.linear.errors(total_of({**self.covariances, **self.beside}))

    @property
    def correlations(self) -> FloatArray:
        """Correlations (p, p) of the parameters' errors."""
        return correlations_of(self.spread)

    @property
    def departure(self) -> PartDeparture:
        """What a law that misses may do to a stiffness, beyond errors of readings and of the model's numbers."""
        if self.law_fits:
            return NO_DEPARTURE
        misfit, known = self.found.search.misfit, ("recordings", "model")
        errors = total_of({source: part for source, part in self.covariances.items() if source in known})
        return departure_of(misfit.parts_along, misfit.measured, self.found.linear.prediction.values, errors)


def correlations_of(spread: FloatArray) -> FloatArray:
    """Return the correlations (p, p) of a covariance."""
    error = np.sqrt(np.diag(spread))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(spread / np.outer(error, error))


def estimates(optimum: Optimum) -> dict[str, Estimate]:
    """Return an estimate of each free parameter, by full name."""
    linear, residual, departure = optimum.found.linear, optimum.found.residual, optimum.departure
    law, at, misfit = linear.law, linear.point, linear.misfit
    spread, bounds = optimum.spread, Domain(law.parameters).bounds
    inverse = inverse_in_units(linear.jacobian)
    curvature = inverse @ inverse.T
    sensitivities = linear.prediction.sensitivities
    forces, measured = misfit.channels.get("force", slice(None)), np.zeros(len(misfit))
    measured[forces] = misfit.measured[forces]
    # By which measured forces would differ less from the model's, were each a tenth higher.
    tenths = {
        **{name: -value * sensitivities[name] for name, value in optimum.assumed.items() if name in sensitivities},
        FORCE: measured,
        DISPLACEMENT: misfit.if_deeper,
    }
    moves = {name: _moves(linear, _TENTH * change) for name, change in tenths.items() if change.any()}
    shares = shares_of_error(linear.gain(), {**optimum.covariances, **optimum.beside})
    seen = linear.errors(total_of(optimum.covariances))
    stopped = [j for j, one in enumerate(law.parameters) if bound_of(at[j], one.bounds)]
    jacobian, covariance = linear.prediction.jacobian(law.names), total_of(optimum.covariances)
    told = shares_of_information(jacobian, covariance, misfit.informed_by, law.priors.jacobian(at))
    found = {}
    for k, parameter in enumerate(law.parameters):
        if curvature[k, k] > 0:
            error = math.sqrt(spread[k, k])
            rise = optimum.times**2 * float(seen[k, k]) / float(curvature[k, k])
            profile = SquaresProfile(residual, at, k, bounds, optimum.times * math.sqrt(seen[k, k]))
            interval = optimum.intervals[k] if optimum.intervals else profile.interval(rise)
            if optimum.beside:
                unseen = linear.errors(total_of(optimum.beside), [j for j in stopped if j != k])[k, k]
                more = optimum.times * math.sqrt(max(unseen, 0.0))
                interval = with_further(float(at[k]), interval, more, bounds[k])
            if bounds[k, 0] < interval[0] and interval[1] < bounds[k, 1]:
                # A tangent leaves a curved valley long before the sum of squares rises.
                error = _half_width(parameter, float(at[k]), interval) / optimum.times
        else:  # it moves nothing here, as an exponent whose factor is zero
            low, high = map(float, bounds[k])
            error, interval = 0.5 * (high - low) / optimum.times, (low, high)
        if parameter.name.endswith((".C10", ".C20")):
            interval = departure.carried(float(at[k]), interval, parameter.bounds)
        known = Estimated(parameter, float(at[k]), error, interval)
        own = {name: float(change[k]) for name, change in moves.items()}
        found[parameter.name] = Estimate(
            parameter, known.value, error, interval, known.verdict(optimum.law_fits), own, shares[k], told[k], departure
        )
    return found


def _half_width(parameter: Parameter, value: float, interval: tuple[float, float]) -> float:
    """Return half the width of an interval, of a logarithmic parameter's logarithm times its value."""
    low, high = interval
    return 0.5 * (value * math.log(high / low) if parameter.scale == "log" and low > 0 else high - low)


def _moves(linear: Linearised, change: FloatArray) -> FloatArray:
    """Return the relative changes (p,) if measured forces changed by (n,) N; NaN at bounds."""
    at, law = linear.point, linear.law
    moves = np.full(len(at), math.nan)
    free = [k for k, one in enumerate(law.parameters) if bound_of(at[k], one.bounds) == ""]
    if not free:
        return moves
    gain = inverse_in_units(linear.jacobian[:, free])[:, : len(linear.misfit)]
    with np.errstate(divide="ignore", invalid="ignore"):
        moves[free] = gain @ linear.misfit.weighted(change) / at[free]
    return np.where(np.isfinite(moves), moves, math.nan)


def shares_of_error(gain: FloatArray, covariances: Covariances) -> list[dict[ErrorSource, float]]:
    r"""Share of each source in the variance of each parameter.

    With the gain :math:`G` by which parameters follow readings and priors, the share of a source of
    covariance :math:`\Sigma_s` in parameter k is :math:`(G \Sigma_s G^T)_{kk}` over the sum of
    these; priors have errors of one.

    Parameters
    ----------
    gain : (p, n + k) array
        Of `legfem.inverse.trial.Linearised`: p parameters, n readings, k priors.
    covariances : mapping
        Of the readings, by source.
    """
    n = len(total_of(covariances))
    of_readings, of_priors = gain[:, :n], gain[:, n:]
    parts: dict[ErrorSource, FloatArray] = {
        source: np.asarray(np.diag(sandwich(of_readings, covariance))) for source, covariance in covariances.items()
    }
    if of_priors.shape[1]:
        parts["priors"] = np.asarray(np.sum(of_priors**2, axis=1))
    whole = np.sum(list(parts.values()), axis=0)
    return [
        {source: float(part[k] / whole[k]) for source, part in parts.items() if whole[k] > 0} for k in range(len(gain))
    ]


def shares_of_information(
    jacobian: FloatArray, covariance: FloatArray, channels: Mapping[str, NDArray[np.int_]], of_priors: FloatArray
) -> list[dict[str, float]]:
    r"""Share of each channel in what determines each parameter.

    With :math:`F_c = J_c^T \Sigma_c^{-1} J_c` of each channel by itself and F their sum, priors included, the share of
    a channel in parameter k is :math:`(F^{-1} F_c F^{-1})_{kk} / (F^{-1})_{kk}`.

    Parameters
    ----------
    jacobian : (n, p) array
        Of the readings.
    covariance : (n, n) array
        Of their errors.
    channels : mapping
        Places of each channel's readings; without any there are no shares.
    of_priors : (k, p) array
        Derivatives of the priors' departures, which have errors of one.
    """
    parameters = jacobian.shape[1]
    if not channels:
        return [{} for _ in range(parameters)]
    # Parameters differ in size by orders.
    size = 1 / np.maximum(np.sqrt(np.sum(jacobian**2, axis=0)), 1e-300)
    parts = {}
    for name, places in channels.items():
        own = size * jacobian[places]
        parts[name] = own.T @ np.linalg.solve(covariance[np.ix_(places, places)], own)
    if len(of_priors):
        parts["priors"] = (size * of_priors).T @ (size * of_priors)
    spread = np.linalg.pinv(np.sum(list(parts.values()), axis=0))
    return [
        {name: float((spread @ part @ spread)[k, k] / spread[k, k]) for name, part in parts.items()}
        for k in range(parameters)
    ]


def main_source(shares: Mapping[ErrorSource, float]) -> ErrorSource:
    """Source of most of an error; the recordings where no source is known."""
    return max(shares, key=lambda source: shares[source], default="recordings")
