"""The second paper's two claims on legs of different shape in stockings, and one state by size of mesh."""

from __future__ import annotations

import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.stats import pearsonr, spearmanr

from legfem.common.units import kpa_to_mpa, mpa_to_kpa
from legfem.geometry.leg_shape import LegShape, fat_thickness_around
from legfem.geometry.slices import calf_levels
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import settings_for_cells
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import CompressionClass, fitted_stocking, stocking_load
from legfem.stockings.leg import default_veins
from legfem.stockings.pressures import PressureProbe, tissue_pressures
from studies.making.shapes import ParametricLeg, horizontal_curvature, parametric_leg
from studies.stockings.truth import D1

LAWS = {"deep": NeoHookean(kpa_to_mpa(3.25), D1), "superficial": NeoHookean(kpa_to_mpa(8.17), D1)}
"""Of the mean C10 of muscle and fat in the paper."""
FAT_FACTORS = (0.7, 1.0, 1.5)
CLASSES: tuple[CompressionClass, ...] = ("1", "2", "3")


@dataclass(frozen=True)
class Variant:
    """A leg, its fat scaled, in a stocking of a class."""

    leg: str
    fat_factor: float
    compression_class: CompressionClass

    @property
    def name(self) -> str:
        """For files."""
        return f"{self.leg}-fat{self.fat_factor:g}-class{self.compression_class}"


@dataclass(frozen=True)
class Pressures:
    """What a variant shows; kPa, mm."""

    variant: Variant
    mean_interface: float
    greatest_interface: float
    at_veins: tuple[float, ...]
    greatest_in_fat: float
    mean_in_muscle: float
    fat_thickness: float
    """Mean around the leg at the calf."""
    greatest_curvature: float
    """Of the bare skin at the calf (1/mm)."""
    converged: bool

    @property
    def mean_at_veins(self) -> float:
        """Over the veins."""
        return float(np.mean(self.at_veins))

    def __str__(self) -> str:
        """Return a line."""
        return f"veins {self.mean_at_veins:.2f} kPa, skin {self.mean_interface:.2f} kPa"


@dataclass(frozen=True)
class Correlation:
    """How closely one quantity follows another over legs."""

    statement: str
    count: int
    pearson: float
    pearson_p: float
    spearman: float
    spearman_p: float


def variants(legs: Sequence[str]) -> tuple[Variant, ...]:
    """Return every leg with every thickness of fat in class 2, and as it is in the others."""
    shapes = [Variant(leg, f, "2") for leg in legs for f in FAT_FACTORS]
    others = [Variant(leg, 1.0, c) for leg in legs for c in (CLASSES[0], CLASSES[2])]
    return (*shapes, *others)


def solve_variant(leg: ParametricLeg, variant: Variant, cells: int) -> Pressures:
    """Put a variant's stocking on and return its pressures."""
    scaled = {name: getattr(leg, name) * variant.fat_factor for name in ("fat_mm", "shin_fat_mm")}
    shape = parametric_leg(leg.model_copy(update=scaled))
    model = LegModel3D(shape, LAWS, settings_for_cells(shape, cells))
    worn = EquilibriumSolver(model, fitted_stocking(shape, variant.compression_class)).solve()
    level = float(np.median(calf_levels(shape)))
    calf = int(np.argmin(np.abs(shape.levels - level)))
    probe = PressureProbe(model.compression)
    found = tissue_pressures(probe, worn.state, worn.load, default_veins(shape, level))
    return Pressures(
        variant,
        mpa_to_kpa(found.mean_interface),
        mpa_to_kpa(found.greatest_interface),
        tuple(map(mpa_to_kpa, found.at_veins)),
        mpa_to_kpa(found.greatest_in_fat),
        mpa_to_kpa(found.mean_in_muscle),
        float(fat_thickness_around(shape)[calf].mean()),
        float(horizontal_curvature(shape)[calf].max()),
        worn.converged,
    )


def correlations(rows: Sequence[Pressures]) -> tuple[Correlation, ...]:
    """Return the claims' correlations, within one class and over all."""
    one = [r for r in rows if r.variant.compression_class == "2"]
    plain = [r for r in rows if r.variant.fat_factor == 1.0]
    asked = (
        (plain, "all classes, fat as it is", "mean_interface", "mean_at_veins"),
        (one, "class 2", "mean_interface", "mean_at_veins"),
        (one, "class 2", "fat_thickness", "greatest_in_fat"),
        (one, "class 2", "greatest_interface", "greatest_in_fat"),
        (one, "class 2", "greatest_curvature", "greatest_in_fat"),
    )
    return tuple(_correlation(*entry) for entry in asked)


_WORDS = {
    "mean_interface": "mean interface pressure",
    "greatest_interface": "greatest interface pressure",
    "fat_thickness": "mean fat thickness",
    "greatest_curvature": "greatest curvature of the bare leg",
    "mean_at_veins": "pressure at the veins",
    "greatest_in_fat": "greatest pressure in fat",
}


def _correlation(rows: Sequence[Pressures], which: str, x: str, y: str) -> Correlation:
    a, b = (np.array([getattr(row, name) for row in rows]) for name in (x, y))
    numbers = map(float, (*pearsonr(a, b), *spearmanr(a, b)))
    return Correlation(f"{_WORDS[y]}, by {_WORDS[x]}; {which}", len(rows), *numbers)


KIB_PER_GIB = 1024.0**2


def sized_state(shape: LegShape, cells: int, comm: MPI.Intracomm) -> str:
    """Solve for the paper's stiffness under a stocking of class 2, on about so many tetrahedra; say what it took.

    Times are by the clock, the peak of memory is the sum over ranks, the meshing included.
    """
    started = time.perf_counter()
    model = LegModel3D(shape, LAWS, settings_for_cells(shape, cells), comm=comm)
    counts: list[int] = []

    def count(solver: object, iteration: int, residual: float) -> None:
        if iteration == 0:
            counts.append(0)
        counts[-1] = iteration

    model.compression.solver.linear_solver.setMonitor(count)
    load = stocking_load(shape, fitted_stocking(shape, "2"))
    meshed = time.perf_counter()
    state = model.solve(None, load.pressure)
    solved = time.perf_counter()
    veins = default_veins(shape, float(calf_levels(shape)[2]))
    peak = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_GIB)
    found = tissue_pressures(PressureProbe(model.compression), state, load, veins)
    at_veins = ", ".join(f"{mpa_to_kpa(p):.4f}" for p in found.at_veins)
    return (
        f"{model.compression.leg_mesh.mesh.topology.index_map(3).size_global} tetrahedra, "
        f"{model.compression.spaces.unknowns} unknowns, {comm.size} ranks: mesh {meshed - started:.0f} s, state "
        f"{solved - meshed:.0f} s ({state.report.factorisations} tangents, iterations {', '.join(map(str, counts))}), "
        f"peak {peak:.1f} GiB; veins {at_veins} kPa, muscle {mpa_to_kpa(found.mean_in_muscle):.4f} kPa, fat "
        f"{mpa_to_kpa(found.greatest_in_fat):.4f} kPa"
    )
