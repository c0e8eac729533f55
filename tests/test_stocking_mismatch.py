"""What is wrong with a leg's model is located and named; simulated, on a small leg.

The scans come from another mesh and stabilisation than the diagnosis has, with noise of the size
that it is told.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_stocking import COARSE, PLANTED_KPA, laws, short_leg

from legfem.common.progress import Silent
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import rigidly_moved
from legfem.geometry.slices import CONTOURS, SliceSet, calf_levels
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.stockings.contour_distances import ContourAccuracy, ContourMisfit, error_modes
from legfem.stockings.discrepancy import ModelDiscrepancy
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import fitted_stocking
from legfem.stockings.identification import SEARCH, ScanProblem
from legfem.stockings.leg import SensorArray, StockingLeg
from legfem.stockings.nuisances import NuisanceSlopes
from legfem.stockings.scan_fit import ScanComparison, StockingForward

ACCURACY = ContourAccuracy(
    sd=0.1, correlation=6.0, around=25.0, along=40.0, pressure_sd=0.003, shift_sd=(0.03, 0.03, 0.05)
)
FINE = SolidMeshSettings(skin_size=7, inside_size=9, bone_size=7)
LAWS = laws(*PLANTED_KPA)


@pytest.fixture(scope="module")
def shape() -> LegShape:
    return short_leg()


@pytest.fixture(scope="module")
def models(shape: LegShape) -> tuple[LegModel3D, LegModel3D]:
    """Of the truth, and of the diagnosis."""
    truth = LegModel3D(shape, LAWS, FINE, CompressionSettings(stabilisation=0.3))
    return truth, LegModel3D(shape, LAWS, COARSE)


def _diagnosed(
    shape: LegShape,
    models: tuple[LegModel3D, LegModel3D],
    factor: np.ndarray | float = 1.0,
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    seed: int = 3,
    accuracy: ContourAccuracy = ACCURACY,
    **mechanism: float,
) -> ModelDiscrepancy:
    """Diagnose a leg whose truth has other pressures, another position, or a mechanism."""
    truth, model = models
    stocking = fitted_stocking(shape, "3")
    worn = EquilibriumSolver(truth, stocking).solve(mechanism, error=factor - 1)
    assert worn.converged
    scanned = rigidly_moved(worn.shape, np.eye(3), np.array(shift))
    clean = ContourMisfit(SliceSet.of(scanned, calf_levels(shape)), accuracy)
    noisy = ContourMisfit(clean.target, accuracy, _noise(clean, seed))
    leg = StockingLeg(
        "t",
        "Test",
        "simulated",
        shape,
        shape,
        scanned,
        None,
        stocking,
        accuracy,
        LAWS,
        False,
        "held",
        calf_levels(shape),
        (),
    )
    solver = EquilibriumSolver(model, stocking)
    scans = ScanComparison(shape, noisy, NuisanceSlopes(solver, noisy), SensorArray.on(shape, ()))
    problem = ScanProblem(leg, StockingForward(solver), scans, Silent())
    return problem.fitted(SEARCH).details.discrepancy


def _noise(misfit: ContourMisfit, seed: int) -> np.ndarray:
    """Draw the errors of both scans' outlines that the misfit assumes (mm)."""
    rng, target = np.random.default_rng(seed), misfit.target
    drawn = []
    for name in CONTOURS:
        modes = error_modes(misfit.accuracy, target.contours(name), target.levels)
        drawn.append((modes @ rng.normal(scale=np.sqrt(2), size=modes.shape[-1])).ravel())
    return np.concatenate(drawn)


@pytest.mark.slow
def test_nothing_wrong_is_called_consistent(shape, models):
    found = _diagnosed(shape, models)
    print(found)
    assert found.verdict == "consistent" and not found.named


@pytest.mark.slow
def test_a_pressure_too_low_on_one_side_is_named_and_mended(shape, models):
    """The posterior skin bears up to 30 % less than Laplace's law says."""
    skin = shape.contours["skin"]
    angle = np.arctan2(*np.moveaxis(skin - skin.mean(axis=1, keepdims=True), 2, 0)[::-1])
    found = _diagnosed(shape, models, 1 - 0.3 * np.exp(-(((angle - np.pi / 2) / 0.5) ** 2)))
    print(found)
    assert found.named[0] == "local-pressure" and found.verdict == "named"
    assert found.rms_after_mm is not None and found.rms_after_mm < 0.8 * found.rms_before_mm
    assert any(abs(place.angle_deg - 90.0) <= 45.0 for place in found.places)


@pytest.mark.slow
def test_drained_blood_is_named(shape, models):
    """2 % of the deep tissue's volume is gone."""
    found = _diagnosed(shape, models, **{"deep.volume_loss.share": 0.02})
    print(found)
    assert found.named and found.named[0] == "volume-loss"
    share, error = next(s for s in found.scores if s.name == "volume-loss").strengths["share"]
    assert share == pytest.approx(0.02, abs=max(3 * error, 0.004))
    assert found.c10_after_kPa[0] == pytest.approx(2.5, rel=0.15)


@pytest.mark.slow
def test_scans_farther_apart_than_the_registration_says_are_named(shape, models):
    found = _diagnosed(shape, models, shift=(0.5, -0.4, 0.0))
    print(found)
    assert "misregistration" in found.named
    assert found.rms_after_mm is not None and found.rms_after_mm < found.rms_before_mm


@pytest.mark.slow
def test_a_fascia_that_the_model_lacks_is_named(shape, models):
    """Of C10 100 kPa and 0.8 mm; behind outlines 0.1 mm off the muscle's stiffness hides it."""
    accuracy = replace(ACCURACY, sd=0.02, model_sd=0.01)
    found = _diagnosed(shape, models, accuracy=accuracy, **{"fascia.membrane.stiffness": 0.16})
    print(found)
    assert "fascia" in found.named
    stiffness, error = next(s for s in found.scores if s.name == "fascia").strengths["stiffness (N/mm)"]
    assert stiffness > 2 * error
    assert found.rms_after_mm is not None and found.rms_after_mm < found.rms_before_mm
