"""Strain energies against stresses derived by hand, in the states of a textbook."""

from __future__ import annotations

import math
from dataclasses import replace

import basix.ufl
import numpy as np
import pytest
import ufl
from scipy.optimize import brentq
from ufl.algorithms import expand_derivatives
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

from legfem.common.errors import InputError
from legfem.mechanics.kinematics import deformation_gradient, isochoric_first_invariant
from legfem.mechanics.materials import ExponentialStiffening, NeoHookean, ReducedPolynomial, Yeoh

LAWS = [
    pytest.param(NeoHookean(C10=1.2e-3, D1=28.0), id="neo-hookean"),
    pytest.param(ReducedPolynomial(C10=0.7e-3, D1=28.0, C20=0.8e-3, D2=14.0), id="reduced-polynomial"),
    pytest.param(ReducedPolynomial(C10=0.7e-3, D1=28.0, C20=0.8e-3), id="without-D2"),
    pytest.param(NeoHookean(C10=0.1, D1=22.5), id="fascia"),
    pytest.param(Yeoh(C10=0.7e-3, D1=28.0, C20=0.3e-3, C30=0.6e-3), id="yeoh"),
    pytest.param(
        ExponentialStiffening(C10=0.7e-3, D1=28.0, C20=0.3e-3, D2=14.0, stiffening=0.5e-3, exponent=1.4),
        id="exponential",
    ),
]
STRETCHES = [0.6, 1.0, 1.15, 1.6]


def _number(expression) -> float:
    return float(apply_algebra_lowering(expand_derivatives(expression))(()))


def _energy(law, F: np.ndarray) -> float:
    return _number(law.strain_energy(ufl.as_tensor(F.tolist())))


def _first_piola(law, F: np.ndarray) -> np.ndarray:
    """Return dU/dF, as UFL differentiates the energy."""
    variable = ufl.variable(ufl.as_tensor(F.tolist()))
    derivative = expand_derivatives(ufl.diff(law.strain_energy(variable), variable))
    stress = apply_algebra_lowering(derivative)
    return np.array([[float(stress[i, j](())) for j in range(3)] for i in range(3)])


def _cauchy(law, F: np.ndarray) -> np.ndarray:
    return _first_piola(law, F) @ F.T / np.linalg.det(F)


def _slopes(law, F: np.ndarray) -> tuple[float, float, float]:
    """Return dU/dI1bar, dU/dJ and J, by hand."""
    J = np.linalg.det(F)
    stretch = J ** (-2 / 3) * np.trace(F.T @ F) - 3
    C20, D2 = getattr(law, "C20", 0.0), getattr(law, "D2", math.inf)
    exponential = getattr(law, "stiffening", 0) * np.expm1(getattr(law, "exponent", 1) * stretch)
    third = 3 * getattr(law, "C30", 0.0) * stretch**2
    return (law.C10 + 2 * C20 * stretch + third + exponential, 2 * (J - 1) / law.D1 + 4 * (J - 1) ** 3 / D2, J)


def _random_gradients(count: int, seed: int = 1) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3)) for _ in range(count)]


@pytest.mark.parametrize("law", LAWS)
def test_uniaxial_state(law):
    for axial in STRETCHES:
        for lateral in (0.9, 1.05):
            F = np.diag([axial, lateral, lateral])
            dI, dJ, J = _slopes(law, F)
            deviator = 2 * dI * J ** (-5 / 3) * (axial**2 - lateral**2) / 3
            expected = np.diag([2 * deviator + dJ, -deviator + dJ, -deviator + dJ])
            np.testing.assert_allclose(_cauchy(law, F), expected, rtol=1e-12, atol=1e-17)


@pytest.mark.parametrize("law", LAWS)
def test_uniaxial_tension_with_free_sides(law):
    """The lateral stretch that frees the sides, found by hand, frees them in the code too."""
    for axial in STRETCHES:

        def side(lateral, axial=axial):
            dI, dJ, J = _slopes(law, np.diag([axial, lateral, lateral]))
            return dJ - 2 * dI * J ** (-5 / 3) * (axial**2 - lateral**2) / 3

        lateral = brentq(side, 0.5, 1.5, xtol=1e-15)
        F = np.diag([axial, lateral, lateral])
        stress = _cauchy(law, F)
        scale = law.shear_modulus
        assert abs(stress[1, 1]) < 1e-12 * scale
        assert stress[0, 0] == pytest.approx(3 * _slopes(law, F)[1], rel=1e-9, abs=1e-12 * scale)


@pytest.mark.parametrize("law", LAWS)
def test_equibiaxial_state(law):
    for planar in STRETCHES:
        for normal in (planar**-2, 1.0):
            F = np.diag([planar, planar, normal])
            dI, dJ, J = _slopes(law, F)
            deviator = 2 * dI * J ** (-5 / 3) * (planar**2 - normal**2) / 3
            expected = np.diag([deviator + dJ, deviator + dJ, -2 * deviator + dJ])
            np.testing.assert_allclose(_cauchy(law, F), expected, rtol=1e-12, atol=1e-16)


@pytest.mark.parametrize("law", LAWS)
def test_simple_shear(law):
    for shear in (-1.2, 0.05, 0.8):
        F = np.array([[1, shear, 0], [0, 1, 0], [0, 0, 1.0]])
        modulus = 2 * _slopes(law, F)[0]
        stress = _cauchy(law, F)
        expected = modulus * np.array(
            [[2 * shear**2 / 3, shear, 0], [shear, -(shear**2) / 3, 0], [0, 0, -(shear**2) / 3]]
        )
        np.testing.assert_allclose(stress, expected, rtol=1e-12, atol=1e-17)
        # The universal relation of simple shear holds whatever the energy.
        assert stress[0, 0] - stress[1, 1] == pytest.approx(shear * stress[0, 1], rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_volumetric_state(law):
    """U depends on J alone: (J - 1)^2 / D1 + (J - 1)^4 / D2."""
    D2 = getattr(law, "D2", math.inf)
    for J in (0.7, 0.95, 1.0, 1.3):
        F = J ** (1 / 3) * np.eye(3)
        pressure = 2 * (J - 1) / law.D1 + 4 * (J - 1) ** 3 / D2
        np.testing.assert_allclose(_cauchy(law, F), pressure * np.eye(3), rtol=1e-12, atol=1e-16)
        energy = (J - 1) ** 2 / law.D1 + (J - 1) ** 4 / D2
        assert _energy(law, F) == pytest.approx(energy, rel=1e-12, abs=1e-17)


@pytest.mark.parametrize("law", LAWS)
def test_any_state(law):
    for F in _random_gradients(5):
        dI, dJ, J = _slopes(law, F)
        inverse = np.linalg.inv(F).T
        isochoric = 2 * dI * J ** (-2 / 3) * (F - np.trace(F.T @ F) / 3 * inverse)
        np.testing.assert_allclose(_first_piola(law, F), isochoric + dJ * J * inverse, rtol=1e-11, atol=1e-16)


@pytest.mark.parametrize("law", LAWS)
def test_moduli_at_small_strain(law):
    e = 1e-6
    shear = np.eye(3) + e * np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
    assert _cauchy(law, shear)[0, 1] / e == pytest.approx(2 * law.C10, rel=1e-9)
    assert law.shear_modulus == 2 * law.C10
    growth = np.trace(_cauchy(law, (1 + e) * np.eye(3))) / 3 / (3 * e)
    assert growth == pytest.approx(2 / law.D1, rel=1e-5)
    assert law.bulk_modulus == 2 / law.D1
    K, mu = law.bulk_modulus, law.shear_modulus
    assert law.poisson_ratio == pytest.approx((3 * K - 2 * mu) / (2 * (3 * K + mu)), rel=1e-12)


def test_the_paper_s_fascia_has_a_negative_poisson_ratio():
    assert NeoHookean(C10=0.1, D1=22.5).poisson_ratio == pytest.approx(-0.14, abs=0.005)


@pytest.mark.parametrize("law", LAWS)
def test_frame_indifference(law):
    rng = np.random.default_rng(2)
    for F in _random_gradients(4):
        Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        Q *= np.linalg.det(Q)
        assert _energy(law, Q @ F) == pytest.approx(_energy(law, F), rel=1e-12)
        np.testing.assert_allclose(_first_piola(law, Q @ F), Q @ _first_piola(law, F), rtol=1e-10, atol=1e-16)


@pytest.mark.parametrize("law", LAWS)
def test_isotropy(law):
    Q = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    for F in _random_gradients(3):
        assert _energy(law, F @ Q * np.linalg.det(Q)) == pytest.approx(_energy(law, F), rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_the_undeformed_state_is_free_of_stress_and_a_minimum(law):
    assert np.abs(_first_piola(law, np.eye(3))).max() < 1e-16
    assert all(_energy(law, F) > 0 for F in _random_gradients(20))


def test_the_reduced_polynomial_contains_the_neo_hookean_law():
    plain, full = NeoHookean(1.2e-3, 28.0), ReducedPolynomial(1.2e-3, 28.0, C20=0.0)
    for F in _random_gradients(3):
        np.testing.assert_allclose(_first_piola(full, F), _first_piola(plain, F), rtol=1e-14)


def _planar(gradient: np.ndarray):
    """Return legfem's F for a displacement in the plane with that gradient."""
    domain = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    u = ufl.dot(ufl.as_tensor(gradient.tolist()), ufl.SpatialCoordinate(domain))
    return expand_derivatives(deformation_gradient(u))


@pytest.mark.parametrize("further", [Yeoh, ExponentialStiffening])
def test_a_further_term_vanishes_by_default(further):
    for law in (NeoHookean(1e-3, 28.0), ReducedPolynomial(1e-3, 28.0, C20=2e-3, D2=14.0)):
        for F in _random_gradients(5):
            assert _energy(further.of(law), F) == _energy(law, F)


def test_impossible_further_terms_are_refused():
    for law in (
        lambda: Yeoh(1e-3, 28.0, 0.0, C30=-1.0),
        lambda: ExponentialStiffening(1e-3, 28.0, 0.0, stiffening=-1.0),
        lambda: ExponentialStiffening(1e-3, 28.0, 0.0, exponent=0.0),
    ):
        with pytest.raises(InputError, match="zero"):
            law()


def test_plane_strain_keeps_the_third_direction():
    gradient = np.array([[0.2, -0.3], [0.1, 0.15]])
    F = _planar(gradient)
    expected = np.eye(3)
    expected[:2, :2] += gradient
    computed = np.array([[_number(F[i, j]) for j in range(3)] for i in range(3)])
    np.testing.assert_allclose(computed, expected, rtol=1e-15)


def test_plane_strain_divides_by_the_three_dimensional_volume_ratio():
    """Equal stretch in the plane: J^(-2/3) sees a distortion that J^(-2/2) would deny."""
    stretch = 1.2
    F = _planar((stretch - 1) * np.eye(2))
    expected = stretch ** (-4 / 3) * (2 * stretch**2 + 1)
    invariant = _number(isochoric_first_invariant(F))
    assert invariant == pytest.approx(expected, rel=1e-14)
    assert invariant > 3.03


@pytest.mark.parametrize(
    "field, value", [("C10", 0.0), ("C10", -1e-3), ("D1", math.nan), ("C20", -1e-3), ("D2", 0.0), ("D1", math.inf)]
)
def test_impossible_parameters_are_refused(field, value):
    good = ReducedPolynomial(C10=1e-3, D1=28.0, C20=1e-3, D2=28.0)
    with pytest.raises(InputError, match=field):
        replace(good, **{field: value})
