"""Channels beside the force at a site: their readings along the loading, and what these err by."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve, Segmentation
from legfem.data.noise import slowest_error
from legfem.data.phases import LOADING
from legfem.data.recording import RecordedChannel
from legfem.geometry.section import layer_thicknesses
from legfem.inverse import errors
from legfem.inverse.channel_readings import ChannelReadings, grouped, noise_of
from legfem.inverse.errors import Elsewhere
from legfem.inverse.readings import Channel
from legfem.legs.nuisances import accuracy_of_shape
from legfem.legs.plausible_recordings import loading_depths
from legfem.legs.subject import Subject
from legfem.solve.path import ForceCurve

_SAME = 0.05


@dataclass(frozen=True, eq=False)
class SiteChannel:
    """Readings of one channel in all trials of a site, with covariances (k, k) of their errors.

    Parameters
    ----------
    readings : ChannelReadings
        k of them, along the loading.
    level, slope : (k,) array
        The values and their slope by the depth, per mm, smoothed.
    own : (k, k) array
        Of a reading, a bias, a gain, slow errors, a lag, and of where contact is put.
    outlines : (k, k) array
        By the outlines' error: a thickness is compared with that of the section.
    laid : Mapping[str, ndarray]
        By the way in which an image lies elsewhere, what one standard deviation does, (k,).
    """

    readings: ChannelReadings
    level: FloatArray
    slope: FloatArray
    own: FloatArray
    outlines: FloatArray
    laid: Elsewhere = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of readings."""
        return len(self.readings.values)

    @property
    def depth(self) -> FloatArray:
        """Displacement after first contact, (k,), mm."""
        return self.readings.displacement

    @property
    def instrument(self) -> FloatArray:
        """Covariance (k, k) by the instrument, but for `image_errors`."""
        return np.asarray(self.own + errors.covariance_of_places(self.readings, self.level, self.laid))

    def seen_in(self, curve: ForceCurve) -> "SiteChannel":
        """Return the channel whose image lies elsewhere in what a model's solve shows."""
        laid = {way: np.zeros(len(self)) for way in self.readings.laid_courses}
        for way, names in self.readings.laid_courses.items():
            for name, rows in zip(names, self.readings.rows, strict=True):
                laid[way][rows] = self.readings.accuracy.laid[way] * curve.channel(name, self.depth[rows])
        return replace(self, laid=laid)

    def as_seen(self, other: "SiteChannel") -> bool:
        """Whether its image does as in another solve, but for a twentieth."""
        return self.laid.keys() == other.laid.keys() and all(
            np.abs(self.laid[way] - effect).max() <= _SAME * np.abs(effect).max() for way, effect in other.laid.items()
        )

    @cached_property
    def parts(self) -> list[tuple[str, FloatArray]]:
        """Names of the courses that were read, and at which depths each, in the readings' order."""
        own = zip(self.readings.courses, self.readings.rows, strict=True)
        return [(name, self.depth[rows]) for name, rows in own if len(rows)]

    @cached_property
    def channel(self) -> Channel:
        """The readings as all tests have them."""
        of_image = sum((effect**2 for effect in self.laid.values()), np.zeros(len(self)))
        return replace(self.readings.channel, sd=np.sqrt(np.diag(self.instrument + self.outlines) + of_image))

    @cached_property
    def size(self) -> float:
        """By how much the values change in the test, and at least by a few readings' errors."""
        return max(float(np.ptp(self.readings.values)), 3 * self.readings.kind.usual.reading)

    @cached_property
    def numerical(self) -> FloatArray:
        """Covariance (k, k) of the model's own error, about the measured change."""
        return errors.model_covariance(self.readings, self.slope * self.depth)


def image_errors(beside: Sequence[SiteChannel]) -> FloatArray:
    """Return the covariance (k, k) of channels, one after the other, by where the images lie that they are read in."""
    modes: dict[str, FloatArray] = {}
    ends = np.cumsum([0, *map(len, beside)])
    for one, start, end in zip(beside, ends[:-1], ends[1:], strict=True):
        for name, effect in errors.errors_of_image(one.readings, one.laid).items():
            modes.setdefault(name, np.zeros(ends[-1]))[start:end] = effect
    return np.asarray(sum((np.outer(mode, mode) for mode in modes.values()), np.zeros((ends[-1], ends[-1]))))


def site_channels(subject: Subject, curve: LoadingCurve, model: str = "2d") -> tuple[SiteChannel, ...]:
    """Return the channels of a site's trials that a model gives, in the loading as far as its mean curve goes.

    Parameters
    ----------
    subject
        With its trials.
    curve
        Their mean loading curve.
    model
        ``2d`` or ``3d``.
    """
    own = layer_thicknesses(subject.section, subject.indenter.aim, subject.indenter.direction)
    found = []
    for name in (kind.name for kind in CHANNELS.values() if model in kind.models):
        recorded = [
            (k, trial, channel)
            for k, trial in enumerate(subject.trials)
            for channel in trial.recording.channels
            if channel.name == name
        ]
        readings = _in_loading(recorded, float(curve.displacement[-1])) if recorded else None
        if readings is not None:
            found.append(_site_channel(subject, curve, readings, own.get(name, 0.0)))
    return tuple(found)


def _in_loading(
    recorded: Sequence[tuple[int, Segmentation, RecordedChannel]], deepest: float
) -> ChannelReadings | None:
    """Return the readings of a channel in the loading down to a depth (mm); None if there are none."""
    found = []
    first = recorded[0][2]
    for k, trial, every in recorded:
        for number, channel in every.at_each_place():
            depth = loading_depths(channel, trial)
            for samples in grouped(np.flatnonzero(depth <= deepest + 1e-9), LOADING, bool(first.places)):
                at = float(np.mean(depth[samples]))
                time = float(np.mean(channel.time[samples])) - trial.touched
                speed = trial.loading.speed if at > 0 else 0.0
                value, variance = float(np.mean(channel.values[samples])), noise_of(channel) ** 2 / len(samples)
                found.append((number, k, at, time, speed, value, variance))
    if not found:
        return None
    # Readings of one place stand together.
    courses, numbers, *rest = zip(*sorted(found, key=lambda one: one[0]), strict=True)
    course = np.array(courses) if first.places else None
    return ChannelReadings(
        first.kind, first.accuracy, np.array(numbers), *map(np.array, rest), course=course, places=first.places
    )


def _site_channel(subject: Subject, curve: LoadingCurve, readings: ChannelReadings, at_rest: float) -> SiteChannel:
    level, slope = np.zeros(len(readings.values)), np.zeros(len(readings.values))
    for rows in (own for own in readings.rows if len(own)):
        at = readings.displacement[rows]
        smooth = _smooth(at, readings.values[rows], at_rest)
        level[rows], slope[rows] = smooth(at), smooth.deriv()(at)
    pressed = [subject.trials[k] for k in np.unique(readings.trial)]
    slowest = slowest_error(
        max(trial.loading.speed for trial in pressed),
        max(float(trial.recording.time[-1]) - trial.touched for trial in pressed),
    )
    own = errors.reading_covariance(readings, slope, slowest, [sorted({int(k) for k in readings.trial})])
    force = np.interp(readings.displacement, curve.displacement, curve.force, left=0.0)
    shared = errors.shared_errors(readings, level, force) | errors.errors_of_places(readings, level)
    alike = [np.outer(effect, effect) for effect in shared.values()]
    # Where contact is put, in each trial by itself and in all.
    contact = curve.noise.shift_sd**2 * np.equal.outer(readings.trial, readings.trial) + curve.noise.common_shift_sd**2
    instrument = own + sum(alike) + contact * np.outer(slope, slope)
    # An outline that is off makes a layer thicker in proportion all along the test.
    share = np.abs(level) / at_rest if at_rest else np.zeros(len(level))
    both = np.sqrt(2) * accuracy_of_shape(subject).contour_sd * share
    return SiteChannel(readings, level, slope, np.asarray(instrument), np.outer(both, both))


def _smooth(depth: FloatArray, values: FloatArray, at_rest: float) -> Polynomial:
    """Return a polynomial in the depth near the values; of few readings one from what is there at rest."""
    several = len(np.unique(np.round(depth, 3)))
    if several <= 2:
        deep = depth > 0
        if not deep.any():
            return Polynomial([float(np.mean(values))])
        rise = float(np.mean((values[deep] - at_rest) / depth[deep]))
        return Polynomial([at_rest, rise])
    return Polynomial.fit(depth, values, min(3, several - 1))
