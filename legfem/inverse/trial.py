"""Full solves of a search, and the model between them: as the instrument shows it, and where it is to be trusted."""

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import block_diag, cholesky, solve_triangular

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import IdentifiedLaw, Values
from legfem.inverse.comparison import Comparison, Prediction
from legfem.inverse.emulator import Emulator
from legfem.inverse.least_squares import gauss_newton_step, inverse_in_units, sandwich
from legfem.inverse.outcome import Outcome
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class FullSolve:
    """One full forward solve of the search."""

    values: Values
    """Values of model and instrument, in their units."""
    cost: float
    """N2 (Eq. 12); NaN where the solve stopped short."""
    stage: Literal["design", "proposal", "bound"]
    complete: bool
    reason: str
    """Why it stopped, if short of its depth."""
    factorisations: int
    seconds: float


@dataclass(frozen=True, eq=False, kw_only=True)
class SearchLog:
    """How the optimum was found; of a fit without a search of its own little of it."""

    names: tuple[str, ...]
    """Names of the free parameters."""
    solves: tuple[FullSolve, ...] = ()
    """In the order in which they were asked for."""
    converged: bool
    seed: int
    """Seed of all random numbers."""
    wall_s: float = math.nan
    """Time that the search took, s."""
    emulator_error: float = math.nan
    """Greatest difference between the emulator before the last solve and that solve, at the optimum, in the readings'
    unit (N); NaN without an emulator."""
    forward_solves: int = 0
    """Full solves that the fit rests on, failed ones included."""
    failed_solves: int = 0
    """Those of them that stopped short."""
    reused_solves: int = 0
    """Those of them that were found on disk from an earlier run."""
    factorisations: int = 0
    compromise: str = ""
    """What the best solve's model gave up to go on, in words; empty if nothing."""


Stage = Literal["design", "proposal"]


@dataclass(frozen=True, eq=False)
class Trial:
    """One full solve of the search."""

    point: FloatArray
    """(p,): the law's free parameters, in the model's units."""
    values: Values
    """Values of model and instrument, free and held."""
    outcome: Outcome
    stage: Stage
    prediction: Prediction | None
    """None where the solve stopped short of the measured depth."""
    objective: float
    """What is minimised, priors included; infinite without a prediction."""


type Asking = Generator[tuple[FloatArray, Stage], list[Trial]]
"""Asks for full solves of points (n, p) as often as it needs, and is sent their trials."""


def objective_of(law: IdentifiedLaw, misfit: Comparison, force: FloatArray, points: FloatArray) -> FloatArray:
    """Return what is minimised (...) for forces (..., n), N, at points (..., p)."""
    return np.asarray(misfit.objective(force) + np.sum(law.priors.residual(points) ** 2, axis=-1))


def sizes_of(trial: Trial, parameters: Sequence[Parameter]) -> FloatArray:
    """Return what steps (p,) are small against: C10 + C20 of a tissue, values, widths."""
    sizes = []
    for parameter, value in zip(parameters, trial.point, strict=True):
        term, _, name = parameter.name.rpartition(".")
        if name in ("C10", "C20"):
            both = (trial.values.get(f"{term}.{one}", 0.0) for one in ("C10", "C20"))
            sizes.append(sum(both))
        elif parameter.scale == "linear":
            sizes.append(0.5 * (parameter.bounds[1] - parameter.bounds[0]))
        else:
            sizes.append(float(value))
    return np.array(sizes)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The weighted misfit and the priors about a full solve.

    Parameters
    ----------
    law : IdentifiedLaw
        p free parameters, k priors.
    misfit : Comparison
        n differences.
    prediction : Prediction
        Of the full solve.
    point : (p,) array
        Where.
    """

    law: IdentifiedLaw
    misfit: Comparison
    prediction: Prediction
    point: FloatArray

    @property
    def residual(self) -> FloatArray:
        """Weighted differences and departures; (n + k,)."""
        return np.concatenate([self.misfit.residual(self.prediction.values), self.law.priors.residual(self.point)])

    @property
    def jacobian(self) -> FloatArray:
        """Derivatives of `residual`; (n + k, p)."""
        own = self.misfit.weighted(self.prediction.jacobian(self.law.names))
        return np.vstack([own, self.law.priors.jacobian(self.point)])

    def gain(self, held: Sequence[int] = ()) -> FloatArray:
        """Return how the parameters follow forces and priors, some of them held; (p, n + k)."""
        moving = self.jacobian * np.isin(np.arange(len(self.point)), held, invert=True)
        return inverse_in_units(moving) @ self.with_priors(self.misfit.weighting_matrix)

    def with_priors(self, matrix: FloatArray) -> FloatArray:
        """Return a matrix (n, n) of the readings with the priors, which have errors of one; (n + k, n + k)."""
        return np.asarray(block_diag(matrix, np.eye(len(self.law.priors))))

    def errors(self, covariance: FloatArray, held: Sequence[int] = ()) -> FloatArray:
        """Return the covariance (p, p) of the parameters' errors from the forces', (n, n), with some of them held."""
        return sandwich(self.gain(held), self.with_priors(covariance))

    def nearest(self, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return differences (n,) and departures (k,) where the law misses least, in the readings' errors.

        That is elsewhere than the optimum where the search didn't weigh by these: an error that the whole curve has
        alike, as of its first contact, takes a plain sum of squares far from there. To first order about the optimum,
        within the bounds.

        Parameters
        ----------
        covariance : (n, n) array
            Of the readings' errors.
        """
        left = self.prediction.values - self.misfit.expected
        departures, by_priors = self.law.priors.residual(self.point), self.law.priors.jacobian(self.point)
        lower, by = cholesky(covariance, lower=True), self.prediction.jacobian(self.law.names)
        whitened = solve_triangular(lower, np.column_stack([left, by]), lower=True)
        limits = np.array([one.bounds for one in self.law.parameters]) - self.point[:, None]
        step = gauss_newton_step(
            np.vstack([whitened[:, 1:], by_priors]), np.concatenate([whitened[:, 0], departures]), limits
        )
        return left + by @ step, departures + by_priors @ step


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates of the q free parameters that are the model's.

    They are ln C10, which carries the scale of a tissue's stiffness, and ln(1 + C20 / C10), which
    is 0 for a neo-Hookean tissue and stays smooth where C20 rules; the logarithm of other
    logarithmic parameters, and a linear one over a quarter of its bounds' width.

    Parameters
    ----------
    law : IdentifiedLaw
        p free parameters.
    """

    law: IdentifiedLaw

    def of(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (..., q) of points (..., p)."""
        columns = [self._of(k, points) for k in self.law.of_model]
        return np.stack(columns, axis=-1) if columns else np.zeros((*points.shape[:-1], 0))

    def points(self, at: FloatArray, like: FloatArray) -> FloatArray:
        """Return the points (n, p) at coordinates (n, q), the instrument's as in others (n, p)."""
        found = np.array(like)
        names = self.law.names
        # A C20 is a multiple of its C10, which comes first.
        order = sorted(enumerate(self.law.of_model), key=lambda one: names[one[1]][-3:] == "C20")
        for q, k in order:
            if names[k].endswith(".C20"):
                found[..., k] = self._first(k, found) * np.expm1(at[..., q])
            elif self.law.parameters[k].scale == "linear":
                found[..., k] = at[..., q] * self._width(k)
            else:
                found[..., k] = np.exp(at[..., q])
        return found

    def derivatives(self, points: FloatArray) -> FloatArray:
        """Return those of the model's parameters by the coordinates at points (n, p); (n, q, q)."""
        indices, names = self.law.of_model, self.law.names
        matrix = np.zeros((len(points), len(indices), len(indices)))
        for q, k in enumerate(indices):
            if names[k].endswith(".C20"):
                first = self._first(k, points)
                matrix[:, q, q] = first + points[:, k]
                scale = self.law.index(_stiffness_of(names[k]))
                if scale is not None:
                    matrix[:, q, indices.index(scale)] = points[:, k]
            elif self.law.parameters[k].scale == "linear":
                matrix[:, q, q] = self._width(k)
            else:
                matrix[:, q, q] = points[:, k]
        return matrix

    def _of(self, k: int, points: FloatArray) -> FloatArray:
        parameter, value = self.law.parameters[k], points[..., k]
        if parameter.name.endswith(".C20"):
            return np.log1p(value / self._first(k, points))
        return value / self._width(k) if parameter.scale == "linear" else np.log(value)

    def _first(self, k: int, points: FloatArray) -> FloatArray:
        return self.law.column(points, _stiffness_of(self.law.names[k]))

    def _width(self, k: int) -> float:
        low, high = self.law.parameters[k].bounds
        return 0.25 * (high - low)


def _stiffness_of(name: str) -> str:
    """Return the name of the C10 that belongs to a C20."""
    return name.removesuffix("C20") + "C10"


# Distance from what was solved beyond which an emulator of two coordinates isn't trusted.
_REACH = 1.2


@dataclass(frozen=True, eq=False)
class Trust:
    """The trusted region, in the emulator's q coordinates.

    Parameters
    ----------
    complete : (n, q) array
        Solves that reached their depth; at least one.
    failed : (k, q) array
        Solves that stopped short.
    """

    complete: FloatArray
    failed: FloatArray

    def share_of_way(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest complete solves (m, q), and how far from there to ``at`` (m,).

        1 is all the way: the point itself is trusted. Else a point goes along the straight line
        to the nearest complete solve: until within reach of it, and until no failed solve is
        nearer.
        """
        solved = self.complete
        distance = np.linalg.norm(at[:, None] - solved[None], axis=-1)
        nearest = solved[np.argmin(distance, axis=1)]
        apart = np.min(distance, axis=1)
        reach = _REACH * math.sqrt(max(solved.shape[1], 2) / 2)
        share = np.minimum(1.0, reach / np.maximum(apart, 1e-300))
        direction = at - nearest
        for one in self.failed:
            # Where the line from the complete solve meets the plane half-way to the failed one.
            gap = one - nearest
            along = np.sum(direction * gap, axis=-1)
            half = 0.5 * np.sum(gap**2, axis=-1)
            share = np.where(along > half, np.minimum(share, half / np.maximum(along, 1e-300)), share)
        return nearest, share


@dataclass(frozen=True, eq=False)
class Emulated:
    """An emulator of the model's corrected force beside what was measured.

    Parameters
    ----------
    law : IdentifiedLaw
        p free parameters, k priors.
    misfit : Comparison
        n differences.
    emulator : Emulator
        Of the force, in `Coordinates`.
    """

    law: IdentifiedLaw
    misfit: Comparison
    emulator: Emulator

    @classmethod
    def between(cls, law: IdentifiedLaw, misfit: Comparison, trials: Sequence[Trial]) -> "Emulated":
        """Return the emulator through full solves, those that have a prediction."""
        complete = [trial for trial in trials if trial.prediction is not None]
        predictions = [trial.prediction for trial in complete if trial.prediction is not None]
        points = np.array([trial.point for trial in complete])
        names = [law.names[k] for k in law.of_model]
        force = np.array([one.model_values for one in predictions])
        by = np.array([[one.model_sensitivities[name] for name in names] for one in predictions])
        coordinates = Coordinates(law)
        slopes = np.einsum(
            "nkm,nkj->njm", by.reshape(len(force), len(names), force.shape[1]), coordinates.derivatives(points)
        )
        return cls(law, misfit, Emulator(coordinates.of(points), force, slopes, misfit.linear_scale))

    def values(self, points: FloatArray) -> FloatArray:
        """Return what the instrument shows (..., n), N, at points (..., p)."""
        return self.misfit.read(self.emulator(Coordinates(self.law).of(points)), self.law.readings(points))

    def residual(self, points: FloatArray) -> FloatArray:
        """Return weighted differences and departures (..., n + k) of points (..., p)."""
        own = self.misfit.residual(self.values(points))
        return np.concatenate([own, self.law.priors.residual(points)], axis=-1)

    def objective(self, points: FloatArray) -> FloatArray:
        """Return what is minimised (...) at points (..., p)."""
        return objective_of(self.law, self.misfit, self.values(points), points)
