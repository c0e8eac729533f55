"""Stations of one or several sites that the same unknowns predict, and what each site says by itself."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_triangular
from scipy.stats import chi2

from legfem.common.units import FloatArray, spans_of
from legfem.inverse.catalogue import Values
from legfem.inverse.comparison import Comparison, Covariances, ErrorSource, Mode, Prediction, Weighting, total_of
from legfem.inverse.fit import EXACT, LEAST_CHANCE, Goodness, OwnEstimate
from legfem.inverse.least_squares import polished
from legfem.inverse.outcome import Outcome
from legfem.inverse.parameter import Domain
from legfem.inverse.readings import Data
from legfem.inverse.searches import Found
from legfem.inverse.station_test import StationTest
from legfem.inverse.trial import Linearised
from legfem.solve.path import ForceCurve


class ComparedTest(Protocol):
    """What a comparison of several tests needs of each: n readings, of m model values."""

    @property
    def data(self) -> Data:
        """The force, then what was recorded with it."""

    @property
    def reach(self) -> str:
        """How far a solve has to come, in words."""

    @property
    def linear_scale(self) -> FloatArray:
        """Sizes (m,) of model values that may have either sign, 0 for forces along the travel."""

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured readings (n,) per relative change of the displacements."""

    @property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the forces in each third of the depth."""

    def reached_by(self, curve: ForceCurve) -> bool:
        """Whether a solve came as far as what was measured."""

    def unseen_in(self, curve: ForceCurve) -> Sequence[str]:
        """Names of the channels that a solve doesn't have."""

    def predict(self, curve: ForceCurve, values: Values, instrument: FloatArray) -> Prediction:
        """Read a solve."""

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) of the model's values (..., m)."""


class ComparedTests[T: ComparedTest](Comparison):
    """Tests that the same unknowns predict, their readings one after the other."""

    tests: tuple[T, ...]

    def solved(self, outcome: Outcome) -> list[tuple[T, ForceCurve]]:
        """Tests with their curves: every one is solved, in this order, unless overridden."""
        return list(zip(self.tests, outcome.curves, strict=True))

    @cached_property
    def spans(self) -> list[slice]:
        """Place of every test's readings among the n."""
        return spans_of(len(test.data) for test in self.tests)

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
    def linear_scale(self) -> FloatArray:
        """Sizes (m,) of model values that may have either sign, 0 for forces along the travel."""
        return np.concatenate([test.linear_scale for test in self.tests])

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the readings (n,) per relative change of the displacements."""
        return np.concatenate([test.if_deeper for test in self.tests])

    @property
    def reach(self) -> str:
        """Depths of the tests."""
        return ", ".join(dict.fromkeys(test.reach for test in self.tests))

    def reached_by(self, outcome: Outcome) -> bool:
        """Whether every test came to its depth."""
        return all(test.reached_by(curve) for test, curve in self.solved(outcome))

    def unseen_in(self, outcome: Outcome) -> tuple[str, ...]:
        """Names of the channels that any test's solve doesn't have."""
        return tuple(dict.fromkeys(name for test, curve in self.solved(outcome) for name in test.unseen_in(curve)))

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Read a complete full solve of all tests."""
        solved = self.solved(outcome)
        return Prediction.joined([test.predict(curve, outcome.values, instrument) for test, curve in solved])

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Readings (..., n) of what the model gives on all tests' grids (..., m)."""
        parts = zip(self.tests, spans_of(len(test.linear_scale) for test in self.tests), strict=True)
        read = [test.read(model_values[..., span], instrument) for test, span in parts]
        return np.concatenate(read, axis=-1)


@dataclass(frozen=True, eq=False)
class JointComparison(ComparedTests[StationTest]):
    """One or several tests that the same unknowns predict.

    Parameters
    ----------
    tests : tuple of StationTest
        With n readings together; every one is solved, in this order, in one outcome.
    weighting : {"covariance", "paper", "equal"}
        What `objective` sums.
    near : tuple, optional
        Values and predicted readings (n,) of a solve near the optimum, about which shared errors count in the weights
        too, as they must where what was known beforehand is weighed against the recordings. Shares of recorded
        forces would draw the model to one side (Peelle's puzzle).
    """

    tests: tuple[StationTest, ...]
    weighting: Weighting = "covariance"
    near: tuple[Values, FloatArray] | None = None

    def contradicts(self, objective: float) -> bool:
        """Whether errors about a solve don't explain so great a sum of squares."""
        weighed = self.weighting != "equal" and self.near is not None
        return weighed and float(chi2.sf(objective, len(self))) < LEAST_CHANCE

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
        found: dict[ErrorSource, FloatArray] = {}
        for test, span in zip(self.tests, self.spans, strict=True):
            for source, part in test.own_errors.items():
                found.setdefault(source, np.zeros((len(self), len(self))))[span, span] = part
        return found

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

    def alone(self, number: int) -> "JointComparison":
        """One of the tests by itself, with the same weights."""
        near = None if self.near is None else (self.near[0], self.near[1][self.spans[number]])
        return JointComparison((self.tests[number],), self.weighting, near)


@dataclass(frozen=True, eq=False)
class SingleTests:
    """What each test of a joint fit says by itself, and whether the tests agree.

    The errors of all are known together, with what the tests share (the correction's error and the priors), so that
    their differences are weighed by what differs.

    Parameters
    ----------
    found : Found
        The joint fit: p parameters, n readings and k priors.
    covariance : (n, n) array
        Of the readings' differences.
    """

    found: Found[JointComparison]
    covariance: FloatArray

    @cached_property
    def _errors(self) -> FloatArray:
        """Errors of readings and priors, (n + k, n + k)."""
        return self.found.linear.with_priors(self.covariance)

    @property
    def _comparison(self) -> JointComparison:
        return self.found.search.misfit

    @property
    def agreement(self) -> Goodness:
        """Whether the tests ask for the same parameters, to first order.

        That is by how much less is missed, in the readings' errors, where each test has parameters of its own.
        """
        if len(self._comparison.tests) < 2:
            return EXACT
        linear, spans = self.found.linear, self._comparison.spans
        joint = linear.prediction.jacobian(linear.law.names)
        # Stiffnesses differ in size by orders.
        joint = joint / np.linalg.norm(joint, axis=0)
        apart = block_diag(*(joint[span] for span in spans))
        lower = np.linalg.cholesky(self.covariance)
        left = solve_triangular(lower, linear.prediction.values - self._comparison.measured, lower=True)
        missed = []
        for by in (joint, apart):
            whitened = solve_triangular(lower, by, lower=True)
            step, _, rank, _ = np.linalg.lstsq(whitened, left)
            missed.append((float(np.sum((left - whitened @ step) ** 2)), int(rank)))
        (together, fewer), (each, more) = missed
        return Goodness.of(together - each, more - fewer)

    def _gain(self, number: int, alone: JointComparison) -> FloatArray:
        """How a test's parameters follow readings and priors, (p, n + k)."""
        linear, n, span = self.found.linear, len(self._comparison), self._comparison.spans[number]
        own = Linearised(linear.law, alone, linear.prediction.part(span), linear.point).gain()
        gain = np.zeros((len(own), n + len(linear.law.priors)))
        gain[:, span], gain[:, n:] = np.split(own, [span.stop - span.start], axis=1)
        return gain

    def goodness(self) -> list[Goodness]:
        """How far each test is from all together, where these miss least in their errors."""
        left, _ = self.found.linear.nearest(self.covariance)
        return [
            Goodness.of(float(left[span] @ np.linalg.solve(self.covariance[span, span], left[span])), len(left[span]))
            for span in self._comparison.spans
        ]

    def by_itself(self) -> Iterator[dict[str, OwnEstimate]]:
        """Parameters as each test alone has them, on the emulator of the joint fit's solves; nothing of one test."""
        joint, linear = self._comparison, self.found.linear
        if len(joint.tests) < 2:
            yield {}
            return
        law = linear.law
        emulated, domain = self.found.search.emulated(), Domain(law.parameters)
        joint_gain = linear.gain()
        for number, span in enumerate(joint.spans):
            alone = joint.alone(number)
            gain = self._gain(number, alone)

            def residual(genes: FloatArray, alone: JointComparison = alone, span: slice = span) -> FloatArray:
                points = domain.values(genes)
                values = emulated.values(points)[..., span]
                return np.concatenate([alone.residual(values), law.priors.residual(points)], axis=-1)

            at = domain.values(polished(residual, domain.genes(linear.point)))
            error = np.sqrt(np.diag(gain @ self._errors @ gain.T))
            apart = gain - joint_gain
            of_difference = np.maximum(np.sqrt(np.diag(apart @ self._errors @ apart.T)), 1e-9 * error)
            yield {
                name: OwnEstimate(float(at[k]), float(error[k]), float((at[k] - linear.point[k]) / of_difference[k]))
                for k, name in enumerate(law.names)
            }
