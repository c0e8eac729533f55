r"""What a recording of a specimen shows after first contact, at few stations, and what its past relaxes of the force.

Relaxation is quasi-linear, of the whole specimen:

.. math:: F(t) = F_e(t) + \sum_k \beta_k \int_0^t e^{-(t - s) / \tau_k} \dot F_e(s)\, ds

with the elastic force :math:`F_e` of the same motion (Y. C. Fung, Biomechanics (1993), section
7.6). Exact where all of the specimen is strained alike, and at small strain under an indenter whose
contact grows (E. H. Lee, J. R. M. Radok, J. Appl. Mech. 27 (1960) 438-444). The branches are those
of `legfem.mechanisms.time_dependence`.

Tissue may relax the faster the more it is strained, which two rates of loading show (a slower one
would take up that no spectrum is quite log-normal). Its clock then
runs ahead of time, by

.. math:: \xi(t) = \int_0^t e^{q\, d(s) / D}\, ds,

with the displacement :math:`d`, the test's greatest one :math:`D`, and the quickening :math:`q`
(strain clock: S. R. Shay, J. M. Caruthers, J. Rheol. 30 (1986) 781-827): :math:`\xi` stands for
:math:`t` and :math:`s` above.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.linalg import solve_banded

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data import Instrument, Recording, Scales, Segmentation, segment
from legfem.data.contact import PARTED, Contact, contact_at_start, first_return
from legfem.data.instrument_faults import standing_force
from legfem.data.plausibility import start_doubts
from legfem.data.quality import check_touch
from legfem.data.segmentation import before_it_tears
from legfem.data.smoothing import sample_noise, without_outliers
from legfem.data.stress_tables import roughness
from legfem.inverse.parameter import Parameter, Prior
from legfem.mechanisms.time_dependence import SPECTRUM, TIMES_S, spectrum

STATIONS = 40
"""Stations of a loading: one for each such share of its way, and of its time."""
SLOW_SHARE = 0.5
"""Share of a reading's variance that doesn't change within a recording (an accuracy's drift, zero)."""
_GROWTH = 0.15
_LEAST_SAMPLES = 10
_LEAST_SEEN = 5.0
_BACK = 0.02
_LEAST_RISE = 0.2
"""Least share of all motion that is a rise: with less, what was recorded goes the other way."""
# Of the greatest force, where no instrument is stated.
_READING = 0.002
_HELD = 0.95
"""Share of the greatest force above which it counts as held."""
_SLOWED = 0.2
"""Share of the mean speed of loading below which motion under a held force is creep."""


@dataclass(frozen=True, eq=False)
class Course:
    """A recording from first contact to its first return, or on; arrays are (n,) at stations.

    Every station is the mean of neighbouring samples: of a part of the way while the drive moves,
    of a part of the time's logarithm while it holds.
    """

    time: FloatArray
    """s after first contact."""
    displacement: FloatArray
    """mm after first contact."""
    force: FloatArray
    """N above what was read in air."""
    count: FloatArray
    """Samples of a station."""
    instrument: Instrument
    """Errors of one reading."""
    arrival: float
    """s: when the greatest displacement was reached."""
    samples: Recording
    """As recorded, on the stations' scales."""
    contact: Contact
    """Where it began, by the recording's own displacement."""
    begun: float = 0.0
    """s on the recording's clock: when first contact was."""
    standing: float = 0.0
    """N that stand before anything is pressed: a preload, or a zero that wasn't taken."""

    @property
    def in_air(self) -> bool:
        """Whether the recording begins in air."""
        return self.contact.in_air

    @property
    def depth(self) -> float:
        """Greatest displacement, mm."""
        return float(self.displacement.max())

    @property
    def rate(self) -> float:
        """Mean speed up to the greatest displacement, mm/s; of no meaning where no clock gave the time."""
        return self.depth / self.arrival

    @property
    def peak(self) -> float:
        """Greatest force, N."""
        return float(self.force.max())

    @property
    def holds(self) -> bool:
        """Whether it goes on for a third of the loading's time with drive or force at rest."""
        return self.samples.timed and (bool(self.time[-1] > 4 / 3 * self.arrival) or self.creeps)

    @property
    def creeps(self) -> bool:
        """Whether the force is held, while what is pressed gives way ever more slowly."""
        full = int(np.argmax(self.force >= _HELD * self.peak))
        begun, way = float(self.time[full]), float(self.displacement[full])
        rest = float(self.time[-1]) - begun
        if rest < begun / 3 or (self.force[full:] < _HELD**2 * self.peak).any():
            return False
        return (float(self.displacement[-1]) - way) * begun < _SLOWED * way * rest

    def down_to(self, depth: float) -> "Course":
        """Return what is recorded before a displacement (mm) is exceeded."""
        deeper = np.flatnonzero(self.displacement > depth)
        if not len(deeper):
            return self
        own = {name: getattr(self, name)[: deeper[0]] for name in ("time", "displacement", "force", "count")}
        end = float(self.time[deeper[0] - 1])
        return replace(self, **own, arrival=min(self.arrival, end), samples=self.samples.part(self.samples.time <= end))


def read_specimen(
    given: Recording, instrument: Instrument | None = None, starts_at_contact: bool = False, power: float | None = None
) -> Segmentation:
    """Read a recording of a specimen by the scales of its own travel and noise.

    Parameters
    ----------
    given : Recording
        Displacement and force positive in the test's direction.
    instrument : Instrument, optional
        Errors of a reading; the samples' own scatter without it.
    starts_at_contact : bool
        Whether displacement counts from first contact; else that is looked for.
    power : float, optional
        Of the displacement, that the force of such a test begins with.

    Raises
    ------
    InputError
        If nothing was pressed.
    """
    source = given.source or given.trial
    if len(given) < _LEAST_SAMPLES:
        remedy = f"record at least {_LEAST_SAMPLES} during loading"
        raise InputError(source, "rows", f"{len(given)} samples are too few", remedy)
    # One sample that overshoots doesn't count.
    recording = before_it_tears(replace(given, displacement=without_outliers(given.displacement)))
    calm, noise = recording.displacement, sample_noise(recording.displacement)
    if float(calm.max() - calm[0]) < _LEAST_RISE * float(np.ptp(calm)):
        remedy = "change its sign: displacement and force are positive in the test's direction"
        raise InputError(f"{source}", "displacement_mm", f"falls by {np.ptp(calm):.3g} mm, and never grows", remedy)
    start, arrived, _ = _loaded_and_held(recording, noise)
    errors = instrument or _shown(recording, sample_noise(recording.force[start : arrived + 1]), noise, start, arrived)
    trial = segment(recording, errors, starts_at_contact, Scales.of_specimen(recording, power))
    list(start_doubts(trial))
    check_touch(trial)
    return trial


def _shown(recording: Recording, force_sd: float, displacement_sd: float, start: int, arrived: int) -> Instrument:
    """Return errors of a reading as they are seen, at least a usual share of the loading."""
    least = _READING * float(np.ptp(recording.force[start : arrived + 1]))
    way = _READING * float(np.ptp(recording.displacement))
    return Instrument(max(force_sd, least), max(displacement_sd, way), stated=False)


def read_table(recording: Recording, instrument: Instrument | None = None) -> Segmentation:
    """Read a table of stretch and stress, which counts from the undeformed state and has no phases.

    Its errors, unless stated, are what its loads are off a smooth curve.
    """
    _, top, end = _loaded_and_held(recording, 0.0)
    loading, back = recording.part(slice(end)), recording.part(slice(top, None))
    if end < len(recording):
        again = loading.part(loading.displacement >= back.displacement.min())
        taken, given = (float(trapezoid(one.force, one.displacement)) for one in (again, back))
        loading = replace(loading, hysteresis=1 + given / taken)
    loading = before_it_tears(loading)
    d = loading.displacement
    errors = instrument or _shown(loading, roughness(d, loading.force), 0.0, 0, int(np.argmax(d)))
    return Segmentation(loading, contact_at_start(), d, errors, Scales.of_specimen(loading))


def course_of(trial: Segmentation, returns: bool = False) -> Course:
    """Return the course of a specimen's recording.

    Parameters
    ----------
    trial : Segmentation
        As `read_specimen` reads it.
    returns : bool
        Whether what follows the first return counts, until hardly any force is left.

    Raises
    ------
    InputError
        If there is too little of it.
    """
    recording, contact, calm = trial.recording, trial.contact, trial.recording.displacement
    start, arrived, end = _loaded_and_held(recording, trial.displacement_noise)
    whole = recording.part(slice(start, _parted(recording, end) if returns else end))
    first = int(np.argmax(whole.displacement > contact.displacement))
    speed = _speed(whole.time[first : end - start], calm[start + first : end])
    touched = float(whole.time[first] - (calm[start + first] - contact.displacement) / speed)
    kept = whole.part(slice(first, None))
    pressed, felt = kept.displacement - contact.displacement, kept.force - contact.baseline
    kept = replace(kept, time=kept.time - touched, displacement=pressed, force=felt)
    arrival = float(recording.time[arrived] - touched)
    numbers = _stations(kept, float(calm[arrived] - contact.displacement), arrival)
    count = np.bincount(numbers).astype(float)
    if len(count) < _LEAST_SEEN:
        problem = f"{len(count)} stations of loading are too few"
        raise InputError(trial.source, "rows", problem, "sample faster or press more slowly")
    time, d, force = (np.bincount(numbers, one) / count for one in (kept.time, kept.displacement, kept.force))
    return Course(time, d, force, count, trial.instrument, arrival, kept, contact, touched, standing_force(trial))


def _loaded_and_held(recording: Recording, noise: float) -> tuple[int, int, int]:
    """Return where motion starts, where it arrives, and where it first goes back."""
    calm = recording.displacement
    travel = float(calm.max() - calm[0])
    back = max(_BACK * travel, 5 * noise)
    end = first_return(calm, recording.force, back, 0.3 * travel)
    if end < len(calm):
        # From where it began to.
        end = int(np.flatnonzero(calm[:end] > calm[:end].max() - 0.2 * back)[-1]) + 1
    top = float(calm[:end].max())
    start = max(0, int(np.argmax(calm > calm[0] + max(0.01 * travel, 3 * noise))) - 2)
    arrived = int(np.argmax(calm[:end] >= top - max(0.005 * travel, noise)))
    return start, arrived, end


def _parted(recording: Recording, end: int) -> int:
    """Return where, after the first return, hardly any force is left."""
    force = recording.force - recording.force[:end].min()
    left = force[end:] < PARTED * force[:end].max()
    return end + int(np.argmax(left)) if left.any() else len(force)


def _speed(time: FloatArray, displacement: FloatArray) -> float:
    """Return the speed (mm/s) just after contact."""
    few = max(3, len(time) // 50)
    slope = float(np.polyfit(time[:few], displacement[:few], 1)[0])
    whole = float((displacement.max() - displacement[0]) / (time[-1] - time[0]))
    return max(slope, whole, 1e-12)


def _stations(kept: Recording, depth: float, arrival: float) -> NDArray[np.intp]:
    """Return the number of the station of every sample."""
    way, while_moving = depth / STATIONS, arrival / STATIONS
    numbers = np.zeros(len(kept), dtype=np.intp)
    begun_at, begun, stopped = kept.displacement[0], kept.time[0], kept.time[0]
    for k in range(1, len(kept)):
        at, now = kept.displacement[k], kept.time[k]
        moved = abs(at - begun_at) >= way
        waited = now - begun >= max(1.5 * while_moving, _GROWTH * (now - stopped))
        if moved:
            stopped = now
        numbers[k] = numbers[k - 1] + (moved or waited)
        if moved or waited:
            begun_at, begun = at, now
    return numbers


QUICKENING = "viscoelasticity.quickening"
# Mean speeds of loading that count as two rates.
_ANOTHER_RATE = 2.0


def relaxation_parameters(longest: float) -> tuple[Parameter, ...]:
    """Return ratio, middle and spread of the spectrum within bounds alone, and the quickening.

    Recordings of that length (s) can't tell what relaxes more slowly from what lasts: the middle lies within.
    """
    found = [replace(one, name=f"viscoelasticity.{one.name}", prior=None, role="identified") for one in SPECTRUM]
    low, high = found[1].bounds
    found[1] = replace(found[1], bounds=(low, min(max(longest, 2.0 * low), high)))
    prior = Prior(0.0, 1.0, "linear", "quasi-linear, unless two rates say otherwise")
    told = "logarithm of how much faster what is pressed deepest relaxes"
    return (*found, Parameter(QUICKENING, "-", (0.0, 3.0), prior, statement=told))


def shows_quickening(rates: Sequence[float]) -> bool:
    """Tell whether mean speeds of loading (mm/s) differ enough."""
    return max(rates) > _ANOTHER_RATE * min(rates)


def clock(time: FloatArray, share: FloatArray, quickening: FloatArray) -> FloatArray:
    """Return the tissue's own time (..., n), s.

    Parameters
    ----------
    time
        (n,) s after first contact.
    share
        (n,) displacement over the greatest one; straight between times, and from 0 at 0.
    quickening
        (...) logarithm of the clock's speed where the share is 1.
    """
    after = quickening[..., None] * share
    before = quickening[..., None] * np.concatenate([[0.0], share[:-1]])
    # Simpson's mean of the speed over a straight way.
    speed = (np.exp(before) + 4 * np.exp(0.5 * (before + after)) + np.exp(after)) / 6
    return np.cumsum(speed * np.diff(time, prepend=0.0), axis=-1)


def borne(time: FloatArray, force: FloatArray) -> FloatArray:
    """Return what each branch bears (..., branches, n) over its ratio, N.

    Parameters
    ----------
    time
        (..., n) s after first contact on the tissue's own clock, increasing.
    force
        (..., n) elastic force, N; straight from each time to the next, and from nothing at 0.
    """
    tau = np.array(TIMES_S)[:, None]
    step = np.diff(time, axis=-1, prepend=0.0)[..., None, :] / tau
    fading = np.exp(-step)
    rise = -np.expm1(-step) / step * np.diff(force, axis=-1, prepend=0.0)[..., None, :]
    # held_k = fading_k held_(k-1) + rise_k, of all branches in one banded system.
    fading = np.broadcast_to(fading, rise.shape).copy()
    fading[..., 0] = 0.0
    bands = np.stack([np.ones(rise.size), np.append(-fading.ravel()[1:], 0.0)])
    return np.asarray(solve_banded((1, 0), bands, rise.ravel())).reshape(rise.shape)


def relaxed(time: FloatArray, share: FloatArray, elastic: FloatArray, numbers: FloatArray) -> FloatArray:
    """Return what is felt (..., n) of a load that a tissue without time would bear, relaxation with it.

    Parameters
    ----------
    time, share
        (n,): s after first contact, and displacement over the greatest one.
    elastic
        (..., n): that load, as `borne` takes it.
    numbers
        (..., 4): ratio, middle and spread of the spectrum, and the clock's quickening.
    """
    quickening = numbers[..., -1]
    if quickening.any():
        time = clock(time, share, quickening)
    return np.asarray(elastic + np.einsum("...b,...bn->...n", branch_ratios(numbers[..., :-1]), borne(time, elastic)))


def branch_ratios(numbers: FloatArray) -> FloatArray:
    """Return the ratio of every branch (..., branches) of ratio, middle and spread (..., 3)."""
    flat = numbers.reshape(-1, 3)
    ratios = [ratio * np.array(spectrum(time, spread)) for ratio, time, spread in flat.tolist()]
    return np.array(ratios).reshape(*numbers.shape[:-1], len(TIMES_S))
