"""Stiffness of fat and muscle from the contours of a leg with and without its stocking.

Two ways to the same answer. The paper's is Nelder-Mead on the sum of squared distances. The other
minimises the distances weighted with their errors, by Gauss and Newton's method with the
derivatives of the finite-element model: it takes a sixth of the solutions and says how sure the
values are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import minimize

from legfem.experiments.compression import Compressed
from legfem.stocking.leg_model import LegModel3D
from legfem.stocking.misfit import ContourMisfit
from legfem.stocking.nuisance import RIGID, Nuisances, distance_slope, nuisances
from legfem.units import FloatArray, kpa_to_mpa

PARAMETERS = ("deep.C10", "superficial.C10")
START = kpa_to_mpa(np.array([3.0, 3.0]))
"""The paper's start (MPa)."""
BOUNDS = (kpa_to_mpa(0.1), kpa_to_mpa(100.0))
STALE = 0.3
"""Change of a log parameter after which the nuisances' slopes are taken anew."""
type OnSolve = Callable[[str], None]


@dataclass(frozen=True)
class SearchSettings:
    """Of both searches.

    Parameters
    ----------
    starts_kPa : tuple of (float, float)
        C10 of muscle and fat from which the weighted search begins, each in turn.
    tolerance : float
        Relative change of the parameters at which a search ends.
    least_gain : float
        Of a step in the sum of weighted squares, below which a search ends too: 95 % of the
        chances lie within 3.84 of the least.
    max_steps : int
        Of one start.
    simplex_tolerance : float
        Nelder-Mead's: relative size of the last simplex.
    max_evaluations : int
        Nelder-Mead's.
    """

    starts_kPa: tuple[tuple[float, float], ...] = ((3.0, 3.0), (1.5, 12.0), (6.0, 1.5))
    tolerance: float = 1e-2
    least_gain: float = 0.1
    max_steps: int = 15
    simplex_tolerance: float = 1e-2
    max_evaluations: int = 120


@dataclass(frozen=True, eq=False)
class Identified:
    """What a search found; parameters in the order of `PARAMETERS`, in MPa.

    ``converged`` is False where it stopped for another reason; ``log_covariance`` (of the
    parameters' logarithms and the nuisances) belongs to the weighted search.
    """

    method: Literal["nelder-mead", "weighted"]
    parameters: FloatArray
    start: FloatArray
    converged: bool
    solves: int
    cost: float
    """The paper's, 1 at its start."""
    rms: float
    """Root-mean-square distance, after motion and pressure are allowed for (mm)."""
    distances: FloatArray
    state: Compressed
    chi_square: float = np.nan
    """Of the weighted distances, over their effective number."""
    nuisance: FloatArray | None = None
    """See `legfem.stocking.nuisance`."""
    log_covariance: FloatArray | None = None

    @property
    def rigid(self) -> FloatArray | None:
        """What is left of a motion between the scans: three shifts (mm), three turns (rad)."""
        return None if self.nuisance is None else self.nuisance[:RIGID]

    @property
    def interval95(self) -> FloatArray | None:
        """95 % intervals of the parameters, (2, 2), MPa."""
        if self.log_covariance is None:
            return None
        half = 1.96 * np.sqrt(np.diag(self.log_covariance)[:2])
        return self.parameters[:, None] * np.exp(np.stack([-half, half], axis=1))


class Search:
    """Solves a leg for stiffnesses and compares it with its scan.

    Parameters
    ----------
    model
        The leg.
    pressure
        At its skin's points (MPa), (n_levels, n_points): that of the scanned shape.
    misfit
        The scanned contours.
    settings
        Of the searches.
    on_solve
        Called with a line after every solution.
    """

    def __init__(
        self,
        model: LegModel3D,
        pressure: FloatArray,
        misfit: ContourMisfit,
        settings: SearchSettings | None = None,
        on_solve: OnSolve | None = None,
    ) -> None:
        self._model, self._pressure, self._misfit = model, pressure, misfit
        self._settings = settings or SearchSettings()
        self._on_solve = on_solve
        self._last: Compressed | None = None
        self.solves = 0

    def nelder_mead(self) -> Identified:
        """Search as the paper does, from 3 kPa in both tissues."""
        first, _ = self._solve(START)
        scale = self._misfit.cost(self._distances(first)) if first.report.complete else np.nan
        best: dict[float, tuple[FloatArray, Compressed]] = {}
        before = self.solves - 1

        def cost(log_parameters: FloatArray) -> float:
            parameters = np.exp(log_parameters)
            if not (parameters > BOUNDS[0]).all() or not (parameters < BOUNDS[1]).all():
                return np.inf
            state, _ = self._solve(parameters)
            if not state.report.complete:
                return np.inf
            value = self._misfit.cost(self._distances(state)) / scale
            if not best or value < min(best):
                best.clear()
                best[value] = (parameters, state)
            return value

        settings = self._settings
        done = minimize(
            cost, np.log(START), method="Nelder-Mead",
            options={
                "initial_simplex": np.log(START) + np.array([[0, 0], [0.4, 0], [0, 0.4]]),
                "xatol": settings.simplex_tolerance, "fatol": 1e-4,
                "maxfev": settings.max_evaluations,
            },
        )  # fmt: skip
        (value, (parameters, state)) = next(iter(best.items()))
        distances = self._distances(state)
        return Identified(
            "nelder-mead", parameters, START, bool(done.success), self.solves - before, value,
            _rms(distances), distances, state,
        )  # fmt: skip

    def weighted(self) -> tuple[Identified, ...]:
        """Search from every start; the best first."""
        found = [self._from(kpa_to_mpa(np.array(start))) for start in self._settings.starts_kPa]
        return tuple(sorted(found, key=lambda result: result.chi_square))

    def _from(self, start: FloatArray) -> Identified:
        """Minimise the weighted distances and the prior of the rigid motions, with damping."""
        before, settings = self.solves, self._settings
        damping, converged = 1e-3, False
        state, residual, slopes = self._weighted_at(start)
        if residual is None or slopes is None:
            return self._unsolved(start, before, state)
        known = self._nuisances(state)
        prior = np.concatenate([np.zeros(2), 1 / known.sd])
        theta = np.concatenate([np.log(start), np.zeros(len(known.sd))])
        others, taken_at = self._misfit.whitened(known.slopes), theta[:2]

        def total(residual: FloatArray, theta: FloatArray) -> FloatArray:
            return np.concatenate([residual + others @ theta[2:], prior * theta])

        for _ in range(settings.max_steps):
            jacobian = np.vstack([np.hstack([slopes, others]), np.diag(prior)])
            now = total(residual, theta)
            normal = jacobian.T @ jacobian
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), jacobian.T @ now)
            step[:2] = np.clip(step[:2], -1.0, 1.0)
            proposed = theta + step
            proposed[:2] = np.clip(proposed[:2], *np.log(BOUNDS))
            new_state, new_residual, new_slopes = self._weighted_at(np.exp(proposed[:2]))
            if new_residual is None or new_slopes is None:
                damping = max(10 * damping, 1.0)
                continue
            gain = float(np.sum(now**2) - np.sum(total(new_residual, proposed) ** 2))
            if gain < -1e-9 * np.sum(now**2):
                damping = max(10 * damping, 0.1)
                continue
            change = np.abs(proposed[:2] - theta[:2]).max()
            theta, state, residual, slopes = proposed, new_state, new_residual, new_slopes
            damping = damping / 10
            if np.abs(theta[:2] - taken_at).max() > STALE:
                # The pressure's slopes fall with the stiffness.
                known = self._nuisances(state)
                others, taken_at = self._misfit.whitened(known.slopes), theta[:2]
            if change < settings.tolerance or gain < settings.least_gain:
                converged = True
                break
        jacobian = np.vstack([np.hstack([slopes, others]), np.diag(prior)])
        distances = self._distances(state)
        weighted = residual + others @ theta[2:]
        return Identified(
            "weighted", np.exp(theta[:2]), start, converged, self.solves - before,
            self._misfit.cost(distances), _rms(distances + known.slopes @ theta[2:]), distances,
            state, float(weighted @ weighted) / len(weighted), theta[2:],
            np.linalg.pinv(jacobian.T @ jacobian),
        )  # fmt: skip

    def _unsolved(self, start: FloatArray, before: int, state: Compressed) -> Identified:
        return Identified(
            "weighted", start, start, False, self.solves - before, np.inf, np.inf, np.array([]),
            state, np.inf,
        )  # fmt: skip

    def _weighted_at(
        self, parameters: FloatArray
    ) -> tuple[Compressed, FloatArray | None, FloatArray | None]:
        """Return the state, its weighted distances, and their slopes by log parameters."""
        state, slopes = self._solve(parameters, differentiate=True)
        if not state.report.complete or slopes is None:
            return state, None, None
        return state, self._misfit.whitened(self._distances(state)), self._misfit.whitened(slopes)

    def _solve(
        self, parameters: FloatArray, differentiate: bool = False
    ) -> tuple[Compressed, FloatArray | None]:
        """Return the state, and the distances' slopes by the parameters' logarithms, (n, 2)."""
        values = dict(zip(PARAMETERS, map(float, parameters), strict=True))
        names: Sequence[str] = PARAMETERS if differentiate else ()
        state = self._model.solve(self._pressure, values, names, self._last)
        self.solves += 1
        if self._on_solve is not None:
            deep, fat = 1e3 * parameters
            self._on_solve(f"muscle {deep:.3g} kPa, fat {fat:.3g} kPa: {state.report}")
        if not state.report.complete:
            return state, None
        self._last = state
        if not differentiate:
            return state, None
        columns = [
            value * distance_slope(self._model, self._misfit, state, state.sensitivities[name])
            for name, value in values.items()
        ]
        return state, np.stack(columns, axis=1)

    def _nuisances(self, state: Compressed) -> Nuisances:
        return nuisances(self._model, self._pressure, self._misfit, state)

    def _distances(self, state: Compressed) -> FloatArray:
        return self._misfit.distances(self._model.deformed_shape(state.unknown))


def _rms(distances: FloatArray) -> float:
    return float(np.sqrt(np.mean(distances**2)))
