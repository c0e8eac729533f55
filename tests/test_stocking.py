"""A leg in its stocking, from two shapes to stiffness and pressures; simulated, and small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import SHARED
from making_stocking import PLANTED_KPA, laws, short_leg

from legfem.common.progress import Silent
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.section import outward_normals
from legfem.geometry.slices import calf_levels
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.equilibrium import (
    PARAMETERS,
    Equilibrium,
    EquilibriumSettings,
    EquilibriumSolver,
    LegModel3D,
    LinearisedCoupling,
)
from legfem.stockings.fabric import fitted_stocking, stocking_load
from legfem.stockings.identification import SAMPLED_AT, identify_in_stocking
from legfem.stockings.leg import StockingLeg, default_veins
from legfem.stockings.nuisances import RIGID, SECTORS, NuisanceSlopes, sectors
from legfem.stockings.pressures import PressureProbe, tissue_pressures

PLANTED = 1e-3 * np.array(PLANTED_KPA)
ACCURACY = ContourAccuracy(sd=0.1, correlation=16.0, around=30.0, along=40.0, pressure_sd=0.003)
"""Alike over a longer way than by default: fewer modes to learn the leg's answers to."""
FINE = SolidMeshSettings(skin_size=8, inside_size=10, bone_size=8)
COARSE = SolidMeshSettings(skin_size=11, inside_size=14, bone_size=9)


@pytest.fixture(scope="module")
def shape() -> LegShape:
    return short_leg()


@pytest.fixture(scope="module")
def truth(shape: LegShape) -> tuple[LegModel3D, Equilibrium]:
    """Another mesh and stabilisation than identification has."""
    stocking = fitted_stocking(shape, "3")
    model = LegModel3D(shape, laws(*PLANTED_KPA), FINE, CompressionSettings(stabilisation=0.3))
    return model, EquilibriumSolver(model, stocking).solve()


@pytest.fixture(scope="module")
def fit(shape: LegShape, truth: tuple[LegModel3D, Equilibrium]) -> StockingFit:
    slices = calf_levels(shape)
    leg = StockingLeg(
        "t",
        "Test",
        "simulated",
        shape,
        shape,
        truth[1].shape,
        None,
        fitted_stocking(shape, "3"),
        ACCURACY,
        laws(3.0, 3.0),
        False,
        "held",
        slices,
        default_veins(shape, float(slices[2])),
    )
    fit = identify_in_stocking(leg, Silent(), mesh=COARSE)
    assert fit.log.converged and fit.log.forward_solves <= 10
    return fit


@pytest.fixture(scope="module")
def result(fit: StockingFit) -> StockingDetails:
    return fit.details


def test_the_pressure_is_that_of_the_shape_it_makes(shape, truth):
    model, worn = truth
    assert worn.converged and len(worn.changes) <= 8
    stocking = fitted_stocking(shape, "3")
    again = stocking_load(model.deformed_shape(worn.state.unknown), stocking)
    error = np.abs(again.pressure - worn.load.pressure).max() / worn.load.pressure.max()
    assert error < 1e-6


def test_the_ends_stay_in_their_planes_and_the_bones_where_they_are(truth):
    model, worn = truth
    moved = model.displacement("skin", worn.state.unknown)
    # Contours lie a little off the flat facets near the ends.
    assert np.abs(moved[[0, -1], :, 2]).max() < 1e-4
    assert np.abs(moved[..., :2]).max() > 0.3
    for bone in worn.shape.bones:
        np.testing.assert_allclose(worn.shape.at(bone, 80.0), model.shape.at(bone, 80.0), atol=0.05)


@pytest.mark.slow
def test_planted_stiffness_lies_in_its_interval(fit):
    """Its quick twin has the model's own mesh: test_stocking_report.py."""
    best = fit.details.best
    for known, planted in zip(fit.estimates.values(), PLANTED_KPA, strict=True):
        print(known.shown, best.rms)
        assert known.shown.ci95[0] < planted < known.shown.ci95[1]
    assert fit.estimates["deep.C10"].shown.value == pytest.approx(PLANTED_KPA[0], rel=0.1)
    assert best.rms < 0.05 and best.weighted_misfit < 1.5


@pytest.mark.slow
def test_an_equilibrium_that_was_kept_is_as_it_was_found(result, tmp_path, monkeypatch):
    """A later run has it without a solution, and its answers to changes are the same."""
    name, at = "deep.C10", {"deep.C10": 2.5e-3, "superficial.C10": 6e-3}
    leg = EquilibriumSolver(result.model, result.leg.stocking, folder=tmp_path)
    found = leg.solve(at, (name,))
    rate = LinearisedCoupling(leg, found).rate(found.state.sensitivities[name])
    assert leg.states == len(found.changes)
    shape, tissues = result.model.shape, result.model.tissues
    again = EquilibriumSolver(
        LegModel3D(shape, tissues, COARSE, CompressionSettings(ends="held")), result.leg.stocking, folder=tmp_path
    )
    with monkeypatch.context() as patched:
        patched.setattr(LegModel3D, "solve", None)
        kept = again.solve(at, (name,))
    np.testing.assert_array_equal(kept.state.unknown, found.state.unknown)
    np.testing.assert_array_equal(kept.load.pressure, found.load.pressure)
    assert (kept.changes, kept.converged) == (found.changes, found.converged)
    after = LinearisedCoupling(again, kept).rate(kept.state.sensitivities[name])
    np.testing.assert_allclose(after, rate, atol=1e-3 * np.abs(rate).max())
    other = EquilibriumSolver(result.model, result.leg.stocking, EquilibriumSettings(1e-4), tmp_path)
    assert other.solve(at, (name,)).changes[-1] < 1e-4, "other settings, another equilibrium"


@pytest.mark.slow
def test_slopes_in_equilibrium_are_those_between_equilibria(result):
    """Without the stocking's answer they would be a quarter off and more."""
    exact = EquilibriumSettings(tolerance=1e-5, max_states=30)
    leg = EquilibriumSolver(result.model, result.leg.stocking, exact)
    names = ("deep.C10", "superficial.C10")
    at = {"deep.C10": 2.5e-3, "superficial.C10": 6e-3}
    for name in names:
        step = 0.02 * at[name]
        low, high = (leg.solve({**at, name: at[name] + s * step}) for s in (-0.5, 0.5))
        assert low.converged and high.converged
        moved = (high.state.unknown - low.state.unknown) / step
        middle = leg.solve(at, (name,))
        own = middle.state.sensitivities[name]
        total = LinearisedCoupling(leg, middle).rate(own)
        skin = [result.model.displacement("skin", rate) for rate in (moved, own, total)]
        size = np.abs(skin[0]).max()
        assert np.abs(skin[2] - skin[0]).max() < 0.05 * size
        assert np.abs(skin[1] - skin[0]).max() > 0.2 * size


@pytest.fixture(scope="module")
def answering(result) -> tuple[EquilibriumSolver, Equilibrium, NuisanceSlopes]:
    """A leg in an exact equilibrium, and what moves its contours there."""
    exact = EquilibriumSettings(tolerance=1e-5, max_states=30)
    leg = EquilibriumSolver(result.model, result.leg.stocking, exact)
    nuisances = NuisanceSlopes(leg, result.best.misfit)
    at = dict(zip(PARAMETERS, PLANTED, strict=True))
    worn = leg.solve(at)
    nuisances.sample(PLANTED, worn)
    return leg, worn, nuisances


@pytest.mark.slow
def test_a_wrong_pressure_moves_the_leg_as_its_slope_says(result, answering):
    leg, plain, nuisances = answering
    bump = sectors(result.model.shape)[2]
    at = dict(zip(PARAMETERS, PLANTED, strict=True))
    wrong = leg.solve(at, start=plain, error=0.02 * bump)
    moved = result.best.misfit.distances(wrong.shape) - result.best.misfit.distances(plain.shape)
    expected = 0.02 * nuisances.at(PLANTED)[:, RIGID + 2]
    assert np.abs(moved - expected).max() < 0.1 * np.abs(expected).max()


@pytest.mark.slow
def test_an_error_of_the_bare_skin_is_answered_as_its_slope_says(result, answering):
    """On another mesh, of a leg with a bump; without the stocking's answer it would not fit."""
    _, plain, nuisances = answering
    shape, at = result.model.shape, dict(zip(PARAMETERS, PLANTED, strict=True))
    modes = nuisances.modes["skin"]
    waves = np.abs(np.fft.rfft(modes[len(modes) // 2], axis=0))
    number = int(np.flatnonzero(np.argmax(waves, axis=0) == 4)[0])
    size = 0.5 / float(np.abs(modes[..., number]).max())
    outwards = size * modes[..., number, None] * outward_normals(shape.contours["skin"])
    bumped = LegShape(shape.levels, {**shape.contours, "skin": shape.contours["skin"] + outwards})
    other = LegModel3D(bumped, laws(*PLANTED_KPA), COARSE)
    found = EquilibriumSolver(other, result.leg.stocking, EquilibriumSettings(1e-5, 30)).solve(at)
    moved = result.best.misfit.distances(found.shape) - result.best.misfit.distances(plain.shape)
    expected = size * nuisances.at(PLANTED)[:, RIGID + SECTORS + number]
    bare = result.best.misfit.distances(bumped) - result.best.misfit.distances(shape)
    print(np.std(moved), np.std(expected), np.std(bare), np.std(moved - expected))
    assert np.std(moved - expected) < 0.2 * np.std(moved)
    assert np.std(moved - bare) > 0.4 * np.std(moved)


@pytest.mark.slow
def test_answers_at_another_stiffness_are_those_of_the_stiffnesses_around_it(result, answering):
    leg, _, exact = answering
    between = NuisanceSlopes(leg, result.best.misfit)
    for parameters in SAMPLED_AT:
        between.sample(parameters, leg.solve(dict(zip(PARAMETERS, parameters, strict=True))))
    known, found = exact.at(PLANTED), between.at(PLANTED)
    assert np.linalg.norm(found - known) < 0.05 * np.linalg.norm(known)


def test_an_equilibrium_that_does_not_settle_still_bears_derivatives(shape):
    hasty = EquilibriumSettings(tolerance=1e-12, max_states=2)
    stocking = fitted_stocking(shape, "3")
    model = LegModel3D(shape, laws(3.0, 3.0), COARSE)
    found = EquilibriumSolver(model, stocking, hasty).solve(sensitivities=("deep.C10",))
    assert not found.converged and len(found.changes) == 2
    assert found.state.report.complete and "deep.C10" in found.state.sensitivities


@pytest.mark.slow
def test_a_wrong_stiffness_fits_worse(result):
    best, misfit = result.best, result.best.misfit
    twice = {"deep.C10": 2 * best.stiffness["deep.C10"]}
    wrong = EquilibriumSolver(result.model, result.leg.stocking).solve(twice, start=result.equilibrium)
    assert np.sum(misfit.distances(wrong.shape) ** 2) > 5 * np.sum(best.distances**2)


@pytest.mark.slow
def test_a_motion_left_between_the_scans_is_found(result, truth):
    """Shifted by 0.3 mm, the target is met again with that shift."""
    from legfem.geometry.motion import rigidly_moved

    shift = np.array([0.3, -0.2, 0.0])
    moved = rigidly_moved(truth[1].shape, np.eye(3), shift)
    leg = replace(result.leg, compressed=moved, accuracy=replace(ACCURACY, shift_sd=(0.5, 0.5, 0.5)))
    found = identify_in_stocking(leg, Silent(), mesh=COARSE).details.best
    np.testing.assert_allclose(found.rigid[:2], shift[:2], atol=0.05)
    assert found.stiffness["deep.C10"] == pytest.approx(result.best.stiffness["deep.C10"], rel=0.1)


def test_pressures_are_those_of_a_leg_squeezed_from_all_sides(shape, truth):
    model, worn = truth
    probe = PressureProbe(model.compression)
    veins = default_veins(shape, float(calf_levels(shape)[2]))
    pressures = tissue_pressures(probe, worn.state, worn.load, veins)
    assert len(pressures.at_veins) == 3
    for vein in pressures.at_veins:
        assert 0.7 < vein / pressures.mean_interface < 1.4
    assert pressures.greatest_in_fat > pressures.mean_in_muscle
    outside = probe.at(np.array([[500.0, 0.0, 80.0]]), worn.state)
    assert np.isnan(outside).all()


def test_the_pressure_at_a_node_is_the_unknown_there(truth):
    model, worn = truth
    probe = PressureProbe(model.compression)
    where, values = probe.nodal("deep", worn.state)
    chosen = np.linspace(0, len(where) - 1, 20).astype(int)
    inwards = where[chosen] * [0.999, 0.999, 1.0] + [0.0, -0.03, 0.0]
    found = probe.at(inwards, worn.state)
    good = np.isfinite(found)
    assert good.sum() > 10
    np.testing.assert_allclose(found[good], values[chosen][good], rtol=0.1)


@pytest.mark.slow
def test_a_finer_mesh_has_the_same_pressures(shape, truth, result):
    """Within 3 % on these coarse meshes; studies/stockings has the figures for larger ones."""
    fine_model, worn = truth
    model = result.model
    stocking = fitted_stocking(shape, "3")
    names = dict(zip(("deep.C10", "superficial.C10"), 1e-3 * np.array(PLANTED_KPA), strict=True))
    coarse = EquilibriumSolver(model, stocking).solve(names)
    fine, rough = (
        tissue_pressures(PressureProbe(m.compression), w.state, w.load, result.leg.veins)
        for m, w in ((fine_model, worn), (model, coarse))
    )
    np.testing.assert_allclose(rough.at_veins, fine.at_veins, rtol=0.03)
    assert rough.mean_interface == pytest.approx(fine.mean_interface, rel=0.005)


@pytest.mark.slow
@pytest.mark.skipif(not (SHARED / "data" / "leg_geometry").is_dir(), reason="needs ../shared/data/leg_geometry")
def test_a_real_leg_s_surfaces_can_wear_a_stocking(tmp_path):
    from legfem.stockings.loading import load_leg

    folder = SHARED / "data" / "leg_geometry"
    (tmp_path / "leg.toml").write_text(
        f"""id = "real"
title = "BodyParts3D, right leg"
origin = "measured"
[bare.surfaces]
skin = "{folder / "right_skin.stl"}"
muscle_hull = "{folder / "right_muscle_hull.stl"}"
tibia = "{folder / "right_tibia.stl"}"
fibula = "{folder / "right_fibula.stl"}"
[stocking]
compression_class = "2"
[segment]
from_mm = 240.0
to_mm = 340.0
[tissues.deep]
C10_kPa = 3.25
[tissues.superficial]
C10_kPa = 8.17
"""
    )
    found = identify_in_stocking(load_leg(tmp_path), Silent(), 20_000).details
    assert found.equilibrium.converged and found.pressures is not None
    assert 1.5e-3 < found.pressures.mean_interface < 3.5e-3
    for vein in found.pressures.at_veins:
        assert 0.6 < vein / found.pressures.mean_interface < 1.6
