"""The indenter's signed distance, the pressure laws and the tangential laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

from legfem.common.errors import InputError
from legfem.mechanics.contact import ContactSettings, Coulomb, ExponentialPressure, Frictionless, Rough, StiffPressure
from legfem.mechanics.indenters import RigidCylinder

LAWS = [
    pytest.param(ExponentialPressure(p0=1e-3, c0=0.02), id="exponential"),
    pytest.param(StiffPressure(stiffness=0.4, width=0.02), id="stiff"),
]


def _numbers(expression) -> np.ndarray:
    lowered = apply_algebra_lowering(expand_derivatives(ufl.as_ufl(expression)))
    if lowered.ufl_shape == ():
        return np.array(lowered(()))
    return np.array([float(lowered[i](())) for i in range(lowered.ufl_shape[0])])


def _pressure(law, overclosure: float) -> float:
    return float(_numbers(law.pressure(ufl.as_ufl(overclosure))))


def _slope(law, overclosure: float) -> float:
    h = ufl.variable(ufl.as_ufl(overclosure))
    return float(_numbers(ufl.diff(law.pressure(h), h)))


def test_the_gap_is_a_signed_distance():
    cylinder = RigidCylinder(15.0)
    for y, gap in (([0.0, 20.0], 5.0), ([15.0, 0.0], 0.0), ([-6.0, 8.0], -5.0)):
        assert float(_numbers(cylinder.gap(ufl.as_vector(y)))) == pytest.approx(gap, abs=1e-14)


def test_the_normal_is_the_gap_s_gradient():
    cylinder = RigidCylinder(15.0)
    y = ufl.variable(ufl.as_vector([9.0, -12.0]))
    expected = _numbers(ufl.diff(cylinder.gap(y), y))
    np.testing.assert_allclose(_numbers(cylinder.normal(y)), expected, rtol=1e-14)
    np.testing.assert_allclose(expected, [0.6, -0.8], rtol=1e-14)


def test_the_exponential_law_is_abaqus():
    law = ExponentialPressure(p0=2e-3, c0=0.05)
    for h in (-0.049, -0.02, 0.0, 0.03, 0.2):
        z = h / 0.05 + 1
        expected = 2e-3 / (math.e - 1) * z * (math.exp(z) - 1)
        assert _pressure(law, h) == pytest.approx(expected, rel=1e-13)
    assert _pressure(law, 0.0) == pytest.approx(2e-3, rel=1e-14)


def test_the_exponential_law_goes_on_along_its_tangent():
    law = ExponentialPressure(p0=1e-3, c0=0.02)
    limit, step = 6 * 0.02, 0.01
    slope = _slope(law, limit - 1e-9)
    beyond = _pressure(law, limit + step) - _pressure(law, limit)
    assert beyond == pytest.approx(slope * step, rel=1e-6)
    assert math.isfinite(_pressure(law, 15.0))


def test_the_stiff_law_is_a_rounded_penalty():
    law = StiffPressure(stiffness=0.4, width=0.02)
    assert _pressure(law, 0.05) == pytest.approx(0.4 * 0.05, rel=1e-14)
    assert _pressure(law, 0.0) == pytest.approx(0.4 * 0.02 / 4, rel=1e-14)


@pytest.mark.parametrize("law", LAWS)
def test_pressure_starts_at_the_onset_and_grows(law):
    assert _pressure(law, -law.onset) == 0.0
    assert _pressure(law, -2 * law.onset) == 0.0
    pressures = [_pressure(law, h) for h in np.linspace(-law.onset, 10 * law.onset, 60)]
    assert (np.diff(pressures) > 0).all()


@pytest.mark.parametrize("law", LAWS)
def test_pressure_and_slope_are_continuous(law):
    w, tiny = law.onset, 1e-9
    for h in (-w, w, 6 * w):
        assert _pressure(law, h + tiny) == pytest.approx(_pressure(law, h - tiny), rel=1e-4, abs=1e-9)
        if h > 0 or isinstance(law, StiffPressure):
            assert _slope(law, h + tiny) == pytest.approx(_slope(law, h - tiny), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_the_pressure_is_in_proportion_to_the_stiffness(law):
    of = "stiffness" if isinstance(law, StiffPressure) else "p0"
    stiffer = replace(law, **{of: 4 * getattr(law, of)})
    for h in (-0.5 * law.onset, 0.3 * law.onset, 4 * law.onset):
        assert _pressure(stiffer, h) == pytest.approx(4 * _pressure(law, h), rel=1e-13)


def _traction(law, slip, pressure: float) -> np.ndarray:
    return _numbers(law.traction(ufl.as_vector(slip), ufl.as_ufl(pressure)))


def test_rough_contact_is_a_spring_without_limit():
    np.testing.assert_allclose(_traction(Rough(0.5), [0.3, -0.4], 0.0), [0.15, -0.2])


def test_frictionless_contact_has_no_traction():
    np.testing.assert_array_equal(_traction(Frictionless(), [0.3, -0.4], 1.0), [0.0, 0.0])


def test_coulomb_friction_sticks_and_then_slips():
    law = Coulomb(friction=0.5, stiffness=0.4)
    np.testing.assert_allclose(_traction(law, [0.3, -0.4], 1.0), [0.12, -0.16], rtol=1e-12)
    sliding = _traction(law, [0.3, -0.4], 0.1)
    assert np.linalg.norm(sliding) == pytest.approx(0.5 * 0.1, rel=1e-12)
    np.testing.assert_allclose(sliding / 0.05, [0.6, -0.8], rtol=1e-12)
    np.testing.assert_array_equal(_traction(law, [0.0, 0.0], 0.1), [0.0, 0.0])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_impossible_numbers_are_refused(law, value):
    for name in vars(law):
        with pytest.raises(InputError, match=name):
            type(law)(**{**vars(law), name: value})


def test_the_penalty_scales_with_the_tissue_and_the_curvature():
    settings = ContactSettings(stiffness=100.0)
    tissue = {"deep.C10": 1e-3, "deep.C20": 2e-3, "superficial.C10": 3e-3}
    penalty = settings.penalty(tissue, radius=15.0)
    assert penalty == pytest.approx(100 * 2 * 6e-3 / 15)
    doubled = {name: 2 * value for name, value in tissue.items()}
    assert settings.penalty(doubled, radius=15.0) == pytest.approx(2 * penalty)
    assert settings.penalty(tissue, radius=30.0) == pytest.approx(penalty / 2)


@pytest.mark.parametrize("field", ["normal", "tangential"])
def test_an_unknown_law_is_named(field):
    with pytest.raises(InputError, match="sticky"):
        ContactSettings(**{field: "sticky"})
