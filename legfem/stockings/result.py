"""One run: a leg meshed, its tissues identified from both scans, its pressures in the stocking computed."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.slices import SliceSet
from legfem.meshing.solid_leg import SolidMeshSettings, settings_for_cells
from legfem.stockings.discrepancy import ModelDiscrepancy, model_discrepancy
from legfem.stockings.equilibrium import Equilibrium, EquilibriumSolver
from legfem.stockings.estimates import StiffnessEstimate, StiffnessFit, stiffness_estimates
from legfem.stockings.fabric import StockingLoad, stocking_load
from legfem.stockings.leg import ComparedSensor, SensorArray, StockingLeg
from legfem.stockings.leg_model import LegModel3D
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.pressures import PressureProbe, TissuePressures, tissue_pressures, vein_pressure_sd
from legfem.stockings.scan_fit import by_name, stiffness_priors
from legfem.stockings.search import SearchSettings, StiffnessSearch


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


@dataclass(frozen=True, eq=False)
class StockingResult:
    """Everything a run found.

    Parameters
    ----------
    leg, model
        What was given, and its finite-element model.
    scan_load : StockingLoad, optional
        Load by Laplace's law on the scanned shape; None without a scan in the stocking.
    misfit : ContourMisfit, optional
        The contours of that scan.
    searches : tuple of StiffnessFit
        Weighted searches, the best first, then Nelder-Mead's if it was asked for.
    discrepancy : ModelDiscrepancy, optional
        Tests of what the best fit leaves; None where no equilibrium was found.
    parameters : dict of str to float
        C10 by full name that the equilibrium has, MPa: identified, or given.
    equilibrium : Equilibrium
        Leg and stocking at these; its load includes the fitted error of the fabric's tension.
    pressures : TissuePressures, optional
        Pressures in that equilibrium; None if it was not found.
    sensors : tuple of ComparedSensor
        Sensors beside that equilibrium.
    states : int
        Finite-element solutions.
    wall_s : float
        Duration, s.
    """

    leg: StockingLeg
    model: LegModel3D
    scan_load: StockingLoad | None
    misfit: ContourMisfit | None
    searches: tuple[StiffnessFit, ...]
    discrepancy: ModelDiscrepancy | None
    parameters: dict[str, float]
    equilibrium: Equilibrium
    pressures: TissuePressures | None
    sensors: tuple[ComparedSensor, ...]
    states: int
    wall_s: float

    @property
    def weighted(self) -> tuple[StiffnessFit, ...]:
        """Weighted searches, the best first."""
        return tuple(search for search in self.searches if search.method == "weighted")

    @property
    def best(self) -> StiffnessFit | None:
        """Best weighted search, if its equilibrium was found."""
        best = next(iter(self.weighted), None)
        return best if best is not None and best.equilibrium.state.report.complete else None

    @property
    def estimates(self) -> tuple[StiffnessEstimate, ...]:
        """Estimates of the best search; none without it."""
        return () if self.best is None else stiffness_estimates(self.best, self.leg.accuracy)

    @property
    def tetrahedra(self) -> int:
        """Number of tetrahedra of the mesh, on all ranks."""
        mesh = self.model.compression.spaces.mesh
        return int(mesh.topology.index_map(mesh.topology.dim).size_global)


def run_leg(
    leg: StockingLeg,
    settings: StockingSettings,
    progress: Progress,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    mesh: SolidMeshSettings | None = None,
    folder: Path | None = None,
) -> StockingResult:
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
        priors = stiffness_priors(leg.elastography)
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
        parameters, tension = by_name(identified.parameters), identified.tension
        covariance = identified.log_covariance if tension is None else tension.log_covariance
    progress.stage("the leg in equilibrium with its stocking")
    error = 0.0 if tension is None else tension.value
    start = searches[0].equilibrium if searches and searches[0].equilibrium.state.report.complete else None
    found = solver.solve(parameters, start=start, error=error)
    progress.advance(f"{len(found.changes)} states")
    borne, pressures = found.load.times(1 + error), None
    if found.state.report.complete:
        probe = PressureProbe(model.compression)
        pressures = tissue_pressures(probe, found.state, borne, leg.veins)
        sd = vein_pressure_sd(solver, found, probe, leg.veins, parameters, covariance, leg.accuracy.pressure_sd, error)
        pressures = replace(pressures, at_veins_sd=tuple(map(float, sd)))
        progress.advance("errors of the pressures at the veins")
    return StockingResult(
        leg,
        model,
        load,
        misfit,
        searches,
        discrepancy,
        parameters,
        replace(found, load=borne),
        pressures,
        sensors.compared(borne.pressure),
        solver.states,
        time.perf_counter() - started,
    )
