"""Channels beside the force at a site: their readings along the loading, and what these err by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial
from scipy.linalg import block_diag

from legfem.common.units import FloatArray
from legfem.data import LoadingCurve, Segmentation
from legfem.data.channels import CHANNELS, ChannelKind, RecordedChannel
from legfem.geometry.section import layer_thicknesses
from legfem.inverse.data import Channel
from legfem.inverse.intervals import NUMERICAL_LENGTH_MM
from legfem.legs.nuisances import accuracy_of_shape
from legfem.legs.plausible_channels import loading_depths
from legfem.legs.subject import Subject

_MOST_READINGS = 40
"""Of a trial; more are averaged within equal steps of depth."""
_SLOW_SHARE = 1 / 3
"""Of the depth: over which a slow error is correlated."""
_MODEL_ERROR, _MODEL_ERROR_OF_READING = 0.01, 0.1
"""Of the model, by its mesh: of the change since first touch, and of what a reading usually errs by. Meshes twice as
fine change thicknesses by 0.007 mm at most, the skin's rise by 0.04 mm and the lateral force by 0.2 %."""
_SHARPEST = 3
"""Degree of the polynomial in depth that slopes are read off."""


@dataclass(frozen=True, eq=False)
class SiteChannel:
    """Readings of one channel in all trials of a site.

    Parameters
    ----------
    kind : ChannelKind
        What it is.
    depth : (k,) array
        mm after first contact; 0 before it.
    values : (k,) array
        In the kind's unit.
    slope : (k,) array
        Of the values by the depth, per mm, smoothed.
    instrument : (k, k) array
        Covariance of the instrument's errors: of a reading, a bias, a gain, slow ones, a lag.
    outlines : (k, k) array
        Covariance by the outlines' error: a thickness is compared with that of the section.
    """

    kind: ChannelKind
    depth: FloatArray
    values: FloatArray
    slope: FloatArray
    instrument: FloatArray
    outlines: FloatArray

    def __len__(self) -> int:
        """Return the number of readings."""
        return len(self.values)

    @cached_property
    def channel(self) -> Channel:
        """The readings as all tests have them."""
        sd = np.sqrt(np.diag(self.instrument + self.outlines))
        return Channel(self.kind.name, self.kind.unit, self.depth, "displacement_mm", self.values, sd)

    @cached_property
    def size(self) -> float:
        """By how much the values change in the test, and at least by a few readings' errors."""
        return max(float(np.ptp(self.values)), 3 * self.kind.usual.reading)

    @cached_property
    def numerical(self) -> FloatArray:
        """Covariance (k, k) of the model's own error, about the measured change."""
        change = np.abs(self.slope * self.depth)
        apart = self.depth[:, None] - self.depth
        correlation = np.exp(-0.5 * (apart / NUMERICAL_LENGTH_MM) ** 2)
        sd = _MODEL_ERROR * change + _MODEL_ERROR_OF_READING * self.kind.usual.reading
        return np.asarray(np.outer(sd, sd) * correlation)


def site_channels(subject: Subject, curve: LoadingCurve) -> tuple[SiteChannel, ...]:
    """Return the channels of a site's trials, in the loading as far as its mean curve goes.

    Parameters
    ----------
    subject
        With its trials.
    curve
        Their mean loading curve.
    """
    deepest = float(curve.displacement[-1])
    own = layer_thicknesses(subject.section, subject.indenter.aim, subject.indenter.direction)
    found = []
    for kind in CHANNELS.values():
        recorded = [
            (trial, channel)
            for trial in subject.trials
            for channel in trial.recording.channels
            if channel.name == kind.name
        ]
        parts = [_in_loading(trial, channel, deepest) for trial, channel in recorded]
        if sum(len(depth) for depth, _, _ in parts):
            found.append(_site_channel(subject, curve, kind, recorded, parts, own.get(kind.name, 0.0)))
    return tuple(found)


def _site_channel(
    subject: Subject,
    curve: LoadingCurve,
    kind: ChannelKind,
    recorded: Sequence[tuple[Segmentation, RecordedChannel]],
    parts: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
    at_rest: float,
) -> SiteChannel:
    depth, values, counts = (np.concatenate(every) for every in zip(*parts, strict=True))
    smooth = _smooth(depth, values, at_rest)
    level, slope = smooth(depth), smooth.deriv()(depth)
    accuracy = recorded[0][1].accuracy
    noise = curve.noise
    length = _SLOW_SHARE * float(curve.displacement[-1])
    own: list[FloatArray] = []
    for of_trial, _, _ in parts:
        apart = np.abs(of_trial[:, None] - of_trial)
        steep = np.asarray(smooth.deriv()(of_trial), dtype=float)
        # Where contact is put, in this trial by itself.
        own.append(accuracy.slow**2 * np.exp(-apart / length) + noise.shift_sd**2 * np.outer(steep, steep))
    speed = np.concatenate(
        [np.where(part[0] > 0, trial.loading.speed, 0.0) for (trial, _), part in zip(recorded, parts, strict=True)]
    )
    late = accuracy.lag * speed * slope
    instrument = (
        np.diag(accuracy.reading**2 / counts)
        + accuracy.bias**2
        + accuracy.gain**2 * np.outer(level, level)
        + np.outer(late, late)
        + noise.common_shift_sd**2 * np.outer(slope, slope)
        + block_diag(*own)
    )
    # An outline that is off makes a layer thicker in proportion all along the test.
    share = np.abs(level) / at_rest if at_rest else np.zeros(len(level))
    both = np.sqrt(2) * accuracy_of_shape(subject).contour_sd * share
    return SiteChannel(kind, depth, values, slope, instrument, np.outer(both, both))


def _in_loading(
    trial: Segmentation, channel: RecordedChannel, deepest: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return depths, values and numbers of readings behind each, no more than a few tens."""
    depth = loading_depths(channel, trial)
    kept = np.isfinite(depth) & (depth <= deepest + 1e-9)
    at, values = depth[kept], channel.values[kept]
    if len(at) <= _MOST_READINGS:
        return at, values, np.ones(len(at))
    step = np.ceil(at / deepest * (_MOST_READINGS - 1) - 1e-9).astype(int)
    _, index, counts = np.unique(step, return_inverse=True, return_counts=True)
    return np.bincount(index, at) / counts, np.bincount(index, values) / counts, counts.astype(float)


def _smooth(depth: FloatArray, values: FloatArray, at_rest: float) -> Polynomial:
    """Return a polynomial in the depth near the values; of few readings one from what is there at rest."""
    several = len(np.unique(np.round(depth, 3)))
    if several <= 2:
        deep = depth > 0
        if not deep.any():
            return Polynomial([float(np.mean(values))])
        rise = float(np.mean((values[deep] - at_rest) / depth[deep]))
        return Polynomial([at_rest, rise])
    return Polynomial.fit(depth, values, min(_SHARPEST, several - 1))
