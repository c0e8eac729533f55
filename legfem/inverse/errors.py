r"""What recordings and predictions err by.

A trial reads

.. math:: (1 + g + g_t)\, F(d - \delta_t) + b_t + e,

with the load cell's gain :math:`g`, a gain :math:`g_t` and a zero :math:`b_t` of each trial, its
first contact :math:`\delta_t`, and errors :math:`e`: white, slow in the load cell (correlated over
time) and slow in the displacement sensor (over displacement, times dF/dd). The model's own error is
a share of its force. What is a share is one of the model's force, not of the recorded one, lest a
wrong model be drawn to one side of the data (Peelle's puzzle).

Sizes of the slow errors come from the differences between repeats and from the data sheet; those of
gains and zeros stay open over a range (`GAIN_SDS`, `ErrorModel.zero_sds`) and are marginalised by
`legfem.inverse.evidence`. First contact is a parameter of the fit.

Each further channel has an instrument of its own: errors from reading to reading, slow ones, those of its clock in
every trial (a lag, times the reading's rate), and one boundary and one gain that all its trials share. None of them is
the load cell's; what isn't known of the leg (outlines, aim, stiffness of the fat) is shared with the force.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cholesky
from scipy.linalg.lapack import dtrtrs

from legfem.channels.kind import PlacedReadings
from legfem.channels.kinds import FILE_OF
from legfem.common.units import FloatArray
from legfem.data.noise import EXPECTED_GAIN_SD, contrasts_of
from legfem.inverse.accuracy import Cause
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.intervals import NUMERICAL_ERROR, NUMERICAL_LENGTH_MM
from legfem.inverse.observations import Observations
from legfem.inverse.trial_noise import Noise, trial_covariance

_MODEL_SHARE, _MODEL_LENGTH_MM = 0.01, 5.0
"""Of the model's own error, smooth along the displacement: over what the channel changes by. Meshes twice as fine
change thicknesses by 0.007 mm at most, the skin's rise by 0.04 mm and the lateral force by 0.2 %."""
_OWN = 0.05
"""Share of a reading's variance that no neighbour shares."""
_SHAPE_LENGTH_MM = 10.0
"""Of what outlines that are off, and two effects at once, do beyond the sum of their single effects
(`ChannelKind.model_share`): with skin and fascia 1 mm off, an aim of 1 mm and bones of 0.5 to 1.4 mm, 0.15 mm of the
skin's rise at 20 mm; fat 2.7 and fascia 12 times as stiff, 0.12 mm at 10 mm; 0.03 mm of thickness each. Along the
displacement; from place to place it is alike over `ChannelKind.model_length`."""


def reading_covariance(
    one: StationChannel, slope: FloatArray, slowest: float, repeated: Sequence[Sequence[int]]
) -> FloatArray:
    """Return the covariance (k, k) of the instrument's errors that aren't alike in all readings, in its unit squared.

    Parameters
    ----------
    one
        The readings.
    slope
        (k,), of the channel by the displacement, in its unit per mm.
    slowest
        Time (s) over which slow errors are correlated.
    repeated
        Numbers of the trials by programme.
    """
    same = np.equal.outer(one.trial, one.trial)
    alike = one.alike(one.accuracy.apart)
    slow = one.accuracy.slow**2 * np.exp(-np.abs(np.subtract.outer(one.time, one.time)) / slowest) * alike
    lag = one.accuracy.lag * slope * one.speed
    white = np.diag(one.white_variance)
    if one.course is not None:
        # Errors from frame to frame, which places near each other share.
        sd = np.sqrt(one.white_variance)
        white = np.outer(sd, sd) * alike * np.equal.outer(one.frame, one.frame) + np.diag(_OWN * sd**2)
    own = white + same * (slow + np.outer(lag, lag))
    return np.asarray(_excess_of_repeats(one, own, repeated) * own)


def model_covariance(one: StationChannel, since_touch: FloatArray, way: float = 1.0) -> FloatArray:
    """Return the covariance (k, k) of the model's own error; ``since_touch`` (k,) is what it says of the change since.

    It changes along the displacement as a leg's does along as many times ``way`` mm. Meshes err by a share of all that
    a channel changes by; of what is read at many places, by a share of each reading.
    """
    apart = np.subtract.outer(one.displacement, one.displacement) / way
    changes = np.full(len(since_touch), np.ptp(since_touch)) if one.course is None else np.abs(since_touch)
    of_meshes = _MODEL_SHARE**2 * np.outer(changes, changes) * np.exp(-0.5 * (apart / _MODEL_LENGTH_MM) ** 2)
    deeper = one.kind.model_share * one.displacement
    total = of_meshes + np.outer(deeper, deeper) * np.exp(-0.5 * (apart / _SHAPE_LENGTH_MM) ** 2)
    return np.asarray(total * one.alike(one.kind.model_length))


def _excess_of_repeats(one: StationChannel, own: FloatArray, repeated: Sequence[Sequence[int]]) -> float:
    """Return the factor on a channel's variance by which repeats differ by more than stated; one where they don't.

    Of contrasts between trials of a programme, which don't hold the true course: their squares over the stated
    variance, in the mean.
    """
    squares, count = 0.0, 0
    for members in repeated:
        rows = [np.flatnonzero(one.trial == k) for k in members]
        if len(rows) < 2 or not len(rows[0]) or len({len(row) for row in rows}) > 1:
            continue
        contrasts = contrasts_of(one.values[np.array(rows)])
        each = own[np.ix_(rows[0], rows[0])]
        squares += float(np.sum(contrasts * np.linalg.solve(each, contrasts)))
        count += contrasts.size
    return max(1.0, squares / count) if count else 1.0


def shared_errors(one: StationChannel, predicted: FloatArray, force: FloatArray) -> dict[str, FloatArray]:
    """Return by name what one standard deviation of an error does that all of a channel's readings share (k,).

    Parameters
    ----------
    one
        The readings.
    predicted
        (k,), by the model, or smoothed.
    force
        (k,), N, along the travel: a cell that reads several forces mixes them by as much as its gains are off.
    """
    alike = "zero" if one.kind.follows_force else "boundary"
    found: dict[str, FloatArray] = {alike: one.accuracy.bias * np.ones(len(predicted))}
    if one.accuracy.gain > 0:
        found["gain"] = one.accuracy.gain * (predicted - one.kind.at_rest)
        if one.kind.is_force:
            found["cross-talk"] = one.accuracy.gain * force
    if one.course is not None:
        read = PlacedReadings(one.place, one.time, one.frame, predicted)
        found |= FILE_OF[one.name].shared(read, one.accuracy)
    return {f"{one.kind.title}: {name}": effect for name, effect in found.items()}


IMAGE_LEFT = 0.1
"""Of what an image does that lies elsewhere: what is left of a second order. By another code, at nine points of three
legs, images laid evenly within 2 mm and 3 degrees of their place err by 0.31 to 0.40 mm in the mean square over a
loading of 20 mm, and by 0.028 to 0.051 mm once the three ways in which they may lie have what they do
(tests/verification/test_diagnosed_inside.py)."""
type Elsewhere = Mapping[str, FloatArray]
"""By the way in which an image lies elsewhere, what one standard deviation of it does to a channel's readings, (k,)."""


def covariance_of_places(one: StationChannel, predicted: FloatArray, laid: Elsewhere) -> FloatArray:
    """Return the covariance (k, k) of errors at each place alone, alike in all frames, in its unit squared.

    Parameters
    ----------
    one
        The readings.
    predicted
        (k,), by the model.
    laid
        Of its image: what is left of a second order is at each place by itself.
    """
    rows = [one.accuracy.each * (predicted - one.kind.at_rest)] if one.course is not None else []
    each = np.array([*rows, *(IMAGE_LEFT * effect for effect in laid.values())]).reshape(-1, len(predicted))
    here = np.equal.outer(one.course, one.course) if one.course is not None else 1.0
    return np.asarray(here * (each.T @ each))


def alike_in_both(one: StationChannel, other: StationChannel) -> FloatArray:
    """Return the covariance (k, m) of a channel's errors in two tests of k and m readings: what one instrument has."""
    accuracy, rest = one.accuracy, one.kind.at_rest
    changes = np.outer(one.values - rest, other.values - rest)
    here = np.equal.outer(one.course, other.course) if one.course is not None and other.course is not None else 0.0
    return np.asarray(accuracy.bias**2 + (accuracy.gain**2 + accuracy.each**2 * here) * changes)


ROUGHNESS, ROUGHNESS_LENGTH = 1e-4, 0.05
"""Of the model's force along the way, over the largest, and over the smooth error's length: elements that come into
contact."""
COMMON_GAIN = "load cell's gain"
"""Name of its effect, which all tests with one cell share."""
COMMON_GAIN_SD = 0.005
"""Relative error of the load cell's calibration, the same in all trials (class 0.5 of ISO 376)."""
GAIN_SDS = tuple(float(EXPECTED_GAIN_SD * np.exp(x)) for x in (-2.0, -1.0, 0.0, 1.0, 2.0))
"""Standard deviations of the gain from trial to trial; a factor e either way is one standard
deviation of what is expected."""
ZERO_FACTORS = (0.37, 1.0, 2.7)
"""Standard deviations of a trial's zero over the one expected: likewise."""
_UNBOUNDED = 1e6
"""Factor on the variance of a reading which is set aside."""


@dataclass(frozen=True, eq=False)
class NuisanceEffect:
    """What one standard deviation of a thing that isn't known exactly does to the readings."""

    name: str
    effect: FloatArray
    """Change of the readings (N,), in their units."""
    cause: Cause
    source: ErrorSource = "shape"
    shared: bool = False
    """Whether all tests of a problem have it alike."""


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """The covariance of the N readings about the prediction, in its parts.

    Parameters
    ----------
    noise
        Of the trials.
    dense
        (N, N), in the readings' units: the trials' noise and the model's error.
    known
        (N, k): effects of what the model doesn't know, an effect of one standard deviation a
        column; the load cell's common gain among them.
    gains, zeros
        (N, R): effects of a trial's gain of 1 (N) and of a zero of 1 N; none on further channels.
    trial_sd
        (N,): of one trial's values by its noise.
    gain_sd, zero_sd
        What `covariance` takes, of a trial's gain and zero (N).
    of_model
        (N, N): the model's own error among ``dense``.
    stated
        Known effects with their causes and sources, by their names, in the order of the columns of ``known``.
    """

    noise: Noise
    dense: FloatArray
    known: FloatArray
    gains: FloatArray
    zeros: FloatArray
    trial_sd: FloatArray
    gain_sd: float = EXPECTED_GAIN_SD
    zero_sd: float = 0.02
    of_model: FloatArray = field(kw_only=True)
    stated: Mapping[str, NuisanceEffect] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns of ``known``."""
        return tuple(self.stated)

    @property
    def zero_sds(self) -> tuple[float, ...]:
        """Standard deviations of a trial's zero that are possible, N."""
        return tuple(factor * self.noise.zero_sd for factor in ZERO_FACTORS)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of all errors together; (n, n), N^2."""
        total = self.dense + self.known @ self.known.T
        total += self.gain_sd**2 * self.gains @ self.gains.T
        return np.asarray(total + self.zero_sd**2 * self.zeros @ self.zeros.T)

    @cached_property
    def lower(self) -> FloatArray:
        """Cholesky factor L of the covariance; (n, n)."""
        return np.asarray(cholesky(self.covariance, lower=True))

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return L^-1 times vectors (n,) or (n, k)."""
        return np.asarray(dtrtrs(self.lower, values, lower=True)[0])

    def part(self, kept: NDArray[np.bool_]) -> "ErrorModel":
        """Return the errors of some of the observations."""
        rows = {name: getattr(self, name)[kept] for name in ("known", "gains", "zeros", "trial_sd")}
        return replace(self, dense=self.dense[np.ix_(kept, kept)], **rows)

    def without_bounds(self, readings: NDArray[np.bool_]) -> "ErrorModel":
        """Return the errors with those of some readings (N,) a thousand times as large."""
        return replace(self, dense=self.dense + np.diag(readings * _UNBOUNDED * np.diag(self.covariance)))

    def draw(self, number: int, generator: np.random.Generator) -> FloatArray:
        """Return error vectors (number, n), N."""
        return np.asarray(generator.normal(size=(number, len(self.covariance))) @ self.lower.T)


def error_model(
    observed: Observations,
    noise: Noise,
    prediction: FloatArray,
    unknowns: Sequence[NuisanceEffect] = (),
    images: Mapping[str, Elsewhere] | None = None,
) -> ErrorModel:
    """Return the errors of observations about a model, of the force and of every further channel.

    Parameters
    ----------
    observed
        The recordings.
    noise
        See `estimate_noise`.
    prediction
        (N,): readings that the model predicts, the n forces (N) first.
    unknowns
        What the model doesn't know.
    images
        By channel; see `legfem.inverse.predictor.Predictor.images_elsewhere`.
    """
    own = trial_covariance(observed, noise)
    force, others = prediction[: len(own)], prediction[len(own) :]
    trials = np.eye(int(observed.trial.max()) + 1)[observed.trial]
    of_model = [numerical_covariance(observed.displacement, force, observed.way * NUMERICAL_LENGTH_MM)]
    blocks: list[FloatArray] = [of_model[0] + own]
    spread: list[FloatArray] = [np.sqrt(np.diag(own))]
    columns = {COMMON_GAIN: np.concatenate([COMMON_GAIN_SD * force, np.zeros(len(others))])}
    columns |= {one.name: one.effect for one in unknowns}
    for one, here in zip(observed.channels, observed.data.spans[1:], strict=True):
        predicted = prediction[here]
        own = reading_covariance(one, one.slope(predicted), noise.correlation_time, observed.repeated)
        laid = (images or {}).get(one.name, {})
        of_model.append(model_covariance(one, predicted, observed.way))
        blocks.append(own + of_model[-1] + covariance_of_places(one, predicted, laid))
        spread.append(np.sqrt(np.diag(blocks[-1])))
        shared = shared_errors(one, predicted, one.weights @ force)
        # Channels that are read in one image have these together.
        shared |= {f"{one.kind.image}: {way}": effect for way, effect in laid.items()}
        for name, effect in shared.items():
            columns.setdefault(name, np.zeros(len(prediction)))[here] = effect
    gain = NuisanceEffect(COMMON_GAIN, columns[COMMON_GAIN], Cause(COMMON_GAIN), "recordings", True)
    stated = {name: NuisanceEffect(name, effect, Cause(name), "channels") for name, effect in columns.items()}
    stated |= {one.name: one for one in (gain, *unknowns)}
    none = np.zeros((len(others), trials.shape[1]))
    return ErrorModel(
        noise,
        np.asarray(block_diag(*blocks)),
        np.column_stack(list(columns.values())),
        np.vstack([trials * force[:, None], none]),
        np.vstack([trials, none]),
        np.concatenate(spread),
        zero_sd=noise.zero_sd,
        of_model=np.asarray(block_diag(*of_model)),
        stated=stated,
    )


def numerical_covariance(
    displacement: FloatArray, force: FloatArray, length: float = NUMERICAL_LENGTH_MM, power: float = 2.0
) -> FloatArray:
    r"""Return the covariance (n, n), N^2, of a model's numerical error.

    A smooth share of the force, and a rough one of the largest.

    Parameters
    ----------
    displacement
        (n,), mm.
    force
        (n,), N: that the model predicts.
    length
        Way l over which it is correlated, mm.
    power
        p of the correlation :math:`\exp(-(a / l)^p / p)` at a distance a: 2 for a smooth error, 1
        where the errors of an emulator, which wiggle along the curve, are to weigh little.
    """
    size = np.abs(force)
    apart = np.abs(displacement[:, None] - displacement[None, :])
    rough = (ROUGHNESS * size.max()) ** 2
    total = np.outer(size, size) * NUMERICAL_ERROR**2 * np.exp(-((apart / length) ** power) / power)
    total += rough * np.exp(-0.5 * (apart / (ROUGHNESS_LENGTH * length)) ** 2)
    return np.asarray(total + 1e-2 * rough * np.eye(len(size)))
