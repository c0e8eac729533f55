"""Identification of fat and muscle from the contours of a leg with and without its stocking, and its pressures.

A `legfem.inverse.problem.Problem` like others: its test is the pair of scans, with what sensors read under the
stocking, and every full solve an equilibrium of leg and stocking.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.progress import Progress
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.slices import SliceSet
from legfem.inverse.catalogue import IdentifiedLaw, LawName
from legfem.inverse.intervals import SquaresProfile, quantile
from legfem.inverse.least_squares import Residual, least_residual
from legfem.inverse.outcome import FullSolver
from legfem.inverse.problem import fit_with, log_of, search_settings
from legfem.inverse.search import Search, SearchError
from legfem.inverse.searches import Found
from legfem.inverse.settings import Genetic, IdentificationSettings
from legfem.meshing.leg_sizes import SolidMeshSettings, settings_for_cells
from legfem.stockings.assessment import LAW, NO_SEARCH, assessed, compared
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.discrepancy import model_discrepancy
from legfem.stockings.equilibrium import PARAMETERS, SURFACES, EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import stocking_load
from legfem.stockings.forward import StockingForward
from legfem.stockings.leg import SensorArray, StockingLeg
from legfem.stockings.nuisances import NuisanceSlopes
from legfem.stockings.pressures import PressureProbe, tissue_pressures, vein_pressure_sd
from legfem.stockings.scan_fit import BOUNDS, ScanComparison, ScanFit, by_name, stiffness_priors

SAMPLED_AT = kpa_to_mpa(np.array([[3.0, 3.0], [1.5, 12.0], [6.0, 1.5]]))
"""C10 of muscle and fat (MPa) at which the leg's response to the nuisances is computed, and the search begins."""

SEARCH = IdentificationSettings(minimiser=Genetic(population=24, generations=30))
CELLS = 15_000
"""About how many tetrahedra a leg has."""


@dataclass(frozen=True, eq=False)
class ScanProblem:
    """Both scans of a leg, a `legfem.inverse.problem.Problem`.

    Parameters
    ----------
    leg
        That was scanned in its stocking.
    forward
        Its model.
    scans
        Both scans and the sensors beside the model.
    progress
        Where the work is told.
    """

    leg: StockingLeg
    forward: StockingForward
    scans: ScanComparison
    progress: Progress
    sensitivities: tuple[str, ...] = PARAMETERS
    weighs_shared_errors: bool = False

    @cached_property
    def unknowns(self) -> Mapping[LawName, IdentifiedLaw]:
        """Stiffness of muscle and fat, looked for from where the nuisances' effects are computed."""
        parameters, starts = stiffness_priors(self.leg.elastography).parameters, tuple(map(by_name, SAMPLED_AT))
        return {LAW: IdentifiedLaw(LAW, parameters, {}, self.forward.nominal, starts=starts)}

    def fitted(self, settings: IdentificationSettings) -> StockingFit:
        """Search, from where the nuisances' effects are computed.

        Raises
        ------
        SearchError
            If the leg can't be computed there.
        """
        with FullSolver(self.forward, None, 1, self.progress, PARAMETERS) as solver:
            self.progress.stage("effects of what isn't known exactly of scans and pressure")
            for parameters in SAMPLED_AT:
                (outcome,) = solver.solve([by_name(parameters)])
                if outcome.complete:
                    self.scans.nuisances.sample(parameters, self.forward.at(outcome.values))
            if not self.scans.nuisances.samples:
                raise SearchError(f"the leg in its stocking could not be computed ({outcome.reason})")
            (fit,) = fit_with(self, [LAW], solver, settings)
        return fit

    def comparison(self, law: IdentifiedLaw, near: Found[ScanComparison] | None = None) -> ScanComparison:
        """Both scans beside the model."""
        return self.scans

    def refined(self, search: Search[ScanComparison]) -> None:
        """Leave the comparison as it is: its weights follow the stiffness."""

    def assessed(self, found: Found[ScanComparison]) -> StockingFit:
        """Result of the finished search, with the leg in equilibrium with its stocking."""
        best = ScanFit.of(found)
        intervals = profile_intervals(found, best.log_covariance) if found.search.converged else []
        self.progress.stage("where model and scan differ")
        discrepancy = model_discrepancy(self.forward, self.scans, best)
        self.progress.advance(discrepancy.verdict)
        log = log_of(found)
        costs = [np.nan if one.prediction is None else np.sum(self.scans.left(one) ** 2) for one in found.trials]
        solves = tuple(replace(one, cost=float(cost)) for one, cost in zip(log.solves, costs, strict=True))
        # What is emulated are differences in standard deviations, and no forces.
        log = replace(log, solves=solves, emulator_error=np.nan)
        details = _dressed(self.leg, self.forward, self.progress, best)
        details = replace(details, best=best, discrepancy=discrepancy)
        return compared(assessed(details, log, search_settings(found.search)), best, found, intervals)


MOST = 6
"""Equilibria that are solved for intervals' ends at most."""
LEAST_WAY = 0.2
"""Distance in log stiffness beyond the nearest equilibrium that one more is worth."""


def profile_intervals(found: Found[ScanComparison], log_covariance: FloatArray) -> list[tuple[float, float]]:
    """Return 95 % intervals of the stiffnesses by profile likelihood, MPa; 0 and infinity where open.

    The profile of one stiffness is the least sum of squares with it held, over the other stiffness and the nuisances,
    between the equilibria that were solved (`legfem.inverse.emulator`). Where an end of an interval lies too far from
    all of them, one more is solved on the way there. An interval that reaches a bound of the search, or stiffnesses at
    which the leg can't be computed, is open.

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
        profiles = [SquaresProfile(residual, least, k, box, width) for k, width in enumerate(half)]
        ends = np.array([one.interval(times**2) for one in profiles])
        points = np.array([one.refitted(end) for one, own in zip(profiles, ends, strict=True) for end in own])
        nearest, share = search.trust.share_of_way(search.coordinates.of(np.exp(points)))
        way = share * np.linalg.norm(points - nearest, axis=1)
        if solved == MOST or (share >= 1.0).all() or way.max() < LEAST_WAY:
            break
        farthest = int(np.argmax(np.where(share < 1.0, way, 0.0)))
        search.solve(np.exp(nearest + share[:, None] * (points - nearest))[[farthest]], "design")
    known = (share >= 1.0).reshape(ends.shape) & (np.abs(ends - box) > 1e-9)
    return [(float(low), float(high)) for low, high in np.where(known, np.exp(ends), (0.0, np.inf))]


def identify_in_stocking(
    leg: StockingLeg,
    progress: Progress,
    cells: int = CELLS,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    mesh: SolidMeshSettings | None = None,
    folder: Path | None = None,
) -> StockingFit:
    """Mesh a leg, identify its tissues if it was scanned in its stocking, and compute its pressures.

    Parameters
    ----------
    leg, progress
        What is run, and where it is told.
    cells
        About how many tetrahedra.
    comm
        Ranks that share one solution; all call.
    mesh
        Element sizes; from ``cells`` by default.
    folder
        Where equilibria are stored, so that the same run goes on where it was stopped.
    """
    started = time.perf_counter()
    progress.stage("mesh")
    mesh = mesh or settings_for_cells(leg.bare, cells)
    model = LegModel3D(leg.bare, leg.tissues, mesh, CompressionSettings(ends=leg.ends), comm)
    progress.advance(f"{model.compression.spaces.unknowns} unknowns")
    forward = StockingForward(EquilibriumSolver(model, leg.stocking, folder=folder))
    fit = None
    problem = ""
    if leg.compressed is not None:
        target = SliceSet.of(leg.compressed, leg.slices)
        misfit = ContourMisfit.between(target, leg.accuracy, leg.scanned_bare, leg.bare)
        sensors = SensorArray.on(leg.bare, leg.sensors)
        scans = ScanComparison(leg.bare, misfit, NuisanceSlopes(forward.solver, misfit, sensors), sensors)
        try:
            fit = ScanProblem(leg, forward, scans, progress).fitted(SEARCH)
        except SearchError as error:
            problem = str(error)
    if fit is None:
        details = replace(_dressed(leg, forward, progress), problem=problem)
        fit = assessed(details, NO_SEARCH, {})
    log = replace(fit.log, wall_s=time.perf_counter() - started)
    return replace(fit, log=log, settings={"cells": cells, **fit.settings})


def _dressed(
    leg: StockingLeg, forward: StockingForward, progress: Progress, best: ScanFit | None = None
) -> StockingDetails:
    """Put a leg into equilibrium with its stocking at the stiffness that was found, or given, and probe it."""
    solver, tension = forward.solver, None
    model = solver.model
    if best is None or leg.known:
        parameters = {f"{name}.C10": float(law.C10) for name, law in leg.tissues.items()}
        # The stiffness counts as exact, the fabric's tension as well as it is stated.
        covariance: FloatArray = np.diag([0.0, 0.0, leg.accuracy.tension_sd**2])
    else:
        parameters, tension = dict(best.stiffness), best.tension
        covariance = best.log_covariance if tension is None else tension.log_covariance
    progress.stage("the leg in equilibrium with its stocking")
    error = 0.0 if tension is None else tension.value
    found = solver.solve(parameters, PARAMETERS, None if best is None else forward.at(best.stiffness), error)
    progress.advance(f"{len(found.changes)} states")
    borne = replace(found, load=found.load.times(1 + error))
    on_scan = None if leg.compressed is None else stocking_load(leg.compressed, leg.stocking)
    sensors = SensorArray.on(leg.bare, leg.sensors).compared(borne.load.pressure)
    details = StockingDetails(leg, model, on_scan, parameters, borne, sensors, solver.states)
    if not found.state.report.complete:
        return details
    probe = PressureProbe(model.compression)
    pressures = tissue_pressures(probe, found.state, borne.load, leg.veins)
    sd = vein_pressure_sd(solver, found, probe, leg.veins, parameters, covariance, leg.accuracy.pressure_sd, error)
    progress.advance("errors of the pressures at the veins")
    return replace(
        details,
        states=solver.states,
        moved={part: model.displacement(part, found.state.unknown) for part in SURFACES},
        pressures=replace(pressures, at_veins_sd=tuple(map(float, sd))),
        section=probe.section(leg.bare, float(np.median(leg.slices)), borne),
        fat=probe.fat(leg.bare, borne),
    )
