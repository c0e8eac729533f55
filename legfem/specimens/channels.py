"""Thicknesses of layers and strains of the face beside a specimen's force: readings, and how far a model is off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from legfem.channels.kinds import CHANNELS
from legfem.channels.kinds.layer_thickness import between_of
from legfem.common.units import FloatArray
from legfem.inverse.comparison import Comparison, Covariances, Prediction, total_of
from legfem.inverse.errors import alike_in_both
from legfem.inverse.fit import ChannelFit
from legfem.inverse.loading_channels import BesideForce, LoadingChannel, loading_channel, loading_readings
from legfem.inverse.outcome import Outcome
from legfem.inverse.readings import INSTRUMENT, OFFSET, RELAXATION
from legfem.specimens.comparison import Part, SpecimenComparison, slopes_by_readings
from legfem.specimens.course import relaxed
from legfem.specimens.sizes import SpecimenRecording

_BEYOND = 1.01
"""Depth to which channels are read, over the recording's: a frame at its end isn't lost to smoothing."""


def beside_of(recording: SpecimenRecording, relative_sd: float) -> tuple[LoadingChannel, ...]:
    """Return what a recording has of its layers' thicknesses and its face's strains, in the loading.

    Parameters
    ----------
    recording
        Of a specimen.
    relative_sd
        Standard deviation of a layer's stated thickness, over that.
    """
    heights = between_of(recording.sizes.heights) if recording.sizes.layers else {}
    # What is nothing at rest.
    heights |= {name: (0.0, 0.0) for name in recording.sizes.kind.beside if CHANNELS[name].at_rest == 0.0}
    course = recording.course
    trial = recording.from_contact
    found = []
    for one in loading_readings([trial], _BEYOND * course.depth, "specimen"):
        if one.name in heights:
            low, high = heights[one.name]
            force = np.interp(one.time, course.time, course.force, left=0.0)
            contact = np.zeros((len(force), len(force)))
            found.append(loading_channel(one, [trial], force, contact, high - low, relative_sd * (high - low)))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class SpecimenReadings(Comparison):
    """Forces of recordings, then what was read beside them.

    Parameters
    ----------
    forces : SpecimenComparison
        n of them.
    beside : tuple of tuple
        Channels of every recording, in the order of the forces' parts.
    """

    forces: SpecimenComparison
    beside: tuple[tuple[LoadingChannel, ...], ...]

    @cached_property
    def _every(self) -> list[LoadingChannel]:
        return [one for channels in self.beside for one in channels]

    @cached_property
    def _read(self) -> list[tuple[Part, BesideForce]]:
        """Recordings with channels, and what their models make of these."""
        parts = zip(self.forces.parts, self.beside, strict=True)
        return [(part, BesideForce(self.forces.grids[part.test], channels)) for part, channels in parts if channels]

    def of_forces(self, values: FloatArray) -> FloatArray:
        """Return the forces among readings (n, ...), in the order of the recordings' stations."""
        return values[: len(self.forces)]

    @cached_property
    def part_of(self) -> NDArray[np.int_]:
        """Number of the recording that every reading (n,) is of."""
        stations = [len(part.course.time) for part in self.forces.parts]
        numbers = np.arange(len(stations))
        of_channels = [len(one) for channels in self.beside for one in channels]
        return np.concatenate(
            [np.repeat(numbers, stations), np.repeat(np.repeat(numbers, [len(c) for c in self.beside]), of_channels)]
        )

    @cached_property
    def measured(self) -> FloatArray:
        """Forces (N) of all stations, and readings of channels in their units."""
        return np.concatenate([self.forces.measured, *(one.readings.values for one in self._every)])

    @cached_property
    def _spans(self) -> list[slice]:
        """Place of every channel among the readings."""
        ends = np.cumsum([len(self.forces), *map(len, self._every)])
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def channels(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings; empty where there is but the force."""
        found: dict[str, list[NDArray[np.int_]]] = {}
        for one, span in zip(self._every, self._spans, strict=True):
            found.setdefault(one.readings.name, []).append(np.arange(span.start, span.stop))
        together = {name: np.concatenate(places) for name, places in found.items()}
        return {"force": np.arange(len(self.forces)), **together} if found else {}

    @property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """As the forces'."""
        return self.forces.parts_along

    @property
    def informed_by(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings, or, where there is but the force, of those of each of several tests."""
        tests = self.forces.readings_of
        return self.channels or (tests if len(tests) > 1 else {})

    @cached_property
    def linear_scale(self) -> FloatArray | None:
        """Sizes of the model's values, 0 of forces; None of these alone."""
        if not self._read:
            return None
        return np.concatenate([np.zeros(self._forces_on_grids), *(beside.scale for _, beside in self._read)])

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
        deep = all(curve.depth >= depth - 1e-9 for curve, depth in pairs)
        return deep and all(beside.told_by(outcome.curves[part.test]) for part, beside in self._read)

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the readings per relative change of the displacements."""
        return np.concatenate([self.forces.if_deeper, *(-one.depth * one.slope for one in self._every)])

    @cached_property
    def expected(self) -> FloatArray:
        """Readings as they are expected of contacts where they are taken to be."""
        moved = [
            part.onset.ahead * one.slope
            for part, channels in zip(self.forces.parts, self.beside, strict=True)
            for one in channels
        ]
        return self.measured - np.concatenate([self.forces.measured - self.forces.expected_force, *moved])

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Read complete full solves."""
        found, offset = self.forces.predict(outcome, instrument), _offset(instrument)
        for part, beside in self._read:
            elastic = beside.predict(outcome.curves[part.test], offset)
            by = {name: self._felt(part, beside, values, instrument) for name, values in elastic.sensitivities.items()}
            felt = partial(self._felt, part, beside, elastic.values)
            by |= {name: slope for name, slope in slopes_by_readings(felt, instrument).items() if name in RELAXATION}
            found = found.followed_by(replace(elastic, values=felt(instrument), sensitivities=by))
        return found

    def _felt(self, part: Part, beside: BesideForce, elastic: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., k), of a tissue without time, as they are of one in which loads relax as forces do."""
        loads = [self.forces.relaxes and one.readings.kind.follows_force for one in beside.channels]
        ends = np.cumsum([0, *map(len, beside.channels)])[1:-1]
        shape = np.broadcast_shapes(elastic.shape[:-1], instrument.shape[:-1])
        blocks = np.split(np.broadcast_to(elastic, (*shape, elastic.shape[-1])), ends, axis=-1)
        numbers, depth = instrument[..., len(INSTRUMENT) :], self.forces.depths[part.test]
        felt = [
            relaxed(one.readings.time, one.depth / depth, block, numbers) if load else block
            for one, block, load in zip(beside.channels, blocks, loads, strict=True)
        ]
        return np.concatenate(felt, axis=-1)

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., n) of the models' values (..., m)."""
        ends = np.cumsum([self._forces_on_grids, *(beside.size for _, beside in self._read)])[:-1]
        force, *others = np.split(model_values, ends, axis=-1) if self._read else [model_values]
        found = [self.forces.read(force, instrument)]
        for (part, beside), values in zip(self._read, others, strict=True):
            found.append(self._felt(part, beside, beside.read(values, _offset(instrument)), instrument))
        return np.concatenate(found, axis=-1)

    def covariances_at(self, values: FloatArray, spread: float = 0.0) -> Covariances:
        """Return covariances about predicted readings by their source; sizes aren't among them."""
        found = {
            k: self.of_forces_alone(c) for k, c in self.forces.covariances_at(self.of_forces(values), spread).items()
        }
        if not self._every:
            return found
        of_model = block_diag(*(one.numerical for one in self._every))
        found["channels"] = self._beside_only(self.beside_errors - of_model)
        found["model"] += self._beside_only(of_model)
        # Where contact is moves forces and channels together.
        spans = iter(self._spans)
        for part, force, channels in zip(self.forces.parts, self.forces.spans, self.beside, strict=True):
            of_force = part.onset.modes[:, 0]
            mode = np.zeros(len(self))
            mode[force] = of_force
            for one in channels:
                mode[next(spans)] = part.onset.way * one.slope
            found["recordings"] += np.outer(mode, mode)
            found["recordings"][force, force] -= np.outer(of_force, of_force)
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
        if not self._every:
            return np.zeros((len(self), len(self)))
        return self._beside_only(block_diag(*(one.outlines for one in self._every)))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of measured less predicted readings."""
        return total_of(self.covariances_at(self.measured)) + self.thickness_errors

    def weighted(self, values: FloatArray) -> FloatArray:
        """Scale values (n, ...): forces alone as recordings that count alike, beside channels by their errors."""
        return super().weighted(values) if self._every else self.forces.weighted(values)

    def residual(self, values: FloatArray) -> FloatArray:
        """Return the weighted residual (..., n) of readings (..., n)."""
        flat = (values - self.expected).reshape(-1, values.shape[-1])
        return self.weighted(flat.T).T.reshape(values.shape)

    @cached_property
    def beside_errors(self) -> FloatArray:
        """Covariance of what was read beside the forces, by instruments and model."""
        found = block_diag(*(one.instrument + one.numerical for one in self._every))
        starts = np.cumsum([0, *map(len, self._every)])
        for (k, one), (m, other) in permutations(enumerate(self._every), 2):
            alike = alike_in_both(one.readings, one.level, other.readings, other.level)
            found[starts[k] : starts[k + 1], starts[m] : starts[m + 1]] = alike
        return np.asarray(found)

    def fits_of(self, part: int, values: FloatArray) -> list[ChannelFit]:
        """Return what was read beside a recording's force, and predicted readings of all recordings at it."""
        mine, before = self.beside[part], sum(map(len, self.beside[:part]))
        spans = self._spans[before : before + len(mine)]
        return [ChannelFit(one.channel, values[span]) for one, span in zip(mine, spans, strict=True)]


def _offset(instrument: FloatArray) -> FloatArray:
    return np.asarray(instrument[..., list(INSTRUMENT).index(OFFSET)])


def readings_of(forces: SpecimenComparison, relative_sd: Sequence[float]) -> SpecimenReadings:
    """Return forces with what their recordings have beside them.

    Parameters
    ----------
    forces
        Beside the model.
    relative_sd
        Standard deviation of a layer's stated thickness over that, of every recording's specimen.
    """
    pairs = zip(forces.recordings, relative_sd, strict=True)
    return SpecimenReadings(forces, tuple(beside_of(one, sd) for one, sd in pairs))
