"""Search for the stiffness of fat and muscle from the contours of a leg with and without its stocking.

Two searches. The paper's is Nelder-Mead on the sum of squared distances. The other minimises the
distances weighted with their errors, those of the bare outlines included (as in total least
squares), by damped Gauss-Newton steps (`legfem.inverse.least_squares`) with the exact derivatives
of the finite-element model and its stocking: it takes a fraction of the solves and yields
intervals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize

from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.inverse.intervals import Bound, Identifiability, bound_of, quantile, verdict_on
from legfem.inverse.parameter import Priors
from legfem.stockings.equilibrium import Worn, WornLeg
from legfem.stockings.intervals import MisfitEmulator, profile_intervals
from legfem.stockings.leg_model import PARAMETERS
from legfem.stockings.misfit import ContourAccuracy, ContourMisfit
from legfem.stockings.nuisances import RIGID, NuisanceSlopes
from legfem.stockings.scan_fit import BOUNDS, BesideScan, Profiled, Tension, beside_scan, profiled, stiffness_priors
from legfem.stockings.sensors import Sensing

START = kpa_to_mpa(np.array([3.0, 3.0]))
"""The paper's start (MPa)."""
LEARNT_AT = kpa_to_mpa(np.array([[3.0, 3.0], [1.5, 12.0], [6.0, 1.5]]))
"""C10 of muscle and fat (MPa) at which the nuisances' slopes are taken."""
NO_GAIN = 0.1
"""Of the least gain: a step that promises less isn't taken."""
type OnSolve = Callable[[str], None]
type Method = Literal["nelder-mead", "weighted"]


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
    parameters' logarithms) belongs to the weighted search.
    """

    method: Method
    parameters: FloatArray
    start: FloatArray
    converged: bool
    solves: int
    """Compressed states solved for; an equilibrium takes a few."""
    cost: float
    """The paper's, 1 at its start."""
    rms: float
    """Root-mean-square distance, after motion and pressure are allowed for (mm)."""
    distances: FloatArray
    worn: Worn
    chi_square: float = np.nan
    """Least sum of squares of weighted distances and nuisances, over the number of the former: 1
    where errors are as large as was assumed."""
    nuisance: FloatArray | None = None
    """See `legfem.stockings.nuisances`."""
    tension: Tension | None = None
    """Of the fabric; None where it is taken as it was given."""
    log_covariance: FloatArray | None = None
    profile95: FloatArray | None = None
    """95 % intervals (2, 2) by profile likelihood, MPa: of the best search."""

    @property
    def rigid(self) -> FloatArray | None:
        """What is left of a motion between the scans: three shifts (mm), three turns (rad)."""
        return None if self.nuisance is None else self.nuisance[:RIGID]

    @property
    def interval95(self) -> FloatArray | None:
        """95 % intervals of the parameters, (2, 2), MPa; 0 and infinity where they are open.

        By profile likelihood, or else by the curvature at the best values.
        """
        if self.profile95 is not None:
            return self.profile95
        if self.log_covariance is None:
            return None
        half = quantile(0) * np.sqrt(np.diag(self.log_covariance))
        return self.parameters[:, None] * np.exp(np.stack([-half, half], axis=1))


class StiffnessSearch:
    """Puts a stocking on a leg of many stiffnesses and compares it with its scan.

    Parameters
    ----------
    leg
        The leg and its stocking.
    misfit
        The scanned contours.
    settings
        Of the searches.
    on_solve
        Called with a line after every equilibrium.
    sensing
        Sensors under the stocking, whose pressures are data of the weighted search.
    priors
        Of the stiffnesses (MPa), for the weighted search.
    """

    def __init__(
        self,
        leg: WornLeg,
        misfit: ContourMisfit,
        settings: SearchSettings | None = None,
        on_solve: OnSolve | None = None,
        sensing: Sensing | None = None,
        priors: Priors | None = None,
    ) -> None:
        self._priors = priors or stiffness_priors()
        self._leg, self._misfit, self._sensing = leg, misfit, sensing
        self._settings = settings or SearchSettings()
        self._on_solve = on_solve
        self._last: Worn | None = None
        self._learnt: dict[tuple[float, ...], Worn] = {}
        self.nuisances = NuisanceSlopes(leg, misfit, sensing)
        self._beside: list[BesideScan] = []

    def nelder_mead(self) -> Identified:
        """Search as the paper does, from 3 kPa in both tissues."""
        before = self._leg.states
        best = self._solve(START)
        if not best.state.report.complete:
            return self._unsolved("nelder-mead", START, before, best)
        scale = least = self._misfit.cost(self._misfit.distances(best.shape))
        found = START

        def cost(log_parameters: FloatArray) -> float:
            nonlocal best, least, found
            parameters = np.exp(log_parameters)
            if not (parameters > BOUNDS[0]).all() or not (parameters < BOUNDS[1]).all():
                return np.inf
            worn = self._solve(parameters)
            if not worn.state.report.complete:
                return np.inf
            value = self._misfit.cost(self._misfit.distances(worn.shape))
            if value < least:
                best, least, found = worn, value, parameters
            return value / scale

        settings = self._settings
        done = minimize(
            cost,
            np.log(START),
            method="Nelder-Mead",
            options={
                "initial_simplex": np.log(START) + np.array([[0, 0], [0.4, 0], [0, 0.4]]),
                "xatol": settings.simplex_tolerance,
                "fatol": 1e-4,
                "maxfev": settings.max_evaluations,
            },
        )
        distances = self._misfit.distances(best.shape)
        return Identified(
            "nelder-mead",
            found,
            START,
            bool(done.success),
            self._leg.states - before,
            least / scale,
            _rms(distances),
            distances,
            best,
        )

    def weighted(self) -> tuple[Identified, ...]:
        """Search from every start; the best first."""
        if not self.nuisances.learnt:
            self._learn()
        found = [self._from(kpa_to_mpa(np.array(start))) for start in self._settings.starts_kPa]
        best, *others = sorted(found, key=lambda result: result.chi_square)
        return (self._with_profile(best), *others)

    def _with_profile(self, best: Identified) -> Identified:
        """Return the best search with intervals by profile likelihood, where it settled."""
        if not best.converged or best.log_covariance is None:
            return best
        sensor_sd = np.zeros(0) if self._sensing is None else self._sensing.sd

        def emulate() -> MisfitEmulator:
            return MisfitEmulator(self._beside, self._misfit, self.nuisances, sensor_sd, self._priors)

        def compare(parameters: FloatArray) -> BesideScan | None:
            worn = self._solve(parameters, differentiate=True)
            return self._compared(parameters, worn) if worn.state.report.complete else None

        intervals = profile_intervals(best.parameters, best.log_covariance, BOUNDS, emulate, compare)
        return replace(best, profile95=intervals)

    def _learn(self) -> None:
        for parameters in LEARNT_AT:
            worn = self._solve(parameters, differentiate=True)
            if worn.state.report.complete:
                self.nuisances.learn(parameters, worn)
                self._learnt[tuple(parameters)] = worn

    def _from(self, start: FloatArray) -> Identified:
        """Minimise what the best nuisances leave, by Gauss and Newton's method with damping."""
        before, settings, misfit = self._leg.states, self._settings, self._misfit
        damping, converged = 1e-3, False
        learnt = self._learnt.get(tuple(start))
        worn = self._solve(start, differentiate=True) if learnt is None else self._leg.back_in(learnt, _by_name(start))
        if not worn.state.report.complete or not self.nuisances.learnt:
            return self._unsolved("weighted", start, before, worn)
        parameters, here = start, self._profiled(start, worn)
        for _ in range(settings.max_steps):
            normal = here.jacobian.T @ here.jacobian
            damped = normal + damping * np.diag(np.diag(normal))
            step = -np.linalg.solve(damped, here.jacobian.T @ here.residual)
            expected = here.objective - np.sum((here.residual + here.jacobian @ step) ** 2)
            if expected < NO_GAIN * settings.least_gain:
                converged = True
                break
            proposed = np.clip(parameters * np.exp(np.clip(step, -1.0, 1.0)), *BOUNDS)
            worn = self._solve(proposed, differentiate=True)
            if not worn.state.report.complete:
                damping = max(10 * damping, 1.0)
                continue
            new = self._profiled(proposed, worn)
            gain = here.objective - new.objective
            if gain < -1e-9 * here.objective:
                damping = max(10 * damping, 0.1)
                continue
            change = np.abs(np.log(proposed / parameters)).max()
            parameters, here, damping = proposed, new, damping / 10
            if change < settings.tolerance or gain < settings.least_gain:
                converged = True
                break
        return Identified(
            "weighted",
            parameters,
            start,
            converged,
            self._leg.states - before,
            misfit.cost(here.distances),
            _rms(here.moved),
            here.distances,
            here.worn,
            here.objective / (len(here.residual) - len(here.nuisance)),
            here.nuisance,
            here.tension,
            np.linalg.pinv(here.jacobian.T @ here.jacobian),
        )

    def _profiled(self, parameters: FloatArray, worn: Worn) -> Profiled:
        found = self._compared(parameters, worn)
        return profiled(found, self._misfit, self.nuisances, self._sensing, self._priors)

    def _compared(self, parameters: FloatArray, worn: Worn) -> BesideScan:
        found = beside_scan(self._leg, self._misfit, parameters, worn, self._sensing)
        self._beside.append(found)
        return found

    def _unsolved(self, method: Method, start: FloatArray, before: int, worn: Worn) -> Identified:
        return Identified(
            method, start, start, False, self._leg.states - before, np.inf, np.inf, np.array([]), worn, np.inf
        )

    def _solve(self, parameters: FloatArray, differentiate: bool = False) -> Worn:
        worn = self._leg.find(_by_name(parameters), PARAMETERS if differentiate else (), self._last)
        if self._on_solve is not None:
            deep, fat = mpa_to_kpa(parameters)
            ended = (
                f"in equilibrium after {len(worn.changes)} states"
                if worn.state.report.complete
                else f"no state found; {worn.state.report}"
            )
            self._on_solve(f"muscle {deep:.3g} kPa, fat {fat:.3g} kPa: {ended}")
        if worn.state.report.complete:
            self._last = worn
        return worn


def _by_name(parameters: FloatArray) -> dict[str, float]:
    return dict(zip(PARAMETERS, map(float, parameters), strict=True))


def _rms(distances: FloatArray) -> float:
    return float(np.sqrt(np.mean(distances**2)))


SAME_WITHIN, SAME_WITHIN_INTERVAL = 0.02, 0.2
"""Relative difference up to which two searches found the same stiffness: either of a share of it,
and of the half width of its 95 % interval."""
MISSED_BEYOND = 1.5
"""Root-mean-square distance, over that of the outlines' errors, beyond which the model misses the
scan: then its intervals don't hold."""


@dataclass(frozen=True)
class KnownStiffness:
    """How well one stiffness is known; MPa."""

    name: str
    """Of `PARAMETERS`."""
    value: float
    interval95: tuple[float, float]
    """0 and infinity where it is open."""
    half_width: float
    """Of the interval, over the value."""
    at_bound: Bound
    verdict: Identifiability


def expected_rms(accuracy: ContourAccuracy) -> float:
    """Return the root-mean-square distance (mm) that errors of the contours alone make."""
    return math.sqrt(2 * accuracy.smoothed_sd**2 + accuracy.model_sd**2)


def model_misses(found: Identified, accuracy: ContourAccuracy) -> bool:
    """Tell whether the best fit is farther from the scan than errors of the contours explain."""
    return not found.rms <= MISSED_BEYOND * expected_rms(accuracy)


def judge(found: Identified, accuracy: ContourAccuracy) -> tuple[KnownStiffness, ...]:
    """Return how well each stiffness is known, in the order of `PARAMETERS`.

    Its interval decides. One at a bound of the search isn't known; one of a model that misses the
    scan, or of a search that didn't end, is weakly so at best.
    """
    intervals = found.interval95
    missed = not found.converged or model_misses(found, accuracy)
    known = []
    for number, name in enumerate(PARAMETERS):
        value = float(found.parameters[number])
        low, high = (math.nan, math.nan) if intervals is None else map(float, intervals[number])
        half = 0.5 * (high - low) / value
        bound = bound_of(value, BOUNDS, within=1e-6)
        verdict = verdict_on(half, bound, model_fits=not missed)
        known.append(KnownStiffness(name, value, (low, high), half, bound, verdict))
    return tuple(known)


def starts_agree(searches: Sequence[Identified]) -> bool:
    """Tell whether searches, the best first, led to the same stiffness."""
    values = np.log([search.parameters for search in searches])
    allowed = np.full(len(PARAMETERS), SAME_WITHIN)
    if (covariance := searches[0].log_covariance) is not None:
        half = quantile(0) * np.sqrt(np.diag(covariance))
        allowed = np.maximum(allowed, SAME_WITHIN_INTERVAL * half)
    return bool((np.ptp(values, axis=0) <= allowed).all())
