r"""What the recordings' forces may err by, before any model is asked.

A trial reads the true force plus white noise, a slow error of the load cell (correlated over time),
an offset, and the slope dF/dd times a slow error of the displacement sensor (correlated over
displacement). An offset, the load cell's gain and the model's numerical error, common to all
trials, are added; the last two are shares of the model's force, not of the recorded one, lest a
wrong model be drawn to one side of the data (Peelle's puzzle). Sizes come from the differences
between repeats and from the instruments' stated figures.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cholesky, helmert, solve_triangular
from scipy.optimize import minimize

from legfem.diagnose.observations import Observations
from legfem.recording import Instrument
from legfem.units import FloatArray

NUMERICAL_ERROR = 0.0015
"""Relative error of the model's force that the convergence study measures (0.02 to 0.2 %)."""
NUMERICAL_LENGTH_MM = 3.0
ROUGHNESS, ROUGHNESS_LENGTH_MM = 1e-4, 0.5
"""Of the model's force along the way, over the largest: elements that come into contact."""
GAIN_ERROR = 0.002
"""Relative error of the load cell's calibration, the same in all trials."""
WANDER_LENGTH_MM = 5.0
CORNER_MM = 5.0
"""Way that counts as walked between two phases: there the drive stops and turns, time passes, and
the sensor's error is no longer that of a moment ago."""
# Log-standard deviation of what is expected before looking at the repeats.
_VAGUENESS = 1.0
POSSIBLE_NOISES = 25
"""Noises drawn from those that the repeats leave possible."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the recordings' errors."""

    white_sd: float
    """Of one reading, N: the mean over trials."""
    slow_sd: float
    """Of the load cell's slow error, N."""
    correlation_time: float
    """s over which the slow error's correlation falls to 1/e."""
    offset_sd: float
    """Of a trial's zero, and as much again of the zero that all trials share, N."""
    wander_sd: float
    """Of the displacement sensor's slow error, mm."""
    shift_sd: float
    """Of first contact, where it was found after air, mm."""
    source: str
    """What the sizes are known from."""

    @property
    def force_sd(self) -> float:
        """Of one reading about its own trial's course, N."""
        return float(np.hypot(self.white_sd, self.slow_sd))


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """The covariance of the observations about the truth."""

    noise: Noise
    covariance: FloatArray
    """(n, n), N^2."""
    trial_sd: FloatArray
    """(n,), N: of one trial's values, without what is common to all trials."""
    possible: tuple[FloatArray, ...] = ()
    """Covariances (n, n) of noises that the repeats leave possible; none where nothing was
    estimated from repeats."""

    @cached_property
    def lower(self) -> FloatArray:
        """Cholesky factor L of the covariance; (n, n)."""
        return np.asarray(cholesky(self.covariance, lower=True))

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return L^-1 times vectors (n,) or (n, k)."""
        return np.asarray(solve_triangular(self.lower, values, lower=True))

    def draw(self, number: int, generator: np.random.Generator) -> FloatArray:
        """Return error vectors (number, n), N, of the noises that are possible in turn."""
        normal = generator.normal(size=(number, len(self.covariance)))
        for k, factor in enumerate(self._factors):
            normal[k :: len(self._factors)] = normal[k :: len(self._factors)] @ factor.T
        return normal

    @cached_property
    def _factors(self) -> list[FloatArray]:
        if not self.possible:
            return [self.lower]
        return [np.asarray(cholesky(covariance, lower=True)) for covariance in self.possible]

    @cached_property
    def effective_samples(self) -> float:
        """Number of independent values with as much information about the curve's shape.

        The trace of the whitening: sum of conditional over marginal precision's ratio.
        """
        marginal = np.diag(self.covariance)
        inverse = np.linalg.inv(self.covariance)
        return float(np.sum(1.0 / (marginal * np.diag(inverse))))


def estimate_noise(observed: Observations, instrument: Instrument) -> tuple[Noise, list[Noise]]:
    """Estimate the errors' sizes from repeats and instruments.

    Contrasts between repeats don't hold the true curve. What a mechanism might change from trial to
    trial (a constant, the force's own course, its slope, a drift) is projected out of them first,
    lest the effect be taken for noise.

    Parameters
    ----------
    observed
        The recordings.
    instrument
        Stated accuracy. What of the load cell's isn't white noise is a slow error, a trial's zero
        and the common zero in equal parts.

    Returns
    -------
    noise, possible
        The most probable, and others that the repeats leave possible: none without repeats.
    """
    white, jitter = observed.white_sd, observed.jitter_sd**2
    rest = max(instrument.force_sd**2 - white**2, 0.12 * instrument.force_sd**2)
    part = float(np.sqrt(rest / 3))
    wander_expected = np.sqrt(
        max(instrument.displacement_sd**2 - jitter, 0.04 * instrument.displacement_sd**2)
    )
    duration = max(float(s.protocol.time[-1]) for s in observed.protocols)
    rate = max(observed.rates)
    expected = Noise(
        white_sd=white,
        slow_sd=part,
        correlation_time=max(WANDER_LENGTH_MM / rate, 0.02 * duration),
        offset_sd=part,
        wander_sd=float(wander_expected),
        shift_sd=max((c.displacement_error for c in observed.contacts if c.in_air), default=0.0),
        source=_source(observed.repeats, instrument.stated),
    )
    return (expected, []) if observed.repeats < 2 else _from_repeats(observed, expected)


def _source(repeats: int, stated: bool) -> str:
    figures = "the instrument's stated accuracy" if stated else "differences from sample to sample"
    return f"{figures} only (there are no repeats)" if repeats < 2 else f"the repeats and {figures}"


def estimate_errors(
    observed: Observations, instrument: Instrument, numerical: float = NUMERICAL_ERROR
) -> ErrorModel:
    """Estimate the errors of recordings before a model is fitted; see `estimate_noise`."""
    return error_model(observed, *estimate_noise(observed, instrument), numerical)


def error_model(
    observed: Observations,
    noise: Noise,
    possible: Sequence[Noise] = (),
    numerical: float = NUMERICAL_ERROR,
    force: FloatArray | None = None,
) -> ErrorModel:
    """Return the covariance that a noise makes at observations.

    Parameters
    ----------
    observed
        The recordings.
    noise, possible
        See `estimate_noise`.
    numerical
        Relative error of the model's force.
    force
        (n,), N: of the model that was fitted, where there is one; else the recorded force.
    """
    size = np.abs(observed.force if force is None else force)
    apart = np.abs(observed.displacement[:, None] - observed.displacement[None, :])
    relative = GAIN_ERROR**2 + numerical**2 * np.exp(-0.5 * (apart / NUMERICAL_LENGTH_MM) ** 2)
    rough = (ROUGHNESS * size.max()) ** 2
    common = np.outer(size, size) * relative + noise.offset_sd**2
    common += rough * np.exp(-0.5 * (apart / ROUGHNESS_LENGTH_MM) ** 2)
    common[np.diag_indices_from(common)] += 1e-2 * rough
    own = _of_trials(observed, noise)
    return ErrorModel(
        noise,
        common + own,
        np.sqrt(np.diag(own)),
        tuple(common + _of_trials(observed, other) for other in possible),
    )


def _of_trials(observed: Observations, noise: Noise) -> FloatArray:
    """Return the covariance (n, n) of the trials' own errors."""
    result = np.zeros((len(observed.force),) * 2)
    for k in range(len(observed.trials)):
        here = np.flatnonzero(observed.trial == k)
        result[np.ix_(here, here)] = _trial_covariance(observed, noise, here)
    return result


def _trial_covariance(observed: Observations, noise: Noise, here: NDArray[np.int_]) -> FloatArray:
    time, slope = observed.time[here], observed.stiffness[here]
    steps = np.abs(np.diff(observed.displacement[here]))
    corners = np.diff(observed.segment[here]) != 0
    walked = np.concatenate([[0.0], np.cumsum(steps + CORNER_MM * corners)])
    apart_s = np.abs(time[:, None] - time[None, :])
    apart_mm = np.abs(walked[:, None] - walked[None, :])
    both = np.outer(slope, slope)
    jitter = np.sqrt(observed.jitter_variance[here])
    result: FloatArray = (
        np.diag(observed.white_variance[here])
        + noise.slow_sd**2 * np.exp(-apart_s / noise.correlation_time)
        + noise.offset_sd**2
        + noise.wander_sd**2 * both * np.exp(-apart_mm / WANDER_LENGTH_MM)
        + both * np.outer(jitter, jitter) * np.exp(-apart_mm / 0.5)
        + noise.shift_sd**2 * both
    )
    return result


def _from_repeats(observed: Observations, expected: Noise) -> tuple[Noise, list[Noise]]:
    """Maximise the contrasts' likelihood times log-normal expectations.

    Returns the noise and others that are possible as well, drawn from the normal distribution that
    the cost's curvature makes about it (Laplace).
    """
    blocks = [
        _contrasts(observed, members)
        for p in range(len(observed.protocols))
        if len(members := observed.trials_of(p)) > 1
    ]
    centre = np.log([expected.slow_sd, expected.correlation_time, expected.wander_sd])

    def noise_at(logs: FloatArray) -> Noise:
        slow, length, wander = np.exp(centre + logs)
        return replace(
            expected, slow_sd=float(slow), correlation_time=float(length), wander_sd=float(wander)
        )

    def cost(logs: FloatArray) -> float:
        noise = noise_at(logs)
        total = 0.5 * float(np.sum((logs / _VAGUENESS) ** 2))
        for here, kept, contrasts in blocks:
            spread = kept.T @ _trial_covariance(observed, noise, here) @ kept
            try:
                factor, _ = cho_factor(spread, lower=True)
            except np.linalg.LinAlgError:
                return 1e12
            white = solve_triangular(factor, contrasts, lower=True)
            log_det = 2 * float(np.sum(np.log(np.diag(factor))))
            total += 0.5 * (contrasts.shape[1] * log_det + float(np.sum(white**2)))
        return total

    fit = minimize(cost, np.zeros(3), method="L-BFGS-B", bounds=[(-4.0, 4.0)] * 3)
    values, axes = np.linalg.eigh(_curvature(cost, fit.x))
    # Nothing is known less well than what was expected beforehand.
    sizes = 1.0 / np.sqrt(np.maximum(values, _VAGUENESS**-2))
    normal = np.random.default_rng(0).normal(size=(POSSIBLE_NOISES, 3))
    return noise_at(fit.x), [noise_at(fit.x + axes @ (sizes * row)) for row in normal]


def _curvature(
    cost: Callable[[FloatArray], float], at: FloatArray, step: float = 0.1
) -> FloatArray:
    """Return a function's second derivatives (k, k) by central differences."""
    size = len(at)
    moves = step * np.eye(size)
    result = np.empty((size, size))
    for i in range(size):
        for j in range(i, size):
            corners = [
                a * b * cost(at + a * moves[i] + b * moves[j]) for a in (-1, 1) for b in (-1, 1)
            ]
            result[i, j] = result[j, i] = sum(corners) / (4 * step**2)
    return result


def _contrasts(
    observed: Observations, members: list[int]
) -> tuple[NDArray[np.int_], FloatArray, FloatArray]:
    """Return a trial's indices, a basis (m, m - 4) without smooth changes, and the contrasts."""
    rows = [np.flatnonzero(observed.trial == k) for k in members]
    forces = np.array([observed.force[row] for row in rows])
    here = rows[0]
    mean = forces.mean(axis=0)
    changes = np.column_stack(
        [np.ones(len(here)), mean, observed.stiffness[here], observed.time[here]]
    )
    basis = np.linalg.qr(changes, mode="complete")[0][:, changes.shape[1] :]
    return here, basis, basis.T @ (helmert(len(members)) @ forces).T
