"""Where the cylinder first touches, and what the load cell reads before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.recording import Recording
from legfem.data.smoothing import sample_noise, smooth_displacement

_DEPTH_FITTED_MM = 3.0
_AIR_FITTED_MM = 6.0
_MAX_POINTS = 400
# Slow drifts of the force look like an earlier or later onset; found by simulation with noise
# correlated over 1.2 mm.
_SLOW_NOISE_FACTOR = 2.0
# Drop in cost, in units of the noise's variance, below which air isn't believed.
_LEAST_GAIN = 25.0
_STIFFENING_PER_MM = (0.0, 0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4)
# What the fitted shape itself may misplace contact by, however little noise there is.
_SHAPE_ERROR_MM = 0.03


@dataclass(frozen=True)
class Contact:
    """First contact of a trial.

    ``displacement`` and ``baseline`` are what to subtract: they are zero unless the recording
    shows that they differ from zero (see `find_first_contact`).
    """

    displacement: float
    """mm."""
    baseline: float
    """N, what the load cell reads in air."""
    displacement_error: float
    """Standard error of ``estimate``, mm."""
    baseline_error: float
    """Standard error of ``baseline``, N; infinite when there is no air to measure it in."""
    estimate: float
    """Best estimate of the displacement at first contact, mm, whether significant or not."""
    in_air: bool
    """Whether the recording begins in air."""


def contact_at_start() -> Contact:
    """Return the contact of a recording whose displacement is known to start at first touch."""
    return Contact(0.0, 0.0, 0.0, float("inf"), 0.0, in_air=False)


def find_first_contact(recording: Recording, force_sd: float = 0.0, displacement_sd: float = 0.0) -> Contact:
    """Find the displacement at first contact and the force read before it.

    F = b + a (x + k x^2) with x = max(0, d - d0), a >= 0 and 0 <= k <= 0.4/mm is fitted to the
    first millimetres by least squares, with d the displacement smoothed over time: a long
    cylinder's force grows nearly linearly at first and then stiffens. The standard error of d0 is
    the half-width of its profile, the rest left free, with the residual's correlation counted.

    A shift by a noisy d0 would bias the stiffness, and many recordings begin at first touch.
    So the displacement is shifted only if d0 lies after the recording's start by more than the
    sensor's standard deviation and fits far better than contact at the start (a drop in cost of
    25 variances, five standard errors); only then has air been recorded and the baseline
    measured. Else contact is taken at zero displacement, or at the first displacement if that
    differs from zero clearly and the force there does not.

    Parameters
    ----------
    recording : Recording
        The trial.
    force_sd, displacement_sd : float
        Standard deviations of a reading, N and mm; the recording's own noise where larger.
    """
    d, _ = smooth_displacement(recording.time, recording.displacement)
    d_noise = max(displacement_sd, sample_noise(recording.displacement))
    deepest = _end_of_first_press(d, d_noise)
    return fit_onset(d[: deepest + 1], recording.force[: deepest + 1], force_sd, d_noise)


def _end_of_first_press(d: FloatArray, noise: float) -> int:
    """Return the deepest sample before the cylinder is drawn back by a tenth of the way.

    Of presses by less than half of the way nothing is to be read: they are passed over.
    """
    reached = np.maximum.accumulate(d)
    way = float(np.ptp(d))
    back = reached - d > max(0.1 * way, 5.0 * noise)
    turned = np.flatnonzero(back & (reached - d[0] > 0.5 * way))
    return int(np.argmax(d[: turned[0]] if len(turned) else d))


def fit_onset(d: FloatArray, force: FloatArray, force_sd: float, displacement_sd: float) -> Contact:
    """Fit the onset of force in samples with growing, smooth displacement.

    See `find_first_contact`; arrays are (n,), mm and N.
    """
    noise = max(force_sd, sample_noise(force), 1e-9 * float(np.ptp(force)), 1e-12)
    rough = _rough_contact(d, force, noise)
    near = (d >= rough - _AIR_FITTED_MM) & (d <= rough + _DEPTH_FITTED_MM)
    x, y = _blocks(d[near], force[near])
    start = float(d[0])
    if len(x) < 8:
        return _at_start(d, force, start, noise, displacement_sd)
    first = float(x[0])
    last = max(rough + 0.5, first + 0.1)
    onsets = np.linspace(first, last, 121)
    best, residual, cost = _profile(x, y, onsets)
    reach = max(3.0 * _half_width(onsets, cost, best, residual), 2 * (onsets[1] - onsets[0]))
    onsets = np.linspace(max(first, best - reach), min(last, best + reach), 161)
    best, residual, cost = _profile(x, y, onsets)
    slope = float(np.polyfit(*_near(x, y, best), 1)[0])
    resolved = float(np.hypot(_half_width(onsets, cost, best, residual), _SHAPE_ERROR_MM))
    slow = _SLOW_NOISE_FACTOR * _slow_part(residual) / max(slope, 1e-12)
    error = float(np.hypot(resolved, slow))
    air = x < best
    # Against the best fit that has contact at the start: noise alone gains little.
    variance = float(cost.min()) / max(len(x) - 4, 1) * _inflation(residual)
    _, _, without = _profile(x, y, np.array([first]))
    gain = (float(without[0]) - float(cost.min())) / max(variance, 1e-30)
    significant = best - start > displacement_sd and gain > _LEAST_GAIN and air.sum() >= 4
    if not significant:
        return _at_start(d, force, start, noise, displacement_sd, best, error)
    in_air = near & (d < best - 2 * error)
    if in_air.sum() < 4:
        in_air = near & (d < best)
    baseline = float(np.mean(force[in_air]))
    spread = float(np.std(force[in_air])) * np.sqrt(_inflation(force[in_air]) / in_air.sum())
    return Contact(
        displacement=best,
        baseline=baseline,
        displacement_error=error,
        baseline_error=max(spread, noise / np.sqrt(in_air.sum())),
        estimate=best,
        in_air=True,
    )


def _at_start(
    d: FloatArray,
    force: FloatArray,
    start: float,
    noise: float,
    displacement_sd: float,
    estimate: float | None = None,
    error: float | None = None,
) -> Contact:
    few = max(1, min(5, len(force)))
    loaded = float(np.mean(force[:few])) > 5.0 * noise
    away = abs(start) > max(3.0 * displacement_sd / np.sqrt(few), displacement_sd)
    return Contact(
        displacement=start if away and not loaded else 0.0,
        baseline=0.0,
        displacement_error=displacement_sd / np.sqrt(few) if error is None else error,
        baseline_error=np.inf,
        estimate=start if estimate is None else estimate,
        in_air=False,
    )


def _rough_contact(d: FloatArray, force: FloatArray, noise: float) -> float:
    few = max(3, min(15, len(force) // 20))
    kernel = np.ones(few) / few
    smooth = np.convolve(np.pad(force, (few // 2, few - 1 - few // 2), "edge"), kernel, "valid")
    base = float(np.median(force[: 2 * few]))
    level = base + max(5.0 * noise / np.sqrt(few), 0.01 * float(smooth.max() - base))
    below = np.flatnonzero(smooth <= level)
    # The last sample below the level, so that a bump in air isn't taken for contact.
    return float(d[min(below[-1] + 1, len(d) - 1)]) if len(below) else float(d[0])


def _blocks(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    size = -(-len(x) // _MAX_POINTS)
    whole = len(x) // size * size if size else 0
    if size <= 1:
        return x, y
    return x[:whole].reshape(-1, size).mean(axis=1), y[:whole].reshape(-1, size).mean(axis=1)


def _profile(x: FloatArray, y: FloatArray, onsets: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Return the best onset, its residual (n,), and the least cost at each onset."""
    depth = np.maximum(x[None, :] - onsets[:, None], 0.0)
    force = y - y.mean()
    cost, best, residual = np.full(len(onsets), np.inf), float(onsets[0]), force
    for stiffening in _STIFFENING_PER_MM:
        shape = depth * (1.0 + stiffening * depth)
        shape -= shape.mean(axis=1, keepdims=True)
        square = np.maximum(np.sum(shape**2, axis=1), 1e-30)
        gain = np.maximum(shape @ force / square, 0.0)
        total = np.sum((force[None, :] - gain[:, None] * shape) ** 2, axis=1)
        i = int(np.argmin(total))
        if total[i] < cost.min():
            best, residual = float(onsets[i]), force - gain[i] * shape[i]
        cost = np.minimum(cost, total)
    return best, residual, cost


def _half_width(onsets: FloatArray, cost: FloatArray, best: float, residual: FloatArray) -> float:
    variance = float(residual @ residual) / max(len(residual) - 4, 1) * _inflation(residual)
    inside = onsets[cost <= float(cost.min()) + variance]
    step = float(onsets[1] - onsets[0])
    return max(float(np.max(np.abs(inside - best), initial=0.0)), 0.5 * step)


def _near(x: FloatArray, y: FloatArray, onset: float) -> tuple[FloatArray, FloatArray]:
    loaded = x >= onset
    return (x[loaded], y[loaded]) if loaded.sum() >= 4 else (x, y)


def _slow_part(residual: FloatArray) -> float:
    """Return the standard deviation of what is correlated from sample to sample."""
    centred = residual - residual.mean()
    variance = float(np.mean(centred**2))
    neighbours = float(np.mean(centred[1:] * centred[:-1]))
    significant = neighbours > 2.0 * variance / np.sqrt(len(residual))
    return float(np.sqrt(neighbours)) if significant else 0.0


def _inflation(residual: FloatArray) -> float:
    """Return samples per independent sample: the sum of the autocorrelation up to its end."""
    centred = residual - residual.mean()
    square = float(centred @ centred)
    if len(residual) < 8 or square == 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, len(residual) // 3):
        rho = float(centred[lag:] @ centred[:-lag]) / square
        # Noise in the autocorrelation itself isn't to be summed.
        if rho < 2.0 / np.sqrt(len(residual)):
            break
        total += 2.0 * rho
    return total
