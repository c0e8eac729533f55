"""Where the cylinder first touches, and what the load cell reads before."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from legfem.common.units import FloatArray
from legfem.data.noise import Instrument, slow_correlation
from legfem.data.recording import Recording
from legfem.data.smoothing import sample_noise, without_outliers

_DEPTH_FITTED = 3.0
"""Ways of `Scales` after a rough contact that are fitted."""
_AIR_FITTED = 6.0
"""Ways of `Scales` before a rough contact that are fitted."""
_MAX_POINTS = 200
"""Points that are fitted at most."""
_LEAST_GAIN = 10.0
"""Drop in cost, in variances of the errors, below which air isn't believed."""
_BY_NOISE = 2.0
"""What of each trial's drop, likewise, counts as noise's."""
_MOST_STIFFENING = 0.4
"""By which the force's slope may grow, relative, over one way of `Scales`."""
_SHAPE_ERROR = 0.03
"""Share of a way by which the fitted shapes may misplace contact, however little noise there is."""
_UNEVEN = ((0.0, 1.0), (0.15, 0.6), (0.3, 0.15), (0.5, 0.01))
"""By how much the power that a force begins with may be higher than an even body's, and how likely that is."""
_OF_FORCE = 0.02
"""Share of the force that the shapes misdescribe."""
SHORT_OF_TRAVEL = 10.0
"""A specimen's travel over its way of `Scales`, short beside it."""
_CLEAR, _BEYOND_STATED = 8.0, 3.0
"""Standard deviations of what is read in air, and of what is stated of a cell, above which a force is no chance."""
PARTED = 0.03
"""Share of the greatest force below which what presses may part from what it presses."""
_FEWEST = 8
"""Fewest samples that show an onset."""


@dataclass(frozen=True)
class Scales:
    """What counts as a short way and as a force in a test; the defaults are a leg's."""

    way: float = 1.0
    """mm over which displacement is smoothed. First contact is looked for within some of them."""
    rise: float = 0.05
    """N that a touch raises the force by at least: a leg pressed by some mm answers with tenths."""
    depth: float = 5.0
    """mm of loading after contact, less of which shows no stiffness."""
    powers: tuple[tuple[float, float], ...] = tuple((1.0 + more, likely) for more, likely in _UNEVEN)
    """Powers of the way that the force may begin with, and how likely they are beforehand: a leg's under a cylinder
    begins nearly in proportion to it."""

    @classmethod
    def of_specimen(cls, recording: Recording, power: float | None = None) -> "Scales":
        """Return those of a specimen's own travel: a tenth of it, up to a leg's 1 mm.

        Of the force its noise alone is the measure, and any depth will do. It begins with the power of a kind of
        test, or with a higher one where faces aren't parallel; in any way where the kind isn't known.
        """
        way = min(1.0, float(np.ptp(without_outliers(recording.displacement))) / SHORT_OF_TRAVEL)
        if power is None:
            return cls(way, 0.0, 0.0, tuple((any_power, 1.0) for any_power in (1.0, 1.25, 1.5, 1.75, 2.0)))
        return cls(way, 0.0, 0.0, tuple((power + more, likely) for more, likely in _UNEVEN))


LEG = Scales()
LEAST_OF_A_LEG_MM = 0.5 * LEG.depth
"""A recording that moves less is a specimen's."""


AT_TOUCH_SD_MM = 0.05
"""Least standard deviation of first contact where a recording begins at first touch."""
FELT = 3.0
"""Force over the load cell's white noise at which a touch shows."""


def way_felt(white_sd: float, slope: float) -> float:
    """Return the way (mm) on which a load cell comes to feel a touch, before which nobody sees it.

    From the standard deviation of a reading (N) and the slope of the force at touch (N/mm).
    """
    return FELT * white_sd / slope


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
    estimate: float
    """Best estimate of the displacement at first contact, mm, whether significant or not."""
    in_air: bool
    """Whether the recording begins in air."""

    known: bool = False
    """Whether it is stated to be at the start."""
    gain: float = 0.0
    """By how many variances of the errors air before it fits better than contact at the start."""
    latest: float = math.inf
    """Displacement, mm, from which on the force stands clearly above the noise: first contact lies before."""

    def touch_sd(self, way: float, felt: float) -> float:
        """Return the standard deviation (mm) of a recording's own first touch, of a test's way and `way_felt`."""
        return max(AT_TOUCH_SD_MM * way, min(self.displacement_error, felt))

    @property
    def expected(self) -> tuple[float, float]:
        """Displacement at which it is expected, and the standard deviation of that, mm; 0 where known.

        Where a recording shows no air for certain, contact may be at its start as well as where it
        seems to be: it is expected half way.
        """
        apart = 0.0 if self.in_air or self.known else self.estimate - self.displacement
        return self.displacement + apart / 2, float(np.hypot(self.displacement_error, apart / 2))


def chance_of_air(contacts: Sequence[Contact]) -> float:
    """Return how likely it is that trials begin in air, beforehand as likely as not: a lab's habit is the same in each.

    Noise alone gains about one variance a trial.
    """
    if any(one.in_air for one in contacts):
        return 1.0
    return float(expit(sum(one.gain - _BY_NOISE for one in contacts) / 2))


def air_is_shown(contacts: Sequence[Contact]) -> bool:
    """Tell whether trials begin in air: one by itself, or all together."""
    return chance_of_air(contacts) > expit((_LEAST_GAIN - _BY_NOISE) / 2)


def contact_at_start() -> Contact:
    """Return the contact of a recording whose displacement is known to start at first touch."""
    return Contact(0.0, 0.0, 0.0, 0.0, in_air=False, known=True)


def first_contact(smooth: FloatArray, recording: Recording, instrument: Instrument, scales: Scales) -> Contact:
    """Find the displacement at first contact and the force read before it.

    F = b + a (x^p + k x^(p+1)) with x = max(0, d - d0), a >= 0 and 0 <= k <= 0.4 a way, for all
    powers p of the scales, is fitted to the first ways by least squares, with d the displacement smoothed over time.
    The load cell's white and slow errors weigh the readings. d0 and its standard error are the mean and the standard
    deviation of exp(-cost / 2) over places and powers, the rest left free.

    A shift by a noisy d0 would bias the stiffness, and many recordings begin at first touch.
    So the displacement is shifted only if d0 lies after the recording's start by more than the
    sensor's standard deviation and fits far better than contact at the start (a drop in cost of
    10 variances, three standard errors); only then has air been recorded and the baseline
    measured. Else contact is taken at zero displacement, or at the first displacement if that
    differs from zero clearly and the force there does not.

    Parameters
    ----------
    smooth : (n,) array
        The recording's displacement, smoothed over time, mm.
    recording : Recording
        The trial.
    instrument : Instrument
        Errors of a reading; the recording's own noise where larger.
    scales : Scales
        Those of the test.
    """
    noise = max(instrument.displacement_sd, sample_noise(recording.displacement))
    # Of presses by less than half of the way nothing is to be read: they are passed over.
    span = float(np.ptp(smooth))
    back = first_return(smooth, recording.force, max(0.1 * span, 5.0 * noise), 0.5 * span)
    deepest = int(np.argmax(smooth[:back]))
    d, force = smooth[: deepest + 1], recording.force[: deepest + 1]
    return fit_onset(d, force, replace(instrument, displacement_sd=noise), scales)


def first_return(d: FloatArray, force: FloatArray, back: float, deep: float) -> int:
    """Return the first sample (of n) drawn back by more than ``back`` mm from ``deep`` mm or deeper; n without.

    Of a drive that bounces in the air no force speaks.
    """
    reached, felt = np.maximum.accumulate(d), np.maximum.accumulate(_smoothed(force)[1])
    turned = (reached - d > back) & (reached - d[0] > deep) & (felt - felt[0] > PARTED * (felt[-1] - felt[0]))
    return int(np.argmax(turned)) if turned.any() else len(d)


def fit_onset(d: FloatArray, force: FloatArray, instrument: Instrument, scales: Scales = LEG) -> Contact:
    """Fit the onset of force in samples with growing, smooth displacement.

    See `first_contact`; arrays are (n,), mm and N. Of an instrument that isn't stated the slow error may be as large
    as what is seen from sample to sample.
    """
    displacement_sd = instrument.displacement_sd
    noise = _scatter(force, instrument)[1]
    rough = _rough_contact(d, force, noise)
    near, latest = _near(d, force, rough, instrument, scales), _surely_touched(d, force, rough, instrument)
    if near is None:
        return replace(_at_start(d, force, noise, displacement_sd), latest=latest)
    best, error, gain = _onset(near, min(rough + 0.5 * scales.way, latest), scales)
    air = near.x < best
    significant = best - float(d[0]) > displacement_sd and gain > _LEAST_GAIN and air.sum() >= 4
    if not significant:
        at_start = _at_start(d, force, noise, displacement_sd)
        return replace(at_start, displacement_error=error, estimate=best, gain=gain, latest=latest)
    within = _within(d, rough, scales)
    in_air = within & (d < best - 2 * error)
    if in_air.sum() < 4:
        in_air = within & (d < best)
    baseline = float(np.mean(force[in_air]))
    return Contact(best, baseline, error, best, in_air=True, gain=gain, latest=latest)


@dataclass(frozen=True, eq=False)
class _Near:
    """A press about its contact; arrays are (n,)."""

    x: FloatArray
    """mm."""
    whitening: FloatArray
    """(n, n), 1/N."""
    level: FloatArray
    """Unit vector that a constant force becomes."""
    left: FloatArray
    """Force, whitened, without its level."""

    def felt(self, values: FloatArray) -> FloatArray:
        """Return forces (n, ...), N, whitened and without their levels."""
        white = self.whitening @ values
        return np.asarray(white - np.multiply.outer(self.level, self.level @ white))


def _scatter(force: FloatArray, instrument: Instrument) -> tuple[float, float]:
    """Return the white noise of a force (n,), N, and all of a reading's error."""
    white = max(sample_noise(force), 1e-9 * float(np.ptp(force)), 1e-12)
    return white, max(instrument.force_sd, white)


def _within(d: FloatArray, rough: float, scales: Scales) -> NDArray[np.bool_]:
    """Return which displacements (n,), mm, are near a rough contact."""
    return (d >= rough - _AIR_FITTED * scales.way) & (d <= rough + _DEPTH_FITTED * scales.way)


def _near(d: FloatArray, force: FloatArray, rough: float, instrument: Instrument, scales: Scales) -> _Near | None:
    """Return a press about a rough contact, mm; None where it has too few samples there."""
    white, noise = _scatter(force, instrument)
    near = _within(d, rough, scales)
    x, y, size = _blocks(d[near], force[near])
    if len(x) < _FEWEST:
        return None
    slow = replace(instrument, force_sd=noise).slow_force_sd(white) if instrument.stated else white
    pressed = _OF_FORCE * np.maximum(y - y[:_FEWEST].mean(), 0.0)
    # What no shape describes errs slowly too.
    covariance = slow_correlation(x / scales.way) * (slow**2 + np.outer(pressed, pressed))
    whitening = np.linalg.inv(np.linalg.cholesky(covariance + np.diag((white / np.sqrt(size)) ** 2)))
    level = whitening.sum(axis=1)
    level /= np.sqrt(level @ level)
    left = whitening @ y
    return _Near(x, whitening, level, left - level * (level @ left))


def _onset(near: _Near, last: float, scales: Scales) -> tuple[float, float, float]:
    """Return where force begins, by ``last`` mm, and its standard error, mm.

    And by how many variances of the errors air before it fits better than contact at the start.
    """
    first = float(near.x[0])
    last = max(last, first + 0.1 * scales.way)
    onsets = np.linspace(first, last, 101)
    best, error, cost = _places(near, onsets, scales)
    reach = max(4.0 * error, 2 * (onsets[1] - onsets[0]))
    onsets = np.linspace(max(first, best - reach), min(last, best + reach), 101)
    best, error, cost = _places(near, onsets, scales)
    # Against the best fit that has contact at the start: noise alone gains little.
    _, _, without = _places(near, np.array([first]), scales)
    gain = (without - cost) / max(1.0, cost / _freedom(near))
    return best, float(np.hypot(error, _SHAPE_ERROR * scales.way)), gain


def _freedom(near: _Near) -> int:
    """Return the degrees of freedom that place, size, stiffening and level leave."""
    return max(len(near.x) - 4, 1)


_LEAST_FELT = 0.1
"""Share of the force that a cubic curve would have had where a recording starts, at least."""


def _at_start(d: FloatArray, force: FloatArray, noise: float, displacement_sd: float) -> Contact:
    start, few = float(d[0]), max(1, min(5, len(force)))
    felt = float(np.mean(force[:few]))
    # What is pressed at once as far as displacement says from first touch, and not as a gap or a crosshead counts.
    least = _LEAST_FELT * float(force.max()) * (start / float(d[-1])) ** 3 if 0 < start < d[-1] else np.inf
    loaded = felt > max(5.0 * noise, least)
    away = abs(start) > max(3.0 * displacement_sd / np.sqrt(few), displacement_sd)
    touch = start if away and not loaded else 0.0
    return Contact(touch, 0.0, displacement_error=displacement_sd / np.sqrt(few), estimate=start, in_air=False)


def _surely_touched(d: FloatArray, force: FloatArray, rough: float, instrument: Instrument) -> float:
    """Return the displacement, mm, from which on the force stands clearly above what was read before touch."""
    few, smooth = _smoothed(force)
    white, noise = _scatter(force, instrument)
    touched, before = int(np.argmax(d >= rough)), len(d)
    while touched < before:
        # The first half of what may be air: the cell's wandering counts in it, the first touch doesn't.
        before, air = touched, smooth[: max(2 * few, touched // 2)]
        level = max(_CLEAR * max(float(air.std()), white / np.sqrt(few)), _BEYOND_STATED * noise * instrument.stated)
        touched = min(int(np.flatnonzero(smooth <= air.mean() + level)[-1]) + few // 2, len(d) - 1)
    return float(d[touched])


def _smoothed(force: FloatArray) -> tuple[int, FloatArray]:
    """Return running means of a force (n,), and of how many samples each is."""
    few = max(3, min(15, len(force) // 20))
    kernel = np.ones(few) / few
    return few, np.convolve(np.pad(force, (few // 2, few - 1 - few // 2), "edge"), kernel, "valid")


def _rough_contact(d: FloatArray, force: FloatArray, noise: float) -> float:
    few, smooth = _smoothed(force)
    base = float(np.median(force[: 2 * few]))
    rise = float(smooth.max() - base)
    # What the load cell wanders by doesn't average out; beside a small force it is stated too large.
    level = base + max(5.0 * noise / np.sqrt(few), min(4.0 * noise, 0.03 * rise), 0.01 * rise)
    below = np.flatnonzero(smooth <= level)
    # The last sample below the level, so that a bump in air isn't taken for contact.
    return float(d[min(below[-1] + 1, len(d) - 1)]) if len(below) else float(d[0])


def _blocks(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return means within equal steps of displacement, so that not too many are left, and of how many each is.

    A rest before the loading is one of them, however long it is.
    """
    if len(x) <= _MAX_POINTS:
        return x, y, np.ones(len(x))
    step = np.floor((x - x.min()) / np.ptp(x) * _MAX_POINTS * (1 - 1e-12)).astype(int)
    _, index, counts = np.unique(step, return_inverse=True, return_counts=True)
    return np.bincount(index, x) / counts, np.bincount(index, y) / counts, counts.astype(float)


def _places(near: _Near, onsets: FloatArray, scales: Scales) -> tuple[float, float, float]:
    """Return the mean and standard deviation of first contact over onsets (m,) and powers, mm, and the least cost."""
    depth, left = np.maximum(near.x[:, None] - onsets[None, :], 0.0) / scales.way, near.left
    costs = []
    for power, likely in scales.powers:
        explained = _explained(left, near.felt(depth**power), near.felt(depth ** (power + 1.0)))
        costs.append(float(left @ left) - explained - 2.0 * np.log(likely))
    cost = np.array(costs)
    least = float(cost.min())
    # A misfit beyond the errors widens: what isn't described isn't known any better.
    weight = np.exp(-0.5 * (cost - least) / max(1.0, least / _freedom(near))).sum(axis=0)
    weight /= weight.sum()
    best = float(weight @ onsets)
    step = float(onsets[-1] - onsets[0]) / max(len(onsets) - 1, 1)
    return best, max(float(np.sqrt(weight @ (onsets - best) ** 2)), 0.5 * step), least


def _explained(force: FloatArray, rise: FloatArray, more: FloatArray) -> FloatArray:
    """Return the sum of squares (m,) of a force (n,) that rise and stiffening (n, m) explain, within their bounds."""
    stiffest = rise + _MOST_STIFFENING * more
    squares = [np.maximum(np.sum(one**2, axis=0), 1e-30) for one in (rise, stiffest)]
    found = np.max([np.maximum(force @ one, 0.0) ** 2 / s for one, s in zip((rise, stiffest), squares, strict=True)], 0)
    # Inside: both free, where the stiffening then lies between none and the most.
    aa, ab, bb = squares[0], np.sum(rise * more, axis=0), np.sum(more**2, axis=0)
    fa, fb = force @ rise, force @ more
    det = np.maximum(aa * bb - ab**2, 1e-12 * aa * np.maximum(bb, 1e-30))
    a, b = (bb * fa - ab * fb) / det, (aa * fb - ab * fa) / det
    inside = (a > 0) & (b > 0) & (b < _MOST_STIFFENING * a)
    return np.asarray(np.where(inside, np.maximum(a * fa + b * fb, found), found))
