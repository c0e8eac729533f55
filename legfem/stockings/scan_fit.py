r"""Comparison of a leg in its stocking with scan and sensors at one stiffness, nuisances fitted.

With :math:`w` the whitened residuals, :math:`N` their derivatives by the nuisances :math:`u` and
:math:`P` the square root of the priors' precision, :math:`u(\theta)` minimises
:math:`|w + N u|^2 + |P u|^2`, and the minimum depends on the stiffness :math:`\theta` alone
(variable projection: G. H. Golub, V. Pereyra, Inverse Problems 19 (2003) R1; derivative after
L. Kaufman). :math:`N` changes with the stiffness, and that enters the derivative: without it noise
would draw the stiffness towards where the contours are least sensitive to the nuisances.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.elastography import ShearModulus, elastography_priors
from legfem.inverse.parameter import Parameter, Priors
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.equilibrium import PARAMETERS, Equilibrium, EquilibriumSolver, LinearisedCoupling, probe_step
from legfem.stockings.leg import SensorArray
from legfem.stockings.nuisances import RIGID, SECTORS, NuisanceSlopes

BOUNDS = (kpa_to_mpa(0.1), kpa_to_mpa(100.0))
"""Bounds of both stiffnesses in a search (MPa)."""
STEP = 0.01
"""Step in log parameters of the finite differences of the nuisances' derivatives."""


def stiffness_priors(moduli: Iterable[ShearModulus] = ()) -> Priors:
    """Return the parameters of a search (MPa), with priors where shear waves were measured."""
    known = elastography_priors(moduli)
    return Priors(tuple(Parameter(name, "MPa", BOUNDS, known.get(name), scale="log") for name in PARAMETERS))


def by_name(parameters: FloatArray) -> dict[str, float]:
    """Return C10 of muscle and fat (MPa) by full name."""
    return dict(zip(PARAMETERS, map(float, parameters), strict=True))


@dataclass(frozen=True, eq=False)
class Tension:
    """Relative error of the fabric's tension, as fitted.

    Parameters
    ----------
    value : float
        Best value.
    log_covariance : (3, 3) array
        Covariance of the logarithms of both stiffnesses, and of the tension's error.
    """

    value: float
    log_covariance: FloatArray

    @property
    def sd(self) -> float:
        """Standard deviation of the tension's error."""
        return float(np.sqrt(self.log_covariance[2, 2]))


class LinearisedContours:
    """Distances (mm) of a leg in its stocking from its scan, and their derivatives in equilibrium.

    Parameters
    ----------
    solver
        Of the leg.
    misfit
        The scanned contours.
    equilibrium
        The one that the model is in.

    Attributes
    ----------
    distances : (n,) array
        mm.
    """

    def __init__(self, solver: EquilibriumSolver, misfit: ContourMisfit, equilibrium: Equilibrium) -> None:
        self._model, self._misfit, self._equilibrium = solver.model, misfit, equilibrium
        self._coupling = LinearisedCoupling(solver, equilibrium)
        self._rates: dict[str, FloatArray] = {}
        self.distances = misfit.distances(equilibrium.shape)

    def by_parameter(self, name: str) -> FloatArray:
        """Return the distances' derivative (n,) by a parameter of the equilibrium's sensitivities."""
        rate = self._rate(name)
        step = probe_step(self._model, rate)
        ahead = self._model.deformed_shape(self._equilibrium.state.unknown + step * rate)
        return (self._misfit.distances(ahead) - self.distances) / step

    def pressure_by_parameter(self, name: str) -> FloatArray:
        """Return the derivative of the stocking's pressure, (n_levels, n_points)."""
        return self._coupling.pressure_rate(self._rate(name))

    def _rate(self, name: str) -> FloatArray:
        if name not in self._rates:
            self._rates[name] = self._coupling.rate(self._equilibrium.state.sensitivities[name])
        return self._rates[name]


@dataclass(frozen=True, eq=False)
class ScanComparison:
    """Residuals of contours and sensors in one equilibrium, and their derivatives.

    Parameters
    ----------
    parameters : (2,) array
        C10 of muscle and fat (MPa).
    equilibrium : Equilibrium
        State at these.
    distances : (n,) array
        Distances of the model outside the scan (mm).
    slopes : (n, 2) array
        Derivatives of the distances by the logarithms of the stiffnesses (mm).
    sensors : (s,) array
        Model's pressures less the sensors' readings, over their standard deviations.
    sensor_slopes : (s, 2) array
        Derivatives of these by the logarithms of the stiffnesses.
    """

    parameters: FloatArray
    equilibrium: Equilibrium
    distances: FloatArray
    slopes: FloatArray
    sensors: FloatArray
    sensor_slopes: FloatArray


def compare_with_scan(
    solver: EquilibriumSolver,
    misfit: ContourMisfit,
    parameters: FloatArray,
    equilibrium: Equilibrium,
    sensors: SensorArray | None = None,
) -> ScanComparison:
    """Compare a leg in its stocking with its scan and its sensors.

    Parameters
    ----------
    solver, misfit
        The leg, and the contours of its scan.
    parameters : (2,) array
        C10 of muscle and fat (MPa).
    equilibrium
        At these, with sensitivities by `PARAMETERS`; the model has to be in it.
    sensors
        Sensors under the stocking.
    """
    contours = LinearisedContours(solver, misfit, equilibrium)
    residual: FloatArray = np.zeros(0)
    sensor_slopes: FloatArray = np.zeros((0, len(PARAMETERS)))
    if sensors is not None:
        residual = (sensors.averages(equilibrium.load.pressure) - sensors.measured) / sensors.sd
        sensed = [sensors.averages(contours.pressure_by_parameter(name)) for name in PARAMETERS]
        sensor_slopes = np.stack(sensed, axis=1) * parameters / sensors.sd[:, None]
    slopes = np.stack([contours.by_parameter(name) for name in PARAMETERS], axis=1) * parameters
    return ScanComparison(parameters, equilibrium, contours.distances, slopes, residual, sensor_slopes)


@dataclass(frozen=True, eq=False)
class ProfiledFit:
    """Least squares at one stiffness, over the nuisances.

    Parameters
    ----------
    at : ScanComparison
        What was fitted.
    nuisance : (k,) array
        Best nuisances, see `legfem.stockings.nuisances`.
    moved : (n,) array
        Distances (mm) less what rigid motions and errors of the pressure explain.
    sensed : (s,) array
        Model's pressures less the sensors' readings, over their standard deviations, likewise.
    residual : (m + s + p + k,) array
        Whitened distances, sensors, deviations from p priors of the stiffnesses, and nuisances, all
        in standard deviations.
    jacobian : (m + s + p + k, 2) array
        Derivatives by the logarithms of the stiffnesses, the nuisances following.
    tension : Tension, optional
        Error of the fabric's tension, where that is uncertain.
    """

    at: ScanComparison
    nuisance: FloatArray
    moved: FloatArray
    sensed: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    tension: Tension | None = None

    @property
    def objective(self) -> float:
        """Least sum of squares."""
        return float(self.residual @ self.residual)


def fit_nuisances(
    found: ScanComparison,
    misfit: ContourMisfit,
    nuisances: NuisanceSlopes,
    sensors: SensorArray | None = None,
    priors: Priors | None = None,
) -> ProfiledFit:
    """Fit the nuisances at a stiffness by linear least squares.

    Parameters
    ----------
    found
        Comparison with the scan there.
    misfit, nuisances
        Whitening, and derivatives by the nuisances.
    sensors
        Sensors under the stocking.
    priors
        Priors of the stiffnesses (MPa); none by default.
    """
    parameters, priors = found.parameters, priors or stiffness_priors()
    slopes, sd = nuisances.at(parameters), nuisances.sd
    sensor_slopes: FloatArray = np.zeros((0, len(sd)))
    if sensors is not None:
        sensor_slopes = nuisances.of_sensors(parameters) / sensors.sd[:, None]
    basis = np.vstack([misfit.whitened(slopes), sensor_slopes, np.zeros((len(priors), len(sd))), np.diag(1 / sd)])
    orthonormal, triangle = np.linalg.qr(basis)
    white = misfit.whitened(found.distances)
    beside = np.concatenate([found.sensors, priors.residual(parameters)])
    right = np.concatenate([white, beside, np.zeros(len(sd))])
    nuisance = -solve_triangular(triangle, orthonormal.T @ right)
    by_stiffness = found.slopes.copy()
    for number in range(len(PARAMETERS)):
        ahead, behind = (nuisances.at(parameters * np.exp(sign * STEP * np.eye(2)[number])) for sign in (1, -1))
        by_stiffness[:, number] += (ahead - behind) @ nuisance / (2 * STEP)
    rows = np.zeros((len(right), 2))
    rows[: len(white)] = misfit.whitened(by_stiffness)
    by_prior = priors.jacobian(parameters) * parameters
    rows[len(white) : len(white) + len(beside)] = np.vstack([found.sensor_slopes, by_prior])
    tension = None
    if nuisances.of_tension:
        every = np.hstack([rows, basis])
        picked = [0, 1, every.shape[1] - 1]
        tension = Tension(float(nuisance[-1]), np.linalg.pinv(every.T @ every)[np.ix_(picked, picked)])
    residual = right + basis @ nuisance
    shown = [*range(RIGID + SECTORS), *([len(sd) - 1] if nuisances.of_tension else [])]
    return ProfiledFit(
        found,
        nuisance,
        found.distances + slopes[:, shown] @ nuisance[shown],
        residual[len(white) : len(white) + len(found.sensors)],
        residual,
        rows - orthonormal @ (orthonormal.T @ rows),
        tension,
    )
