r"""Recordings at their stations as a test of a problem: what a solved curve makes of them, and what both err by.

With the first contacts :math:`\delta_t` at which a fit has the trials, readings are linear in what the model gives on
its grid. About these contacts they are linear in the contacts, too, which have a prior of their own from the
recordings: to first order a contact that is left open is an error of the readings,

.. math:: F(d - \delta_t) \approx F(d - \hat\delta_t) - F'(d - \hat\delta_t)\, (\delta_t - \hat\delta_t),

and a problem is made anew about the contacts that it leads to until they stay (`StationTest.about`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.data.phases import LOADING
from legfem.inverse.catalogue import Values, deep_stiffness
from legfem.inverse.comparison import Covariances, ErrorSource, Mode, Prediction
from legfem.inverse.correction import TabulatedCorrection, corrected
from legfem.inverse.errors import ErrorModel, NuisanceEffect, error_model
from legfem.inverse.intervals import by_third
from legfem.inverse.observations import Observations, StationReading
from legfem.inverse.predictor import onset_prior
from legfem.inverse.readings import GAIN, INSTRUMENT, OFFSET, ZERO, Data, read_at_offsets
from legfem.inverse.trial_noise import Noise
from legfem.solve.path import ForceCurve

GRID_MM = 0.25
"""Step of the grid on which the model's force is taken."""
MARGIN_MM = 0.3
"""How much deeper than the recordings a model is pressed: contact may have begun earlier."""
_ENDS_OF_LENGTHS = 0.05
"""Share of a thickness's or the skin's change by which it may differ in 3D. Assumed: no table of it is there."""
_FIRST_SHARE = 0.05
"""Share of a channel's range that counts as its misfit before there is a fit."""


class FittedStations(NamedTuple):
    """Recordings at their stations beside a fit."""

    contacts: FloatArray
    """First contacts of the trials (K,), mm, after those counted from."""
    predicted: Mapping[str, FloatArray]
    """Readings (n,) of each channel at these contacts, by its name."""


@dataclass(frozen=True, eq=False)
class StationTest:
    """Recordings of one site at their stations.

    Parameters
    ----------
    name : str
        What people call the site.
    observed : Observations
        K trials at n stations, and what else was recorded.
    rows : (N,) array
        Places of the readings that count among all of ``observed``.
    correction : TabulatedCorrection, optional
        Of the force in plane strain for the cylinder's ends.
    beyond : float
        How much deeper than the recordings the model's grid goes (mm), for contact that began before their zero.
    onsets : (K,) array, optional
        First contacts about which the readings are linear (mm), after those counted from; as expected without it.
    errors : ErrorModel, optional
        Errors of all readings about a fit; equal ones in each channel without it.
    slopes : (N,) array, optional
        Derivatives of all readings by the displacement, from a fit; those of the recordings without it.
    sizes : (N,) array, optional
        Misfits of the channels that weigh their readings where weights are equal.
    """

    name: str
    observed: Observations
    rows: NDArray[np.int_]
    correction: TabulatedCorrection | None = None
    beyond: float = 0.0
    onsets: FloatArray | None = None
    errors: ErrorModel | None = None
    slopes: FloatArray | None = None
    sizes: FloatArray | None = None

    @cached_property
    def data(self) -> Data:
        """The forces (N) along the displacement after first contact (mm), then what was recorded with them."""
        every = self.observed.data
        kept = [self.rows[(self.rows >= span.start) & (self.rows < span.stop)] - span.start for span in every.spans]
        pairs = zip(every.channels, kept, strict=True)
        return Data(tuple(one.part(rows) for one, rows in pairs if len(rows) or one.name == "force"))

    @cached_property
    def contacts(self) -> FloatArray:
        """First contacts (K,) about which the readings are linear, mm."""
        return self.onset_priors[0] if self.onsets is None else self.onsets

    @cached_property
    def onset_priors(self) -> tuple[FloatArray, FloatArray]:
        """First contacts as the recordings by themselves have them, and standard deviations of these; (K,) each."""
        priors = [onset_prior(self.observed, trial) for trial in range(len(self.observed.trials))]
        return np.array([one.centre for one in priors]), np.array([one.sd for one in priors])

    @cached_property
    def grid(self) -> FloatArray:
        """Displacements (g,) at which the model's force is taken, mm."""
        deepest = float(self.observed.displacement[self._force_rows].max()) + self.beyond + MARGIN_MM
        return GRID_MM * np.arange(1, int(np.floor(deepest / GRID_MM + 1e-9)) + 1)

    @cached_property
    def _force_rows(self) -> NDArray[np.int_]:
        return self.rows[self.rows < len(self.observed.force)]

    @property
    def reach(self) -> str:
        """Deepest point of the grid."""
        return f"{self.grid[-1]:g} mm"

    @cached_property
    def by_displacement(self) -> FloatArray:
        """Derivative (all N readings,) by the displacement, per mm: of a fit, else of the recordings."""
        return self.observed.by_displacement if self.slopes is None else self.slopes

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured readings (n,) per relative change of the displacements."""
        observed = self.observed
        along = np.concatenate([observed.displacement, *(one.displacement for one in observed.channels)])
        return np.asarray(-along * self.by_displacement)[self.rows]

    @cached_property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the forces of the loading, by the third of the depth that they were read in."""
        d, phase = self.observed.displacement[self._force_rows], self.observed.phase[self._force_rows]
        return by_third(d, float(d.max()), phase != LOADING)

    @property
    def linear_scale(self) -> FloatArray:
        """Sizes (m,) of model values that may have either sign, 0 for forces along the travel."""
        return self.station.linear_scale

    def unseen_in(self, curve: ForceCurve) -> list[str]:
        """Names of the channels that a solve doesn't have."""
        return self.station.unseen_in(curve)

    def reached_by(self, curve: ForceCurve) -> bool:
        """Whether a solve came to the grid's end; one that stops short says nothing of the greatest forces."""
        return curve.depth >= self.grid[-1] - 1e-9

    @cached_property
    def station(self) -> StationReading:
        """What the readings take of a model's courses."""
        return StationReading(self.observed, self.contacts, self.grid)

    @cached_property
    def _reading(self) -> FloatArray:
        return self.station.plain[self.rows]

    @cached_property
    def _shift(self) -> FloatArray:
        """What contacts that are expected elsewhere than the readings are linear about change of these, (n,)."""
        return np.asarray((self._onset_effects @ (self.contacts - self.onset_priors[0]))[self.rows])

    @cached_property
    def _onset_effects(self) -> FloatArray:
        """Derivative of all readings by how much deeper each trial pressed, (N, K)."""
        trial = self.observed.trial[self.observed.nearest]
        return np.asarray(np.eye(len(self.contacts))[trial] * self.by_displacement[:, None])

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) that the instrument shows of the model's (..., m)."""
        return np.asarray(self._shown(model_values, instrument) + self._shift)

    def _shown(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return the same but for contacts that are expected elsewhere."""
        gain, zero, offset = np.moveaxis(instrument, -1, 0)[: len(INSTRUMENT)]
        seen = read_at_offsets(self._matrix, model_values, offset)
        return np.where(self._of_force, gain[..., None] * seen + zero[..., None], seen)

    @property
    def _of_force(self) -> NDArray[np.bool_]:
        """Which of the readings (n,) are forces along the travel."""
        return self.rows < len(self.observed.force)

    def _matrix(self, offset: float) -> FloatArray:
        """Return what the readings take of the model's values, all trials touching later by an offset (mm); (n, m)."""
        return self._reading if offset == 0.0 else self.station.matrix(offset=offset)[self.rows]

    def predict(self, curve: ForceCurve, values: Values, instrument: FloatArray) -> Prediction:
        """Corrected force of a solve, and further channels, as the instrument shows them."""
        model, by = self.on_grid(curve, values)
        numbers = instrument[: len(INSTRUMENT)]
        slope = self.station.matrix(1, float(numbers[2]))[self.rows] @ model
        linear, of_gain = numbers * (1.0, 0.0, 1.0), numbers * (0.0, 0.0, 1.0) + (1.0, 0.0, 0.0)
        seen = {name: self._shown(rates, linear) for name, rates in by.items()} | {
            GAIN: np.where(self._of_force, self._shown(model, of_gain), 0.0),
            ZERO: self._of_force.astype(float),
            OFFSET: -np.where(self._of_force, numbers[0], 1.0) * slope,
        }
        return Prediction(self.read(model, numbers), seen, model, by)

    def on_grid(self, curve: ForceCurve, values: Values) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return what the model gives on its grid (m,), corrected, and the derivatives."""
        return self.station.model_values(
            curve, lambda change, by: corrected(self.correction, self.grid, change, by, values)
        )

    @cached_property
    def equal_covariance(self) -> FloatArray:
        """Covariance (n, n) that weighs a channel's readings equally, first contacts left open."""
        sizes = self.observed.data.sizes_by_range(_FIRST_SHARE) if self.sizes is None else self.sizes
        return np.asarray(np.diag(sizes**2) + self._of_onsets)[np.ix_(self.rows, self.rows)]

    @cached_property
    def _of_onsets(self) -> FloatArray:
        effects = self._onset_effects * self.onset_priors[1]
        return np.asarray(effects @ effects.T)

    @cached_property
    def own_errors(self) -> Covariances:
        """Errors that no other test has, (n, n) by source; equal ones before there is a fit."""
        if self.errors is None:
            return {"recordings": self.equal_covariance}
        errors, forces = self.errors, len(self.observed.force)
        by_trial = np.hstack([errors.gain_sd * errors.gains, errors.zero_sd * errors.zeros])
        read = errors.dense - errors.of_model
        channels = read.copy()
        channels[:forces, :forces] = 0.0
        recordings = read - channels + by_trial @ by_trial.T + self._of_onsets
        found: dict[ErrorSource, FloatArray] = {"recordings": recordings, "model": errors.of_model}
        if self.observed.channels:
            found["channels"] = channels
        return {source: part[np.ix_(self.rows, self.rows)] for source, part in found.items()}

    def shared_errors(self, values: Values, predicted: FloatArray) -> Mapping[str, Mode]:
        """Errors of the correction, and known effects: of the instrument, and of what isn't known exactly."""
        if self.errors is None:
            return {}
        found = {
            name if one.shared else f"{self.name}: {name}": Mode(one.source, one.effect[self.rows])
            for name, one in self.errors.stated.items()
        }
        if self.correction is not None:
            found |= self._of_correction(values, predicted)
        return found

    def _of_correction(self, values: Values, predicted: FloatArray) -> dict[str, Mode]:
        assert self.correction is not None
        observed, of_deep = self.observed, deep_stiffness(values)
        relative, sources = self.correction.relative_errors(observed.displacement, *of_deep), self.correction.sources
        modes = {name: Mode(sources.get(name, "ends"), mode) for name, mode in relative.items()}
        # How an error runs along the depth is known roughly: it may lean by as much as it is.
        lean = 2.0 * observed.displacement / observed.displacement.max() - 1.0
        lean_on = {name: mode for name, mode in modes.items() if mode.source != "model"}
        modes |= {f"{name}, leaning": Mode(mode.source, mode.effect * lean) for name, mode in lean_on.items()}
        found = {
            name: Mode(source, observed.following_force(mode)[self.rows] * predicted)
            for name, (source, mode) in modes.items()
        }
        share = {one.name: 0.0 if one.kind.follows_force else _ENDS_OF_LENGTHS for one in observed.channels}
        unlike = (share[one.name] * one.displacement * one.slope(one.values) for one in observed.channels)
        shape = np.concatenate([np.zeros(len(lean)), *unlike])
        if shape.any():
            found[f"{self.name}: ends, shape under the cylinder"] = Mode("ends", shape[self.rows])
        return found

    def contacts_of(self, left: FloatArray) -> FloatArray:
        """Return where a fit has contacts (K,), mm.

        Parameters
        ----------
        left
            (n,): predicted less measured readings over the covariance of their errors, contacts left open in it.
        """
        centre, sd = self.onset_priors
        return np.asarray(centre + sd**2 * (self._onset_effects[self.rows].T @ left))

    def about(
        self,
        curve: ForceCurve,
        values: Values,
        contacts: FloatArray,
        noise: Noise | None = None,
        unknowns: Sequence[NuisanceEffect] = (),
    ) -> "StationTest":
        """Return the test with contacts, slopes, misfits and errors about a solve.

        Parameters
        ----------
        curve, values
            The solve.
        contacts
            (K,), mm: about which readings are linear from now on.
        noise
            Of the trials; errors stay as they are without it.
        unknowns
            What isn't known exactly.
        """
        moved = replace(self, onsets=contacts)
        model = moved.on_grid(curve, values)[0]
        predicted = moved.station.plain @ model
        errors, data = self.errors, self.observed.data
        counted, sd = np.isin(np.arange(len(data)), self.rows), np.concatenate([one.sd for one in data.channels])
        sizes = data.equal_sizes(predicted - data.values, counted, sd)
        if noise is not None:
            images = moved.station.images_elsewhere(curve)
            errors = error_model(self.observed, noise, predicted, unknowns, images=images)
        return replace(moved, slopes=moved.station.matrix(1) @ model, sizes=sizes, errors=errors)

    def derivatives(self, curve: ForceCurve, values: Values) -> dict[str, FloatArray]:
        """Return the derivatives (N,) of all readings of a solve by the model's parameters, by their names."""
        return {name: np.asarray(self.station.plain @ rates) for name, rates in self.on_grid(curve, values)[1].items()}

    def fitted(self, curve: ForceCurve, values: Values) -> FittedStations:
        """Return the recordings beside a solve at the model's values, about which they are weighed."""
        data, every = self.observed.data, self.every_reading(curve, values)
        pairs = zip(data.channels, data.spans, strict=True)
        return FittedStations(self.contacts, {one.name: every[span] for one, span in pairs})

    def every_reading(self, curve: ForceCurve, values: Values) -> FloatArray:
        """Return all readings (N,) of a solve, those too that don't count."""
        return np.asarray(self.station.plain @ self.on_grid(curve, values)[0])


def rows_of(observed: Observations, depth: float | None = None, loading_alone: bool = False) -> NDArray[np.int_]:
    """Return the places of the readings that count.

    Parameters
    ----------
    observed
        All that was recorded.
    depth
        Greatest displacement that counts, mm.
    loading_alone
        Whether neither holds, unloading nor further channels count, as in the paper's Eq. 12.
    """
    along = np.concatenate([observed.displacement, *(one.displacement for one in observed.channels)])
    kept = np.ones(len(along), dtype=bool) if depth is None else along <= depth + 1e-9
    if loading_alone:
        kept[: len(observed.force)] &= observed.phase == LOADING
        kept[len(observed.force) :] = False
    return np.flatnonzero(kept)
