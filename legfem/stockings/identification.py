"""Identification of fat and muscle from the contours of a leg with and without its stocking, and its pressures.

Two searches. The paper's is Nelder-Mead on the sum of squared distances. The other minimises the
distances weighted with their errors, those of the bare outlines included (as in total least
squares), by damped Gauss-Newton steps (`legfem.inverse.least_squares`) with the exact derivatives
of the finite-element model and its stocking: it takes a fraction of the solves and yields
intervals.

Legs that are pressed and specimens are searched on an emulator, with errors whose covariance stays
as it is near the optimum (`legfem.inverse.problem`). Here every equilibrium starts from the one
before, and what the errors of the bare outlines do follows the stiffness: the covariance is another
at each, so that its change enters the steps. What was found is the same `legfem.inverse.fit.Fit`.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.optimize import minimize

from legfem.common.progress import Progress
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.slices import SliceSet
from legfem.inverse.least_squares import GaussNewtonSettings, damped_gauss_newton
from legfem.inverse.parameter import Domain, Priors
from legfem.meshing.leg_sizes import SolidMeshSettings, settings_for_cells
from legfem.stockings import scan_fit
from legfem.stockings.assessment import assessed
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.discrepancy import model_discrepancy
from legfem.stockings.equilibrium import PARAMETERS, SURFACES, Equilibrium, EquilibriumSolver, LegModel3D
from legfem.stockings.estimates import Method, MisfitEmulator, StiffnessFit, profile_intervals
from legfem.stockings.fabric import stocking_load
from legfem.stockings.leg import SensorArray, StockingLeg
from legfem.stockings.nuisances import NuisanceSlopes
from legfem.stockings.pressures import (
    PressureProbe,
    fat_pressures,
    section_pressures,
    tissue_pressures,
    vein_pressure_sd,
)

START = kpa_to_mpa(np.array([3.0, 3.0]))
"""C10 of muscle and fat at the start of the paper's search (MPa)."""
SAMPLED_AT = kpa_to_mpa(np.array([[3.0, 3.0], [1.5, 12.0], [6.0, 1.5]]))
"""C10 of muscle and fat (MPa) at which the leg's response to the nuisances is computed."""
type OnSolve = Callable[[str], None]


@dataclass(frozen=True)
class SearchSettings:
    """Starts and stopping criteria of both searches.

    Parameters
    ----------
    starts_kPa : tuple of (float, float)
        C10 of muscle and fat from which the weighted search begins, each in turn.
    tolerance : float
        Relative change of the parameters at which a weighted search ends.
    least_gain : float
        Decrease of the sum of weighted squares below which it ends, too; a 95 % interval reaches to
        an increase of 3.84.
    max_steps : int
        Equilibria of one start at most.
    simplex_tolerance : float
        Relative size of Nelder-Mead's last simplex.
    max_evaluations : int
        Equilibria of Nelder-Mead at most.
    """

    starts_kPa: tuple[tuple[float, float], ...] = ((3.0, 3.0), (1.5, 12.0), (6.0, 1.5))
    tolerance: float = 1e-2
    least_gain: float = 0.1
    max_steps: int = 15
    simplex_tolerance: float = 1e-2
    max_evaluations: int = 120


class StiffnessSearch:
    """Both searches on one leg, which share the equilibria they solved for.

    Parameters
    ----------
    solver
        Of the leg and its stocking.
    misfit
        The scanned contours.
    settings
        Starts and stopping criteria.
    on_solve
        Called with a line of text after every equilibrium.
    sensors
        Sensors under the stocking, whose pressures are data of the weighted search.
    priors
        Priors of the stiffnesses (MPa) in the weighted search.

    Attributes
    ----------
    nuisances : NuisanceSlopes
        Derivatives of the misfit by the nuisances.
    """

    def __init__(
        self,
        solver: EquilibriumSolver,
        misfit: ContourMisfit,
        settings: SearchSettings | None = None,
        on_solve: OnSolve | None = None,
        sensors: SensorArray | None = None,
        priors: Priors | None = None,
    ) -> None:
        self._priors = priors or scan_fit.stiffness_priors()
        self._box = Domain(self._priors.parameters)
        self._solver, self._misfit, self._sensors = solver, misfit, sensors
        self._settings = settings or SearchSettings()
        self._on_solve = on_solve
        self._last: Equilibrium | None = None
        self._sampled: dict[tuple[float, ...], Equilibrium] = {}
        self.nuisances = NuisanceSlopes(solver, misfit, sensors)
        self._compared: list[scan_fit.ScanComparison] = []

    def nelder_mead(self) -> StiffnessFit:
        """Search as the paper does, from 3 kPa in both tissues."""
        before = self._solver.states
        best = self._solve(START)
        if not best.state.report.complete:
            return self._failed("nelder-mead", START, before, best)
        scale = least = self._misfit.cost(self._misfit.distances(best.shape))
        found = START

        def cost(log_parameters: FloatArray) -> float:
            nonlocal best, least, found
            parameters = np.exp(log_parameters)
            if not (parameters > scan_fit.BOUNDS[0]).all() or not (parameters < scan_fit.BOUNDS[1]).all():
                return np.inf
            here = self._solve(parameters)
            if not here.state.report.complete:
                return np.inf
            value = self._misfit.cost(self._misfit.distances(here.shape))
            if value < least:
                best, least, found = here, value, parameters
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
        distances, solves = self._misfit.distances(best.shape), self._solver.states - before
        return StiffnessFit(
            "nelder-mead", found, START, bool(done.success), solves, least / scale, distances, best, objective=np.nan
        )

    def weighted(self) -> tuple[StiffnessFit, ...]:
        """Search from every start; the best first."""
        if not self.nuisances.samples:
            for parameters in SAMPLED_AT:
                found = self._solve(parameters, differentiate=True)
                if found.state.report.complete:
                    self.nuisances.sample(parameters, found)
                    self._sampled[tuple(parameters)] = found
        fits = [self._from(kpa_to_mpa(np.array(start))) for start in self._settings.starts_kPa]
        best, *others = sorted(fits, key=lambda fit: fit.chi_square)
        return (self._with_profile(best), *others)

    def _with_profile(self, best: StiffnessFit) -> StiffnessFit:
        """Add intervals by profile likelihood to a search that converged."""
        if not best.converged or best.log_covariance is None:
            return best
        sensor_sd = np.zeros(0) if self._sensors is None else self._sensors.sd

        def emulate() -> MisfitEmulator:
            return MisfitEmulator(self._compared, self._misfit, self.nuisances, sensor_sd, self._priors)

        def compare(parameters: FloatArray) -> scan_fit.ScanComparison | None:
            found = self._solve(parameters, differentiate=True)
            return self._compare(parameters, found) if found.state.report.complete else None

        intervals = profile_intervals(best.parameters, best.log_covariance, scan_fit.BOUNDS, emulate, compare)
        return replace(best, profile95=intervals)

    def _from(self, start: FloatArray) -> StiffnessFit:
        """Minimise the sum of squares that the best nuisances leave, in logarithms of the stiffnesses."""
        before, settings = self._solver.states, self._settings
        sampled = self._sampled.get(tuple(start))
        if sampled is None:
            first = self._solve(start, differentiate=True)
        else:
            first = self._solver.restore(sampled, scan_fit.by_name(start))
        if not first.state.report.complete or not self.nuisances.samples:
            return self._failed("weighted", start, before, first)

        def evaluate(logs: FloatArray) -> scan_fit.ProfiledFit | None:
            parameters = self._box.inside(np.exp(logs))
            found = self._solve(parameters, differentiate=True)
            return self._profile(parameters, found) if found.state.report.complete else None

        bounds = np.tile(np.log(scan_fit.BOUNDS), (len(start), 1))
        stop = GaussNewtonSettings(settings.tolerance, settings.least_gain, settings.max_steps, longest=1.0)
        _, best, converged = damped_gauss_newton(evaluate, np.log(start), self._profile(start, first), bounds, stop)
        return StiffnessFit(
            "weighted",
            best.at.parameters,
            start,
            converged,
            self._solver.states - before,
            self._misfit.cost(best.at.distances),
            best.moved,
            best.at.equilibrium,
            best.sensed,
            best.objective,
            len(best.residual) - len(best.nuisance),
            best.nuisance,
            best.tension,
            np.linalg.pinv(best.jacobian.T @ best.jacobian),
        )

    def _profile(self, parameters: FloatArray, equilibrium: Equilibrium) -> scan_fit.ProfiledFit:
        found = self._compare(parameters, equilibrium)
        return scan_fit.fit_nuisances(found, self._misfit, self.nuisances, self._sensors, self._priors)

    def _compare(self, parameters: FloatArray, equilibrium: Equilibrium) -> scan_fit.ScanComparison:
        found = scan_fit.compare_with_scan(self._solver, self._misfit, parameters, equilibrium, self._sensors)
        self._compared.append(found)
        return found

    def _failed(self, method: Method, start: FloatArray, before: int, found: Equilibrium) -> StiffnessFit:
        return StiffnessFit(method, start, start, False, self._solver.states - before, np.inf, np.zeros(0), found)

    def _solve(self, parameters: FloatArray, differentiate: bool = False) -> Equilibrium:
        found = self._solver.solve(scan_fit.by_name(parameters), PARAMETERS if differentiate else (), self._last)
        complete = found.state.report.complete
        if self._on_solve is not None:
            muscle, fat = mpa_to_kpa(parameters)
            states = f"in equilibrium after {len(found.changes)} states"
            ended = states if complete else f"no state found; {found.state.report}"
            self._on_solve(f"muscle {muscle:.3g} kPa, fat {fat:.3g} kPa: {ended}")
        if complete:
            self._last = found
        return found


@dataclass(frozen=True)
class StockingSettings:
    """Settings of a run.

    Parameters
    ----------
    cells : int
        Approximate number of tetrahedra.
    nelder_mead : bool
        Whether to search as the paper does, too; its optimum is not unique.
    search : SearchSettings
        Starts and stopping criteria of the searches.
    """

    cells: int = 15_000
    nelder_mead: bool = False
    search: SearchSettings = field(default_factory=SearchSettings)


def identify_in_stocking(
    leg: StockingLeg,
    settings: StockingSettings,
    progress: Progress,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    mesh: SolidMeshSettings | None = None,
    folder: Path | None = None,
) -> StockingFit:
    """Mesh a leg, identify its tissues if it was scanned in its stocking, and compute its pressures.

    Parameters
    ----------
    leg, settings, progress
        What is run, how, and where it is told.
    comm
        Ranks that share one solution; all call.
    mesh
        Element sizes; from ``settings.cells`` by default.
    folder
        Where equilibria are stored, so that the same run goes on where it was stopped.
    """
    started = time.perf_counter()
    progress.stage("mesh")
    mesh = mesh or settings_for_cells(leg.bare, settings.cells)
    model = LegModel3D(leg.bare, leg.tissues, mesh, CompressionSettings(ends=leg.ends), comm)
    progress.advance(f"{model.compression.spaces.unknowns} unknowns")
    solver = EquilibriumSolver(model, leg.stocking, folder=folder)
    sensors = SensorArray.on(leg.bare, leg.sensors)
    searches: tuple[StiffnessFit, ...] = ()
    load = misfit = discrepancy = None
    if leg.compressed is not None:
        load = stocking_load(leg.compressed, leg.stocking)
        misfit = ContourMisfit.between(
            SliceSet.of(leg.compressed, leg.slices), leg.accuracy, leg.scanned_bare, leg.bare
        )
        used = sensors if leg.sensors else None
        priors = scan_fit.stiffness_priors(leg.elastography)
        search = StiffnessSearch(solver, misfit, settings.search, progress.advance, used, priors)
        progress.stage("identification, weighted")
        searches = search.weighted()
        if settings.nelder_mead:
            progress.stage("identification, Nelder-Mead")
            searches = (*searches, search.nelder_mead())
        if searches[0].equilibrium.state.report.complete:
            progress.stage("where model and scan differ")
            discrepancy = model_discrepancy(solver, misfit, search.nuisances, searches[0])
            progress.advance(discrepancy.verdict)
    identified = searches[0] if searches and not leg.known else None
    if identified is None:
        parameters = {f"{name}.C10": float(law.C10) for name, law in leg.tissues.items()}
        # The stiffness counts as exact, the fabric's tension as well as it is stated.
        tension = None
        covariance: FloatArray | None = np.diag([0.0, 0.0, leg.accuracy.tension_sd**2])
    else:
        parameters, tension = scan_fit.by_name(identified.parameters), identified.tension
        covariance = identified.log_covariance if tension is None else tension.log_covariance
    progress.stage("the leg in equilibrium with its stocking")
    error = 0.0 if tension is None else tension.value
    start = searches[0].equilibrium if searches and searches[0].equilibrium.state.report.complete else None
    found = solver.solve(parameters, start=start, error=error)
    progress.advance(f"{len(found.changes)} states")
    borne = replace(found, load=found.load.times(1 + error))
    moved = pressures = section = fat = None
    if found.state.report.complete:
        probe = PressureProbe(model.compression)
        pressures = tissue_pressures(probe, found.state, borne.load, leg.veins)
        sd = vein_pressure_sd(solver, found, probe, leg.veins, parameters, covariance, leg.accuracy.pressure_sd, error)
        pressures = replace(pressures, at_veins_sd=tuple(map(float, sd)))
        progress.advance("errors of the pressures at the veins")
        section = section_pressures(leg.bare, float(np.median(leg.slices)), borne, probe)
        fat = fat_pressures(leg.bare, borne, probe)
        moved = {part: model.displacement(part, found.state.unknown) for part in SURFACES}
    details = StockingDetails(
        leg,
        model,
        load,
        misfit,
        searches,
        discrepancy,
        parameters,
        borne,
        moved,
        pressures,
        section,
        fat,
        sensors.compared(borne.load.pressure),
        solver.states,
    )
    return assessed(details, asdict(settings), time.perf_counter() - started)
