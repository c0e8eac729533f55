"""One compressed state by size of mesh: work, memory, and how the pressures change."""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass

from mpi4py import MPI

from legfem.common.units import kpa_to_mpa, mpa_to_kpa
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.slices import calf_levels
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.solid_leg import settings_for_cells
from legfem.stockings.fabric import ClassFit, CompressionClass, fitted_stocking, stocking_load
from legfem.stockings.leg import default_veins
from legfem.stockings.leg_model import LegModel3D
from legfem.stockings.pressures import PressureProbe, TissuePressures, tissue_pressures
from studies.stockings.claims import PAPER_KPA
from studies.stockings.truth import D1

KIB_PER_GIB = 1024.0**2


@dataclass(frozen=True)
class SizedState:
    """One state on one mesh."""

    tetrahedra: int
    unknowns: int
    ranks: int
    mesh_s: float
    solve_s: float
    """By the clock."""
    tangents: int
    iterations: tuple[int, ...]
    """Of the linear solver, tangent by tangent."""
    peak_GiB: float
    """Sum over ranks, the meshing included."""
    pressures: TissuePressures

    def __str__(self) -> str:
        """Return one line."""
        veins = ", ".join(f"{mpa_to_kpa(p):.4f}" for p in self.pressures.at_veins)
        return (
            f"{self.tetrahedra} tetrahedra, {self.unknowns} unknowns, {self.ranks} ranks: mesh "
            f"{self.mesh_s:.0f} s, state {self.solve_s:.0f} s ({self.tangents} tangents, "
            f"iterations {', '.join(map(str, self.iterations))}), peak {self.peak_GiB:.1f} GiB; "
            f"veins {veins} kPa, muscle {mpa_to_kpa(self.pressures.mean_in_muscle):.4f} kPa, fat "
            f"{mpa_to_kpa(self.pressures.greatest_in_fat):.4f} kPa"
        )


def sized_state(shape: LegShape, cells: int, comm: MPI.Intracomm) -> SizedState:
    """Solve for the paper's stiffness under a stocking of class 2, on about so many tetrahedra."""
    started = time.perf_counter()
    tissues = {
        name: NeoHookean(kpa_to_mpa(value), D1) for name, value in zip(("deep", "superficial"), PAPER_KPA, strict=True)
    }
    model = LegModel3D(shape, tissues, settings_for_cells(shape, cells), comm=comm)
    counts: list[int] = []

    def count(solver: object, iteration: int, residual: float) -> None:
        if iteration == 0:
            counts.append(0)
        counts[-1] = iteration

    model.compression.solver.linear_solver.setMonitor(count)
    load = stocking_load(shape, fitted_stocking(shape, ClassFit(CompressionClass.MODERATE)))
    meshed = time.perf_counter()
    state = model.solve(None, load.pressure)
    solved = time.perf_counter()
    veins = default_veins(shape, float(calf_levels(shape)[2]))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_GIB
    mesh = model.compression.leg_mesh.mesh
    return SizedState(
        mesh.topology.index_map(3).size_global,
        model.compression.spaces.unknowns,
        comm.size,
        meshed - started,
        solved - meshed,
        state.report.factorisations,
        tuple(counts),
        float(comm.allreduce(peak)),
        tissue_pressures(PressureProbe(model.compression), state, load, veins),
    )
