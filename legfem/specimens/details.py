"""What a fit of specimens has beside that of any test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit, TestFit, r_squared
from legfem.specimens.course import Course
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.kind import ShownAxes
from legfem.specimens.lateral_stretch import LateralFit
from legfem.specimens.misfit import LawMisfit
from legfem.specimens.recorded import LeftOut, SpecimenRecording
from legfem.specimens.size_dependence import SizeDependence


@dataclass(frozen=True, eq=False)
class SpecimenDetails:
    """Folder, and how its specimens differ."""

    folder: SpecimenFolder
    left_out: tuple[LeftOut, ...]
    """Recordings that couldn't be used."""
    gain_sd: float
    """Factor by which recordings differ, one standard deviation."""
    stiffness: Mapping[str, float]
    """Stiffness of every fitted specimen over the typical one that the estimates are of; empty where all are alike."""
    stiffness_spread: float
    """Standard deviation of its logarithm, among specimens of a kind."""
    misfit: LawMisfit
    ratio_undetermined: str
    """Why the fibres' ratio can't be determined, as a sentence, where it was looked for in vain."""
    thickness: SizeDependence | None = None
    """How specimens' stiffness goes with their thickness, where it does."""
    lateral: LateralFit | None = None
    """Lateral stretches beside the fit, where a video showed them."""
    alternatives: tuple[Weighed, ...] = ()
    """Of what isn't known of the test, the most probable first; the fit is that of the first."""


@dataclass(frozen=True)
class Weighed:
    """One of the alternatives of a test, as the recordings weigh it."""

    name: str
    words: str
    probability: float
    estimates: Mapping[str, Estimate]
    """Its own."""


def recording_of(one: TestFit) -> SpecimenRecording:
    """Recording that a test's fit is of."""
    assert isinstance(one.test, SpecimenRecording)
    return one.test


@dataclass(frozen=True, eq=False)
class SampleFit:
    """A recording's own samples beside a prediction at its stations."""

    name: str
    specimen: str
    fitted: bool
    """Else it was left out, and is predicted."""
    course: Course
    predicted: FloatArray
    """Force at the course's stations, (n,), N."""
    axes: ShownAxes

    @classmethod
    def of(cls, one: TestFit) -> SampleFit:
        """Samples of a test beside its fit."""
        recording = recording_of(one)
        return cls(one.name, recording.specimen, one.fitted, recording.course, one.force.predicted, recording.axes)

    @property
    def _differences(self) -> FloatArray:
        samples = self.course.samples
        inside = samples.time <= self.course.time[-1]
        known = np.concatenate([[0.0], self.course.time])
        at = np.interp(samples.time[inside], known, np.concatenate([[0.0], self.predicted]))
        return np.asarray(at - samples.force[inside])

    @property
    def rmse(self) -> float:
        """Root mean square of the samples' differences, N."""
        return float(np.sqrt(np.mean(self._differences**2)))

    @property
    def r_squared(self) -> float:
        """Share of the samples' variance that is predicted."""
        left = self._differences
        return r_squared(float(np.sum(left**2)), self.course.samples.force[: len(left)])

    @property
    def scale(self) -> float:
        """Factor on the prediction that would fit best."""
        force = self.course.force
        return float(force @ self.predicted / (self.predicted @ self.predicted))

    @property
    def shape_r_squared(self) -> float:
        """Share of the variance that is predicted with the stiffness that fits best."""
        return replace(self, predicted=self.scale * self.predicted).r_squared


def compared(fit: Fit[SpecimenDetails]) -> list[SampleFit]:
    """Samples of all recordings beside the fit: those that were fitted, then those left out."""
    return [SampleFit.of(one) for one in fit.tests]


def rms_percent(fit: Fit[SpecimenDetails]) -> float:
    """Root mean square of the fit's differences over each recording's greatest force, %."""
    shares = [(SampleFit.of(one).rmse / recording_of(one).course.peak) ** 2 for one in fit.tests if one.fitted]
    return 100 * float(np.sqrt(np.mean(shares)))
