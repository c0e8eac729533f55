"""The plane-strain test: what goes in and what comes out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from making import write_subject
from making_mechanics import COARSE, fixed_steps, subject_3

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.geometry.indenter import Indenter
from legfem.legs.finite_element_models import tissues_of
from legfem.legs.loading import load_subject
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.solve.protocol import Protocol

DEPTHS = np.array([1.0, 3.0, 5.0, 8.0])


@pytest.fixture(scope="module")
def test() -> PlaneStrainIndentation:
    """Subject 3 on a coarse mesh; steps of one size, so that runs compare exactly."""
    return PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(mesh=COARSE, steps=fixed_steps(1.0)))


@pytest.fixture(scope="module")
def curve(test):
    return test.solve(depth=8.0).curve


def test_the_curve_starts_at_touch_and_stiffens(curve):
    assert (curve.displacement[0], curve.force[0]) == (0.0, 0.0)
    assert curve.depth == 8.0
    assert (np.diff(curve.force) > 0).all()
    assert (np.diff(curve.force, 2) > 0).all()


def test_the_same_question_has_the_same_answer(test, curve):
    test.solve({"deep.C10": 5e-3}, depth=2.0)
    np.testing.assert_allclose(test.solve(depth=8.0).curve.force, curve.force, rtol=1e-10)


def test_all_stiffnesses_times_k_is_the_force_times_k(test, curve):
    """The contact's stiffness follows the tissues', so that this is exact."""
    k = 3.7
    scaled = {
        name: value * k if ".C" in name else value / k
        for name, value in test.model.parameters.items()
        if name.split(".")[0] in ("deep", "superficial", "fascia")
    }
    force = test.solve(scaled, depth=8.0).curve.force
    np.testing.assert_allclose(force, k * curve.force, rtol=1e-8)


def test_the_force_is_that_of_the_whole_cylinder(curve):
    section, indenter, tissues = subject_3()
    longer = Indenter(indenter.radius, 2 * indenter.length, indenter.aim, indenter.direction_deg)
    settings = PlaneStrainSettings(mesh=COARSE, steps=fixed_steps(1.0))
    double = PlaneStrainIndentation(section, longer, tissues, settings).solve(depth=8.0).curve
    np.testing.assert_allclose(double.force, 2 * curve.force, rtol=1e-10)


@pytest.mark.parametrize("name", ["deep.C10", "deep.C20", "superficial.C10", "fascia.C10"])
def test_stiffer_tissue_needs_more_force(test, curve, name):
    stiffer = test.solve({name: 1.5 * test.model.parameters[name]}, depth=8.0).curve
    assert stiffer(8.0) > 1.001 * curve(8.0)


@pytest.mark.slow
def test_without_its_second_terms_the_polynomial_is_neo_hookean():
    section, indenter, tissues = subject_3()
    settings = PlaneStrainSettings(mesh=COARSE, steps=fixed_steps(1.0))
    curves = []
    for deep in (NeoHookean(1.2e-3, 28.0), ReducedPolynomial(1.2e-3, 28.0, C20=0.0)):
        laws = type(tissues)(deep, tissues.superficial, tissues.fascia)
        curves.append(PlaneStrainIndentation(section, indenter, laws, settings).solve(depth=5.0))
    assert curves[0].report.complete and curves[1].report.complete
    np.testing.assert_allclose(curves[0].curve(DEPTHS[:3]), curves[1].curve(DEPTHS[:3]), rtol=1e-8)


def test_both_formulations_agree(subject_3_test):
    displacement = PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(formulation="displacement"))
    mixed = subject_3_test.solve(depth=8.0).curve(DEPTHS)
    error = displacement.solve(depth=8.0).curve(DEPTHS) / mixed - 1
    print(error)
    assert (np.abs(error) < 5e-3).all()
    assert (error > 0).all(), "displacements alone are the stiffer"


def test_contact_starts_at_zero_displacement(test):
    """The mesh's outline is what is touched: no force before it, force right after."""
    solved = test.solve(depth=0.02)
    assert solved.report.complete and 0 < solved.curve.force[-1] < 0.02


def test_sensitivities_come_with_the_loading_curve(test):
    solved = test.solve(None, Protocol.through((3.0, 1.0), rate=1.0), ["deep.C10", "fascia.C10"])
    assert set(solved.curve.sensitivities) == {"deep.C10", "fascia.C10"}
    for values in solved.curve.sensitivities.values():
        assert len(values) == len(solved.curve.displacement) == 4
        assert values[0] == 0.0 and (np.diff(values) > 0).all()
    assert solved.path.displacement[-1] == 1.0


def test_every_accepted_step_is_told(test):
    seen = []
    solved = test.solve(depth=3.0, on_step=seen.append)
    np.testing.assert_array_equal(solved.path.displacement[1:], seen)


def test_an_unknown_parameter_is_named(test):
    with pytest.raises(KeyError, match="muscle"):
        test.solve({"muscle.C10": 1.0})


def test_parameters_of_the_solution_hold_the_contact_s(test):
    parameters = test.solve({"deep.C10": 2e-3}, depth=0.5).parameters
    assert parameters["deep.C10"] == 2e-3
    expected = test.settings.contact.penalty(parameters, test.indenter.radius)
    assert parameters["contact.stiffness"] == parameters["friction.stiffness"] == expected


def test_tissues_of_a_subject_folder(tmp_path):
    tissues = tissues_of(load_subject(write_subject(tmp_path / "made")))
    assert tissues.deep == ReducedPolynomial(C10=1e-3, D1=28.0, C20=0.0, D2=28.0)
    assert tissues.superficial == NeoHookean(C10=2e-3, D1=22.5)
    assert tissues.fascia.poisson_ratio < 0
    assert not math.isinf(tissues.deep.D2)
