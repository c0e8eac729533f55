"""What an identification of specimens found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.identify.result import IdentifiedParameters
from legfem.inverse.fit import Fit
from legfem.specimens.course import Course
from legfem.specimens.details import SpecimenDetails, recording_of
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.recorded import LeftOut


@dataclass(frozen=True, eq=False)
class ComparedRecording:
    """A recording beside the model."""

    name: str
    specimen: str
    fitted: bool
    """Else it was left out, and is predicted."""
    course: Course
    predicted: FloatArray
    """Force at the course's stations (n,), N."""

    @property
    def _differences(self) -> FloatArray:
        samples = self.course.samples
        inside = samples.time <= self.course.time[-1]
        return np.asarray(self._at(samples.time[inside]) - samples.force[inside])

    def _at(self, time: FloatArray) -> FloatArray:
        known = np.concatenate([[0.0], self.course.time])
        return np.interp(time, known, np.concatenate([[0.0], self.predicted]))

    @property
    def rmse(self) -> float:
        """Root mean square of the samples' differences, N."""
        return float(np.sqrt(np.mean(self._differences**2)))

    @property
    def r_squared(self) -> float:
        """Share of the samples' variance that is predicted."""
        left = self._differences
        force = self.course.samples.force[: len(left)]
        return 1 - float(np.sum(left**2) / np.sum((force - force.mean()) ** 2))

    @property
    def shape_r_squared(self) -> float:
        """The same if the prediction had the stiffness that fits best."""
        return replace(self, predicted=self.scale * self.predicted).r_squared

    @property
    def scale(self) -> float:
        """Factor on the prediction that would fit best."""
        force = self.course.force
        return float(force @ self.predicted / (self.predicted @ self.predicted))


@dataclass(frozen=True, eq=False, kw_only=True)
class SpecimenResult(IdentifiedParameters):
    """One law identified from specimens."""

    folder: SpecimenFolder
    recordings: tuple[ComparedRecording, ...]
    """Those that were fitted, then those left out by the user."""
    left_out: tuple[LeftOut, ...]
    """Those that couldn't be used."""
    chi_square: float
    degrees_of_freedom: int
    p_value: float
    gain_sd: float
    """By which factor recordings differ, one standard deviation."""
    failed_solves: int
    stiffness: Mapping[str, float] = field(default_factory=dict)
    """Every fitted specimen's, over the typical one that the parameters are of; nothing where all
    are alike."""
    stiffness_spread: float = 0.0
    """Standard deviation of its logarithm, among specimens of a kind."""
    untold: str = ""
    """Why the fibres' ratio can't be told, as a sentence, where it was looked for in vain."""

    @property
    def fitted(self) -> tuple[ComparedRecording, ...]:
        """Recordings that the law was fitted to."""
        return tuple(one for one in self.recordings if one.fitted)

    @property
    def held_out(self) -> tuple[ComparedRecording, ...]:
        """Recordings that it predicts."""
        return tuple(one for one in self.recordings if not one.fitted)

    @property
    def rms_percent(self) -> float:
        """Root mean square of the fit's differences over each recording's greatest force."""
        shares = [(one.rmse / one.course.peak) ** 2 for one in self.fitted]
        return 100 * float(np.sqrt(np.mean(shares)))


def specimen_result(fit: Fit[SpecimenDetails]) -> SpecimenResult:
    """Result of a fit of specimens as pages and documents read it."""
    log, details = fit.log, fit.details
    return SpecimenResult(
        law=fit.law,
        parameters=fit.estimates,
        correlations=fit.correlations,
        values=fit.values,
        assumed=fit.assumed,
        forward_solves=log.forward_solves,
        reused_solves=log.reused_solves,
        wall_s=log.wall_s,
        seed=log.seed,
        emulator_error=log.emulator_error,
        converged=log.converged,
        warnings=fit.warnings,
        versions=fit.versions,
        folder=details.folder,
        recordings=tuple(
            ComparedRecording(
                one.name, recording_of(one).specimen, one.fitted, recording_of(one).course, one.force.predicted
            )
            for one in fit.tests
        ),
        left_out=details.left_out,
        chi_square=fit.goodness.chi_square,
        degrees_of_freedom=fit.goodness.degrees_of_freedom,
        p_value=fit.goodness.p_value,
        gain_sd=details.gain_sd,
        failed_solves=log.failed_solves,
        stiffness=details.stiffness,
        stiffness_spread=details.stiffness_spread,
        untold=details.ratio_undetermined,
    )
