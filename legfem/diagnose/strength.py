r"""A mechanism's strength integrated out step by step.

About one fit the evidence is linear in all parameters. What a strength does is often far from that:
fat ten times as stiff isn't twice as much as five times, and a tension takes ever more of the
force. So the strength :math:`z` (in standard deviations of what is known beforehand) is held at
steps either side of the fit, all else is fitted anew at each, and

.. math:: Z = \int \phi(z) Z(z) dz \Big/ \int \phi(z) dz

within its bounds, with :math:`Z(z)` linear in the rest; parameters are distributed as the mixture
over steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.special import logsumexp
from scipy.stats import norm

from legfem.diagnose.fit import Fit, Problem, fit
from legfem.diagnose.mechanisms.base import prior_of
from legfem.inference.posterior import Posterior, Strands, mixed, moments_of

_BELOW = 6.0
"""ln below the greatest density at which steps end."""
_MOST, _GROWS = 8, 1.5
"""Steps to a side, and their growth where the density hardly changes."""
_FLAT = 1.0
"""In ln of the density."""
_CLOSE = 1e-3
_POINTS = 41
type Conditional = Callable[[Fit], Posterior]
"""What the data say of a fit with its strength held."""


@dataclass(frozen=True, eq=False)
class _Step:
    z: float
    fit: Fit
    posterior: Posterior
    log_density: float


def least_told(fitted: Fit, posterior: Posterior) -> int:
    """Return which of the mechanisms' strengths the data tell least of, as a parameter's number."""
    first = [f"{m.name}.{m.parameters[0].name}" for m in fitted.mechanisms]
    numbers = [fitted.free.index(name) for name in first]
    return max(numbers, key=lambda k: float(posterior.covariance[k, k]))


def integrated(problem: Problem, fitted: Fit, posterior: Posterior, of: Conditional) -> Posterior:
    """Return what the data say of a model, one strength integrated out.

    Parameters
    ----------
    problem
        The observations, as the model was fitted to them.
    fitted
        The model's fit.
    posterior
        Linear about that.
    of
        What the data say of a fit with its strength held.
    """
    k = least_told(fitted, posterior)
    prior = prior_of(fitted.parameters[k])
    low, high = sorted(prior.departure(end) for end in fitted.parameters[k].bounds)
    steps = _steps(problem, fitted, k, of, (low, high))
    if len(steps) < 2:
        return posterior
    z = np.array([step.z for step in steps])
    fine = np.linspace(z[0], z[-1], _POINTS)
    log_shares = CubicSpline(z, [step.log_density for step in steps])(fine)
    log_shares += np.log(fine[1] - fine[0])
    log_shares[[0, -1]] -= np.log(2.0)
    total = float(logsumexp(log_shares))
    shares = np.exp(log_shares - total)
    hats = np.array([np.interp(fine, z, one) for one in np.eye(len(z))])
    # Between points the strength is spread evenly.
    parts = [_whole(step, k, (fine[1] - fine[0]) ** 2 / 12) for step in steps]
    means, covariances = (
        PchipInterpolator(z, np.array([getattr(part, name) for part in parts]))(fine)
        for name in ("mean", "covariance")
    )
    mean, covariance = moments_of(shares, means, covariances)
    strands = Strands(shares, means, np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)))
    found = mixed(total - _log_inside(low, high), hats @ shares, parts)
    return replace(found, mean=mean, covariance=covariance, strands=strands)


def _steps(
    problem: Problem, fitted: Fit, k: int, of: Conditional, ends: tuple[float, float]
) -> list[_Step]:
    """Return steps in order, from the fit to either side."""
    sd = float(np.sqrt(fitted.covariance[k, k]))
    first = _held(problem, fitted, k, float(np.clip(fitted.departure[k], *ends)), of)
    found = [first]
    for end, side in zip(ends, (-1.0, 1.0), strict=True):
        last, size = first, sd
        for _ in range(_MOST):
            if abs(last.z - end) < _CLOSE * sd or last.log_density < _best(found) - _BELOW:
                break
            further = last.z + side * size
            # What would be left to the bound isn't worth a step.
            z = end if side * (end - further) < 0.3 * size else further
            step = _held(problem, last.fit, k, z, of)
            if abs(step.log_density - last.log_density) < _FLAT:
                size *= _GROWS
            last = step
            found.append(step)
    return sorted(found, key=lambda step: step.z)


def _best(steps: Sequence[_Step]) -> float:
    return max(step.log_density for step in steps)


def _held(problem: Problem, near: Fit, k: int, z: float, of: Conditional) -> _Step:
    """Return all else fitted with the strength held, beginning at a fit nearby."""
    every = problem.parameters(near.mechanisms)
    own = every[k]
    value = own.inside(prior_of(own).value_at(z))
    held = fit(problem, near.mechanisms, {**near.values, own.name: value}, (own.name,))
    posterior = of(held)
    return _Step(z, held, posterior, posterior.log_evidence + float(norm.logpdf(z)))


def _whole(step: _Step, k: int, variance: float) -> Posterior:
    """Return a step's posterior with the strength among its parameters."""
    mean = np.insert(step.posterior.mean, k, step.z)
    covariance = np.insert(np.insert(step.posterior.covariance, k, 0.0, 0), k, 0.0, 1)
    covariance[k, k] = variance
    return replace(step.posterior, mean=mean, covariance=covariance)


def _log_inside(low: float, high: float) -> float:
    """Return the logarithm of what the prior holds between the bounds."""
    return float(np.log(norm.cdf(high) - norm.cdf(low)))
