"""A site of a leg as one test: the mean loading curve beside the corrected force of a model."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.linalg import block_diag

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.common.wording import Argument
from legfem.data import LoadingCurve, mean_loading_curve
from legfem.data.contact import LEG
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values, deep_stiffness
from legfem.inverse.comparison import Covariances, ErrorSource, Mode, Prediction, Test
from legfem.inverse.errors import numerical_covariance
from legfem.inverse.fibre_correction import FIBRES
from legfem.inverse.fit import TestFit
from legfem.inverse.loading_channels import BesideForce, LoadingChannel, image_errors
from legfem.inverse.parameter import Parameter
from legfem.inverse.readings import GAIN, INSTRUMENT, OFFSET, ZERO, Channel, Data, Reading
from legfem.legs.correction_of_leg import Correction, correction_factor
from legfem.legs.subject import TYPICAL_FORCE_SD, Subject
from legfem.solve.path import ForceCurve

OF_MODEL = "in 3D: "
"""Beginning of the names of modes that are errors of a leg's own model in 3D."""
TYPICAL_SHAPE = "typical shape"
"""Mode of the error that a typical calf's outlines make."""
_STEP = 1e-4
_ENDS_BESIDE = 0.05
"""Of a thickness's or the skin's change: by how much it may differ in 3D. Assumed: no table of it is there."""


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
    finds_contact : bool
        Whether the model's own rise says where contact was, as it does where readings are weighed by their errors.
    beside : tuple of LoadingChannel
        What else was recorded, and is predicted.
    """

    subject: Subject
    curve: LoadingCurve
    correction: Correction | None = None
    beyond: float = 0.0
    by_instrument: bool = False
    finds_contact: bool = True
    beside: tuple[LoadingChannel, ...] = ()

    @property
    def name(self) -> str:
        """Name of the site; ``leg`` where a leg has one."""
        return self.subject.site or "leg"

    @cached_property
    def data(self) -> Data:
        """The force (N) along the displacement after first contact (mm), then what was recorded beside it."""
        curve = self.curve
        force = Channel("force", "N", curve.displacement, "displacement_mm", curve.force, curve.force_sd)
        return Data((force, *(one.channel for one in self.beside)))

    @cached_property
    def grid(self) -> FloatArray:
        """Displacements (m,) at which the model's force is taken, mm."""
        own = self.curve.displacement
        step = own[1] - own[0]
        further = own[-1] + step * np.arange(1, int(np.ceil(self.beyond / step - 1e-9)) + 1)
        return np.concatenate([own, further])

    @property
    def model_size(self) -> int:
        """Number m of values on the model's grid: forces, and of each channel its value at rest and changes."""
        return len(self.grid) + self._beside.size

    @cached_property
    def linear_scale(self) -> FloatArray | None:
        """Sizes (m,) of what isn't a force along the travel, which is 0; None where all is."""
        if not self.beside:
            return None
        return np.concatenate([np.zeros(len(self.grid)), self._beside.scale])

    @property
    def reach(self) -> str:
        """Deepest point of the grid."""
        return f"{self.grid[-1]:g} mm"

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured forces (n,) per relative change of the displacements, N."""
        of_force = -self.curve.displacement * np.gradient(self.curve.force, self.curve.displacement)
        return np.concatenate([of_force, *(-one.depth * one.slope for one in self.beside)])

    def reached_by(self, curve: ForceCurve) -> bool:
        """Whether a solve came to the grid's end; one that stops short says nothing of the greatest forces."""
        return self._beside.told_by(curve) and curve.depth >= self.grid[-1] - 1e-9

    def seen_in(self, curve: ForceCurve) -> "SiteTest | None":
        """Same test with what images do that lie elsewhere, as a solve shows it; None where that is known already."""
        beside = tuple(one.seen_in(curve) for one in self.beside)
        known = all(one.as_seen(other) for one, other in zip(self.beside, beside, strict=True))
        return None if known else replace(self, beside=beside)

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) that the instrument shows of the model's (..., m)."""
        if not self.beside:
            return self._reading(model_values, instrument) if self.by_instrument else model_values
        force, others = np.split(model_values, [len(self.grid)], axis=-1)
        offset = instrument[..., 2] if self.by_instrument else np.zeros(())
        seen = self._reading(force, instrument) if self.by_instrument else force[..., : len(self.curve.force)]
        return np.concatenate([seen, self._beside.read(others, offset)], axis=-1)

    def predict(self, curve: ForceCurve, values: Values, instrument: FloatArray) -> Prediction:
        """Corrected force of a solve, and further channels, as the instrument shows them."""
        seen_by = instrument[: len(INSTRUMENT)]
        force, by = self._corrected(
            curve(self.grid), _on_grid(curve.sensitivity, curve.sensitivities, self.grid), values
        )
        if not self.by_instrument:
            return self._with_beside(Prediction(force, by, force, by), curve, values, np.zeros(()))
        # Linear in the force but for the zero.
        slope = seen_by * (1.0, 0.0, 1.0)
        seen = {name: self._reading(derivative, slope) for name, derivative in by.items()}
        seen |= self._reading.derivatives(force, seen_by)
        read = Prediction(self._reading(force, seen_by), seen, force, by)
        return self._with_beside(read, curve, values, np.asarray(seen_by[2]))

    def _with_beside(self, read: Prediction, curve: ForceCurve, values: Values, offset: FloatArray) -> Prediction:
        """Return a prediction of forces with those of further channels after them, at a contact's offset (mm)."""
        if not self.beside:
            return read
        corrected = partial(self._corrected, values=values)
        return read.followed_by(self._beside.predict(curve, offset, corrected))

    @cached_property
    def _beside(self) -> BesideForce:
        return BesideForce(self.grid, self.beside)

    @cached_property
    def _reading(self) -> Reading:
        return Reading(self.grid, self.curve.displacement)

    def _corrected(
        self, force: FloatArray, by: dict[str, FloatArray], values: Values
    ) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return forces on the grid (g,), and their derivatives, times the correction's factor."""
        if self.correction is None:
            return force, by
        c10, c20 = deep_stiffness(values)
        factor = self._factor(c10, c20)
        by = {name: factor * derivative for name, derivative in by.items()}
        up, beside = c10 * (1 + _STEP), c20 + _STEP * c10
        for name, ends in ((DEEP_C10, (up, c20)), (DEEP_C20, (c10, beside))):
            if name in by:
                step = (ends[0] - c10) + (ends[1] - c20)
                by[name] = by[name] + force * (self._factor(*ends) - factor) / step
        return factor * force, by

    def _factor(self, c10: float, c20: float) -> FloatArray:
        return correction_factor(self.correction, self.grid, np.asarray(c10), np.asarray(c20))

    @cached_property
    def own_errors(self) -> Covariances:
        """Errors of the recordings, the numerical model and further channels' instruments, (n, n)."""
        numerical = numerical_covariance(self.curve.displacement, self.curve.smooth, power=1.0)
        few = self.curve.few_repeats
        recordings = self.curve.covariance - few + self.finds_contact * self.curve.open_contact
        if not self.beside:
            return {"recordings": recordings, "few_repeats": few, "model": numerical}
        blank = [np.zeros((len(one), len(one))) for one in self.beside]
        own = block_diag(numerical, *(one.numerical + one.outlines for one in self.beside))
        instruments = block_diag(*(one.instrument for one in self.beside))
        return {
            "recordings": np.asarray(block_diag(recordings, *blank)),
            "few_repeats": np.asarray(block_diag(few, *blank)),
            "model": np.asarray(own),
            "channels": np.asarray(block_diag(np.zeros_like(numerical), instruments + image_errors(self.beside))),
        }

    def shared_errors(self, values: Values, predicted: FloatArray) -> Mapping[str, Mode]:
        """Errors of the correction and of a typical shape, alike at all sites of a leg; about readings (n,)."""
        found: dict[str, Mode] = {}
        if self.subject.typical_shape:
            forces = np.zeros(len(predicted))
            forces[self.data.spans[0]] = predicted[self.data.spans[0]]
            found[TYPICAL_SHAPE] = Mode("shape", TYPICAL_FORCE_SD * forces)
        if self.correction is None:
            return found
        of_deep = deep_stiffness(values)
        effects: dict[str, list[FloatArray]] = {
            name: [error * force]
            for force in (predicted[self.data.spans[0]],)
            for name, error in self.correction.relative_errors(self.curve.displacement, *of_deep).items()
        }
        unlike: list[FloatArray] = [np.zeros(len(self.curve.force))]
        for one, span in zip(self.beside, self.data.spans[1:], strict=True):
            along = self.correction.relative_errors(one.depth, *of_deep)
            follows = one.readings.kind.follows_force
            for name, parts in effects.items():
                parts.append(along[name] * predicted[span] if follows else np.zeros(len(one)))
            unlike.append(np.zeros(len(one)) if follows else _ENDS_BESIDE * one.slope * one.depth)
        found |= {name: Mode(source_of_mode(name), np.concatenate(parts)) for name, parts in effects.items()}
        if self.beside:
            found["ends: shape under the cylinder"] = Mode("ends", np.concatenate(unlike))
        return found


def _on_grid(
    of: Callable[[str, FloatArray], FloatArray], names: Iterable[str], grid: FloatArray
) -> dict[str, FloatArray]:
    return {name: of(name, grid) for name in names}


def source_of_mode(name: str) -> ErrorSource:
    """Source that an error of the correction counts to, by its name."""
    if name.startswith(OF_MODEL):
        return "model"
    return "fibres" if name.startswith(FIBRES) else "ends"


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
            Argument("depth"),
            f"{depth:g} mm",
            "is too shallow to identify a stiffness from",
            f"give at least {LEG.depth:g} mm",
        )
    n = int((curve.displacement <= depth + 1e-9).sum())
    return replace(
        curve,
        displacement=curve.displacement[:n],
        force=curve.force[:n],
        force_sd=curve.force_sd[:n],
        covariance=curve.covariance[:n, :n],
        few_repeats=curve.few_repeats[:n, :n],
        smooth=curve.smooth[:n],
        slope=curve.slope[:n],
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
    effects = {GAIN: curve.smooth, ZERO: np.ones(len(curve.force)), OFFSET: curve.slope}
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


def curve_of(one: TestFit) -> LoadingCurve:
    """Mean loading curve of a site."""
    assert isinstance(one.test, SiteTest)
    return one.test.curve
