"""What a run finds of a leg in its stocking."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.stockings.discrepancy import ModelDiscrepancy
from legfem.stockings.equilibrium import Equilibrium
from legfem.stockings.estimates import StiffnessEstimate, StiffnessFit, stiffness_estimates
from legfem.stockings.fabric import StockingLoad
from legfem.stockings.leg import ComparedSensor, StockingLeg
from legfem.stockings.leg_model import LegModel3D
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.pressures import TissuePressures


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
