"""Recordings of several specimens beside one model: each counts alike.

How stiff each is beside the others is found with it, see `legfem.specimens.nuisances`.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from legfem.common.units import FloatArray, spans_of
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.comparison import Comparison, Covariances, Prediction, total_of
from legfem.inverse.errors import COMMON_GAIN_SD, alike_in_both, numerical_covariance
from legfem.inverse.fibre_ratio import SHAPE_SD_OF_FIBRES
from legfem.inverse.fit import ChannelFit
from legfem.inverse.intervals import by_third, third_of
from legfem.inverse.outcome import JointForward, Outcome
from legfem.inverse.readings import INSTRUMENT, OFFSET
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.nuisances import OnsetEffect, OwnStiffness, kinds_of, power_of, tells_ratio, were_turned
from legfem.specimens.parts import GRID, Part, grid_to, slopes_by_readings, weighed_with_force
from legfem.specimens.sizes import SpecimenRecording

WEIGHT = 0.01
"""Error of every station in the fit, over the recording's greatest force."""
COUNTED = 20
"""Stations that a recording counts as, however many it has: neighbours err alike."""
FACTOR_SD = 0.015
"""Relative error of the force by gain and sizes of one of several tests, in the weights alone."""
LEAST_GAIN_SD = 0.01
"""From recording to recording; more where their scatter says so."""
SHAPE_SD_OF_LAYERS = 0.05
"""Layers of unlike stiffness bend a curve by a few percent: so do what the law leaves out of how
tissue stiffens, and the rounding of edges."""
_GAIN, _ZERO, _ = range(len(INSTRUMENT))


@dataclass(frozen=True, eq=False)
class SpecimenComparison(Comparison):
    """Forces of recordings beside a model, then what was read beside them.

    Parameters
    ----------
    parts : tuple of Part
        Recordings, of f forces and n readings together.
    depths : tuple of float
        Of the tests (mm), how deep they are solved.
    own : OwnStiffness, optional
        Of every specimen; all are alike without it.
    shape_sd : float
        By which the model's force may rise otherwise over the depth, relative, one standard
        deviation, alike in all recordings of a kind.
    """

    parts: tuple[Part, ...]
    depths: tuple[float, ...]
    own: OwnStiffness | None = None
    shape_sd: float = 0.0

    @cached_property
    def forces(self) -> FloatArray:
        """Measured forces of all stations (f,), N."""
        return np.concatenate([part.course.force for part in self.parts])

    @cached_property
    def measured(self) -> FloatArray:
        """The forces, and readings of channels in their units."""
        return np.concatenate([self.forces, *(part.values for part in self.parts)])

    def of_forces(self, values: FloatArray) -> FloatArray:
        """Return the forces among readings (n, ...), in the order of the recordings' stations."""
        return values[: len(self.forces)]

    @cached_property
    def expected(self) -> FloatArray:
        """Readings as they are expected of contacts where they are taken to be."""
        moved = [part.onset.expected for part in self.parts]
        return self.measured - np.concatenate([*moved, *(part.onset.ahead * part.slope for part in self.parts)])

    @cached_property
    def spans(self) -> list[slice]:
        """Where every recording's forces stand."""
        return spans_of(len(part.course.time) for part in self.parts)

    @cached_property
    def every_channel(self) -> list[StationChannel]:
        """Channels beside the forces of all recordings, in the order of the readings."""
        return [channel for part in self.parts for channel in part.channels]

    @cached_property
    def _channel_spans(self) -> list[slice]:
        """Place of every channel among the readings."""
        return spans_of([len(self.forces), *(len(one.values) for one in self.every_channel)])[1:]

    @cached_property
    def _beside(self) -> list[tuple[int, Part]]:
        """Recordings that have something beside the force, with their numbers."""
        return [(number, part) for number, part in enumerate(self.parts) if part.channels]

    @cached_property
    def part_of(self) -> NDArray[np.int_]:
        """Number of the recording that every reading (n,) is of."""
        sizes = [*(len(part.course.time) for part in self.parts), *(len(part.values) for part in self.parts)]
        return np.repeat([*range(len(self.parts))] * 2, sizes)

    @cached_property
    def channels(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings; empty where there is but the force."""
        found: dict[str, list[NDArray[np.int_]]] = {}
        for one, span in zip(self.every_channel, self._channel_spans, strict=True):
            found.setdefault(one.name, []).append(np.arange(span.start, span.stop))
        together = {name: np.concatenate(places) for name, places in found.items()}
        return {"force": np.arange(len(self.forces)), **together} if found else {}

    @property
    def recordings(self) -> list[SpecimenRecording]:
        """Recordings of the parts."""
        return [part.recording for part in self.parts]

    @cached_property
    def recordings_of(self) -> dict[str, NDArray[np.int_]]:
        """Places of the recordings of every test, by its name."""
        names = np.array([one.test for one in self.recordings])
        return {name: np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())}

    @cached_property
    def forces_of(self) -> dict[str, NDArray[np.int_]]:
        """Places of the forces of every test, by its name."""
        places = [np.arange(span.start, span.stop) for span in self.spans]
        return {name: np.concatenate([places[k] for k in found]) for name, found in self.recordings_of.items()}

    def of_test(self, name: str) -> "SpecimenComparison":
        """Return the recordings of one test, to compare forces with that are as they stand."""
        return replace(self, parts=tuple(self.parts[k] for k in self.recordings_of[name]), own=None)

    @property
    def informed_by(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings, or, where there is but the force, of those of each of several tests."""
        return self.channels or (self.forces_of if len(self.forces_of) > 1 else {})

    @cached_property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the loading's stations in each third of its depth."""
        third, after = [], []
        for part in self.parts:
            course = part.course
            third.append(third_of(course.displacement, course.depth))
            after.append(course.time > course.arrival * (1 + 1e-9))
        return by_third(np.concatenate(third), np.concatenate(after))

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the readings per relative change of the displacements.

        Of forces as if in proportion to a power of the depth, which holds and returns keep to.
        """
        forces = [power_of(part.course) * -part.course.force for part in self.parts]
        depth = np.concatenate([np.zeros(0), *(one.displacement for one in self.every_channel)])
        return np.concatenate([*forces, -depth * np.concatenate([part.slope for part in self.parts])])

    @cached_property
    def linear_scale(self) -> FloatArray:
        """Sizes of the model's values, 0 of forces."""
        return np.concatenate([np.zeros(GRID * len(self.depths)), *(part.scale for part in self.parts)])

    @property
    def reach(self) -> str:
        """The tests' depths."""
        return ", ".join(f"{depth:.3g}" for depth in self.depths) + " mm"

    def reached_by(self, outcome: Outcome) -> bool:
        """Whether every test came to its depth."""
        pairs = zip(outcome.curves, self.depths, strict=True)
        return all(curve.depth >= depth - 1e-9 for curve, depth in pairs)

    def unseen_in(self, outcome: Outcome) -> tuple[str, ...]:
        """Names of the channels that their tests' solves don't have."""
        pairs = [(part.beside, outcome.curves[part.test]) for part in self.parts]
        return tuple(dict.fromkeys(name for one, curve in pairs if one is not None for name in one.unseen_in(curve)))

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., n) of the models' values (..., m): forces of all tests, then what is beside them."""
        spans = spans_of([GRID * len(self.depths), *(len(part.scale) for _, part in self._beside)])[1:]
        pairs = zip(self._beside, spans, strict=True)
        others = [part.read(model_values[..., span], instrument) for (_, part), span in pairs]
        return np.concatenate([self._read_forces(model_values, instrument), *others], axis=-1)

    def _read_forces(self, force: FloatArray, instrument: FloatArray) -> FloatArray:
        felt = self._felt(force, instrument)
        if self.own is not None:
            felt = felt * self.own(felt)
        return np.asarray(felt + instrument[..., _ZERO, None])

    def _felt(self, force: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return the same but for the zero, if all specimens were alike."""
        found = [part.felt(force, instrument) for part in self.parts]
        return np.asarray(instrument[..., _GAIN, None] * np.concatenate(found, -1))

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Return complete full solves as they are read."""
        pairs = [(curve, grid_to(depth)) for curve, depth in zip(outcome.curves, self.depths, strict=True)]
        force = np.concatenate([curve(grid) for curve, grid in pairs])
        by = {
            name: np.concatenate([curve.sensitivity(name, grid) for curve, grid in pairs])
            for name in pairs[0][0].sensitivities
        }
        seen = {name: self._felt(values, instrument) for name, values in by.items()}
        if self.own is not None:
            felt = self._felt(force, instrument)
            seen = {name: self.own.slope(felt, values) for name, values in seen.items()}
        seen |= slopes_by_readings(partial(self._read_forces, force), instrument)
        forces = Prediction(self._read_forces(force, instrument), seen, force, by)
        beside = (part.predict(outcome.curves[part.test], instrument) for _, part in self._beside)
        return Prediction.joined([forces, *beside])

    @cached_property
    def _weighing(self) -> list[FloatArray]:
        """Covariances of forces that make recordings count alike, N2."""
        sizes = [WEIGHT * part.course.peak * float(np.sqrt(len(part.course.time) / COUNTED)) for part in self.parts]
        return [part.onset.weighing(sd) for part, sd in zip(self.parts, sizes, strict=True)]

    @property
    def weighing_covariance(self) -> FloatArray:
        """Covariance (n, n) in the weights: forces alone are of recordings that count alike; channels bring errors."""
        return self.covariance if self._beside else np.asarray(block_diag(*self._weighing))

    def aheads(self, force: FloatArray) -> list[float]:
        """Return how far (mm) each recording's contact is from where it is expected."""
        left = self.forces - force
        each = zip(self.parts, self.spans, self._weighing, strict=True)
        return [part.onset.moved(left[span], covariance) for part, span, covariance in each]

    def slopes(self, force: FloatArray, readings: FloatArray) -> list[FloatArray]:
        """Return what every recording's stations (N) lose per mm of contact, of models' forces."""
        lost = -slopes_by_readings(partial(self._felt, force), readings)[OFFSET]
        if self.own is not None:
            lost = self.own(self._felt(force, readings)) * lost
        return [lost[span] for span in self.spans]

    def scales(self, force: FloatArray) -> FloatArray:
        """Return what would make each recording's share of forces (f,) fit it best, without what stood before."""
        pairs = [
            (self.forces[span] - part.course.standing, force[span])
            for part, span in zip(self.parts, self.spans, strict=True)
        ]
        return np.array([float(one @ other / (other @ other)) for one, other in pairs])

    def gain_sd(self, force: FloatArray) -> float:
        """Return how recordings of a test differ by a factor, one standard deviation, about forces (f,)."""
        scales, tests = self.scales(force), self.recordings_of
        if len(scales) <= len(tests):
            return LEAST_GAIN_SD
        # Of one test the law is the middle; how several tests differ is asked apart from how recordings do.
        left = [scales[one] - (scales[one].mean() if len(tests) > 1 else 1) for one in tests.values()]
        return max(LEAST_GAIN_SD, float(np.sqrt(np.sum(np.concatenate(left) ** 2) / (len(scales) - len(tests)))))

    def stiffness(self, prediction: Prediction, readings: FloatArray) -> dict[str, float]:
        """Return every specimen's stiffness over the typical one; nothing where all are alike."""
        if self.own is None:
            return {}
        return self.own.named(self._felt(prediction.model_values, readings))

    def covariances_at(self, values: FloatArray, spread: float = 0.0) -> Covariances:
        """Return covariances (n, n) about predicted readings (n,), by their source; sizes aren't among them.

        Of forces, readings and a gain of all; a gain of each recording and, with a spread, a standard
        deviation of the logarithm of the specimens' stiffness, how they differ; and the model's own
        error.
        """
        force = self.of_forces(values)
        readings = COMMON_GAIN_SD**2 * np.outer(force, force)
        model, differences = np.zeros_like(readings), np.zeros_like(readings)
        if self.own is not None:
            differences += spread**2 * np.outer(force, force) * self.own.same
        if self.shape_sd:
            share = [part.course.displacement / part.course.depth for part in self.parts]
            otherwise = self.shape_sd * force * np.concatenate(share)
            kinds = np.repeat([p.kind for p in self.parts], [len(d) for d in share])
            model += np.outer(otherwise, otherwise) * (kinds[:, None] == kinds)
        gain = self.gain_sd(force)
        for part, span in zip(self.parts, self.spans, strict=True):
            course, own = part.course, force[span]
            for errors in part.force_errors(own):
                readings[span, span] += errors
            differences[span, span] += gain**2 * np.outer(own, own)
            model[span, span] += numerical_covariance(course.displacement, own, length=course.depth / 3, power=1.0)
        each: Covariances = {"recordings": readings, "differences": differences, "model": model}
        found = {source: self.of_forces_alone(one) for source, one in each.items()}
        if self._beside:
            of_model = block_diag(*(part.errors[1] for part in self.parts))
            found["channels"] = self._beside_only(self.beside_errors - of_model)
            found["model"] += self._beside_only(of_model)
        # Where contact is moves forces and channels together.
        first = len(force)
        for number, part in self._beside:
            span, mode, later = self.spans[number], np.zeros(len(self)), part.onset.modes[:, 0]
            mode[span], mode[first : first + len(part.values)] = later, part.onset.way * part.slope
            first += len(part.values)
            found["recordings"] += np.outer(mode, mode)
            found["recordings"][span, span] -= np.outer(later, later)
        return found

    def of_forces_alone(self, of_forces: FloatArray) -> FloatArray:
        """Return a covariance of the forces as one of all readings (n, n)."""
        more = len(self) - len(of_forces)
        return np.asarray(block_diag(of_forces, np.zeros((more, more))))

    def _beside_only(self, covariance: FloatArray) -> FloatArray:
        return np.asarray(block_diag(np.zeros((len(self.forces), len(self.forces))), covariance))

    @cached_property
    def thickness_errors(self) -> FloatArray:
        """Covariance (n, n) by the stated thickness of layers, where channels show it."""
        return self._beside_only(block_diag(*(part.of_sizes for part in self.parts)))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of measured less predicted readings."""
        return total_of(self.covariances_at(self.measured)) + self.thickness_errors

    @cached_property
    def beside_errors(self) -> FloatArray:
        """Covariance of what was read beside the forces, by instruments and model; one instrument reads all tests."""
        found = np.asarray(block_diag(*(part.errors[0] for part in self.parts)))
        first = len(self.forces)
        places = [slice(span.start - first, span.stop - first) for span in self._channel_spans]
        for (one, mine), (other, its) in permutations(zip(self.every_channel, places, strict=True), 2):
            if one.name == other.name:
                found[mine, its] = alike_in_both(one, other)
        return found

    def fits_of(self, number: int, values: FloatArray) -> list[ChannelFit]:
        """Return what was read beside a recording's force, and predicted readings of all recordings at it."""
        numbers = [k for k, part in enumerate(self.parts) for _ in part.channels]
        each = zip(numbers, self.every_channel, self._channel_spans, strict=True)
        sd = np.sqrt(np.diag(self._beside_only(self.beside_errors) + self.thickness_errors))
        return [ChannelFit(replace(one.channel, sd=sd[span]), values[span]) for k, one, span in each if k == number]

    def with_channels(
        self, relative_sd: Sequence[float], names: Callable[[SpecimenRecording], Collection[str]] = weighed_with_force
    ) -> "SpecimenComparison":
        """Return the forces with what their recordings have beside them.

        Parameters
        ----------
        relative_sd
            Standard deviation of a layer's stated thickness over that, of every recording's specimen.
        names
            Channels of a recording.
        """
        pairs = zip(self.parts, relative_sd, strict=True)
        return replace(self, parts=tuple(part.with_channels(names(part.recording), sd) for part, sd in pairs))


def comparison_of(
    recordings: Sequence[SpecimenRecording],
    model: JointForward[SpecimenForward],
    folder: SpecimenFolder,
    seeks: bool,
    known: Mapping[str, float] | None = None,
    slopes: Sequence[FloatArray | None] = (),
) -> SpecimenComparison:
    """Return forces of recordings beside a model; known factors of specimens aren't looked for.

    Parameters
    ----------
    recordings
        That count.
    model
        Of their tests.
    folder
        Theirs.
    seeks
        Whether the fibres' ratio is free.
    known
        Stiffness of specimens over a typical one, by name.
    slopes
        Of the recordings' forces at their stations, N/mm; their own without them.
    """
    several, tests = len({one.test for one in recordings}) > 1, [one.sizes for one in model.models]
    depths = tuple(one.depth for one in model.models)
    parts = tuple(
        Part(
            one,
            OnsetEffect.of(one.course, one.detected, slope, FACTOR_SD if several else 0.0),
            (number := tests.index(one.sizes)),
            depths[number],
            folder.relaxes,
            one.test + one.sizes.fibres_text,
        )
        for one, slope in zip(recordings, slopes or [None] * len(recordings), strict=True)
    )
    told = tells_ratio(folder, recordings)
    bent = len(folder.tissues) > 1 or any(one.sizes.fibres_text for one in recordings)
    shape_sd = SHAPE_SD_OF_LAYERS if bent else 0.0
    if seeks and not told:
        shape_sd = SHAPE_SD_OF_FIBRES
    found = SpecimenComparison(parts, depths, shape_sd=shape_sd)
    if folder.equally_stiff:
        return found
    return replace(found, own=_own_stiffness(found, known, seeks and told and not were_turned(recordings)))


def _own_stiffness(
    forces: SpecimenComparison, known: Mapping[str, float] | None, by_direction: bool
) -> OwnStiffness | None:
    """Return the specimens' stiffness beside typical ones of a test or of a direction of fibres; None of too few."""
    recordings, several = forces.recordings, len(forces.recordings_of) > 1
    kinds = kinds_of(recordings)
    names = tuple(kinds)
    if known is None and len(names) <= len(forces.recordings_of):
        return None
    stations = [len(one.course.time) for one in recordings]
    specimen = np.repeat([names.index(one.specimen) for one in recordings], stations)
    tests = tuple({one.specimen: one.test for one in recordings}.values()) if several else ()
    directions = tuple(kind for (kind,) in kinds.values()) if by_direction else ()
    return OwnStiffness(names, specimen, forces.expected, forces.weighted, known, directions or tests)
