"""What the model doesn't know: effects of one standard deviation, with what is stated of a leg."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from making_diagnosis import GRID, SOUGHT, fat, observations, problem_of, ramps
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import LateralPlacement
from legfem.geometry.section import CALF, LAYERS, LIMBS
from legfem.inverse.accuracy import GEOMETRY_DOF, MATERIAL_LOG_SD, Cause
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.correction import read_correction
from legfem.inverse.errors import NuisanceEffect
from legfem.inverse.explain import explain
from legfem.inverse.library import NuisanceChanges
from legfem.inverse.library_build import smoothed
from legfem.inverse.linearised import nuisance_effects, variance_degrees
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import accuracy_of
from legfem.legs.loading import load_subject
from legfem.legs.nuisances import (
    AIM_SD_MM,
    CONTOUR_ARC_MM,
    CONTOUR_SD_MM,
    DIRECTION_SD_DEG,
    DRAWN,
    RIG_SD_MM_PER_N,
    ShapeAccuracy,
    errors_of_geometry,
)
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import LegAccuracy
from legfem.meshing.section import MeshMotion


def effects_of(*given) -> dict[str, FloatArray]:
    return {one.name: one.effect for one in nuisance_effects(*given)}


BONES = LIMBS[CALF]
OUTLINE = Cause("outlines", GEOMETRY_DOF)


@pytest.fixture(scope="module")
def blank():
    """A leg's observations and force, with changes that differ from geometry to geometry."""
    observed, predictor = observations(ramps())
    force = predictor({DEEP_C10: 0.001, DEEP_C20: 0.0008})
    geometric = {
        name: {"force": 0.01 * np.cos((k + 1) * GRID / 15)} for k, name in enumerate(errors_of_geometry(BONES))
    }
    return observed, force, NuisanceChanges(GRID, geometric, {"superficial.C10": {"force": fat(GRID)}})


def test_an_effect_is_the_force_times_its_relative_change_by_one_standard_deviation(blank):
    observed, force, nuisances = blank
    effects = effects_of(nuisances, observed, force, ShapeAccuracy(bones=BONES))
    expected = MATERIAL_LOG_SD["superficial.C10"] * fat(observed.displacement) * force
    deep = observed.displacement > GRID[0]
    np.testing.assert_allclose(effects["stiffness of the fat"][deep], expected[deep], rtol=1e-3)
    aim = CubicSpline(GRID, nuisances.geometric["aim"]["force"])(observed.displacement) * force
    np.testing.assert_allclose(effects["aim"][deep], aim[deep], rtol=1e-9)


def test_effects_of_geometry_follow_what_is_stated_of_the_leg(blank):
    observed, force, nuisances = blank
    usual = effects_of(nuisances, observed, force, ShapeAccuracy(bones=BONES))
    worse = effects_of(
        nuisances, observed, force, ShapeAccuracy(contour_sd=2 * CONTOUR_SD_MM, aim_sd=3 * AIM_SD_MM, bones=BONES)
    )
    assert list(usual) == list(worse)
    for name, effect in usual.items():
        outline = "outline" in name or name.startswith(LIMBS[CALF])
        factor = 2 if outline else 3 if name == "aim" else 1
        np.testing.assert_allclose(worse[name], factor * effect)
    known = ShapeAccuracy(contour_sd=0.0, aim_sd=0.0, direction_sd=0.0, contact_sd=0.0, bones=BONES)
    assert list(effects_of(nuisances, observed, force, known)) == ["stiffness of the fat"]
    assert not effects_of(nuisances, observed, force, replace(known, assumed_sd=0.0))


def test_a_drawn_leg_is_known_unless_its_folder_says_otherwise():
    drawn = load_subject(SUBJECTS.find("3"))
    assert drawn.origin == "reconstructed"
    assert accuracy_of(drawn) == ShapeAccuracy(**asdict(DRAWN) | {"rig_sd": RIG_SD_MM_PER_N}, bones=BONES)
    stated = replace(drawn, accuracy=LegAccuracy(contour_sd=1.0, assumed_sd=0.1))
    assert accuracy_of(stated) == ShapeAccuracy(
        0.1, contour_sd=1.0, aim_sd=AIM_SD_MM, direction_sd=DIRECTION_SD_DEG, bones=BONES
    )
    assert accuracy_of(replace(drawn, origin="measured")) == ShapeAccuracy(bones=BONES)


def test_modes_of_an_outline_have_its_error_s_covariance_along_the_arc(blank):
    observed, force, nuisances = blank
    effects = effects_of(nuisances, observed, force, ShapeAccuracy(bones=BONES))
    for part in LAYERS:
        modes = np.array([e for name, e in effects.items() if name.startswith(f"outline of the {part}")])
        hats = {name: m for name, m in errors_of_geometry(BONES).items() if name.startswith(f"outline of the {part}")}
        arcs = np.array([m.arc for m in hats.values()])
        apart = (arcs[:, None] - arcs[None, :]) / CONTOUR_ARC_MM
        courses = [nuisances.geometric[name]["force"] for name in hats]
        each = np.array([force * CubicSpline(GRID, course)(observed.displacement) for course in courses])
        expected = each.T @ np.exp(-0.5 * apart**2) @ each
        found = modes.T @ modes
        shallow = observed.displacement < GRID[0]
        expected[shallow] = expected[:, shallow] = 0.0
        found[shallow] = found[:, shallow] = 0.0
        np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())


def test_errors_of_the_correction_count_where_it_is_applied(blank):
    observed, force, nuisances = blank
    correction = read_correction(REFERENCE)
    without = effects_of(nuisances, observed, force, ShapeAccuracy(bones=BONES))
    effects = effects_of(nuisances, observed, force, ShapeAccuracy(bones=BONES), correction, (1.0, 0.8))
    added = {name.removeprefix("3D correction: ") for name in effects.keys() - without.keys()}
    assert added == set(correction.errors)
    deep = np.argmax(observed.displacement)
    most = np.hypot.reduce([effects[f"3D correction: {name}"][deep] for name in added])
    assert 0.001 < most / force[deep] < 0.2


def test_errors_of_the_geometry_are_one_standard_deviation_each():
    errors = errors_of_geometry(BONES)
    outlines = [error for error in errors.values() if isinstance(error, MeshMotion)]
    assert {error.size for error in outlines} == {CONTOUR_SD_MM}
    assert {error.outline for error in outlines} == {*LAYERS, *BONES}
    assert errors["aim"] == LateralPlacement(offset_mm=AIM_SD_MM)
    assert errors["direction"] == LateralPlacement(tilt_deg=DIRECTION_SD_DEG)
    assert len(outlines) + 2 == len(errors)


def test_a_variance_that_a_bound_makes_small_keeps_its_degrees_of_freedom():
    """A bound takes variance away, not what the errors' sizes are known by."""
    problem, base = problem_of(ramps(), seed=1)
    known, name = 0.1 * base.sensitivities[:, :1], "outline of the skin, mode 1"
    stated = {name: NuisanceEffect(name, known[:, 0], OUTLINE)}
    problem = replace(problem, errors=replace(problem.errors, known=known, stated=stated))
    one = explain(replace(base, problem=problem), SOUGHT[:1]).base
    assert np.isfinite(one.degrees_of_freedom[0])
    posterior = replace(one.posterior, covariance=1e-6 * one.posterior.covariance)
    assert replace(one, posterior=posterior).degrees_of_freedom[0] >= GEOMETRY_DOF


def test_what_is_known_poorly_of_the_leg_widens_intervals():
    """An effect of the outlines that is all that errs: its own degrees of freedom remain."""
    problem, base = problem_of(ramps(), seed=1)
    errors = problem.errors
    effect = base.sensitivities[:, :1]
    name = "outline of the skin, mode 1"
    stated = {name: NuisanceEffect(name, effect[:, 0], OUTLINE)}
    known = replace(errors, known=effect, stated=stated)
    estimator = np.linalg.pinv(base.sensitivities)
    variance = np.full((len(base.free),) * 2, 1.0)
    degrees = variance_degrees(variance, estimator, known)
    assert degrees[0] == pytest.approx(3.0)
    of_cell = NuisanceEffect("load cell's gain", effect[:, 0], Cause("load cell's gain"))
    exact = replace(known, stated={of_cell.name: of_cell})
    assert variance_degrees(variance, estimator, exact)[0] == np.inf


def test_waves_of_elements_that_come_into_contact_go_and_the_course_stays():
    """A fat's effect falls with depth; waves of 1.5 mm are a coarse mesh's (3 % of it measured)."""
    course = 0.26 * GRID**-0.45
    waves = 0.03 * course * np.sin(2 * np.pi * GRID / 1.5)
    inside = (GRID > 3) & (GRID < 19)
    left = smoothed(GRID, course + waves) / course - 1
    assert np.abs(left[inside]).max() < 0.006
    np.testing.assert_allclose(smoothed(GRID, course), course, rtol=0.002)
    stopped = np.where(GRID > 15, np.nan, course)
    np.testing.assert_array_equal(smoothed(GRID, stopped), stopped)
    vanishing = -1.0 / (20.6 - GRID)
    np.testing.assert_array_equal(smoothed(GRID, vanishing), vanishing)
