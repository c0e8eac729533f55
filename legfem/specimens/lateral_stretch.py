r"""What a video of a specimen's side says of its ends: lateral stretches beside those of a model.

A model's law is found from the forces alone. Its lateral stretches then have a density,

.. math:: \log p = -\tfrac12 \left(r^T C^{-1} r + \log|2 \pi C|\right), \qquad
          C = C_i + h^2 (\lambda - 1)(\lambda - 1)^T,

with the instrument's errors (`legfem.inverse.channel_errors`) and a share h of the strain that the model's shape and
law are off by. Where it isn't known whether ends stick, that density weighs each possibility, beside the forces'
evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH
from legfem.common.units import FloatArray
from legfem.data.noise import slowest_error
from legfem.data.phases import LOADING
from legfem.inverse.catalogue import Values
from legfem.inverse.channel_errors import reading_covariance, shared_errors
from legfem.inverse.channel_readings import ChannelReadings, grouped, noise_of
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import bulk_ratio
from legfem.specimens.sizes import SpecimenRecording

POISSON_RATIOS = (0.2, 0.3, 0.35, 0.4, 0.43, 0.45, 0.47, 0.49, 0.4999)
"""That are tried where the stretches depart from those of the ratio that was assumed."""
_SHAPE = 0.03
"""Of the model's lateral strain: a body that isn't quite round or level, a law that is another."""


@dataclass(frozen=True)
class LateralFit:
    """Lateral stretches beside a model that was found from the forces.

    Parameters
    ----------
    readings
        How many.
    rms
        Root mean square of measured less predicted.
    deepest
        Measured less predicted at the deepest reading of each recording, in the mean.
    error
        Standard deviation of one reading, everything counted.
    log_density
        Of the readings.
    poisson_ratio
        That meets the readings best, of `POISSON_RATIOS`, and between which it may be within two units of the density's
        logarithm; None where the fit's does, or of several tissues.
    """

    readings: int
    rms: float
    deepest: float
    error: float
    log_density: float
    poisson_ratio: tuple[float, float, float] | None = None

    @property
    def agrees(self) -> bool:
        """Whether the deepest readings lie within two standard deviations of the model's."""
        return abs(self.deepest) <= 2 * self.error

    @property
    def text(self) -> str:
        """What is to be said of it, as a sentence."""
        more = "wider" if self.deepest > 0 else "narrower"
        known = f"each is known to {self.error:.2g}"
        if self.agrees:
            return f"Lateral stretch, {self.readings} readings: the model's within {self.rms:.2g} (rms), where {known}."
        return (
            f"Lateral stretch: at the deepest readings the specimen is {more} by {abs(self.deepest):.2g} of its "
            f"diameter than the model, where {known}: its ends hold otherwise than stated, or it is "
            f"{'less' if self.deepest > 0 else 'more'} compressible than assumed{self._ratio_text}."
        )

    @property
    def _ratio_text(self) -> str:
        if self.poisson_ratio is None:
            return ""
        best, low, high = self.poisson_ratio
        return f" (with ends as stated a Poisson's ratio near {best:.3g}, of {low:.3g} to {high:.3g})"


def lateral_fit(recordings: Sequence[SpecimenRecording], model: SpecimenForward, values: Values) -> LateralFit | None:
    """Return lateral stretches beside a model's; None where none were read, or the model has none.

    Parameters
    ----------
    recordings
        That were fitted.
    model
        Of their tests.
    values
        Of the fit.
    """
    if not any(channel.name == LATERAL_STRETCH.name for one in recordings for channel in one.recording.channels):
        return None
    found = _compared(recordings, model, values)
    tissues = list(model.laws)
    if found is None or found.agrees or len(tissues) > 1:
        return found
    stiffness = values.get(f"{tissues[0]}.C10", model.nominal[f"{tissues[0]}.C10"])
    densities = {}
    for ratio in POISSON_RATIOS:
        other = _compared(recordings, model, {**values, f"{tissues[0]}.D1": 1 / (bulk_ratio(ratio) * stiffness)})
        if other is not None:
            densities[ratio] = other.log_density
    best = max(densities, key=lambda ratio: densities[ratio])
    likely = [ratio for ratio, density in densities.items() if density > densities[best] - 2.0]
    return replace(found, poisson_ratio=(best, min(likely), max(likely)))


def _compared(recordings: Sequence[SpecimenRecording], model: SpecimenForward, values: Values) -> LateralFit | None:
    outcome = model.solve(values, ())
    if not outcome.complete:
        return None
    left, errors, deepest = [], [], []
    for one in recordings:
        curve = outcome.curves[model.tests.index(one.sizes)]
        if LATERAL_STRETCH.name not in curve.channels:
            continue
        readings = _readings(one, curve.depth)
        if readings is None:
            continue
        depth = readings.displacement
        predicted = curve.channel(LATERAL_STRETCH.name, depth)
        left.append(readings.values - predicted)
        errors.append(_covariance(one, readings, predicted))
        deepest.append(float(left[-1][np.argmax(depth)]))
    if not left:
        return None
    density = sum(
        -0.5 * float(r @ np.linalg.solve(c, r) + np.linalg.slogdet(2 * np.pi * c)[1])
        for r, c in zip(left, errors, strict=True)
    )
    every = np.concatenate(left)
    error = float(np.sqrt(np.mean(np.concatenate([np.diag(c) for c in errors]))))
    return LateralFit(len(every), float(np.sqrt(np.mean(every**2))), float(np.mean(deepest)), error, density)


def _covariance(one: SpecimenRecording, readings: ChannelReadings, predicted: FloatArray) -> FloatArray:
    """Return the covariance (k, k) of stretches about predicted ones (k,)."""
    slowest = slowest_error(one.course.rate, float(one.recording.time[-1]) - one.trial.touched)
    covariance = reading_covariance(readings, readings.slope(predicted), slowest, [[0]])
    force = np.interp(readings.time, one.course.time, one.course.force)
    for effect in shared_errors(readings, predicted, force).values():
        covariance = covariance + np.outer(effect, effect)
    strain = _SHAPE * (predicted - LATERAL_STRETCH.at_rest)
    return np.asarray(covariance + np.outer(strain, strain))


def _readings(one: SpecimenRecording, reach: float) -> ChannelReadings | None:
    """Return the stretches in the loading, as far as a model reaches (mm); None without any."""
    recording = one.recording
    channel = next((each for each in recording.channels if each.name == LATERAL_STRETCH.name), None)
    if channel is None:
        return None
    after = recording.displacement - one.course.contact.displacement
    depth = np.interp(channel.time, recording.time, after)
    loading = channel.time <= recording.time[np.argmax(after)]
    groups = grouped(np.flatnonzero(loading & (depth >= 0.0) & (depth <= reach)), LOADING)
    if not groups:
        return None
    depths, times, values = (
        np.array([each[samples].mean() for samples in groups])
        for each in (depth, channel.time - one.trial.touched, channel.values)
    )
    variances = noise_of(channel) ** 2 / np.array([len(samples) for samples in groups])
    trial, speed = np.zeros(len(groups), dtype=int), np.full(len(groups), one.course.rate)
    return ChannelReadings(LATERAL_STRETCH, channel.accuracy, trial, depths, times, speed, values, variances)
