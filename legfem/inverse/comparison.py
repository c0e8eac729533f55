r"""Predictions of a model beside what was measured, and what their difference costs.

A problem has n readings, of one or several tests and of one or several channels each (`legfem.inverse.readings`).
Their errors are known by source; an error that several tests have alike is a mode with a name, and is theirs
together: it doesn't average out over them.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.inverse.emulator import LinearScale
from legfem.inverse.outcome import Outcome

Weighting = Literal["paper", "covariance", "equal"]
"""What is minimised: the plain sum of squares (Eq. 12 of the paper), the sum weighted by the errors, or one in which a
channel's readings weigh equally, as of a model that misses what was read by more than its errors: weighted by these,
a wrong model's best fit may lie far from all data (Peelle's puzzle)."""
ErrorSource = Literal[
    "recordings",
    "differences",
    "model",
    "misfit",
    "sizes",
    "ends",
    "fibres",
    "shape",
    "assumed",
    "channels",
    "contact",
    "rig",
    "priors",
]
"""Readings of the force; a factor by which recordings or specimens differ; the model's numerical error; what the law
misses; sizes of specimens; the correction for the cylinder's ends; muscle fibres' part in it; outlines, aim and
direction; what was assumed of other tissues; instruments of what else was recorded; first contact, where it is stated;
what the rig takes of the displacement; what was known beforehand."""
Covariances = Mapping[ErrorSource, FloatArray]
"""Covariances of the readings (n, n), in their units squared, by source; they add up."""


class Mode(NamedTuple):
    """An error of one standard deviation that tests share."""

    source: ErrorSource
    effect: FloatArray
    """Effect on the readings, (n,)."""


def total_of(covariances: Covariances) -> FloatArray:
    """Sum of the covariances of all sources, (n, n)."""
    return np.asarray(sum(covariances.values()))


@dataclass(frozen=True, eq=False)
class Prediction:
    """A full solve as it is read: corrected, and seen by the instrument."""

    values: FloatArray
    """Predicted readings (n,)."""
    sensitivities: Mapping[str, FloatArray]
    """Derivatives (n,) of the readings by parameters, by full name, per unit of the parameter."""
    model_values: FloatArray
    """What the model gives on its own grid (m,), correction included, before the instrument."""
    model_sensitivities: Mapping[str, FloatArray]
    """Derivatives (m,) of these."""

    def jacobian(self, names: Sequence[str]) -> FloatArray:
        """Derivatives of the readings by parameters, (n, p)."""
        return np.column_stack([self.sensitivities[name] for name in names])

    @classmethod
    def joined(cls, every: Sequence["Prediction"]) -> "Prediction":
        """Return predictions as one, by the first one's parameters, of which some may move only a part of them."""

        def stacked(by: Sequence[Mapping[str, FloatArray]], of: Sequence[FloatArray]) -> dict[str, FloatArray]:
            pairs = [(rates, np.zeros(len(values))) for rates, values in zip(by, of, strict=True)]
            return {name: np.concatenate([rates.get(name, nothing) for rates, nothing in pairs]) for name in by[0]}

        values, model_values = [one.values for one in every], [one.model_values for one in every]
        return cls(
            np.concatenate(values),
            stacked([one.sensitivities for one in every], values),
            np.concatenate(model_values),
            stacked([one.model_sensitivities for one in every], model_values),
        )

    def part(self, span: slice) -> "Prediction":
        """Prediction of some of the readings; nothing of the model's grid goes along."""
        values = self.values[span]
        by = {name: derivative[span] for name, derivative in self.sensitivities.items()}
        return Prediction(values, by, values, by)


class Comparison(ABC):
    """Predicted readings beside n measured ones: what a search needs to know of them."""

    @property
    @abstractmethod
    def measured(self) -> FloatArray:
        """Readings to be met, (n,)."""

    @property
    @abstractmethod
    def covariance(self) -> FloatArray:
        """Covariance of measured less predicted readings at the truth, (n, n), as the weights have it."""

    @property
    def expected(self) -> FloatArray:
        """Readings (n,) that predicted ones are to meet: the measured, but for what is expected of their errors."""
        return self.measured

    weighting: Weighting = "covariance"
    """What `objective` sums."""

    @property
    def weighing_covariance(self) -> FloatArray:
        """Covariance (n, n) by whose inverse readings are weighed: that of all errors, unless overridden."""
        return self.covariance

    def covariance_at(self, values: Values) -> FloatArray:
        """`covariance` with the errors that depend on the model's values, (n, n)."""
        return self.covariance

    @property
    @abstractmethod
    def reach(self) -> str:
        """How far a solve has to come, in words."""

    @property
    def channels(self) -> Mapping[str, NDArray[np.int_]]:
        """Places among the n readings of each channel's; empty where there is but the force."""
        return {}

    @property
    def informed_by(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of what is told apart in how much each tells of the parameters: channels, unless overridden."""
        return self.channels

    @property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the forces read in each part of the way, by its name; none where that isn't told."""
        return {}

    @property
    def linear_scale(self) -> LinearScale:
        """Sizes (m,) of model values that may have either sign; 0 for forces along the travel."""
        return 0.0

    def of_force(self, values: FloatArray) -> FloatArray:
        """Return those of values (..., n) that are of forces along the travel: all, where there is nothing else."""
        return values[..., self.channels["force"]] if self.channels else values

    def reached_by(self, outcome: Outcome) -> bool:
        """Whether a complete solve came as far as what was measured; it did, unless overridden."""
        return True

    def unseen_in(self, outcome: Outcome) -> tuple[str, ...]:
        """Names of recorded channels that a solve doesn't have."""
        return ()

    def told_by(self, outcome: Outcome) -> bool:
        """Whether a solve tells all that was measured."""
        return outcome.complete and self.reached_by(outcome) and not self.unseen_in(outcome)

    @abstractmethod
    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Read a complete full solve.

        Parameters
        ----------
        outcome
            That reached what was measured.
        instrument
            (k,): numbers of `legfem.inverse.readings.READINGS`.
        """

    @abstractmethod
    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) of what the model gives on its grid (..., m), by an instrument (..., k)."""

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured readings (n,) per relative change of the displacements; none where none is driven."""
        return np.zeros(len(self))

    def weighted(self, values: FloatArray) -> FloatArray:
        """Scale values (n, ...) so that `objective` is their sum of squares: by the errors, unless overridden."""
        return np.asarray(solve_triangular(self._lower, values, lower=True))

    @cached_property
    def _lower(self) -> FloatArray:
        return np.linalg.cholesky(self.weighing_covariance)

    def __len__(self) -> int:
        """Number n of readings."""
        return len(self.measured)

    @cached_property
    def weighting_matrix(self) -> FloatArray:
        """What `weighted` multiplies with, (n, n)."""
        return self.weighted(np.eye(len(self)))

    def cost(self, values: FloatArray) -> FloatArray:
        """Sum of squared differences (...) of the forces among predicted readings (..., n): Eq. 12, N2."""
        return np.asarray(np.sum(self.of_force(values - self.measured) ** 2, axis=-1))

    def contradicts(self, objective: float) -> bool:
        """Whether errors don't explain so great a sum of squares, and another weighting is to be taken."""
        return False

    def residual(self, values: FloatArray) -> FloatArray:
        """Weighted residual (..., n) of predicted readings (..., n)."""
        flat = (values - self.expected).reshape(-1, values.shape[-1])
        return self.weighted(flat.T).T.reshape(values.shape)

    def objective(self, values: FloatArray) -> FloatArray:
        """What is minimised (...) but for the priors, of predicted readings (..., n)."""
        return np.asarray(np.sum(self.residual(values) ** 2, axis=-1))
