"""How well the stiffnesses of a leg in its stocking are known: 95 % intervals by profile likelihood, and verdicts.

The profile of one stiffness is the least sum of squares with it held, over the other stiffness and the nuisances,
between the equilibria that were solved (`legfem.inverse.emulator`). Where an end of an interval lies too far from
all of them, one more is solved on the way there. An interval that reaches a bound of the search, or stiffnesses at
which the leg can't be computed, is open.
"""

import math

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.estimates import Estimate, correlations_of, reasons, trade_of
from legfem.inverse.intervals import Estimated, profile_interval, profile_point, quantile
from legfem.inverse.least_squares import Residual, least_residual
from legfem.inverse.parameter import Priors
from legfem.inverse.searches import Found
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.equilibrium import PARAMETERS
from legfem.stockings.scan_fit import BOUNDS, ScanComparison, ScanFit

MISSED_BEYOND = 1.5
"""Root-mean-square distance, over that which errors of the outlines make, beyond which the model
misses the scan, so that its intervals don't hold."""
MOST = 6
"""Equilibria that are solved for intervals' ends at most."""
LEAST_WAY = 0.2
"""Distance in log stiffness beyond the nearest equilibrium that one more is worth."""


def profile_intervals(found: Found[ScanComparison], log_covariance: FloatArray) -> FloatArray:
    """Return 95 % intervals of the stiffnesses, (2, 2), MPa; 0 and infinity where they are open.

    Parameters
    ----------
    found
        The finished search.
    log_covariance : (2, 2) array
        Covariance of the stiffnesses' logarithms, for a first guess.
    """
    search, times = found.search, quantile(0)
    box = np.tile(np.log(BOUNDS), (len(PARAMETERS), 1))
    half = np.clip(times * np.sqrt(np.diag(log_covariance)), 0.02, 1.0)
    for solved in range(MOST + 1):
        left = found.residual

        def residual(logs: FloatArray, left: Residual = left) -> FloatArray:
            return left(np.exp(logs))

        least = least_residual(residual, np.clip(np.log(found.best.point), *box.T), box)
        ends = np.array([profile_interval(residual, least, k, times**2, box, width) for k, width in enumerate(half)])
        points = np.array(
            [[profile_point(residual, least, k, end, box, width) for end in ends[k]] for k, width in enumerate(half)]
        ).reshape(-1, len(PARAMETERS))
        nearest, share = search.trust.share_of_way(search.coordinates.of(np.exp(points)))
        way = share * np.linalg.norm(points - nearest, axis=1)
        if solved == MOST or (share >= 1.0).all() or way.max() < LEAST_WAY:
            break
        farthest = int(np.argmax(np.where(share < 1.0, way, 0.0)))
        search.solve(np.exp(nearest + share[:, None] * (points - nearest))[[farthest]], "design")
    known = (share >= 1.0).reshape(ends.shape) & (np.abs(ends - box) > 1e-9)
    return np.where(known, np.exp(ends), (0.0, np.inf))


def expected_rms(accuracy: ContourAccuracy) -> float:
    """Return the root-mean-square distance (mm) that errors of the contours alone make."""
    return math.sqrt(2 * accuracy.smoothed_sd**2 + accuracy.model_sd**2)


def model_misses(found: ScanFit, accuracy: ContourAccuracy) -> bool:
    """Tell whether the best fit is farther from the scan than errors of the contours explain."""
    return not found.rms <= MISSED_BEYOND * expected_rms(accuracy)


def stiffness_estimates(
    found: ScanFit, accuracy: ContourAccuracy, priors: Priors, converged: bool = True
) -> dict[str, Estimate]:
    """Return the estimates by full name; each weakly identifiable at best where the fit isn't sound.

    Parameters
    ----------
    found
        The best fit.
    accuracy
        Errors of the contours.
    priors
        The stiffnesses with what was known of them (MPa).
    converged
        Whether the search had settled.
    """
    correlations = correlations_of(found.log_covariance)
    errors = found.parameters * np.sqrt(np.diag(found.log_covariance))
    missed = ""
    if model_misses(found, accuracy):
        missed = "the model misses the scan, so the interval doesn't hold"
    elif not converged:
        missed = "the search ended before it had settled"
    estimates = {}
    for k, parameter in enumerate(priors.parameters):
        low, high = map(float, found.interval95[k])
        known = Estimated(parameter, float(found.parameters[k]), float(errors[k]), (low, high))
        why = reasons(known, missed, trade_of(PARAMETERS, k, correlations), data="both scans")
        estimates[parameter.name] = Estimate(
            parameter, known.value, known.standard_error, known.ci95, known.verdict(not missed), why
        )
    return estimates
