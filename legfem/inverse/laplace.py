r"""Posterior of an explanation: Laplace's approximation about its fit, and where that isn't enough.

**Strengths measured by other means**: a reading :math:`m` with standard deviation :math:`\sigma` multiplies the
evidence of every explanation by :math:`N(m;\ \mu,\ \sigma^2 + s^2)`, with the strength's mean :math:`\mu` and standard
deviation s by the recordings (its null and nought where the explanation hasn't that mechanism), and moves an
explanation's parameters as an observation of one of them does (R. E. Kalman, J. Basic Eng. 82 (1960) 35).

**A strength's effect** is often far from linear: fat ten times as stiff isn't twice as much as five times, and a
tension takes ever more of the force. So the strength :math:`z` (in standard deviations of its prior) is held at steps
either side of the fit, all else is fitted anew at each, and

.. math:: Z = \frac{\int p(z) Z(z) dz}{\int p(z) dz}

within its bounds, with :math:`Z(z)` linear in the rest; the posterior is the mixture over steps. How large an effect is
that begins at nothing is known to no better than an order of magnitude: :math:`p` is a sum of normal distributions of
several widths (`WIDTHS`). With one width alone, of two mechanisms that do the same to the force that one would be
preferred whose usual strength is nearer to what it needs. Parameters are given with the widest, so that as much may be
hidden as by the usual strength. A share of them may be of any strength that is possible
(`legfem.inverse.mechanism.Occurrence`): :math:`p` then has a level part.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.special import logsumexp
from scipy.stats import norm

from legfem.common.units import FloatArray
from legfem.inverse.accuracy import MeasuredStrength
from legfem.inverse.evidence import Evidence
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import Occurrence, prior_of
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.posterior import MixtureComponents, Posterior, mixed, moments_of


def laplace_posterior(evidence: Evidence, fitted: LinearisedFit, shares: Sequence[float]) -> Posterior:
    """Return what the recordings and all readings of strengths say of a model.

    Parameters
    ----------
    evidence
        Of the observations.
    fitted
        The model, whose problem has what else was measured.
    shares
        Logarithms of the shares of unknown errors beside it.
    """
    posterior = evidence.of(fitted.linearised, shares, fitted.problem.errors)
    for reading in fitted.problem.measured:
        posterior = _told(reading, fitted, posterior)
    return posterior


def _told(reading: MeasuredStrength, fitted: LinearisedFit, posterior: Posterior) -> Posterior:
    if reading.name not in fitted.free:
        strength = reading.mechanism.parameters[0]
        held = reading.mechanism.name in fitted.names
        at = prior_of(strength).departure(fitted.values[reading.name]) if held else 0.0
        return _likelier(posterior, float(norm.logpdf(reading.prior_z, at, reading.sd)))
    k = fitted.free.index(reading.name)
    along = posterior.covariance[:, k]
    variance = float(along[k]) + reading.sd**2
    away = reading.prior_z - float(posterior.mean[k])
    covariance = posterior.covariance - np.outer(along, along) / variance
    moved = replace(posterior, mean=posterior.mean + along * away / variance, covariance=covariance)
    return _likelier(moved, float(norm.logpdf(away, 0.0, np.sqrt(variance))))


def _likelier(posterior: Posterior, log_likelihood: float) -> Posterior:
    return replace(posterior, log_evidence=posterior.log_evidence + log_likelihood)


_BELOW = 6.0
"""ln below the greatest density at which steps end."""
_MOST, _GROWS = 8, 1.5
"""Steps to a side, and their growth where the density hardly changes."""
_FLAT = 1.0
"""In ln of the density."""
_CLOSE = 1e-3
_NO_WIDTH = 1e-9
"""Standard deviation of a departure below which steps are rounding: that of a model that is wrong by far."""
_POINTS = 161
WIDTHS: Mapping[float, float] = {1.0: 0.6, 0.3: 0.2, 0.1: 0.2}
"""Of the stated standard deviation of a strength that begins at nothing, and how probable."""
type Conditional = Callable[[LinearisedFit], Posterior]
"""What the data say of a fit with its strength held."""


@dataclass(frozen=True, eq=False)
class _Step:
    z: float
    fit: LinearisedFit
    posterior: Posterior
    log_likelihood: float
    """Logarithm of the likelihood of the data, all but the strength integrated out."""
    log_density: float
    """With the widest prior."""


def least_determined(fitted: LinearisedFit, posterior: Posterior) -> int:
    """Return which of the mechanisms' strengths the data tell least of, as a parameter's number."""
    numbers = [fitted.free.index(m.strength_name) for m in fitted.mechanisms]
    return max(numbers, key=lambda k: float(posterior.covariance[k, k]))


def integrate_strength(fitted: LinearisedFit, posterior: Posterior, of: Conditional) -> Posterior:
    """Return what the data say of a model, one strength integrated out.

    Parameters
    ----------
    fitted
        The model's fit.
    posterior
        Linear about that.
    of
        What the data say of a fit with its strength held.
    """
    k = least_determined(fitted, posterior)
    prior = prior_of(fitted.parameters[k])
    low, high = sorted(prior.departure(end) for end in fitted.parameters[k].bounds)
    possible = _possible(fitted, fitted.parameters[k])
    beside_strong = partial(_beside_strong, possible, fitted.parameters[k])
    steps = _steps(fitted, k, of, (low, high))
    if len(steps) < 2:
        return posterior
    z = np.array([step.z for step in steps])
    fine = np.linspace(z[0], z[-1], _POINTS)
    log_likelihood = CubicSpline(z, [step.log_likelihood for step in steps])(fine)
    log_likelihood += np.log(fine[1] - fine[0])
    log_likelihood[[0, -1]] -= np.log(2.0)
    widths, of_width = _widths(prior)
    log_prior = logsumexp(norm.logpdf(fine[:, None] / widths) - np.log(widths), axis=-1, b=of_width)
    total = float(logsumexp(log_likelihood + beside_strong(log_prior, fine)))
    log_shares = log_likelihood + beside_strong(norm.logpdf(fine), fine)
    shares = np.exp(log_shares - logsumexp(log_shares))
    hats = np.array([np.interp(fine, z, one) for one in np.eye(len(z))])
    # Between points the strength is spread evenly.
    parts = [_whole(step, k, (fine[1] - fine[0]) ** 2 / 12) for step in steps]
    means, covariances = (
        PchipInterpolator(z, np.array([getattr(part, name) for part in parts]))(fine) for name in ("mean", "covariance")
    )
    mean, covariance = moments_of(shares, means, covariances)
    strands = MixtureComponents(shares, means, np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)))
    strong = 0.0 if possible is None else possible.strong
    inside = strong + (1 - strong) * (of_width @ (norm.cdf(high / widths) - norm.cdf(low / widths)))
    found = mixed(total - float(np.log(inside)), hats @ shares, parts)
    return replace(found, mean=mean, covariance=covariance, components=strands)


def _steps(fitted: LinearisedFit, k: int, of: Conditional, ends: tuple[float, float]) -> list[_Step]:
    """Return steps in order, from the fit to either side."""
    sd = float(np.sqrt(fitted.covariance[k, k]))
    first = _held(fitted, k, float(np.clip(fitted.prior_z[k], *ends)), of)
    found = [first]
    if not np.isfinite(first.log_likelihood) or sd < _NO_WIDTH:
        return found
    for end, side in zip(ends, (-1.0, 1.0), strict=True):
        last, size = first, sd
        for _ in range(_MOST):
            if abs(last.z - end) < _CLOSE * sd or last.log_density < max(one.log_density for one in found) - _BELOW:
                break
            further = last.z + side * size
            # What would be left to the bound isn't worth a step.
            z = end if side * (end - further) < 0.3 * size else further
            step = _held(last.fit, k, z, of)
            if not np.isfinite(step.log_likelihood):
                # A model that has no prediction, or one beyond all numbers, is no step.
                break
            if abs(step.log_density - last.log_density) < _FLAT:
                size *= _GROWS
            last = step
            found.append(step)
    return sorted(found, key=lambda step: step.z)


def _held(near: LinearisedFit, k: int, z: float, of: Conditional) -> _Step:
    """Return all else fitted with the strength held, beginning at a fit nearby."""
    own = near.problem.parameters(near.mechanisms)[k]
    value = own.inside(prior_of(own).value_at(z))
    held = fit(near.problem, near.mechanisms, {**near.values, own.name: value}, (own.name,))
    posterior = of(held)
    likelihood = posterior.log_evidence + gain_of_widths(held, posterior)
    density = float(_beside_strong(_possible(near, own), own, np.asarray(norm.logpdf(z)), np.asarray(z)))
    return _Step(z, held, posterior, likelihood, likelihood + density)


def _beside_strong(
    possible: Occurrence | None, strength: Parameter, log_usual: FloatArray, z: FloatArray
) -> FloatArray:
    """Return the logarithm of the density of usual strengths and of those that lie anywhere within what is possible."""
    if possible is None or possible.strong == 0.0:
        return log_usual
    prior, (low, high) = prior_of(strength), strength.bounds
    low, high = prior.departure(max(low, possible.low)), prior.departure(min(high, possible.high))
    even = np.where((z >= low) & (z <= high), possible.strong / (high - low), 0.0)
    return np.asarray(np.log((1 - possible.strong) * np.exp(log_usual) + even))


def _possible(fitted: LinearisedFit, strength: Parameter) -> Occurrence | None:
    return fitted.problem.possible.get(strength.name.partition(".")[0])


def gain_of_widths(fitted: LinearisedFit, posterior: Posterior) -> float:
    r"""Return what strengths of any width gain in evidence over those of the stated one, ln.

    About a fit, for a strength that was found with mean m and standard deviation s by the stated
    one (both over that) and with :math:`a = w^{-2} - 1`,

    .. math:: \ln \sum_w p_w w^{-1} (1 + a s^2)^{-1/2} e^{-a m^2 / (2 (1 + a s^2))}.
    """
    strengths = {m.strength_name for m in fitted.mechanisms}
    more = 0.0
    for k, one in enumerate(fitted.parameters):
        if one.name in strengths:
            widths, shares = _widths(prior_of(one))
            narrower = widths**-2 - 1.0
            spread = 1.0 + narrower * float(posterior.covariance[k, k])
            each = -0.5 * (narrower * float(posterior.mean[k]) ** 2 / spread + np.log(spread))
            more += float(logsumexp(each - np.log(widths), b=shares))
    return more


def _widths(prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Return a strength's widths and their shares: of a factor, which is measured, one alone."""
    known = WIDTHS if prior.scale != "log" else {1.0: 1.0}
    return np.array(list(known)), np.array(list(known.values()))


def _whole(step: _Step, k: int, variance: float) -> Posterior:
    """Return a step's posterior with the strength among its parameters."""
    mean = np.insert(step.posterior.mean, k, step.z)
    covariance = np.insert(np.insert(step.posterior.covariance, k, 0.0, 0), k, 0.0, 1)
    covariance[k, k] = variance
    return replace(step.posterior, mean=mean, covariance=covariance)
