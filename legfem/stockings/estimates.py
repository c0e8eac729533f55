r"""What a search for the stiffness found: the fit, 95 % intervals, and how well each stiffness is known.

Intervals are by profile likelihood. The profile of one stiffness is the least sum of squares with
it held, over the other stiffness and the nuisances. With :math:`w` the whitened distances,
:math:`N` their derivatives by the nuisances and :math:`\Sigma` the priors' covariance, that sum is
:math:`w^T (1 + N \Sigma N^T)^{-1} w`, where :math:`w(\theta)` is interpolated between the
equilibria solved so far (`legfem.inverse.emulator`). Where an end of an interval lies far from all
of them, one more is solved there. An interval that reaches a bound of the search, or stiffnesses at
which the leg can't be computed, is open.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.emulator import Kriging
from legfem.inverse.estimates import Estimate, correlations_of, reasons, trade_of
from legfem.inverse.intervals import Estimated, profile_interval, profile_point, quantile
from legfem.inverse.least_squares import least_residual
from legfem.inverse.parameter import Priors
from legfem.stockings.contour_distances import ContourAccuracy, ContourMisfit
from legfem.stockings.equilibrium import PARAMETERS, Equilibrium
from legfem.stockings.nuisances import RIGID, NuisanceSlopes
from legfem.stockings.scan_fit import ScanComparison, Tension

SAME_WITHIN, SAME_WITHIN_INTERVAL = 0.02, 0.2
"""Relative difference within which two searches agree: 2 %, or this share of the half-width of the
95 % interval."""
MISSED_BEYOND = 1.5
"""Root-mean-square distance, over that which errors of the outlines make, beyond which the model
misses the scan, so that its intervals don't hold."""
type Method = Literal["nelder-mead", "weighted"]
FAR, FARTHEST = 0.35, 1.0
"""Distances in `_coordinates` from the nearest equilibrium: beyond which one more is solved, and at
most from the others."""
MOST = 8
"""Equilibria that are solved for the ends at most."""
_NUGGET = 1e-6
"""Relative variance of the interpolated values: an equilibrium is found to some 1e-4."""
_MIDDLE = kpa_to_mpa(3.0)

type Compare = Callable[[FloatArray], ScanComparison | None]
"""Compares with the scan at stiffnesses (2,), MPa; None where no equilibrium is found."""


class MisfitEmulator:
    """The least sum of squares over the nuisances at any stiffness, from equilibria solved before.

    Parameters
    ----------
    found
        Comparisons with the scan, at two stiffnesses or more.
    misfit, nuisances
        Whitening, and derivatives by the nuisances.
    sensor_sd
        Standard deviations of the sensors' readings, (s,), MPa.
    priors
        Priors of the stiffnesses (MPa).
    """

    def __init__(
        self,
        found: Sequence[ScanComparison],
        misfit: ContourMisfit,
        nuisances: NuisanceSlopes,
        sensor_sd: FloatArray,
        priors: Priors,
    ) -> None:
        self._priors = priors
        self._white, self._sensor_sd = nuisances.mapped(misfit.whitened), sensor_sd
        self.at = _coordinates(np.log([one.parameters for one in found]))
        values = [np.concatenate([misfit.whitened(one.distances), one.sensors]) for one in found]
        slopes = np.stack([np.vstack([misfit.whitened(one.slopes), one.sensor_slopes]).T for one in found])
        # Of q = exp(-x / 2) the derivative by x is -q / 2.
        slopes /= -0.5 * self.at[:, :, None]
        self._values = Kriging(self.at, np.array(values), slopes, _NUGGET)

    def residual(self, logs: FloatArray) -> FloatArray:
        """Return residuals (..., m), whose squares sum to the objective, at logarithms of C10 (..., 2)."""
        flat = logs.reshape(-1, logs.shape[-1])
        every = [
            self._uncorrelated(np.exp(one), values)
            for one, values in zip(flat, self._values(_coordinates(flat)), strict=True)
        ]
        return np.array(every).reshape(*logs.shape[:-1], -1)

    def _uncorrelated(self, parameters: FloatArray, values: FloatArray) -> FloatArray:
        sensed = self._white.of_sensors(parameters) / self._sensor_sd[:, None]
        slopes = np.vstack([self._white.at(parameters), sensed]) * self._white.sd
        factor = np.linalg.cholesky(np.eye(len(slopes)) + slopes @ slopes.T)
        unexplained = solve_triangular(factor, values, lower=True)
        return np.concatenate([unexplained, self._priors.residual(parameters)])


def profile_intervals(
    best: FloatArray,
    log_covariance: FloatArray,
    bounds: tuple[float, float],
    emulate: Callable[[], MisfitEmulator],
    compare: Compare,
) -> FloatArray:
    """Return 95 % intervals of the stiffnesses, (2, 2), MPa; 0 and infinity where they are open.

    Parameters
    ----------
    best : (2,) array
        Best stiffnesses found (MPa).
    log_covariance : (2, 2) array
        Covariance of their logarithms, for a first guess.
    bounds : (float, float)
        Bounds of the search (MPa).
    emulate
        Returns the emulator of all comparisons made so far.
    compare
        Makes one more comparison.
    """
    box = np.tile(np.log(bounds), (len(best), 1))
    half = np.clip(quantile(0) * np.sqrt(np.diag(log_covariance)), 0.02, 1.0)
    reach = np.full(box.shape, FARTHEST)
    for solved in range(MOST + 1):
        emulator = emulate()
        least = least_residual(emulator.residual, np.clip(np.log(best), *box.T), box)
        ends = np.array(
            [profile_interval(emulator.residual, least, k, quantile(0) ** 2, box, half[k]) for k in range(len(best))]
        )
        points = np.array(
            [
                [profile_point(emulator.residual, least, k, end, box, half[k]) for end in ends[k]]
                for k in range(len(best))
            ]
        )
        away = _gaps_to_solved(points, emulator.at)
        unknown = away >= FAR
        tried = np.where(reach >= FAR, away, 0.0)
        if solved == MOST or tried.max() < FAR:
            break
        end = np.unravel_index(np.argmax(tried), tried.shape)
        if compare(np.exp(_nearer(points[end], emulator.at, reach[end]))) is None:
            # Where a leg can't be computed, a point nearer to the others may do.
            reach[end] /= 2
    lost = unknown & (reach < FAR)
    found = np.exp(ends)
    found[(ends[:, 0] <= box[:, 0] + 1e-9) | lost[:, 0], 0] = 0.0
    found[(ends[:, 1] >= box[:, 1] - 1e-9) | lost[:, 1], 1] = np.inf
    return found


def _coordinates(logs: FloatArray) -> FloatArray:
    r"""Return :math:`\sqrt{3\,\mathrm{kPa} / C_{10}}`: a leg hardly changes where it is stiff."""
    return np.asarray(np.exp(-0.5 * (logs - np.log(_MIDDLE))))


def _gaps_to_solved(logs: FloatArray, at: FloatArray) -> FloatArray:
    """Return how far logarithms of C10 (..., 2) are from the nearest solved ones (n, 2); (...)."""
    apart = at - _coordinates(logs)[..., None, :]
    return np.asarray(np.linalg.norm(apart, axis=-1).min(axis=-1))


def _nearer(logs: FloatArray, at: FloatArray, reach: float) -> FloatArray:
    """Return logarithms of C10 that are no farther from the solved ones than a reach."""
    wanted = _coordinates(logs)
    nearest = at[np.argmin(np.linalg.norm(at - wanted, axis=1))]
    share = min(1.0, reach / float(np.linalg.norm(wanted - nearest)))
    reached = nearest + share * (wanted - nearest)
    return np.asarray(np.log(_MIDDLE) - 2 * np.log(reached))


@dataclass(frozen=True, eq=False)
class StiffnessFit:
    """Result of one search; parameters in the order of `PARAMETERS`, MPa.

    Parameters
    ----------
    method : str
        ``"weighted"`` or ``"nelder-mead"``.
    parameters, start : (2,) array
        Best values, and those it started from.
    converged : bool
        Whether a tolerance ended it.
    solves : int
        Finite-element solutions; an equilibrium takes a few.
    cost : float
        The paper's cost: mm2 of the weighted search, relative to the start of Nelder-Mead.
    distances : (n,) array
        Distances outside the scan (mm), less rigid motions and errors of the pressure.
    equilibrium : Equilibrium
        State at the best values.
    sensed : (s,) array
        Model's pressures less the sensors' readings, over their standard deviations, of the weighted search.
    objective : float
        Least sum of squares.
    residuals : int
        Number of residuals that are no nuisances.
    nuisance : (k,) array, optional
        Best nuisances, see `legfem.stockings.nuisances`.
    tension : Tension, optional
        Error of the fabric's tension; None where it is taken as given.
    log_covariance : (2, 2) array, optional
        Covariance of the parameters' logarithms; of the weighted search.
    profile95 : (2, 2) array, optional
        95 % intervals by profile likelihood (MPa); of the best weighted search.
    """

    method: Method
    parameters: FloatArray
    start: FloatArray
    converged: bool
    solves: int
    cost: float
    distances: FloatArray
    equilibrium: Equilibrium
    sensed: FloatArray = field(default_factory=lambda: np.zeros(0))
    objective: float = np.inf
    residuals: int = 0
    nuisance: FloatArray | None = None
    tension: Tension | None = None
    log_covariance: FloatArray | None = None
    profile95: FloatArray | None = None

    @property
    def rms(self) -> float:
        """Root-mean-square distance from the scan, mm; infinite where there was no state to compare."""
        return float(np.sqrt(np.mean(self.distances**2))) if len(self.distances) else math.inf

    @property
    def chi_square(self) -> float:
        """Least sum of squares over `residuals`: 1 where errors are as large as assumed; NaN of no weighted search."""
        return self.objective / self.residuals if self.residuals else math.nan

    @property
    def rigid(self) -> FloatArray | None:
        """Motion between the scans beyond their registration: three shifts (mm), three turns (rad)."""
        return None if self.nuisance is None else self.nuisance[:RIGID]

    @property
    def interval95(self) -> FloatArray | None:
        """95 % intervals (2, 2) of the parameters, MPa; 0 or infinity at an open end.

        By profile likelihood if there is one, else by the curvature at the best values.
        """
        if self.profile95 is not None:
            return self.profile95
        if self.log_covariance is None:
            return None
        half = quantile(0) * np.sqrt(np.diag(self.log_covariance))
        return self.parameters[:, None] * np.exp(np.stack([-half, half], axis=1))


def expected_rms(accuracy: ContourAccuracy) -> float:
    """Return the root-mean-square distance (mm) that errors of the contours alone make."""
    return math.sqrt(2 * accuracy.smoothed_sd**2 + accuracy.model_sd**2)


def model_misses(found: StiffnessFit, accuracy: ContourAccuracy) -> bool:
    """Tell whether the best fit is farther from the scan than errors of the contours explain."""
    return not found.rms <= MISSED_BEYOND * expected_rms(accuracy)


def stiffness_correlations(found: StiffnessFit) -> FloatArray:
    """Return the correlations (2, 2) of the errors of a weighted search's stiffnesses; NaN where it has none."""
    unknown = np.full((len(PARAMETERS), len(PARAMETERS)), np.nan)
    return unknown if found.log_covariance is None else correlations_of(found.log_covariance)


def stiffness_estimates(found: StiffnessFit, accuracy: ContourAccuracy, priors: Priors) -> dict[str, Estimate]:
    """Return the estimates of a search, by full name; each weakly identifiable at best where the fit isn't sound.

    Parameters
    ----------
    found
        The best weighted search.
    accuracy
        Errors of the contours.
    priors
        The stiffnesses with what was known of them (MPa).
    """
    intervals = np.full((len(PARAMETERS), 2), np.nan) if found.interval95 is None else found.interval95
    covariance, correlations = found.log_covariance, stiffness_correlations(found)
    errors = found.parameters * (np.nan if covariance is None else np.sqrt(np.diag(covariance)))
    missed = ""
    if model_misses(found, accuracy):
        missed = "the model misses the scan, so the interval doesn't hold"
    elif not found.converged:
        missed = "the search ended before it had settled"
    estimates = {}
    for k, parameter in enumerate(priors.parameters):
        low, high = map(float, intervals[k])
        known = Estimated(parameter, float(found.parameters[k]), float(errors[k]), (low, high))
        why = reasons(known, missed, trade_of(PARAMETERS, k, correlations), data="both scans")
        estimates[parameter.name] = Estimate(
            parameter, known.value, known.standard_error, known.ci95, known.verdict(not missed), why
        )
    return estimates


def starts_agree(searches: Sequence[StiffnessFit]) -> bool:
    """Tell whether searches, the best first, led to the same stiffness."""
    values = np.log([search.parameters for search in searches])
    allowed = np.full(len(PARAMETERS), SAME_WITHIN)
    if (covariance := searches[0].log_covariance) is not None:
        half = quantile(0) * np.sqrt(np.diag(covariance))
        allowed = np.maximum(allowed, SAME_WITHIN_INTERVAL * half)
    return bool((np.ptp(values, axis=0) <= allowed).all())
