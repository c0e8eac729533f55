"""A site of a leg as one test: the mean loading curve beside the corrected force of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.data import LoadingCurve, mean_loading_curve
from legfem.data.contact import LEG
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values
from legfem.inverse.comparison import Covariances, ErrorSource, Mode, Prediction, Test
from legfem.inverse.data import Channel, Data
from legfem.inverse.errors import numerical_covariance
from legfem.inverse.instrument import GAIN, INSTRUMENT, OFFSET, ZERO, Reading
from legfem.inverse.parameter import Parameter
from legfem.legs.correction_of_leg import FIBRES, Correction, correction_factor
from legfem.legs.subject import TYPICAL_FORCE_SD, Subject
from legfem.solve.path import ForceCurve

OF_MODEL = "in 3D: "
"""Beginning of the names of modes that are errors of a leg's own model in 3D."""
TYPICAL_SHAPE = "typical shape"
"""Mode of the error that a typical calf's outlines make."""
_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class SiteTest(Test):
    """Recordings of one site.

    Parameters
    ----------
    subject : Subject
        The leg as it was pressed there.
    curve : LoadingCurve
        Mean of the trials' loading, with its covariance: n forces.
    correction : Correction, optional
        Of the force in plane strain for the cylinder's ends.
    beyond : float
        How far the model's grid goes on after the measured one (mm), for contact that began before the recording's
        zero.
    by_instrument : bool
        Whether the instrument has a gain, zero or contact offset that is free or held.
    """

    subject: Subject
    curve: LoadingCurve
    correction: Correction | None = None
    beyond: float = 0.0
    by_instrument: bool = False

    @property
    def name(self) -> str:
        """Name of the site; ``leg`` where a leg has one."""
        return self.subject.site or "leg"

    @cached_property
    def data(self) -> Data:
        """One channel, the force (N) along the displacement after first contact (mm)."""
        curve = self.curve
        return Data((Channel("force", "N", curve.displacement, "displacement_mm", curve.force, curve.force_sd),))

    @cached_property
    def grid(self) -> FloatArray:
        """Displacements (m,) at which the model's force is taken, mm."""
        own = self.curve.displacement
        step = own[1] - own[0]
        further = own[-1] + step * np.arange(1, int(np.ceil(self.beyond / step - 1e-9)) + 1)
        return np.concatenate([own, further])

    @property
    def model_size(self) -> int:
        """Number m of forces on the model's grid."""
        return len(self.grid)

    @property
    def reach(self) -> str:
        """Deepest point of the grid."""
        return f"{self.grid[-1]:g} mm"

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured forces (n,) per relative change of the displacements, N."""
        return -self.curve.displacement * np.gradient(self.curve.force, self.curve.displacement)

    def reached_by(self, curve: ForceCurve) -> bool:
        """Whether a solve came to the grid's end; one that stops short says nothing of the greatest forces."""
        return curve.depth >= self.grid[-1] - 1e-9

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Forces (..., n) that the instrument shows of the model's (..., m)."""
        return self._reading(model_values, instrument) if self.by_instrument else model_values

    def predict(self, curve: ForceCurve, values: Values, instrument: FloatArray) -> Prediction:
        """Corrected force of a solve, as the instrument shows it."""
        seen_by = instrument[: len(INSTRUMENT)]
        force, by = self._corrected(curve, values)
        if not self.by_instrument:
            return Prediction(force, by, force, by)
        # Linear in the force but for the zero.
        slope = seen_by * (1.0, 0.0, 1.0)
        seen = {name: self._reading(derivative, slope) for name, derivative in by.items()}
        seen |= self._reading.derivatives(force, seen_by)
        return Prediction(self._reading(force, seen_by), seen, force, by)

    @cached_property
    def _reading(self) -> Reading:
        return Reading(self.grid, self.curve.displacement)

    def _corrected(self, curve: ForceCurve, values: Values) -> tuple[FloatArray, dict[str, FloatArray]]:
        grid = self.grid
        force = curve(grid)
        by = {name: curve.sensitivity(name, grid) for name in curve.sensitivities}
        if self.correction is None:
            return force, by
        c10, c20 = deep_stiffness(values)
        factor = self._factor(c10, c20)
        by = {name: factor * derivative for name, derivative in by.items()}
        up, beside = c10 * (1 + _STEP), c20 + _STEP * c10
        for name, ends in ((DEEP_C10, (up, c20)), (DEEP_C20, (c10, beside))):
            if name in by:
                step = kpa_to_mpa((ends[0] - c10) + (ends[1] - c20))
                by[name] = by[name] + force * (self._factor(*ends) - factor) / step
        return factor * force, by

    def _factor(self, c10: float, c20: float) -> FloatArray:
        return correction_factor(self.correction, self.grid, np.asarray(c10), np.asarray(c20))

    @cached_property
    def own_errors(self) -> Covariances:
        """Errors of the recordings and of the numerical model, (n, n), N2."""
        numerical = numerical_covariance(self.curve.displacement, self.curve.force, power=1.0)
        return {"recordings": self.curve.covariance, "model": numerical}

    def shared_errors(self, values: Values, predicted: FloatArray) -> Mapping[str, Mode]:
        """Errors of the correction and of a typical shape, alike at all sites of a leg; about forces (n,), N."""
        found: dict[str, Mode] = {}
        if self.subject.typical_shape:
            found[TYPICAL_SHAPE] = Mode("shape", TYPICAL_FORCE_SD * predicted)
        if self.correction is not None:
            relative = self.correction.relative_errors(self.curve.displacement, *deep_stiffness(values))
            found |= {name: Mode(source_of_mode(name), error * predicted) for name, error in relative.items()}
        return found


def source_of_mode(name: str) -> ErrorSource:
    """Source that an error of the correction counts to, by its name."""
    if name.startswith(OF_MODEL):
        return "model"
    return "fibres" if name.startswith(FIBRES) else "ends"


def deep_stiffness(values: Values) -> tuple[float, float]:
    """C10 and C20 of the deep tissue in kPa, by which corrections are tabulated."""
    return mpa_to_kpa(values[DEEP_C10]), mpa_to_kpa(values.get(DEEP_C20, 0.0))


def measured_curve(subject: Subject, depth: float | None = None) -> LoadingCurve:
    """Mean loading curve of a subject's trials, down to a depth (mm) at most.

    Raises
    ------
    InputError
        If the depth leaves too little to identify from.
    """
    curve = mean_loading_curve(subject.trials)
    if depth is None:
        return curve
    if not depth >= LEG.depth:
        raise InputError(
            "--depth", f"{depth:g} mm", "is too little to identify from", f"give at least {LEG.depth:g} mm"
        )
    n = int((curve.displacement <= depth + 1e-9).sum())
    return replace(
        curve,
        displacement=curve.displacement[:n],
        force=curve.force[:n],
        force_sd=curve.force_sd[:n],
        covariance=curve.covariance[:n, :n],
        trial_force=curve.trial_force[:, :n],
        n_samples=curve.n_samples[:n],
    )


def with_instrument_errors(curve: LoadingCurve, sds: Mapping[str, float]) -> LoadingCurve:
    """Widen a curve's errors by a gain, a zero and a first contact of the site's own.

    To first order that is what letting them vary under a prior comes to.

    Parameters
    ----------
    curve : LoadingCurve
        n forces.
    sds : Mapping[str, float]
        Standard deviations by full name: ``instrument.gain`` (-), ``instrument.zero`` (N),
        ``instrument.contact_offset`` (mm).
    """
    if not sds:
        return curve
    slope = np.gradient(curve.force, curve.displacement)
    effects = {GAIN: curve.force, ZERO: np.ones(len(curve.force)), OFFSET: slope}
    covariance = np.array(curve.covariance)
    for name, sd in sds.items():
        covariance += sd**2 * np.outer(effects[name], effects[name])
    return replace(curve, covariance=covariance, force_sd=np.sqrt(np.diag(covariance)))


def beyond_of(parameters: Sequence[Parameter], fixed: Values) -> float:
    """How far (mm) a model is to be pressed beyond the measured curve.

    Contact that began before the recording's zero takes the indenter deeper than it says.
    """
    least = fixed.get(OFFSET, 0.0)
    for one in parameters:
        if one.name == OFFSET:
            least = min(least, one.bounds[0])
    return max(0.0, -least)
