"""What the fit of a leg in its stocking has beside that of any test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from legfem.common.units import FloatArray
from legfem.inverse.fit import Fit
from legfem.stockings.discrepancy import ModelDiscrepancy
from legfem.stockings.equilibrium import Equilibrium
from legfem.stockings.estimates import StiffnessFit
from legfem.stockings.fabric import StockingLoad, stocking_load
from legfem.stockings.leg import ComparedSensor, StockingLeg
from legfem.stockings.leg_model import LegModel3D
from legfem.stockings.levels import LevelPressure, PressureAlong, pressures_at_levels
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.pressures import FatPressures, SectionPressures, TissuePressures

type StockingFit = Fit[StockingDetails]


@dataclass(frozen=True, eq=False)
class StockingDetails:
    """The leg in equilibrium with its stocking, and how its stiffness was searched for.

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
    moved : dict of str to array, optional
        Displacement (mm) in it of the points of skin and hull, (n_levels, n_points, 3) each; None if it was not found.
    pressures : TissuePressures, optional
        Pressures in that equilibrium, likewise.
    section : SectionPressures, optional
        Pressures in the level at mid calf.
    fat : FatPressures, optional
        Pressures in columns of fat all round the leg.
    sensors : tuple of ComparedSensor
        Sensors beside that equilibrium.
    states : int
        Finite-element solutions.
    """

    leg: StockingLeg
    model: LegModel3D
    scan_load: StockingLoad | None
    misfit: ContourMisfit | None
    searches: tuple[StiffnessFit, ...]
    discrepancy: ModelDiscrepancy | None
    parameters: dict[str, float]
    equilibrium: Equilibrium
    moved: Mapping[str, FloatArray] | None
    pressures: TissuePressures | None
    section: SectionPressures | None
    fat: FatPressures | None
    sensors: tuple[ComparedSensor, ...]
    states: int

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
    def tetrahedra(self) -> int:
        """Number of tetrahedra of the mesh, on all ranks."""
        mesh = self.model.compression.spaces.mesh
        return int(mesh.topology.index_map(mesh.topology.dim).size_global)

    @property
    def pressure_along(self) -> PressureAlong:
        """Pressure of the stocking by height."""
        leg, tension = self.leg, None if self.best is None else self.best.tension
        on_bare = stocking_load(leg.bare, leg.stocking).times(1.0 if tension is None else 1 + tension.value)
        return PressureAlong.of(leg.bare, self.equilibrium.load, on_bare, leg.accuracy)

    @property
    def at_levels(self) -> list[LevelPressure]:
        """Pressure at every level of makers that the modelled part of the leg has."""
        return pressures_at_levels(self.pressure_along, self.leg.makers, self.leg.bare)
