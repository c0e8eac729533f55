"""Channels beside a specimen's force: readings at a diagnosis' stations, and how far a model is off."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray, spans_of
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.comparison import Comparison, Covariances, Prediction, total_of
from legfem.inverse.errors import alike_in_both, error_model
from legfem.inverse.fit import ChannelFit
from legfem.inverse.observations import Observations, observe
from legfem.inverse.outcome import Outcome
from legfem.inverse.readings import INSTRUMENT, OFFSET, RELAXATION, read_at_offsets
from legfem.inverse.station_reading import StationReading
from legfem.inverse.trial_noise import estimate_noise
from legfem.solve.path import ForceCurve
from legfem.specimens.comparison import Part, SpecimenComparison, slopes_by_readings
from legfem.specimens.course import relaxed
from legfem.specimens.sizes import SpecimenRecording

_BEYOND = 1.01
"""Time to which channels are read, over the course's: a frame at its end counts, however contact's time is found."""
_OFFSET = list(INSTRUMENT).index(OFFSET)


def _observed(recording: SpecimenRecording, names: Collection[str]) -> Observations | None:
    """Return a recording's stations with the named channels' readings within its course; None where it has none."""
    if not {one.name for one in recording.recording.channels}.intersection(names):
        return None
    observed, end = observe([recording.from_contact]), recording.course.samples.time[-1]
    found = [one.part(one.time <= _BEYOND * end) for one in observed.channels if one.name in names]
    kept = tuple(one for one in found if len(one.values))
    return replace(observed, channels=kept) if kept else None


def weighed_with_force(recording: SpecimenRecording) -> set[str]:
    """Return the channels that are weighed with a force: layers' thicknesses, and what is nothing at rest."""
    more = [name for name in recording.sizes.kind.beside if CHANNELS[name].at_rest == 0.0]
    return {*recording.sizes.thicknesses, *more}


@dataclass(frozen=True, eq=False)
class BesideForce:
    """What a recording has beside its force, and what its test's model makes of that.

    Parameters
    ----------
    number : int
        Of the recording among the comparison's parts.
    part : Part
        The recording.
    station : StationReading
        Its k readings, and what they take of the model's courses on a grid.
    depth : float
        mm that the model is solved to.
    relaxes : bool
        Whether loads relax as the force does.
    relative_sd : float
        Standard deviation of a layer's stated thickness, over that.
    """

    number: int
    part: Part
    station: StationReading
    depth: float
    relaxes: bool
    relative_sd: float

    def __len__(self) -> int:
        """Return the number k of readings."""
        return len(self.values)

    @property
    def channels(self) -> tuple[StationChannel, ...]:
        """In the order of the readings."""
        return self.station.observed.channels

    @cached_property
    def values(self) -> FloatArray:
        """The readings (k,), each in its unit."""
        return np.concatenate([one.values for one in self.channels])

    @cached_property
    def slope(self) -> FloatArray:
        """Their slope (k,) by the displacement, per mm."""
        return np.concatenate([one.slope(one.values) for one in self.channels])

    @cached_property
    def errors(self) -> tuple[FloatArray, FloatArray]:
        """Covariance (k, k) by instruments and model, and the model's of it."""
        observed, instrument = self.station.observed, self.part.course.instrument
        found = error_model(observed, estimate_noise(observed, instrument, observed.slowest), observed.values)
        assert found.of_model is not None
        forces = len(observed.force)
        return found.covariance[forces:, forces:], found.of_model[forces:, forces:]

    @cached_property
    def of_sizes(self) -> FloatArray:
        """Covariance (k, k) by stated thicknesses: a layer's that is off is so in proportion all along the test."""
        layers = self.part.recording.sizes.thicknesses
        each = [self.relative_sd * (one.name in layers) * one.values for one in self.channels]
        return np.asarray(block_diag(*(np.outer(one, one) for one in each)))

    @property
    def scale(self) -> FloatArray:
        """Sizes of the model's values: of each course its value at rest and changes on the grid."""
        assert self.station.linear_scale is not None
        return self.station.linear_scale[len(self.station.grid) :]

    def _matrix(self, offset: float) -> FloatArray:
        """Return what elastic readings take of the model's values, contact having begun at an offset (mm)."""
        whole = self.station.matrix(offset=offset) if offset else self.station.plain
        return whole[len(self.station.observed.force) :, len(self.station.grid) :]

    def read(self, values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., k) of the model's values; loads relax as forces do."""
        elastic = read_at_offsets(self._matrix, values, instrument[..., _OFFSET])
        if not self.relaxes:
            return elastic
        numbers, ends = instrument[..., len(INSTRUMENT) :], np.cumsum([len(one.values) for one in self.channels])
        felt = [
            relaxed(one.time, one.displacement / self.depth, block, numbers) if one.follows_force else block
            for one, block in zip(self.channels, np.split(elastic, ends[:-1], axis=-1), strict=True)
        ]
        return np.concatenate(felt, axis=-1)

    def predict(self, curve: ForceCurve, instrument: FloatArray) -> Prediction:
        """Return the readings of a solve."""
        grid, (whole, rates) = len(self.station.grid), self.station.model_values(curve)
        values, by = whole[grid:], {name: each[grid:] for name, each in rates.items()}
        seen = {name: self.read(each, instrument) for name, each in by.items()}
        slopes = slopes_by_readings(partial(self.read, values), instrument)
        seen |= {name: slope for name, slope in slopes.items() if name == OFFSET or name in RELAXATION}
        return Prediction(self.read(values, instrument), seen, values, by)


@dataclass(frozen=True, eq=False)
class SpecimenReadings(Comparison):
    """Forces of recordings, then what was read beside them.

    Parameters
    ----------
    forces : SpecimenComparison
        n of them.
    beside : tuple of BesideForce
        Of the recordings that have something, in the order of the forces' parts.
    """

    forces: SpecimenComparison
    beside: tuple[BesideForce, ...]

    @cached_property
    def every_channel(self) -> list[StationChannel]:
        """Channels of all recordings, in the order of the readings."""
        return [channel for one in self.beside for channel in one.channels]

    def of_forces(self, values: FloatArray) -> FloatArray:
        """Return the forces among readings (n, ...), in the order of the recordings' stations."""
        return values[: len(self.forces)]

    @cached_property
    def part_of(self) -> NDArray[np.int_]:
        """Number of the recording that every reading (n,) is of."""
        stations = [len(part.course.time) for part in self.forces.parts]
        numbers = [*range(len(stations)), *(one.number for one in self.beside)]
        return np.repeat(numbers, [*stations, *map(len, self.beside)])

    @cached_property
    def measured(self) -> FloatArray:
        """Forces (N) of all stations, and readings of channels in their units."""
        return np.concatenate([self.forces.measured, *(one.values for one in self.beside)])

    @cached_property
    def _spans(self) -> list[slice]:
        """Place of every channel among the readings."""
        return spans_of([len(self.forces), *(len(one.values) for one in self.every_channel)])[1:]

    @cached_property
    def channels(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings; empty where there is but the force."""
        found: dict[str, list[NDArray[np.int_]]] = {}
        for one, span in zip(self.every_channel, self._spans, strict=True):
            found.setdefault(one.name, []).append(np.arange(span.start, span.stop))
        together = {name: np.concatenate(places) for name, places in found.items()}
        return {"force": np.arange(len(self.forces)), **together} if found else {}

    @property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Those of the forces."""
        return self.forces.parts_along

    @property
    def informed_by(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings, or, where there is but the force, of those of each of several tests."""
        tests = self.forces.readings_of
        return self.channels or (tests if len(tests) > 1 else {})

    @cached_property
    def linear_scale(self) -> FloatArray | None:
        """Sizes of the model's values, 0 of forces; None of these alone."""
        if not self.beside:
            return None
        return np.concatenate([np.zeros(self._forces_on_grids), *(one.scale for one in self.beside)])

    @cached_property
    def _forces_on_grids(self) -> int:
        return sum(map(len, self.forces.grids))

    @property
    def reach(self) -> str:
        """The tests' depths."""
        return ", ".join(f"{depth:.3g}" for depth in self.forces.depths) + " mm"

    def reached_by(self, outcome: Outcome) -> bool:
        """Whether every test came to its depth, and tells what was read."""
        pairs = zip(outcome.curves, self.forces.depths, strict=True)
        told = (outcome.curves[one.part.test].channels.keys() >= set(one.station.courses) for one in self.beside)
        return all(curve.depth >= depth - 1e-9 for curve, depth in pairs) and all(told)

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the readings per relative change of the displacements."""
        depth = [one.displacement for one in self.every_channel]
        beside = -np.concatenate([[], *depth]) * np.concatenate([[], *(one.slope for one in self.beside)])
        return np.concatenate([self.forces.if_deeper, beside])

    @cached_property
    def expected(self) -> FloatArray:
        """Readings as they are expected of contacts where they are taken to be."""
        moved = [one.values - one.part.onset.ahead * one.slope for one in self.beside]
        return np.concatenate([self.forces.expected_force, *moved])

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Read complete full solves."""
        found = self.forces.predict(outcome, instrument)
        for one in self.beside:
            found = found.followed_by(one.predict(outcome.curves[one.part.test], instrument))
        return found

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., n) of the models' values (..., m)."""
        ends = np.cumsum([self._forces_on_grids, *(len(one.scale) for one in self.beside)])[:-1]
        force, *others = np.split(model_values, ends, axis=-1) if self.beside else [model_values]
        pairs = zip(self.beside, others, strict=True)
        found = [self.forces.read(force, instrument), *(one.read(values, instrument) for one, values in pairs)]
        return np.concatenate(found, axis=-1)

    def covariances_at(self, values: FloatArray, spread: float = 0.0) -> Covariances:
        """Return covariances about predicted readings by their source; sizes aren't among them."""
        found = {
            k: self.of_forces_alone(c) for k, c in self.forces.covariances_at(self.of_forces(values), spread).items()
        }
        if not self.beside:
            return found
        of_model = block_diag(*(one.errors[1] for one in self.beside))
        found["channels"] = self._beside_only(self.beside_errors - of_model)
        found["model"] += self._beside_only(of_model)
        # Where contact is moves forces and channels together.
        first = len(self.forces)
        for one in self.beside:
            force, onset = self.forces.spans[one.number], one.part.onset
            mode = np.zeros(len(self))
            mode[force], mode[first : first + len(one)] = onset.modes[:, 0], onset.way * one.slope
            first += len(one)
            found["recordings"] += np.outer(mode, mode)
            found["recordings"][force, force] -= np.outer(onset.modes[:, 0], onset.modes[:, 0])
        return found

    def of_forces_alone(self, of_forces: FloatArray) -> FloatArray:
        """Return a covariance of the forces as one of all readings (n, n)."""
        more = len(self) - len(of_forces)
        return np.asarray(block_diag(of_forces, np.zeros((more, more))))

    def _beside_only(self, covariance: FloatArray) -> FloatArray:
        none = np.zeros((len(self.forces), len(self.forces)))
        return np.asarray(block_diag(none, covariance))

    @cached_property
    def thickness_errors(self) -> FloatArray:
        """Covariance (n, n) by the stated thickness of layers, where channels show it."""
        if not self.beside:
            return np.zeros((len(self), len(self)))
        return self._beside_only(block_diag(*(one.of_sizes for one in self.beside)))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of measured less predicted readings."""
        return total_of(self.covariances_at(self.measured)) + self.thickness_errors

    @property
    def weighing_covariance(self) -> FloatArray:
        """Covariance (n, n) in the weights: forces alone are of recordings that count alike; channels bring errors."""
        return self.covariance if self.beside else self.forces.weighing_covariance

    @cached_property
    def beside_errors(self) -> FloatArray:
        """Covariance of what was read beside the forces, by instruments and model; one instrument reads all tests."""
        found = np.asarray(block_diag(*(one.errors[0] for one in self.beside)))
        first = len(self.forces)
        places = [slice(span.start - first, span.stop - first) for span in self._spans]
        for (one, mine), (other, its) in permutations(zip(self.every_channel, places, strict=True), 2):
            if one.name == other.name:
                found[mine, its] = alike_in_both(one, other)
        return found

    def fits_of(self, number: int, values: FloatArray) -> list[ChannelFit]:
        """Return what was read beside a recording's force, and predicted readings of all recordings at it."""
        if not self.beside:
            return []
        numbers = [one.number for one in self.beside for _ in one.channels]
        each = zip(numbers, self.every_channel, self._spans, strict=True)
        sd = np.sqrt(np.diag(self._beside_only(self.beside_errors) + self.thickness_errors))
        return [ChannelFit(replace(one.channel, sd=sd[span]), values[span]) for k, one, span in each if k == number]


def readings_of(
    forces: SpecimenComparison,
    relative_sd: Sequence[float],
    names: Callable[[SpecimenRecording], Collection[str]] = weighed_with_force,
) -> SpecimenReadings:
    """Return forces with what their recordings have beside them.

    Parameters
    ----------
    forces
        Beside the model.
    relative_sd
        Standard deviation of a layer's stated thickness over that, of every recording's specimen.
    names
        Channels of a recording.
    """
    found = []
    for number, (part, sd) in enumerate(zip(forces.parts, relative_sd, strict=True)):
        observed = _observed(part.recording, names(part.recording))
        if observed is not None:
            station = StationReading(observed, np.zeros(1), forces.grids[part.test])
            found.append(BesideForce(number, part, station, forces.depths[part.test], forces.relaxes, sd))
    return SpecimenReadings(forces, tuple(found))
