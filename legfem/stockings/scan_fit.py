r"""Comparison of a leg in its stocking with scan and sensors at one stiffness, nuisances fitted.

With :math:`w` the whitened residuals, :math:`N` their derivatives by the nuisances :math:`u` and
:math:`P` the square root of the priors' precision, :math:`u(\theta)` minimises
:math:`|w + N u|^2 + |P u|^2`, and the minimum depends on the stiffness :math:`\theta` alone
(variable projection: G. H. Golub, V. Pereyra, Inverse Problems 19 (2003) R1; derivative after
L. Kaufman). :math:`N` changes with the stiffness, and that enters the derivative: without it noise
would draw the stiffness towards where the contours are least sensitive to the nuisances.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.parameter import Parameter, Priors
from legfem.legs.elastography import ShearModulus, elastography_priors
from legfem.stockings.equilibrium import Feedback, Worn, WornLeg, slope_step
from legfem.stockings.leg_model import PARAMETERS
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.nuisances import RIGID, SECTORS, NuisanceSlopes
from legfem.stockings.sensors import Sensing

BOUNDS = (kpa_to_mpa(0.1), kpa_to_mpa(100.0))
"""Of a search (MPa)."""


def stiffness_priors(moduli: Iterable[ShearModulus] = ()) -> Priors:
    """Return what shear waves say of `PARAMETERS` (MPa); nothing without them."""
    known = elastography_priors(moduli)
    return Priors(tuple(Parameter(name, "MPa", BOUNDS, known.get(name), scale="log") for name in PARAMETERS))


class LinearisedContours:
    """Distances (mm) of a worn leg from its scan, and their derivatives, (n,) each.

    Parameters
    ----------
    leg
        The leg.
    misfit
        The scanned contours.
    worn
        The equilibrium that was found last.
    """

    def __init__(self, leg: WornLeg, misfit: ContourMisfit, worn: Worn) -> None:
        self._model, self._misfit, self._worn = leg.model, misfit, worn
        self._feedback = Feedback(leg, worn)
        self._rates: dict[str, FloatArray] = {}

    @cached_property
    def distances(self) -> FloatArray:
        """How far the leg lies outside its scan."""
        return self._misfit.distances(self._worn.shape)

    def by_parameter(self, name: str) -> FloatArray:
        """Return the slope by a parameter of the model by which the state was differentiated."""
        return self._slope(self._rate(name))

    def pressure_by_parameter(self, name: str) -> FloatArray:
        """Return that of the stocking's pressure at the skin's points, (n_levels, n_points)."""
        return self._feedback.pressure_slope(self._rate(name))

    def _rate(self, name: str) -> FloatArray:
        if name not in self._rates:
            self._rates[name] = self._feedback.to_rate(self._worn.state.sensitivities[name])
        return self._rates[name]

    def _slope(self, rate: FloatArray) -> FloatArray:
        step = slope_step(self._model, rate)
        ahead = self._model.deformed_shape(self._worn.state.unknown + step * rate)
        return (self._misfit.distances(ahead) - self.distances) / step


STEP = 0.01
"""Of log parameters, for a difference of the nuisances' slopes."""


@dataclass(frozen=True, eq=False)
class Tension:
    """By which share the fabric's tension exceeds what was given.

    Parameters
    ----------
    value : float
        The best one.
    log_covariance : (3, 3) array
        Of the logarithms of the stiffnesses, and of it.
    """

    value: float
    log_covariance: FloatArray

    @property
    def sd(self) -> float:
        """Its standard deviation."""
        return float(np.sqrt(self.log_covariance[2, 2]))


@dataclass(frozen=True, eq=False)
class BesideScan:
    """What contours and sensors say of a worn leg at one stiffness.

    Parameters
    ----------
    parameters : (2,) array
        C10 of muscle and fat (MPa).
    worn : Worn
        The equilibrium there.
    distances : (n,) array
        mm.
    slopes : (n, 2) array
        Of the distances, by the logarithms of the stiffnesses.
    felt : (s,) array
        What sensors feel over what they showed, over their errors.
    felt_slopes : (s, 2) array
        By the logarithms of the stiffnesses.
    """

    parameters: FloatArray
    worn: Worn
    distances: FloatArray
    slopes: FloatArray
    felt: FloatArray
    felt_slopes: FloatArray


def beside_scan(
    leg: WornLeg, misfit: ContourMisfit, parameters: FloatArray, worn: Worn, sensing: Sensing | None = None
) -> BesideScan:
    """Compare a worn leg with its scan and its sensors.

    Parameters
    ----------
    leg, misfit
        Of the leg.
    parameters : (2,) array
        C10 of muscle and fat (MPa).
    worn
        The equilibrium there, differentiated by `PARAMETERS`; the last that was found.
    sensing : Sensing, optional
        Sensors under the stocking.
    """
    contours = LinearisedContours(leg, misfit, worn)
    felt: FloatArray = np.zeros(0)
    felt_slopes: FloatArray = np.zeros((0, len(PARAMETERS)))
    if sensing is not None:
        felt = (sensing.felt(worn.load.pressure) - sensing.measured) / sensing.sd
        slopes_felt = [sensing.felt(contours.pressure_by_parameter(name)) for name in PARAMETERS]
        felt_slopes = np.stack(slopes_felt, axis=1) * parameters / sensing.sd[:, None]
    slopes = np.stack([contours.by_parameter(name) for name in PARAMETERS], axis=1) * parameters
    return BesideScan(parameters, worn, contours.distances, slopes, felt, felt_slopes)


@dataclass(frozen=True, eq=False)
class Profiled:
    """One stiffness.

    Parameters
    ----------
    worn : Worn
        The equilibrium there.
    distances : (n,) array
        mm.
    nuisance : (k,) array
        See `legfem.stockings.nuisances`.
    moved : (n,) array
        Distances after motions and pressure are allowed for (mm).
    residual : (m + s + p + k,) array
        Whitened distances, what sensors feel over their errors, departures from p priors, and
        nuisances.
    jacobian : (m + s + p + k, 2) array
        Derivatives by the logarithms of the stiffnesses, nuisances following.
    tension : Tension, optional
        Of the fabric, where that isn't taken as it was given.
    """

    worn: Worn
    distances: FloatArray
    nuisance: FloatArray
    moved: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    tension: Tension | None = None

    @property
    def objective(self) -> float:
        """The least sum of squares."""
        return float(self.residual @ self.residual)


def profiled(
    found: BesideScan,
    misfit: ContourMisfit,
    nuisances: NuisanceSlopes,
    sensing: Sensing | None = None,
    priors: Priors | None = None,
) -> Profiled:
    """Fit the nuisances at a stiffness.

    Parameters
    ----------
    found
        There.
    misfit, nuisances
        Of the leg.
    sensing : Sensing, optional
        Sensors under the stocking.
    priors : Priors, optional
        Of the stiffnesses (MPa).
    """
    parameters, priors = found.parameters, priors or stiffness_priors()
    slopes, sd = nuisances.at(parameters), nuisances.sd
    felt_slopes: FloatArray = np.zeros((0, len(sd)))
    if sensing is not None:
        felt_slopes = nuisances.felt(parameters) / sensing.sd[:, None]
    unmoved = np.zeros((len(priors), len(sd)))
    basis = np.vstack([misfit.whitened(slopes), felt_slopes, unmoved, np.diag(1 / sd)])
    orthonormal, triangle = np.linalg.qr(basis)
    white = misfit.whitened(found.distances)
    beside = np.concatenate([found.felt, priors.residual(parameters)])
    right = np.concatenate([white, beside, np.zeros(len(sd))])
    nuisance = -solve_triangular(triangle, orthonormal.T @ right)
    by_stiffness = found.slopes.copy()
    for number in range(len(PARAMETERS)):
        ahead, behind = (nuisances.at(parameters * np.exp(sign * STEP * np.eye(2)[number])) for sign in (1, -1))
        by_stiffness[:, number] += (ahead - behind) @ nuisance / (2 * STEP)
    rows = np.zeros((len(right), 2))
    rows[: len(white)] = misfit.whitened(by_stiffness)
    by_prior = priors.jacobian(parameters) * parameters
    rows[len(white) : len(white) + len(beside)] = np.vstack([found.felt_slopes, by_prior])
    tension = None
    if nuisances.of_tension:
        every = np.hstack([rows, basis])
        picked = [0, 1, every.shape[1] - 1]
        covariance = np.linalg.pinv(every.T @ every)[np.ix_(picked, picked)]
        tension = Tension(float(nuisance[-1]), covariance)
    shown = [*range(RIGID + SECTORS), *([len(sd) - 1] if nuisances.of_tension else [])]
    return Profiled(
        found.worn,
        found.distances,
        nuisance,
        found.distances + slopes[:, shown] @ nuisance[shown],
        right + basis @ nuisance,
        rows - orthonormal @ (orthonormal.T @ rows),
        tension,
    )
