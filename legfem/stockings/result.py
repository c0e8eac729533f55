"""One run: a leg meshed, its tissues identified from both scans, its pressures in the stocking computed."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from mpi4py import MPI

from legfem.common.progress import Progress
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.slices import SliceSet
from legfem.meshing.solid_leg import SolidMeshSettings, settings_for_cells
from legfem.stockings.discrepancy import Mismatch, mismatch_of
from legfem.stockings.equilibrium import Worn, WornLeg
from legfem.stockings.fabric import StockingLoad, stocking_load
from legfem.stockings.leg import StockingLeg
from legfem.stockings.leg_model import PARAMETERS, LegModel3D
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.pressures import PressureProbe, TissuePressures, tissue_pressures, vein_pressure_sd
from legfem.stockings.scan_fit import stiffness_priors
from legfem.stockings.search import Identified, SearchSettings, StiffnessSearch
from legfem.stockings.sensors import ComparedSensor, Sensing


@dataclass(frozen=True)
class StockingSettings:
    """Of a whole run.

    Parameters
    ----------
    cells : int
        About how many tetrahedra.
    nelder_mead : bool
        Whether to search as the paper does too; its solutions are many.
    search : SearchSettings
        Of the searches.
    """

    cells: int = 15_000
    nelder_mead: bool = False
    search: SearchSettings = field(default_factory=SearchSettings)


@dataclass(frozen=True, eq=False)
class StockingResult:
    """What a run found.

    ``searches`` holds the weighted search from every start, the best first, then Nelder-Mead's if
    it was asked for; nothing where the stiffness was given. ``scan_load`` is the pressure that the
    scanned shape would bear. ``worn`` is the leg in equilibrium with its stocking at the stiffness
    found, or given.
    """

    leg: StockingLeg
    model: LegModel3D
    scan_load: StockingLoad | None
    misfit: ContourMisfit | None
    searches: tuple[Identified, ...]
    mismatch: Mismatch | None
    """What the best fit leaves; None where no state was found."""
    parameters: dict[str, float]
    """C10 by name, MPa."""
    worn: Worn
    pressures: TissuePressures | None
    """None if the worn state was not found."""
    sensors: tuple[ComparedSensor, ...]
    """Beside the worn state."""
    states: int
    """Compressed states solved for."""
    wall_s: float

    @property
    def best(self) -> Identified | None:
        """The best weighted search."""
        weighted = [search for search in self.searches if search.method == "weighted"]
        return weighted[0] if weighted else None

    @property
    def tetrahedra(self) -> int:
        """Of the mesh, on all ranks."""
        mesh = self.model.compression.spaces.mesh
        return int(mesh.topology.index_map(mesh.topology.dim).size_global)

    @property
    def simulated_scan(self) -> LegShape | None:
        """Shape in the state that fits the scan best."""
        best = self.best
        if best is None or not best.worn.state.report.complete:
            return None
        return best.worn.shape


def run_leg(
    leg: StockingLeg,
    settings: StockingSettings,
    progress: Progress,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    mesh: SolidMeshSettings | None = None,
    folder: Path | None = None,
) -> StockingResult:
    """Mesh a leg, identify its tissues if it was scanned in its stocking, and put that on.

    Equilibria are kept in a folder, where one is given: the same run goes on where it was stopped.
    """
    started = time.perf_counter()
    progress.stage("mesh")
    mesh = mesh or settings_for_cells(leg.bare, settings.cells)
    model = LegModel3D(leg.bare, leg.tissues, mesh, CompressionSettings(ends=leg.ends), comm)
    progress.advance(f"{model.compression.spaces.unknowns} unknowns")
    searches: tuple[Identified, ...] = ()
    parameters = {f"{name}.C10": float(law.C10) for name, law in leg.tissues.items()}
    load = misfit = mismatch = None
    sensing = Sensing.on(leg.bare, leg.sensors)
    worn_leg = WornLeg(model, leg.stocking, folder=folder)
    if leg.compressed is not None:
        load = stocking_load(leg.compressed, leg.stocking)
        misfit = ContourMisfit.between(
            SliceSet.of(leg.compressed, leg.slices), leg.accuracy, leg.scanned_bare, leg.bare
        )
        search = StiffnessSearch(
            worn_leg,
            misfit,
            settings.search,
            progress.advance,
            sensing if leg.sensors else None,
            stiffness_priors(leg.elastography),
        )
        progress.stage("identification, weighted")
        searches = search.weighted()
        if settings.nelder_mead:
            progress.stage("identification, Nelder-Mead")
            searches = (*searches, search.nelder_mead())
        if searches[0].worn.state.report.complete:
            progress.stage("where model and scan differ")
            mismatch = mismatch_of(worn_leg, misfit, search.nuisances, searches[0])
            progress.advance(mismatch.verdict)
        if not leg.known:
            parameters = dict(zip(PARAMETERS, map(float, searches[0].parameters), strict=True))
    progress.stage("the leg in equilibrium with its stocking")
    tension = searches[0].tension if searches and not leg.known else None
    error = 0.0 if tension is None else tension.value
    best = searches[0].worn if searches else None
    start = best if best is not None and best.state.report.complete else None
    worn = worn_leg.find(parameters, start=start, error=error)
    progress.advance(f"{len(worn.changes)} states")
    borne, pressures = worn.load.times(1 + error), None
    if worn.state.report.complete:
        probe = PressureProbe(model.compression)
        pressures = tissue_pressures(probe, worn.state, borne, leg.veins)
        covariance = None if leg.known or not searches else searches[0].log_covariance
        if tension is not None:
            covariance = tension.log_covariance
        sd = vein_pressure_sd(worn_leg, worn, probe, leg.veins, parameters, covariance, leg.accuracy.pressure_sd, error)
        pressures = replace(pressures, at_veins_sd=tuple(map(float, sd)))
        progress.advance("errors of the pressures at the veins")
    return StockingResult(
        leg,
        model,
        load,
        misfit,
        searches,
        mismatch,
        parameters,
        replace(worn, load=borne),
        pressures,
        sensing.compared(borne.pressure),
        worn_leg.states,
        time.perf_counter() - started,
    )
