"""Simulated scans of the six legs, of another discretisation, and whether planted stiffnesses are found again."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit
from scipy.spatial.transform import Rotation

from legfem.common.documents import write_atomically
from legfem.common.progress import Silent
from legfem.common.units import kpa_to_mpa
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import RigidTransform
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import settings_for_cells
from legfem.stockings.details import StockingFit
from legfem.stockings.equilibrium import Equilibrium, EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import CompressionClass, Stocking, fitted_stocking
from legfem.stockings.identification import identify_in_stocking
from legfem.stockings.loading import load_leg
from studies.cases.outcomes import Interval
from studies.making.scans import SegmentationNoise, simulated_scan, write_volume
from studies.making.shapes import ParametricLeg, parametric_leg

VOXEL_SD = 0.15
"""Error (mm) of outlines of a perfect segmentation on the paper's voxels, before smoothing, which
leaves 0.09 mm of it: that was measured on leg 1."""
D1 = 2.0
"""1/MPa: a bulk modulus of 1 MPa, the second paper's."""


@dataclass(frozen=True)
class TrueTissues:
    """Planted C10 of a leg (kPa), and its stocking."""

    deep_kPa: float
    superficial_kPa: float
    compression_class: CompressionClass


TRUTHS = {
    "1": TrueTissues(3.2, 8.2, "2"),
    "2": TrueTissues(2.4, 4.0, "2"),
    "3": TrueTissues(4.5, 16.0, "3"),
    "4": TrueTissues(2.8, 2.0, "2"),
    "5": TrueTissues(3.6, 12.0, "3"),
    "6": TrueTissues(2.1, 5.5, "2"),
}
"""Within the paper's 3.25 ± 0.93 kPa for muscle and 8.17 ± 7.22 kPa for fat."""


NOISE = {"perfect": None, "noisy": SegmentationNoise()}
"""Segmentations."""


@dataclass(frozen=True, eq=False)
class TrueLeg:
    """A simulated leg in its stocking."""

    bare: LegShape
    stocking: Stocking
    equilibrium: Equilibrium
    model: LegModel3D


def true_leg(leg: ParametricLeg, truth: TrueTissues, cells: int = 80_000) -> TrueLeg:
    """Put a leg in its stocking."""
    bare = parametric_leg(leg)
    stocking = fitted_stocking(bare, truth.compression_class)
    tissues = {
        "deep": NeoHookean(kpa_to_mpa(truth.deep_kPa), D1),
        "superficial": NeoHookean(kpa_to_mpa(truth.superficial_kPa), D1),
    }
    settings = CompressionSettings(stabilisation=0.3)
    model = LegModel3D(bare, tissues, settings_for_cells(bare, cells), settings)
    return TrueLeg(bare, stocking, EquilibriumSolver(model, stocking).solve(), model)


def write_subject(name: str, made: TrueLeg, folder: Path, seed: int, noise: SegmentationNoise | None) -> None:
    """Write the folder of a leg: both scans, the stocking and ``leg.toml``, the latter last."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, int(name)])
    turn = Rotation.from_rotvec(np.radians(rng.normal(0.0, [0.5, 0.5, 3.0]))).as_matrix()
    motion = RigidTransform(turn, rng.normal(0.0, [4.0, 4.0, 2.0]))
    bare, compressed = (int(s) for s in rng.integers(0, 2**31, 2))
    write_volume(simulated_scan(made.bare, bare, noise), folder / "bare.nii.gz")
    write_volume(simulated_scan(made.equilibrium.shape, compressed, noise, motion), folder / "compressed.nii.gz")
    rows = zip(made.stocking.levels, made.stocking.unstretched, strict=True)
    table = "".join(f"{z:.3f},{length:.4f}\n" for z, length in rows)
    write_atomically(folder / "stocking.csv", "level_mm,perimeter_mm\n" + table)
    write_atomically(folder / "leg.toml", _toml(name, made, noise))


def _toml(name: str, made: TrueLeg, noise: SegmentationNoise | None) -> str:
    sd = float(np.hypot(VOXEL_SD, noise.boundary_sd if noise else 0.0))
    document = {
        "id": name,
        "title": f"Leg {name}, simulated",
        "origin": "simulated",
        "bare": {"scan": "bare.nii.gz"},
        "compressed": {"scan": "compressed.nii.gz"},
        "stocking": {"stiffness_N_per_mm": float(f"{made.stocking.stiffness:g}"), "unstretched": "stocking.csv"},
        "accuracy": {"contour_sd_mm": float(f"{sd:g}"), "correlation_mm": noise.correlation_length if noise else 5.0},
    }
    return tomlkit.dumps(document)


@dataclass(frozen=True)
class Recovery:
    """A leg's planted values and what was found; C10 of muscle, then of fat, in kPa."""

    leg: str
    kind: str
    planted: tuple[float, float]
    found: tuple[Interval, Interval]
    solves: int
    """Equilibria of the search."""
    rms_mm: float
    chi_square: float
    cpu_s: float

    @property
    def covered(self) -> tuple[bool, bool]:
        """Whether the intervals hold the planted values."""
        muscle, fat = (one.covers(true) for one, true in zip(self.found, self.planted, strict=True))
        return muscle, fat

    def __str__(self) -> str:
        """Return a line that says what was found."""
        found = ", ".join(f"{one.value:.3g}" for one in self.found)
        planted = ", ".join(f"{value:.3g}" for value in self.planted)
        return f"found {found} kPa, planted {planted} kPa ({self.solves} equilibria)"


def recover(folder: Path, kind: str, cells: int) -> Recovery:
    """Identify a leg."""
    started = time.process_time()
    found = identify_in_stocking(load_leg(folder), Silent(), cells)
    return _recovery(found, kind, time.process_time() - started)


def _recovery(fit: StockingFit, kind: str, seconds: float) -> Recovery:
    leg, best = fit.details.leg, fit.details.best
    assert best is not None
    truth = TRUTHS[leg.id]
    muscle, fat = map(Interval.of, fit.estimates.values())
    return Recovery(
        leg.id,
        kind,
        (truth.deep_kPa, truth.superficial_kPa),
        (muscle, fat),
        fit.log.forward_solves,
        best.rms,
        best.weighted_misfit,
        seconds,
    )
