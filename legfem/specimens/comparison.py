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

from legfem.common.units import FloatArray
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.comparison import Covariances, Prediction, total_of
from legfem.inverse.errors import COMMON_GAIN_SD, alike_in_both
from legfem.inverse.fibre_ratio import SHAPE_SD_OF_FIBRES
from legfem.inverse.fit import ChannelFit
from legfem.inverse.joint_comparison import ComparedTests
from legfem.inverse.outcome import JointForward, Outcome
from legfem.inverse.readings import INSTRUMENT, OFFSET, ZERO
from legfem.solve.path import ForceCurve
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.nuisances import OnsetEffect, OwnStiffness, kinds_of, tells_ratio, were_turned
from legfem.specimens.parts import GRID, Part, slopes_by_readings, weighed_with_force
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
_ZERO = list(INSTRUMENT).index(ZERO)


@dataclass(frozen=True, eq=False)
class SpecimenComparison(ComparedTests[Part]):
    """Recordings beside models of their tests, of which several may be of one.

    Parameters
    ----------
    tests : tuple of Part
        Recordings, of n readings together.
    own : OwnStiffness, optional
        Of every specimen; all are alike without it.
    shape_sd : float
        By which the model's force may rise otherwise over the depth, relative, one standard
        deviation, alike in all recordings of a kind.
    """

    tests: tuple[Part, ...]
    own: OwnStiffness | None = None
    shape_sd: float = 0.0

    def solved(self, outcome: Outcome) -> list[tuple[Part, ForceCurve]]:
        """Recordings with their tests' curves."""
        return [(part, outcome.curves[part.test]) for part in self.tests]

    @cached_property
    def expected(self) -> FloatArray:
        """Readings as they are expected of contacts where they are taken to be."""
        return np.concatenate([part.expected for part in self.tests])

    @cached_property
    def is_force(self) -> NDArray[np.bool_]:
        """Which of the readings (n,) are forces."""
        return np.concatenate([part.is_force for part in self.tests])

    @cached_property
    def forces(self) -> "SpecimenComparison":
        """The same without what is beside the forces."""
        return replace(self, tests=tuple(replace(part, beside=None) for part in self.tests))

    @cached_property
    def beside(self) -> list[tuple[int, StationChannel, slice]]:
        """Channels beside the forces: numbers of their recordings, and their places among the readings."""
        return [
            (number, one, slice(whole.start + span.start, whole.start + span.stop))
            for number, (part, whole) in enumerate(zip(self.tests, self.spans, strict=True))
            for one, span in zip(part.channels, part.data.spans[1:], strict=True)
        ]

    @cached_property
    def part_of(self) -> NDArray[np.int_]:
        """Number of the recording that every reading (n,) is of."""
        return np.repeat(np.arange(len(self.tests)), [len(part.data) for part in self.tests])

    @property
    def recordings(self) -> list[SpecimenRecording]:
        """Recordings of the parts."""
        return [part.recording for part in self.tests]

    @cached_property
    def recordings_of(self) -> dict[str, NDArray[np.int_]]:
        """Places of the recordings of every test, by its name."""
        names = np.array([one.test for one in self.recordings])
        return {name: np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())}

    def of_test(self, name: str) -> "SpecimenComparison":
        """Return the recordings of one test, to compare forces with that are as they stand."""
        return replace(self, tests=tuple(self.tests[k] for k in self.recordings_of[name]), own=None)

    @property
    def informed_by(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of each channel's readings, or, where there is but the force, of those of each of several tests."""
        return self.channels or (self.readings_of if len(self.recordings_of) > 1 else {})

    @cached_property
    def readings_of(self) -> dict[str, NDArray[np.int_]]:
        """Places of the readings of every test, by its name."""
        return {name: np.flatnonzero(np.isin(self.part_of, found)) for name, found in self.recordings_of.items()}

    @cached_property
    def _once(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Where, of the recordings' model values, each is first, and where all are among these: a test's are shared."""
        each = ((number, part.test, k) for number, part in enumerate(self.tests) for k in range(len(part.linear_scale)))
        keys = [(0, test, k) if k < GRID else (1, number, k) for number, test, k in each]
        _, first, every = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        return first, every.ravel()

    @cached_property
    def linear_scale(self) -> FloatArray:
        """Sizes (m,) of the model's values, 0 of forces."""
        return super().linear_scale[self._once[0]]

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., n) of the models' values (..., m): forces of all tests, then what is beside them."""
        return self._by_specimen(self._alike(model_values, instrument), instrument)

    def _alike(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return the same, if all specimens were alike."""
        return super().read(model_values[..., self._once[1]], instrument)

    def _felt(self, alike: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return the forces (..., f) of readings (..., n) without the zero."""
        return np.asarray(alike[..., self.is_force] - instrument[..., _ZERO, None])

    def _by_specimen(self, alike: FloatArray, instrument: FloatArray) -> FloatArray:
        if self.own is not None:
            felt = self._felt(alike, instrument)
            alike[..., self.is_force] += felt * (self.own(felt) - 1.0)
        return alike

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Return complete full solves as they are read."""
        found, (first, _) = super().predict(outcome, instrument), self._once
        if self.own is not None:
            felt = self._felt(found.values, instrument)
            for by in (by for name, by in found.sensitivities.items() if name != ZERO):
                by[self.is_force] = self.own.slope(felt, by[self.is_force])
        values, rates = self._by_specimen(found.values, instrument), found.model_sensitivities
        by_model = {name: by[first] for name, by in rates.items()}
        return Prediction(values, found.sensitivities, found.model_values[first], by_model)

    @cached_property
    def _weighing(self) -> list[FloatArray]:
        """Covariances of forces that make recordings count alike, N2."""
        sizes = [WEIGHT * part.course.peak * float(np.sqrt(len(part.course.time) / COUNTED)) for part in self.tests]
        return [part.onset.weighing(sd) for part, sd in zip(self.tests, sizes, strict=True)]

    @property
    def weighing_covariance(self) -> FloatArray:
        """Covariance (n, n) in the weights: forces alone are of recordings that count alike; channels bring errors."""
        return self.covariance if self.beside else np.asarray(block_diag(*self._weighing))

    def aheads(self, predicted: FloatArray) -> list[float]:
        """Return how far (mm) each recording's contact is from where it is expected."""
        left = self.measured - predicted
        each = zip(self.tests, self.spans, self._weighing, strict=True)
        return [part.onset.moved(left[span][part.is_force], covariance) for part, span, covariance in each]

    def slopes(self, model_values: FloatArray, readings: FloatArray) -> list[FloatArray]:
        """Return what every recording's stations (N) lose per mm of contact, of models' forces."""
        lost = -slopes_by_readings(partial(self._alike, model_values), readings)[OFFSET]
        if self.own is not None:
            lost = self.own(self._felt(self._alike(model_values, readings), readings)) * lost
        return [lost[span] for span in self.spans]

    def scales(self, predicted: FloatArray) -> FloatArray:
        """Return what would make each recording's share of predicted forces fit it best, without what stood before."""
        pairs = [
            (part.course.force - part.course.standing, predicted[span][part.is_force])
            for part, span in zip(self.tests, self.spans, strict=True)
        ]
        return np.array([float(one @ other / (other @ other)) for one, other in pairs])

    def gain_sd(self, predicted: FloatArray) -> float:
        """Return how recordings of a test differ by a factor, one standard deviation, about predicted forces."""
        scales, tests = self.scales(predicted), self.recordings_of
        if len(scales) <= len(tests):
            return LEAST_GAIN_SD
        # Of one test the law is the middle; how several tests differ is asked apart from how recordings do.
        left = [scales[one] - (scales[one].mean() if len(tests) > 1 else 1) for one in tests.values()]
        return max(LEAST_GAIN_SD, float(np.sqrt(np.sum(np.concatenate(left) ** 2) / (len(scales) - len(tests)))))

    def stiffness(self, prediction: Prediction, readings: FloatArray) -> dict[str, float]:
        """Return every specimen's stiffness over the typical one; nothing where all are alike."""
        if self.own is None:
            return {}
        return self.own.named(self._felt(self._alike(prediction.model_values, readings), readings))

    def covariances_at(self, values: FloatArray, spread: float = 0.0) -> Covariances:
        """Return covariances (n, n) about predicted readings (n,), by their source; sizes aren't among them.

        Of forces, readings and a gain of all; a gain of each recording and, with a spread, a standard
        deviation of the logarithm of the specimens' stiffness, how they differ; and the model's own
        error.
        """
        force, bent, gain = np.where(self.is_force, values, 0.0), np.zeros(len(self)), self.gain_sd(values)
        share = np.concatenate([part.course.displacement / part.course.depth for part in self.tests])
        bent[self.is_force] = self.shape_sd * force[self.is_force] * share
        specimen = np.array([one.specimen for one in self.recordings])[self.part_of]
        kind = np.array([part.kind for part in self.tests])[self.part_of]
        of_force, model = np.outer(force, force), np.outer(bent, bent) * (kind[:, None] == kind)
        readings = COMMON_GAIN_SD**2 * of_force
        differences = spread**2 * of_force * (specimen[:, None] == specimen)
        for part, span in zip(self.tests, self.spans, strict=True):
            read, of_model = part.own_errors(values[span])
            readings[span, span] += read
            model[span, span] += of_model
            differences[span, span] += gain**2 * of_force[span, span]
        found: Covariances = {"recordings": readings, "differences": differences, "model": model}
        return {**found, "channels": self.instrument_errors} if self.beside else found

    def of_forces_alone(self, of_forces: FloatArray) -> FloatArray:
        """Return a covariance of the forces as one of all readings (n, n)."""
        found = np.zeros((len(self), len(self)))
        found[np.ix_(self.is_force, self.is_force)] = of_forces
        return found

    @cached_property
    def thickness_errors(self) -> FloatArray:
        """Covariance (n, n) by the stated thickness of layers, where channels show it."""
        return np.asarray(block_diag(*(part.of_sizes for part in self.tests)))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of measured less predicted readings."""
        return total_of(self.covariances_at(self.measured)) + self.thickness_errors

    @cached_property
    def instrument_errors(self) -> FloatArray:
        """Covariance (n, n) of what was read beside the forces, by instruments; one reads all recordings."""
        found = np.asarray(block_diag(*(part.errors[0] for part in self.tests)))
        for (_, one, mine), (_, other, its) in permutations(self.beside, 2):
            if one.name == other.name:
                found[mine, its] = alike_in_both(one, other)
        return found

    @property
    def beside_errors(self) -> FloatArray:
        """The same, by the model too."""
        return self.instrument_errors + block_diag(*(part.errors[1] for part in self.tests))

    def fits_of(self, number: int, values: FloatArray) -> list[ChannelFit]:
        """Return what was read beside a recording's force, and predicted readings of all recordings at it."""
        sd = np.sqrt(np.diag(self.beside_errors + self.thickness_errors))
        mine = (each[1:] for each in self.beside if each[0] == number)
        return [ChannelFit(replace(one.channel, sd=sd[span]), values[span]) for one, span in mine]

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
        pairs = zip(self.tests, relative_sd, strict=True)
        return replace(self, tests=tuple(part.with_channels(names(part.recording), sd) for part, sd in pairs))


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
    parts = tuple(
        Part(
            one,
            OnsetEffect.of(one.course, one.detected, slope, FACTOR_SD if several else 0.0),
            (number := tests.index(one.sizes)),
            model.models[number].depth,
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
    found = SpecimenComparison(parts, shape_sd=shape_sd)
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
    specimen = np.array([names.index(one.specimen) for one in recordings])[forces.part_of]
    tests = tuple({one.specimen: one.test for one in recordings}.values()) if several else ()
    directions = tuple(kind for (kind,) in kinds.values()) if by_direction else ()
    return OwnStiffness(names, specimen, forces.expected, forces.weighted, known, directions or tests)
