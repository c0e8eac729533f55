"""Where the cylinder first touches, and what the load cell reads before."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.recording import Recording
from legfem.data.smoothing import sample_noise, without_outliers

_DEPTH_FITTED, _AIR_FITTED = 3.0, 6.0
"""Ways of `Scales` after and before a rough contact that are fitted."""
_MAX_POINTS = 400
# Slow drifts of the force look like an earlier or later onset; found by simulation with noise
# correlated over 1.2 mm.
_SLOW_NOISE_FACTOR = 2.0
# Drop in cost, in units of the noise's variance, below which air isn't believed.
_LEAST_GAIN = 25.0
_STIFFENING = (0.0, 0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4)
"""By which the force's slope may grow, relative, over one way of `Scales`."""
_SHAPE_ERROR = 0.03
"""Of a way: what the fitted shape may misplace contact by, however little noise there is."""
_TRAVELS = 10.0
_FEWEST = 8
"""Samples."""


@dataclass(frozen=True)
class Scales:
    """What counts as a short way and as a force in a test; the defaults are a leg's."""

    way: float = 1.0
    """mm over which displacement is smoothed. First contact is looked for within some of them."""
    rise: float = 0.05
    """N that a touch raises the force by at least: a leg pressed by some mm answers with tenths."""
    depth: float = 5.0
    """mm of loading after contact, less of which shows no stiffness."""
    shape_known: bool = True
    """Whether the force begins as under a cylinder on a leg, in proportion to the way at first."""

    @classmethod
    def of_specimen(cls, recording: Recording) -> Scales:
        """Return those of a specimen's own travel: a tenth of it, up to a leg's 1 mm.

        Of the force its noise alone is the measure, any depth will do, and the force may begin in any way: under
        a ball with the power 3/2.
        """
        return cls(min(1.0, float(np.ptp(without_outliers(recording.displacement))) / _TRAVELS), 0.0, 0.0, False)


LEG = Scales()


@dataclass(frozen=True)
class Contact:
    """First contact of a trial.

    ``displacement`` and ``baseline`` are what to subtract: they are zero unless the recording
    shows that they differ from zero (see `first_contact`).
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

    known: bool = False
    """Whether it is stated to be at the start."""

    @property
    def expected(self) -> tuple[float, float]:
        """Displacement at which it is expected, and the standard deviation of that, mm; 0 where known.

        Where a recording shows no air for certain, contact may be at its start as well as where it
        seems to be: it is expected half way.
        """
        apart = 0.0 if self.in_air or self.known else self.estimate - self.displacement
        return self.displacement + apart / 2, float(np.hypot(self.displacement_error, apart / 2))


def contact_at_start() -> Contact:
    """Return the contact of a recording whose displacement is known to start at first touch."""
    return Contact(0.0, 0.0, 0.0, float("inf"), 0.0, in_air=False, known=True)


def first_contact(
    smooth: FloatArray, recording: Recording, force_sd: float, displacement_sd: float, scales: Scales
) -> Contact:
    """Find the displacement at first contact and the force read before it.

    F = b + a (x + k x^2) with x = max(0, d - d0), a >= 0 and 0 <= k <= 0.4 a way is fitted to the
    first ways by least squares, with d the displacement smoothed over time: a long
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
    smooth : (n,) array
        The recording's displacement, smoothed over time, mm.
    recording : Recording
        The trial.
    force_sd, displacement_sd : float
        Standard deviations of a reading, N and mm; the recording's own noise where larger.
    scales : Scales
        Those of the test. Where the shape of the force isn't known, the error counts what it misplaces contact by:
        that is in proportion to the way that is fitted, so half of it says how much; and what the load cell's
        slow half of its error moves it by, which so short a way doesn't show.
    """
    noise = max(displacement_sd, sample_noise(recording.displacement))
    # Of presses by less than half of the way nothing is to be read: they are passed over.
    span = float(np.ptp(smooth))
    back = first_return(smooth, max(0.1 * span, 5.0 * noise), 0.5 * span)
    deepest = int(np.argmax(smooth[:back]))
    d, force = smooth[: deepest + 1], recording.force[: deepest + 1]
    whole = fit_onset(d, force, force_sd, noise, scales.way)
    after = (d > whole.estimate) & (d < whole.estimate + 0.5 * _DEPTH_FITTED * scales.way)
    if scales.shape_known or np.count_nonzero(after) < _FEWEST:
        return whole
    half = fit_onset(d, force, force_sd, noise, 0.5 * scales.way)
    misplaced = max(0.0, (whole.estimate - half.estimate) ** 2 - half.displacement_error**2)
    slow = force_sd / max(float(np.polyfit(d[after], force[after], 1)[0]), 1e-12)
    variance = whole.displacement_error**2 + 4.0 * misplaced + 0.5 * slow**2
    return replace(whole, displacement_error=float(np.sqrt(variance)))


def first_return(d: FloatArray, back: float, deep: float) -> int:
    """Return the first sample (of n) drawn back by more than ``back`` mm from ``deep`` mm or deeper; n without."""
    reached = np.maximum.accumulate(d)
    turned = (reached - d > back) & (reached - d[0] > deep)
    return int(np.argmax(turned)) if turned.any() else len(d)


def fit_onset(d: FloatArray, force: FloatArray, force_sd: float, displacement_sd: float, way: float = 1.0) -> Contact:
    """Fit the onset of force in samples with growing, smooth displacement.

    See `first_contact`; arrays are (n,), mm and N.
    """
    noise = max(force_sd, sample_noise(force), 1e-9 * float(np.ptp(force)), 1e-12)
    rough = _rough_contact(d, force, noise)
    near = (d >= rough - _AIR_FITTED * way) & (d <= rough + _DEPTH_FITTED * way)
    x, y = _blocks(d[near], force[near])
    start = float(d[0])
    if len(x) < _FEWEST:
        return _at_start(d, force, start, noise, displacement_sd)
    first = float(x[0])
    last = max(rough + 0.5 * way, first + 0.1 * way)
    onsets = np.linspace(first, last, 121)
    best, residual, cost = _profile(x, y, onsets, way)
    reach = max(3.0 * _half_width(onsets, cost, best, residual), 2 * (onsets[1] - onsets[0]))
    onsets = np.linspace(max(first, best - reach), min(last, best + reach), 161)
    best, residual, cost = _profile(x, y, onsets, way)
    slope = float(np.polyfit(*_near(x, y, best), 1)[0])
    resolved = float(np.hypot(_half_width(onsets, cost, best, residual), _SHAPE_ERROR * way))
    slow = _SLOW_NOISE_FACTOR * _slow_part(residual) / max(slope, 1e-12)
    error = float(np.hypot(resolved, slow))
    air = x < best
    # Against the best fit that has contact at the start: noise alone gains little.
    variance = float(cost.min()) / max(len(x) - 4, 1) * _inflation(residual)
    _, _, without = _profile(x, y, np.array([first]), way)
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


def _profile(x: FloatArray, y: FloatArray, onsets: FloatArray, way: float) -> tuple[float, FloatArray, FloatArray]:
    """Return the best onset, its residual (n,), and the least cost at each onset."""
    depth = np.maximum(x[None, :] - onsets[:, None], 0.0)
    force = y - y.mean()
    cost, best, residual = np.full(len(onsets), np.inf), float(onsets[0]), force
    for stiffening in _STIFFENING:
        shape = depth * (1.0 + stiffening / way * depth)
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
