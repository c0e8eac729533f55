"""Mechanisms vanish at their nulls, have the right tangents, and do what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_derivatives import forces, taylor_orders, worst_error
from making_mechanics import COARSE, block, fixed_steps, free_of_contact, nodal, one_tissue, pressed_block, subject_3

from legfem.common.errors import InputError
from legfem.experiments.plane_strain import LateralPlacement, PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.system import System
from legfem.mechanics.materials import ExponentialStiffening, Yeoh
from legfem.mechanics.terms import Fibres, Prestress, Tissue, Viscoelasticity
from legfem.mechanics.terms.membranes import contour_tangents
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.stepping import follow

TISSUES = one_tissue(1e-3, 28.0, C20=0.5e-3)
SMALL = block(np.linspace(-20, 20, 11), np.linspace(-20, 0, 6))
CYCLE = Protocol.cycle(2.0, rate=1.0, hold=4.0)
YEOH = Tissue("deep", Yeoh.of(TISSUES.deep))
EXPONENTIAL = Tissue("deep", ExponentialStiffening.of(TISSUES.deep))
CIRCLE = 30 * np.column_stack([f(np.linspace(0, 2 * np.pi, 61)[:-1]) for f in (np.cos, np.sin)])
# What is added to the model, and values at which it is felt.
MECHANISMS = {
    "third order": ([YEOH], {"deep.C30": 2e-3}),
    "exponential": ([EXPONENTIAL], {"deep.stiffening": 2e-3, "deep.exponent": 1.5}),
    "prestress": ([Prestress(CIRCLE, region="deep")], {"deep.prestress.tension": 1e-3}),
    "fibres": ([Fibres("deep", axis=(0.8, 0.6, 0.0))], {"deep.fibres.shear": 2e-3, "deep.fibres.extension": 5e-3}),
}


def _system(name: str, formulation: str = "mixed") -> tuple[System, dict[str, float]]:
    terms, felt = MECHANISMS[name]
    system = pressed_block(formulation, None, TISSUES, direction=(0.28, -0.96), meshed=SMALL, mechanisms=terms)
    return system, {**system.model.parameters, **felt}


@pytest.mark.parametrize("name", MECHANISMS)
def test_it_vanishes_at_its_null_and_is_felt_beyond(name):
    _, felt = MECHANISMS[name]
    base = pressed_block("mixed", None, TISSUES, direction=(0.28, -0.96), meshed=SMALL)
    without = forces(base, base.model.parameters, CYCLE, 0.5)
    system, values = _system(name)
    null = forces(system, system.model.parameters, CYCLE, 0.5)
    np.testing.assert_allclose(null, without, rtol=1e-10, atol=1e-14)
    change = abs(forces(system, values, CYCLE, 0.5).max() / without.max() - 1)
    print(name, felt, change)
    assert change > 0.01


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_tangent_is_the_residual_s_derivative(name):
    system, values = _system(name)
    system.set_parameters(values)
    assert follow(system, NewtonSolver(system), Protocol.ramp(1.5, rate=1.0), fixed_steps(0.5)).complete
    system.set_displacement(1.9)
    system.set_time(1.9, 0.4)
    orders = taylor_orders(system)
    print(orders)
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


@pytest.mark.parametrize("name", MECHANISMS)
def test_sensitivities_are_exact(name):
    system, values = _system(name)
    felt = list(MECHANISMS[name][1])
    assert worst_error(system, values, ["deep.C10", *felt], CYCLE, 0.5) < 1e-4


def test_tangents_of_a_contour():
    angle = np.linspace(0, 2 * np.pi, 17)
    points = 28 * np.column_stack([np.cos(angle), np.sin(angle)])
    expected = np.column_stack([-np.sin(angle), np.cos(angle)])
    tangents = contour_tangents(CIRCLE, points)
    assert (np.sum(tangents * expected, axis=1) > np.cos(np.pi / 59)).all()
    with pytest.raises(InputError, match="contour"):
        Prestress(CIRCLE[:2])


def test_tension_resists_what_turns_its_line_and_works_along_it():
    """Its work is tension/2 |grad u t|^2 times the volume; across it there is none."""
    wide = np.array([[-1e3, -50], [1e3, -50], [1e3, 2e3], [-1e3, 2e3]])
    terms = [Prestress(wide, 0.3, region="deep")]
    plain, tense = (free_of_contact(SMALL, TISSUES, "displacement", mechanisms) for mechanisms in ([], terms))
    nodes, dofs = nodal(tense)
    for gradient, along in (([[0, 0], [2e-3, 0]], 2e-3), ([[0, 2e-3], [0, 0]], 0.0)):
        for system in (plain, tense):
            system.unknown.x.array[dofs] = nodes @ np.array(gradient).T
        change = tense.balance().internal_work - plain.balance().internal_work
        assert change == pytest.approx(0.3 * along**2 * 800.0, rel=1e-9, abs=1e-12)


@pytest.fixture(scope="module")
def leg() -> PlaneStrainIndentation:
    settings = PlaneStrainSettings(mesh=COARSE, steps=fixed_steps(1.0))
    return PlaneStrainIndentation(*subject_3(), settings)


@pytest.mark.slow
def test_a_leg_with_every_mechanism_at_its_null_is_the_base_model(leg):
    """Sensitivities at the nulls are the effects' signatures, in loading, hold and unloading."""
    section, _, tissues = subject_3()
    deep = Yeoh.of(tissues.deep)
    everything = [
        Tissue("deep", deep),
        Viscoelasticity("deep", deep),
        Viscoelasticity("superficial", tissues.superficial),
        Prestress(section.fascia),
    ]
    full = PlaneStrainIndentation(*subject_3(), leg.settings, mechanisms=everything)
    cycle = Protocol.cycle(4.0, rate=1.0, hold=30.0)
    names = ["deep.C10", "deep.viscoelasticity.ratio", "fascia.prestress.tension"]
    base, null = leg.solve(None, cycle), full.solve(None, cycle, names)
    np.testing.assert_allclose(null.path.force, base.path.force, rtol=1e-9, atol=1e-11)
    top, end = (null.path.sensitivity_at(names[1], time) for time in (4.0, 34.0))
    print(top, end)
    assert top > 0 and abs(end) < 0.2 * top
    np.testing.assert_array_equal(null.curve.sensitivities["deep.C10"], null.path.sensitivities["deep.C10"][:5])


def test_a_placement_as_stated_changes_nothing(leg):
    force = leg.solve(depth=6.0).curve.force
    moved = leg.solve(depth=6.0, placement=LateralPlacement(tilt_deg=5.0)).curve.force
    assert abs(moved[-1] / force[-1] - 1) > 1e-3
    again = leg.solve(depth=6.0, placement=LateralPlacement()).curve.force
    np.testing.assert_allclose(again, force, rtol=1e-12)


def test_a_tilted_travel_turns_about_first_touch(leg):
    """The centre at first touch stays; a path tilted there and its force turn together."""
    stated = leg.system.direction.copy()
    leg.solve(depth=1.0, placement=LateralPlacement(tilt_deg=30.0))
    centre = np.array(leg.system.skin.domain.centre.value)
    np.testing.assert_allclose(np.linalg.norm(centre - leg.section_mesh.touch), 1.0, rtol=1e-12)
    assert (centre - leg.section_mesh.touch) @ stated == pytest.approx(np.cos(np.pi / 6))


def test_an_offset_line_starts_at_its_own_first_touch(leg):
    for offset in (-4.0, 4.0):
        light = leg.solve(depth=0.02, placement=LateralPlacement(offset_mm=offset))
        assert light.report.complete and 0 < light.curve.force[-1] < 0.02
        centre = np.array(leg.system.skin.domain.centre.value)
        across = np.array([-leg.section_mesh.direction[1], leg.section_mesh.direction[0]])
        assert (centre - leg.section_mesh.touch) @ across == pytest.approx(offset)


def test_an_offset_is_the_test_at_another_aim(leg):
    section, indenter, tissues = subject_3()
    across = np.array([-leg.section_mesh.direction[1], leg.section_mesh.direction[0]])
    elsewhere = replace(indenter, aim=indenter.aim + 3.0 * across)
    settings = leg.settings
    there = PlaneStrainIndentation(section, elsewhere, tissues, settings).solve(depth=8.0)
    moved = leg.solve(depth=8.0, placement=LateralPlacement(offset_mm=3.0))
    assert moved.curve(8.0) == pytest.approx(float(there.curve(8.0)), rel=0.02)


@pytest.mark.parametrize("wrong", [{"tilt_deg": 75.0}, {"offset_mm": np.nan}])
def test_an_impossible_placement_is_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        LateralPlacement(**wrong)


def test_branches_without_a_share_are_left_out_of_the_forms_until_they_have_one():
    tissues = one_tissue(1e-3, 28.0, C20=0.5e-3)
    branches = [Viscoelasticity("deep", tissues.deep, branch=str(k)) for k in (1, 2)]
    plain, relaxing = (pressed_block(mechanisms=given) for given in ((), branches))
    state = 1e-3 * np.random.default_rng(0).standard_normal(len(plain.unknown.x.array))

    def residual_of(system, **ratios):
        system.set_parameters({f"deep.{name}.ratio": value for name, value in ratios.items()})
        system.set_time(1.0, 1.0)
        system.unknown.x.array[:] = state
        return system.assemble_residual().x.array.copy(), system.assemble_tangent().norm()

    without = residual_of(plain)
    assert np.isfinite(without[0]).all()
    silent = residual_of(relaxing, viscoelasticity1=0.0, viscoelasticity2=0.0)
    np.testing.assert_allclose(silent[0], without[0], rtol=1e-9, atol=1e-15)
    assert silent[1] == pytest.approx(without[1], rel=1e-9)
    for number in (1, 2):
        ratios = {f"viscoelasticity{k}": 0.5 * (k == number) for k in (1, 2)}
        heard = residual_of(relaxing, **ratios)
        assert np.linalg.norm(heard[0] - without[0]) > 1e-3 * np.linalg.norm(without[0])
    again = residual_of(relaxing, viscoelasticity1=0.0, viscoelasticity2=0.0)
    np.testing.assert_array_equal(again[0], silent[0])
