"""Recordings of several specimens beside one model: each counts alike.

How stiff each is beside the others is found with it, see `legfem.specimens.nuisances`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag, solve_triangular

from legfem.common.units import FloatArray, spans_of
from legfem.inverse.comparison import Covariances, Prediction
from legfem.inverse.errors import COMMON_GAIN_SD, numerical_covariance
from legfem.inverse.fibre_ratio import SHAPE_SD_OF_FIBRES
from legfem.inverse.intervals import by_third, third_of
from legfem.inverse.outcome import JointForward, Outcome
from legfem.inverse.readings import INSTRUMENT, READINGS, read_at_offsets, unit_spline
from legfem.specimens.course import SLOW_SHARE, STATIONS, Course, relaxed
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.nuisances import OnsetEffect, OwnStiffness, kinds_of, power_of, tells_ratio, were_turned
from legfem.specimens.sizes import SpecimenRecording

GRID = 50
"""Displacements at which a test's force is known to the search."""
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
_STEP = 1e-5


def grid_to(depth: float) -> FloatArray:
    """Return the grid (m,), mm, of a test pressed to a depth: finer at first."""
    return np.asarray(depth * (np.arange(1, GRID + 1) / GRID) ** 1.3)


def slopes_by_readings(read: Callable[[FloatArray], FloatArray], readings: FloatArray) -> dict[str, FloatArray]:
    """Return the derivatives (n,) of what is read by the numbers of `READINGS`, by differences."""
    found = {}
    for k, name in enumerate(READINGS):
        step = _STEP * max(abs(readings[k]), 0.1)
        ends = np.repeat(readings[None], 2, axis=0)
        ends[:, k] += (step, -step)
        up, down = read(ends)
        found[name] = (up - down) / (2 * step)
    return found


@dataclass(frozen=True, eq=False)
class Part:
    """One recording, and which of the tests that are solved it is of."""

    recording: SpecimenRecording
    onset: OnsetEffect
    test: int
    """Number of its test among those that are solved."""
    kind: str = ""
    """Test, and how fibres lie in it: the model's shape errs alike in all of one."""

    @property
    def course(self) -> Course:
        """What the recording shows after first contact."""
        return self.recording.course


@dataclass(frozen=True, eq=False)
class SpecimenComparison:
    """How far forces are from recordings.

    Parameters
    ----------
    parts : tuple of Part
        Recordings, of n stations together.
    depths : tuple of float
        Of the tests (mm), how deep they are solved; all grids together have m points.
    relaxes : bool
        Whether the spectrum counts.
    own : OwnStiffness, optional
        Of every specimen; all are alike without it.
    shape_sd : float
        By which the model's force may rise otherwise over the depth, relative, one standard
        deviation, alike in all recordings of a kind.
    """

    parts: tuple[Part, ...]
    depths: tuple[float, ...]
    relaxes: bool
    own: OwnStiffness | None = None
    shape_sd: float = 0.0

    def __len__(self) -> int:
        """Return the number n of stations."""
        return len(self.measured)

    @cached_property
    def measured(self) -> FloatArray:
        """Forces of all stations (n,), N."""
        return np.concatenate([part.course.force for part in self.parts])

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
        """Change of the measured forces (n,) per relative change of the displacements, N.

        As of a force in proportion to a power of the depth, which holds and returns keep to.
        """
        return np.concatenate([power_of(part.course) * -part.course.force for part in self.parts])

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
    def readings_of(self) -> dict[str, NDArray[np.int_]]:
        """Places of the stations (n,) of every test, by its name."""
        places = [np.arange(span.start, span.stop) for span in self.spans]
        return {name: np.concatenate([places[k] for k in found]) for name, found in self.recordings_of.items()}

    def of_test(self, name: str) -> "SpecimenComparison":
        """Return the recordings of one test, to compare forces with that are as they stand."""
        return replace(self, parts=tuple(self.parts[k] for k in self.recordings_of[name]), own=None)

    @cached_property
    def grids(self) -> list[FloatArray]:
        """Grids of the tests' displacements, mm."""
        return [grid_to(depth) for depth in self.depths]

    @cached_property
    def spans(self) -> list[slice]:
        """Where every recording's stations stand."""
        return spans_of(len(part.course.time) for part in self.parts)

    @cached_property
    def _weighing(self) -> list[FloatArray]:
        """Covariances that make recordings count alike, N2."""
        sizes = [WEIGHT * part.course.peak * float(np.sqrt(len(part.course.time) / COUNTED)) for part in self.parts]
        return [part.onset.weighing(sd) for part, sd in zip(self.parts, sizes, strict=True)]

    @cached_property
    def weighing_covariance(self) -> FloatArray:
        """Those of all recordings, (n, n)."""
        return np.asarray(block_diag(*self._weighing))

    @cached_property
    def _lower(self) -> FloatArray:
        return np.linalg.cholesky(self.weighing_covariance)

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return values (n, ...) over what they count as erring by."""
        return np.asarray(solve_triangular(self._lower, values, lower=True))

    @cached_property
    def expected_force(self) -> FloatArray:
        """Measured forces (n,), N, as they are expected of contacts where they are taken to be."""
        moved = np.concatenate([part.onset.expected for part in self.parts])
        return np.asarray(self.measured - moved)

    def aheads(self, force: FloatArray) -> list[float]:
        """Return how far (mm) each recording's contact is from where it is expected."""
        left = self.measured - force
        each = zip(self.parts, self.spans, self._weighing, strict=True)
        return [part.onset.moved(left[span], covariance) for part, span, covariance in each]

    def slopes(self, force: FloatArray, readings: FloatArray) -> list[FloatArray]:
        """Return what every recording's stations (N) lose per mm of contact, of models' forces."""
        ends = np.repeat(readings[None], 2, axis=0)
        offset = list(INSTRUMENT).index("instrument.contact_offset")
        ends[:, offset] += (-_STEP, _STEP)
        early, late = self._felt(force, ends)
        lost = (early - late) / (2 * _STEP)
        if self.own is not None:
            lost = self.own(self._felt(force, readings)) * lost
        return [lost[span] for span in self.spans]

    @cached_property
    def _splines(self) -> list[CubicSpline]:
        return [unit_spline(grid) for grid in self.grids]

    @cached_property
    def _plain(self) -> list[FloatArray]:
        """What every recording takes of its model's forces, (n, `GRID`)."""
        return [self._splines[part.test](part.course.displacement) for part in self.parts]

    def _matrix(self, number: int, offset: float) -> FloatArray:
        """Return what a recording takes of its model's forces, contact having begun at an offset (mm); (n, `GRID`)."""
        if not offset:
            return self._plain[number]
        part = self.parts[number]
        return np.asarray(self._splines[part.test](np.maximum(part.course.displacement - offset, 0.0)))

    def read(self, force: FloatArray, readings: FloatArray) -> FloatArray:
        """Return what is read (..., n) of the models' forces (..., m)."""
        zero = readings[..., list(INSTRUMENT).index("instrument.zero")]
        felt = self._felt(force, readings)
        if self.own is not None:
            felt = felt * self.own(felt)
        return np.asarray(felt + zero[..., None])

    def _felt(self, force: FloatArray, readings: FloatArray) -> FloatArray:
        """Return the same but for the zero, if all specimens were alike."""
        gain, _, offset = np.moveaxis(readings, -1, 0)[: len(INSTRUMENT)]
        found = []
        for number, part in enumerate(self.parts):
            own = force[..., part.test * GRID : (part.test + 1) * GRID]
            elastic = read_at_offsets(partial(self._matrix, number), own, offset)
            if self.relaxes:
                share = part.course.displacement / self.depths[part.test]
                elastic = relaxed(part.course.time, share, elastic, readings[..., len(INSTRUMENT) :])
            found.append(elastic)
        return np.asarray(gain[..., None] * np.concatenate(found, -1))

    def predict(self, outcome: Outcome, readings: FloatArray) -> Prediction:
        """Return complete full solves as they are read."""
        pairs = list(zip(outcome.curves, self.grids, strict=True))
        force = np.concatenate([curve(grid) for curve, grid in pairs])
        by = {
            name: np.concatenate([curve.sensitivity(name, grid) for curve, grid in pairs])
            for name in pairs[0][0].sensitivities
        }
        seen = {name: self._felt(values, readings) for name, values in by.items()}
        if self.own is not None:
            felt = self._felt(force, readings)
            seen = {name: self.own.slope(felt, values) for name, values in seen.items()}
        seen |= slopes_by_readings(partial(self.read, force), readings)
        return Prediction(self.read(force, readings), seen, force, by)

    def scales(self, force: FloatArray) -> FloatArray:
        """Return what would make each recording's share of forces (n,) fit it best, without what stood before."""
        pairs = [
            (self.measured[span] - part.course.standing, force[span])
            for part, span in zip(self.parts, self.spans, strict=True)
        ]
        return np.array([float(one @ other / (other @ other)) for one, other in pairs])

    def gain_sd(self, force: FloatArray) -> float:
        """Return how recordings of a test differ by a factor, one standard deviation, about forces (n,)."""
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

    def covariances_at(self, force: FloatArray, spread: float = 0.0) -> Covariances:
        """Return covariances (n, n), N2, about predicted forces (n,), by their source.

        Readings and a gain of all; a gain of each recording and, with a spread, a standard
        deviation of the logarithm of the specimens' stiffness, how they differ; and the model's own
        error.
        """
        readings = COMMON_GAIN_SD**2 * np.outer(force, force)
        model = np.zeros_like(readings)
        differences = np.zeros_like(readings)
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
            d = course.displacement
            # A hold's steps are shorter than any of the loading's.
            step = np.diff(d, prepend=0.0)
            way = np.maximum(np.abs(step), 0.5 * course.depth / STATIONS)
            slope = np.maximum(np.sign(step) * np.diff(own, prepend=0.0), 0.0) / way
            errors = course.instrument
            white = (errors.force_sd**2 + (slope * errors.displacement_sd) ** 2) / course.count
            readings[span, span] += np.diag((1 - SLOW_SHARE) * white)
            apart = np.abs(d[:, None] - d) / (course.depth / 3)
            slow = SLOW_SHARE * errors.force_sd**2 * np.exp(-apart)
            readings[span, span] += slow + part.onset.zero_sd**2
            later = part.onset.modes[:, 0]
            readings[span, span] += np.outer(later, later)
            differences[span, span] += gain**2 * np.outer(own, own)
            model[span, span] += numerical_covariance(d, own, length=course.depth / 3, power=1.0)
        return {"recordings": readings, "differences": differences, "model": model}


def comparison_of(
    recordings: Sequence[SpecimenRecording],
    model: JointForward[SpecimenForward],
    folder: SpecimenFolder,
    seeks: bool,
    known: Mapping[str, float] | None = None,
    slopes: Sequence[FloatArray | None] = (),
) -> SpecimenComparison:
    """Return recordings beside a model; known factors of specimens aren't looked for.

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
            tests.index(one.sizes),
            one.test + one.sizes.fibres_text,
        )
        for one, slope in zip(recordings, slopes or [None] * len(recordings), strict=True)
    )
    told = tells_ratio(folder, recordings)
    bent = len(folder.tissues) > 1 or any(one.sizes.fibres_text for one in recordings)
    shape_sd = SHAPE_SD_OF_LAYERS if bent else 0.0
    if seeks and not told:
        shape_sd = SHAPE_SD_OF_FIBRES
    depths = tuple(one.depth for one in model.models)
    misfit = SpecimenComparison(parts, depths, folder.relaxes, shape_sd=shape_sd)
    kinds = kinds_of(recordings)
    names = tuple(kinds)
    if folder.equally_stiff or (known is None and len(names) <= (len(misfit.recordings_of) if several else 1)):
        return misfit
    stations = [len(part.course.time) for part in parts]
    specimen = np.repeat([names.index(part.recording.specimen) for part in parts], stations)
    apart = seeks and told and not were_turned(recordings)
    test_of = {one.specimen: one.test for one in recordings}
    own = OwnStiffness(
        names,
        specimen,
        misfit.expected_force,
        misfit.weighted,
        known,
        tuple(kind for (kind,) in kinds.values()) if apart else tuple(test_of.values()) if several else (),
    )
    return replace(misfit, own=own)
