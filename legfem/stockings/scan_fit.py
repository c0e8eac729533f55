r"""Both scans of a leg beside its model: distances of the contours and readings of the sensors, nuisances fitted.

The model (`StockingForward`) takes stiffnesses, and gives skin, hull and pressure in equilibrium.

With :math:`w` the whitened distances and the sensors' differences, :math:`N` their derivatives by the nuisances
:math:`u` and :math:`P` the square root of the priors' precision, :math:`u(\theta)` minimises
:math:`|w + N u|^2 + |P u|^2`, and the minimum depends on the stiffness :math:`\theta` alone
(variable projection: G. H. Golub, V. Pereyra, Inverse Problems 19 (2003) R1; derivative after
L. Kaufman). What is left, :math:`w + N u` and :math:`P u`, are the readings that a search compares with zero.
:math:`N` changes with the stiffness, and that enters the derivative: without it noise
would draw the stiffness towards where the contours are least sensitive to the nuisances.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.motion import displaced
from legfem.inverse.catalogue import Values
from legfem.inverse.comparison import Comparison, Prediction
from legfem.inverse.elastography import ShearModulus, elastography_priors
from legfem.inverse.outcome import Key, Outcome, StateField, key_of_values
from legfem.inverse.parameter import Parameter, Priors
from legfem.inverse.searches import Found
from legfem.inverse.trial import Trial
from legfem.jobs.store import key_of
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.equilibrium import (
    PARAMETERS,
    PROBE_STEP,
    SURFACES,
    Equilibrium,
    EquilibriumSolver,
    LinearisedCoupling,
)
from legfem.stockings.leg import SensorArray
from legfem.stockings.nuisances import RIGID, SECTORS, NuisanceSlopes

PRESSURE = "pressure"
"""Name of the field of the stocking's pressure (MPa), (n_levels, n_points)."""


@dataclass(eq=False)
class StockingForward:
    """A leg and its stocking, a `legfem.inverse.outcome.Forward`.

    An outcome's fields are the displacements (mm) of the points of skin and hull, (n_levels, n_points, 3), and the
    stocking's pressure, with their derivatives in equilibrium.

    Parameters
    ----------
    solver
        Of the leg; one process and its ranks have it.
    """

    solver: EquilibriumSolver
    equilibria: dict[Key, Equilibrium] = field(default_factory=dict, init=False)
    """Those that were found, by the values asked for."""

    @property
    def nominal(self) -> Values:
        """Stiffness and compressibility of both tissues as assumed (MPa, 1/MPa)."""
        tissues = self.solver.model.tissues
        return {f"{name}.{of}": value for name, law in tissues.items() for of, value in law.parameters.items()}

    def prepare(self) -> None:
        """Mesh and compile now."""
        _ = self.solver.model.compression

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Find the equilibrium, from the nearest one that is known; the model is left in it."""
        started = time.perf_counter()
        found = self.solver.solve(values, sensitivities, self._nearest(values))
        model, report = self.solver.model, found.state.report
        fields = {}
        if report.complete:
            self.equilibria[key_of_values(values)] = found
            coupling = LinearisedCoupling(self.solver, found)
            rates = {name: coupling.rate(found.state.sensitivities[name]) for name in sensitivities}
            for part in SURFACES:
                by = {name: model.displacement(part, rate) for name, rate in rates.items()}
                fields[part] = StateField(model.displacement(part, found.state.unknown), by)
            by = {name: coupling.pressure_rate(rate) for name, rate in rates.items()}
            fields[PRESSURE] = StateField(found.load.pressure, by)
        seconds = time.perf_counter() - started
        return Outcome(values, (), bool(report.complete), report.reason, 0, seconds, fields=fields)

    def at(self, values: Values) -> Equilibrium:
        """Return the equilibrium that was found at values."""
        return self.equilibria[key_of_values(values)]

    def _nearest(self, values: Values) -> Equilibrium | None:
        """Return the known equilibrium whose stiffnesses differ least, by their logarithms."""

        def apart(key: Key) -> float:
            return sum(abs(np.log(values[name] / value)) for name, value in key if value > 0 and values.get(name))

        return self.equilibria[min(self.equilibria, key=apart)] if self.equilibria else None

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what a solve depends on."""
        model = self.solver.model
        given = key_of(model.shape, model.tissues, model.mesh, model.settings, self.solver.stocking)
        return {"model": "leg in a stocking", "given": given}


BOUNDS = (kpa_to_mpa(0.1), kpa_to_mpa(100.0))
"""Bounds of both stiffnesses in a search (MPa)."""
MISSED_BEYOND = 1.5
"""Root-mean-square distance, over that which errors of the outlines make, beyond which the model
misses the scan, so that its intervals don't hold."""
STEP = 0.01
"""Step in log parameters of the finite differences of the nuisances' derivatives."""


def stiffness_priors(moduli: Iterable[ShearModulus] = ()) -> Priors:
    """Return the parameters of a search (MPa), with priors where shear waves were measured."""
    known = elastography_priors(moduli)
    return Priors(tuple(Parameter(name, "MPa", BOUNDS, known.get(name), scale="log") for name in PARAMETERS))


def by_name(parameters: FloatArray) -> dict[str, float]:
    """Return C10 of muscle and fat (MPa) by full name."""
    return dict(zip(PARAMETERS, map(float, parameters), strict=True))


def shape_of(outcome: Outcome, bare: LegShape) -> LegShape:
    """Return the shape of a leg in a state."""
    return displaced(bare, {part: outcome.fields[part].values for part in SURFACES})


def distances_of(outcome: Outcome, bare: LegShape, misfit: ContourMisfit) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the distances (n,) of a state of a leg from its scan (mm), and their derivatives (n,) by parameters."""
    fields, distances = outcome.fields, misfit.distances(shape_of(outcome, bare))
    by = {}
    for name, rate in fields[SKIN].sensitivities.items():
        step = PROBE_STEP / max(float(np.abs(rate).max()), 1e-12)
        ahead = {part: fields[part].values + step * fields[part].sensitivities[name] for part in SURFACES}
        by[name] = (misfit.distances(displaced(bare, ahead)) - distances) / step
    return distances, by


@dataclass(frozen=True)
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


@dataclass(frozen=True, eq=False)
class NuisanceFit:
    """Least squares over the nuisances, at one stiffness.

    Parameters
    ----------
    differences : (m + s,) array
        Whitened distances, then pressures at the sensors less readings over their standard deviations.
    basis : (m + s + k, k) array
        Derivatives of these and of the nuisances over their priors' standard deviations, by the nuisances.
    """

    differences: FloatArray
    basis: FloatArray

    @property
    def slopes(self) -> FloatArray:
        """Derivatives of the differences (m + s, k)."""
        return self.basis[: len(self.differences)]

    @cached_property
    def _factors(self) -> tuple[FloatArray, FloatArray]:
        orthonormal, triangle = np.linalg.qr(self.basis)
        return orthonormal, triangle

    @property
    def nuisance(self) -> FloatArray:
        """Best nuisances (k,), see `legfem.stockings.nuisances`."""
        return self.following(self.differences)

    def following(self, values: FloatArray) -> FloatArray:
        """Return the best nuisances (k, ...) of differences (m + s, ...), or of derivatives of these."""
        orthonormal, triangle = self._factors
        return -solve_triangular(triangle, orthonormal[: len(values)].T @ values)

    @property
    def left(self) -> FloatArray:
        """What is left of the differences, and the nuisances, in standard deviations, (m + s + k,)."""
        return self.projected(self.differences)

    def projected(self, values: FloatArray) -> FloatArray:
        """Return differences or derivatives (m + s, ...) less what the nuisances explain, (m + s + k, ...)."""
        orthonormal, count = self._factors[0], len(self.differences)
        found = -orthonormal @ (orthonormal[:count].T @ values)
        found[:count] += values
        return found


@dataclass(frozen=True, eq=False)
class ScanComparison(Comparison):
    """A leg's contours and sensors beside its model: readings that a right one brings to zero but for their errors.

    Parameters
    ----------
    bare
        The modelled leg.
    misfit, nuisances
        Distances from the scanned contours, and the derivatives by what isn't known.
    sensors
        Under the stocking; there may be none.
    nuisances_sd : (k,) array, optional
        Standard deviations of the nuisances' priors, where they aren't those that are known.
    """

    bare: LegShape
    misfit: ContourMisfit
    nuisances: NuisanceSlopes
    sensors: SensorArray
    nuisances_sd: FloatArray | None = None
    reach = "an equilibrium with the stocking"

    @property
    def of_contours(self) -> "ScanComparison":
        """The same without sensors."""
        sensors = SensorArray.on(self.bare, ())
        return replace(self, sensors=sensors, nuisances=self.nuisances.without_sensors())

    @cached_property
    def _white(self) -> NuisanceSlopes:
        return self.nuisances.mapped(self.misfit.whitened)

    @cached_property
    def _size(self) -> int:
        """Number m + s of differences."""
        return len(self._slopes(np.full(len(PARAMETERS), BOUNDS[1])))

    @cached_property
    def measured(self) -> FloatArray:
        """Zeros, (m + s + k,)."""
        return np.zeros(self._size + len(self.nuisances.sd))

    @cached_property
    def covariance(self) -> FloatArray:
        """Identity: the readings are in standard deviations."""
        return np.eye(len(self))

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return the values: they are in standard deviations."""
        return values

    @property
    def linear_scale(self) -> FloatArray:
        """Model values may have either sign, and are in standard deviations."""
        return np.ones(self._size + len(PARAMETERS))

    def differences(self, outcome: Outcome) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return whitened distances and sensors' differences, (m + s,), and their derivatives by parameters."""

        def read(distances: FloatArray, sensed: FloatArray) -> FloatArray:
            return np.concatenate([self.misfit.whitened(distances), sensed / self.sensors.sd])

        pressure, averages = outcome.fields[PRESSURE], self.sensors.averages
        distances, by = distances_of(outcome, self.bare, self.misfit)
        slopes = {name: read(rate, averages(pressure.sensitivities[name])) for name, rate in by.items()}
        return read(distances, averages(pressure.values) - self.sensors.measured), slopes

    def fit_nuisances(self, differences: FloatArray, parameters: FloatArray) -> NuisanceFit:
        """Fit the nuisances to differences (m + s,) at C10 of muscle and fat (MPa)."""
        sd = self.nuisances.sd if self.nuisances_sd is None else self.nuisances_sd
        return NuisanceFit(differences, np.vstack([self._slopes(parameters), np.diag(1 / sd)]))

    def unexplained(self, distances: FloatArray, nuisance: FloatArray, parameters: FloatArray) -> FloatArray:
        """Return distances (n,) less what rigid motions and errors of the pressure explain, mm."""
        known = self.nuisances
        shown = [*range(RIGID + SECTORS), *([len(nuisance) - 1] if known.of_tension else [])]
        return np.asarray(distances + known.at(parameters)[:, shown] @ nuisance[shown])

    def left(self, trial: Trial) -> FloatArray:
        """Return the distances (n,) of a full solve less what rigid motions and errors of the pressure explain, mm."""
        assert trial.prediction is not None
        stiffness = trial.point[: len(PARAMETERS)]
        fitted = self.fit_nuisances(trial.prediction.model_values[: -len(PARAMETERS)], stiffness)
        distances = self.misfit.distances(shape_of(trial.outcome, self.bare))
        return self.unexplained(distances, fitted.nuisance, stiffness)

    def with_nuisances(self, slopes: Mapping[str, FloatArray], fitted: NuisanceFit, values: Values) -> FloatArray:
        """Return the derivatives (m + s, p) by parameters, per unit of each, the nuisances held at their best."""
        parameters, columns = np.array([values[name] for name in PARAMETERS]), dict(slopes)
        for number, name in enumerate(PARAMETERS):
            step = STEP * np.eye(len(PARAMETERS))[number]
            ahead, behind = (self._slopes(parameters * np.exp(sign * step)) for sign in (1, -1))
            columns[name] = slopes[name] + (ahead - behind) @ fitted.nuisance / (2 * STEP * parameters[number])
        return np.stack(list(columns.values()), axis=1)

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        """Read an equilibrium; the stiffness is among the model's values, since the nuisances' effects follow it."""
        parameters = np.array([outcome.values[name] for name in PARAMETERS])
        differences, by = self.differences(outcome)
        fitted = self.fit_nuisances(differences, parameters)
        slopes = fitted.projected(self.with_nuisances(by, fitted, outcome.values))
        logs = {name: np.equal(PARAMETERS, name) / parameters for name in by}
        rates = {name: np.concatenate([rate, logs[name]]) for name, rate in by.items()}
        values = np.concatenate([differences, np.log(parameters)])
        return Prediction(fitted.left, dict(zip(by, slopes.T, strict=True)), values, rates)

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return what nuisances leave of differences (..., m + s) that are followed by the stiffnesses' logarithms."""
        flat = model_values.reshape(-1, model_values.shape[-1])
        count = len(PARAMETERS)
        every = [self.fit_nuisances(one[:-count], np.exp(one[-count:])).left for one in flat]
        return np.reshape(every, (*model_values.shape[:-1], len(self)))

    def _slopes(self, parameters: FloatArray) -> FloatArray:
        """Return the derivatives (m + s, k) of the differences by the nuisances at C10 of muscle and fat (MPa)."""
        sensed = self.nuisances.of_sensors(parameters) / self.sensors.sd[:, None]
        return np.vstack([self._white.at(parameters), sensed])


@dataclass(frozen=True, eq=False)
class ScanFit:
    """What is beside the estimates of the best fit of both scans: its nuisances, and what is left.

    Parameters
    ----------
    stiffness : dict of str to float
        C10 of muscle and fat by full name, MPa.
    misfit : ContourMisfit
        The contours of the scan in the stocking.
    shape : LegShape
        The leg in its stocking at that stiffness.
    nuisance : (k,) array
        Best nuisances, see `legfem.stockings.nuisances`.
    distances : (n,) array
        Distances outside the scan (mm), less what rigid motions and errors of the pressure explain.
    sensed : (s,) array
        Model's pressures less the sensors' readings, over their standard deviations, likewise.
    weighted_misfit : float
        Least sum of squares over the number of readings and priors: 1 where errors are as large as assumed.
    log_covariance : (2, 2) array
        Covariance of the stiffnesses' logarithms.
    tension : Tension, optional
        Error of the fabric's tension; None where it is taken as given.
    """

    stiffness: Values
    misfit: ContourMisfit
    shape: LegShape
    nuisance: FloatArray
    distances: FloatArray
    sensed: FloatArray
    weighted_misfit: float
    log_covariance: FloatArray
    tension: Tension | None = None

    @classmethod
    def of(cls, found: Found[ScanComparison]) -> "ScanFit":
        """Fit the nuisances where a finished search ended."""
        comparison, best, linear = found.search.misfit, found.best, found.linear
        differences = linear.prediction.model_values[: -len(PARAMETERS)]
        fitted = comparison.fit_nuisances(differences, best.point)
        log_covariance = linear.errors(comparison.covariance) / np.outer(best.point, best.point)
        tension = None
        if comparison.nuisances.of_tension:
            by = {name: rate[: len(differences)] for name, rate in linear.prediction.model_sensitivities.items()}
            # By how much the tension follows the logarithms of the stiffnesses, and its variance at fixed ones.
            follows = fitted.following(comparison.with_nuisances(by, fitted, best.values) * best.point)[-1]
            alone = np.linalg.inv(fitted.basis.T @ fitted.basis)[-1, -1]
            both = np.vstack([np.eye(len(PARAMETERS)), follows])
            covariance = both @ log_covariance @ both.T
            covariance[-1, -1] += alone
            tension = Tension(float(fitted.nuisance[-1]), covariance)
        return cls(
            by_name(best.point),
            comparison.misfit,
            shape_of(best.outcome, comparison.bare),
            fitted.nuisance,
            comparison.left(best),
            fitted.left[len(differences) - len(comparison.sensors) : len(differences)],
            best.objective / (len(differences) + len(found.search.law.priors)),
            log_covariance,
            tension,
        )

    @property
    def rms(self) -> float:
        """Root-mean-square distance from the scan, mm."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def misses(self) -> bool:
        """Whether the leg is farther from the scan than errors of the contours explain."""
        return not self.rms <= MISSED_BEYOND * self.misfit.accuracy.expected_rms

    @property
    def rigid(self) -> FloatArray:
        """Motion between the scans beyond their registration: three shifts (mm), three turns (rad)."""
        return self.nuisance[:RIGID]
