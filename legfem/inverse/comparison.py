r"""Predictions of a model beside what was measured, and what their difference costs.

A problem has n readings, of one or several tests and of one or several channels each (`legfem.inverse.readings`).
Their errors are known by source; an error that several tests have alike is a mode with a name, and is theirs
together: it doesn't average out over them.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_triangular

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.inverse.intervals import thirds_of
from legfem.inverse.outcome import Outcome
from legfem.inverse.readings import Data
from legfem.solve.path import ForceCurve

Weighting = Literal["paper", "covariance", "equal"]
"""What is minimised: the plain sum of squares (Eq. 12 of the paper), the sum weighted by the errors, or one in which a
channel's readings weigh equally, as of a model that misses what was read by more than its errors: weighted by these,
a wrong model's best fit may lie far from all data (Peelle's puzzle)."""
ErrorSource = Literal[
    "recordings", "differences", "model", "misfit", "sizes", "ends", "fibres", "shape", "assumed", "channels", "priors"
]
"""Readings of the force; a factor by which recordings or specimens differ; the model's numerical error; what the law
misses; sizes of specimens; the correction for the cylinder's ends; muscle fibres' part in it; outlines, aim and
direction; what was assumed of other tissues; instruments of what else was recorded; what was known beforehand."""
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

    def followed_by(self, other: "Prediction") -> "Prediction":
        """Return the prediction with readings that only some of its parameters move after its own."""

        def joined(own: Mapping[str, FloatArray], then: Mapping[str, FloatArray], size: int) -> dict[str, FloatArray]:
            nothing = np.zeros(size)
            return {name: np.concatenate([values, then.get(name, nothing)]) for name, values in own.items()}

        return Prediction(
            np.concatenate([self.values, other.values]),
            joined(self.sensitivities, other.sensitivities, len(other.values)),
            np.concatenate([self.model_values, other.model_values]),
            joined(self.model_sensitivities, other.model_sensitivities, len(other.model_values)),
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
    def linear_scale(self) -> FloatArray | None:
        """Sizes (m,) of model values that may have either sign, 0 for forces along the travel; None of these alone."""
        return None

    def of_force(self, values: FloatArray) -> FloatArray:
        """Return those of values (..., n) that are of forces along the travel: all, where there is nothing else."""
        return values[..., self.channels["force"]] if self.channels else values

    @abstractmethod
    def reached_by(self, outcome: Outcome) -> bool:
        """Whether a solve came as far as what was measured."""

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
    @abstractmethod
    def if_deeper(self) -> FloatArray:
        """Change of the measured readings (n,) per relative change of the displacements."""

    def weighted(self, values: FloatArray) -> FloatArray:
        """Scale values (n, ...) so that `objective` is their sum of squares: by the errors, unless overridden."""
        return np.asarray(solve_triangular(self._lower, values, lower=True))

    @cached_property
    def _lower(self) -> FloatArray:
        return np.linalg.cholesky(self.covariance)

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

    def residual(self, values: FloatArray) -> FloatArray:
        """Weighted residual (..., n) of predicted readings (..., n)."""
        flat = (values - self.measured).reshape(-1, values.shape[-1])
        return self.weighted(flat.T).T.reshape(values.shape)

    def objective(self, values: FloatArray) -> FloatArray:
        """What is minimised (...) but for the priors, of predicted readings (..., n)."""
        return np.asarray(np.sum(self.residual(values) ** 2, axis=-1))


class Test(ABC):
    """One thing that was measured: a site of a leg, or a recording of a specimen."""

    __test__ = False  # pytest's

    @property
    @abstractmethod
    def name(self) -> str:
        """What people call it."""

    @property
    @abstractmethod
    def data(self) -> Data:
        """Channels of n readings."""

    @property
    @abstractmethod
    def reach(self) -> str:
        """How far a solve has to come, in words."""

    @property
    @abstractmethod
    def if_deeper(self) -> FloatArray:
        """Change of the readings (n,) per relative change of the displacements."""

    @property
    @abstractmethod
    def model_size(self) -> int:
        """Number m of values that the model gives on its grid."""

    @property
    def linear_scale(self) -> FloatArray | None:
        """As that of a `Comparison`, of this test's m."""
        return None

    @abstractmethod
    def reached_by(self, curve: ForceCurve) -> bool:
        """Whether a solve of this test came as far as what was measured."""

    @abstractmethod
    def predict(self, curve: ForceCurve, values: Values, instrument: FloatArray) -> Prediction:
        """Read a solve that was made at the model's values, by an instrument (k,)."""

    @abstractmethod
    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) of what the model gives on its grid (..., m)."""

    @property
    @abstractmethod
    def own_errors(self) -> Covariances:
        """Errors that no other test has, (n, n) by source."""

    @property
    def equal_covariance(self) -> FloatArray:
        """Covariance (n, n) that weighs the readings of a channel equally."""
        return np.eye(len(self.data))

    @property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the forces read in each third of the depth, where they are read over displacement."""
        return thirds_of(self.data.channels[0])

    def shared_errors(self, values: Values, predicted: FloatArray) -> Mapping[str, Mode]:
        """Errors that tests of a problem have alike, by name, about predicted readings (n,) at values."""
        return {}


@dataclass(frozen=True, eq=False)
class JointComparison(Comparison):
    """One or several tests that the same unknowns predict.

    Parameters
    ----------
    tests : tuple of Test
        With n readings together; every one is solved, in this order, in one outcome.
    weighting : {"covariance", "paper", "equal"}
        What `objective` sums.
    near : tuple, optional
        Values and predicted readings (n,) of a solve near the optimum, about which shared errors count in the weights
        too, as they must where what was known beforehand is weighed against the recordings. Shares of recorded
        forces would draw the model to one side (Peelle's puzzle).
    """

    tests: tuple[Test, ...]
    weighting: Weighting = "covariance"
    near: tuple[Values, FloatArray] | None = None

    @cached_property
    def spans(self) -> list[slice]:
        """Place of every test's readings among the n."""
        return _spans(len(test.data) for test in self.tests)

    @cached_property
    def _model_spans(self) -> list[slice]:
        return _spans(test.model_size for test in self.tests)

    @cached_property
    def measured(self) -> FloatArray:
        """Readings of all tests, (n,)."""
        return np.concatenate([test.data.values for test in self.tests])

    @cached_property
    def channels(self) -> Mapping[str, NDArray[np.int_]]:
        """Places among the n readings of each channel's; empty where there is but the force."""
        found: dict[str, list[NDArray[np.int_]]] = {}
        for test, whole in zip(self.tests, self.spans, strict=True):
            for one, span in zip(test.data.channels, test.data.spans, strict=True):
                found.setdefault(one.name, []).append(whole.start + np.arange(span.start, span.stop))
        return {} if len(found) < 2 else {name: np.concatenate(places) for name, places in found.items()}

    @cached_property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the forces in each third of every test's depth, where they are read over displacement."""
        found: dict[str, list[NDArray[np.int_]]] = {}
        for test, span in zip(self.tests, self.spans, strict=True):
            for name, places in test.parts_along.items():
                found.setdefault(name, []).append(span.start + places)
        return {name: np.concatenate(places) for name, places in found.items()}

    @cached_property
    def linear_scale(self) -> FloatArray | None:
        """Sizes (m,) of model values that may have either sign, 0 for forces along the travel; None of these alone."""
        every = [test.linear_scale for test in self.tests]
        if all(one is None for one in every):
            return None
        pairs = zip(every, self.tests, strict=True)
        return np.concatenate([np.zeros(test.model_size) if one is None else one for one, test in pairs])

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the readings (n,) per relative change of the displacements."""
        return np.concatenate([test.if_deeper for test in self.tests])

    @property
    def reach(self) -> str:
        """Depths of the tests."""
        return ", ".join(test.reach for test in self.tests)

    def reached_by(self, outcome: Outcome) -> bool:
        """Whether every test came to its depth."""
        return all(test.reached_by(curve) for test, curve in zip(self.tests, outcome.curves, strict=True))

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Read a complete full solve of all tests."""
        every = [
            test.predict(curve, outcome.values, instrument)
            for test, curve in zip(self.tests, outcome.curves, strict=True)
        ]

        def joined(of: Callable[[Prediction], Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
            return {name: np.concatenate([of(one)[name] for one in every]) for name in of(every[0])}

        return Prediction(
            np.concatenate([one.values for one in every]),
            joined(lambda one: one.sensitivities),
            np.concatenate([one.model_values for one in every]),
            joined(lambda one: one.model_sensitivities),
        )

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) of what the model gives on all tests' grids (..., m)."""
        parts = zip(self.tests, self._model_spans, strict=True)
        read = [test.read(model_values[..., span], instrument) for test, span in parts]
        return np.concatenate(read, axis=-1)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (n, n) that weighs the readings: errors of single tests, and shared ones about `near`."""
        return total_of(self._own_errors if self.near is None else self._covariances(*self.near))

    def covariance_at(self, values: Values) -> FloatArray:
        """Covariance (n, n) of all errors at the model's values."""
        return total_of(self.covariances_at(values))

    def covariances_at(self, values: Values) -> Covariances:
        """Covariances (n, n) by source at the model's values, about predicted readings where there are some."""
        return self._covariances(values, self.measured if self.near is None else self.near[1])

    @cached_property
    def _own_errors(self) -> dict[ErrorSource, FloatArray]:
        every = [test.own_errors for test in self.tests]
        sources = dict.fromkeys(source for errors in every for source in errors)
        sizes = [len(test.data) for test in self.tests]
        nothing = [np.zeros((size, size)) for size in sizes]
        return {
            source: np.asarray(
                block_diag(*(errors.get(source, zero) for errors, zero in zip(every, nothing, strict=True)))
            )
            for source in sources
        }

    def _covariances(self, values: Values, predicted: FloatArray) -> dict[ErrorSource, FloatArray]:
        modes: dict[str, Mode] = {}
        for test, span in zip(self.tests, self.spans, strict=True):
            for name, mode in test.shared_errors(values, predicted[span]).items():
                whole = modes.setdefault(name, Mode(mode.source, np.zeros(len(self))))
                whole.effect[span] = mode.effect
        shared: dict[ErrorSource, FloatArray] = {}
        for mode in modes.values():
            shared[mode.source] = shared.get(mode.source, 0.0) + np.outer(mode.effect, mode.effect)
        own = dict(self._own_errors)
        if "model" in shared:
            # A model's error that was measured, as modes, isn't taken to be what is usual too.
            own.pop("model", None)
        return {
            source: np.asarray(own.get(source, 0.0) + shared.get(source, 0.0))
            for source in dict.fromkeys([*own, *shared])
        }

    def weighted(self, values: FloatArray) -> FloatArray:
        """Scale values (n, ...) so that `objective` is their sum of squares."""
        return values if self.weighting == "paper" else super().weighted(values)

    @cached_property
    def weighing_covariance(self) -> FloatArray:
        """Covariance (n, n) by whose inverse readings are weighed where that isn't the paper's plain sum."""
        if self.weighting != "equal":
            return self.covariance
        return np.asarray(block_diag(*(test.equal_covariance for test in self.tests)))

    @cached_property
    def _lower(self) -> FloatArray:
        return np.linalg.cholesky(self.weighing_covariance)

    def alone(self, number: int) -> "JointComparison":
        """One of the tests by itself, with the same weights."""
        near = None if self.near is None else (self.near[0], self.near[1][self.spans[number]])
        return JointComparison((self.tests[number],), self.weighting, near)


def _spans(sizes: Iterable[int]) -> list[slice]:
    return [slice(*pair) for pair in pairwise(np.cumsum([0, *sizes]))]
