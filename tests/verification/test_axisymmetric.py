"""Axial symmetry: closed forms of a compressed cylinder and of a ball on a layer, and derivatives.

The ball on a thick frictionless layer is Hertz', with E* = E / (1 - nu^2) and
F = 4/3 E* R^(1/2) d^(3/2); on a thin one bonded to its base, nu = 1/2, that times
1 + 1.133 x + 1.283 x^2 + 0.769 x^3 + 0.0975 x^4 with x = (R d)^(1/2) / h (E. K. Dimitriadis,
F. Horkay, J. Maresca, B. Kachar, R. S. Chadwick, Biophys. J. 82 (2002) 2798-2810).
"""

from __future__ import annotations

import numpy as np
import pytest
from making_derivatives import taylor_orders, worst_error
from making_mechanics import press
from scipy.optimize import brentq

from legfem.experiments.axisymmetric import AxisymmetricSettings, BallIndentation, CylinderCompression
from legfem.experiments.bodies import BallOnLayer, CylinderBetweenPlates
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Viscoelasticity
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.protocol import Protocol
from legfem.solve.settings import NewtonSettings, StepSettings

C10 = 5e-3
TIGHT = NeoHookean(C10, 1e-3 / C10)  # K = 1000 mu
LOOSE = NeoHookean(C10, 0.2 / C10)  # K = 5 mu


def _uniaxial(law: NeoHookean, stretch: float) -> float:
    """Return the nominal stress (MPa, positive in compression) at a stretch, sides free."""

    def slope(axial: float, side: float) -> tuple[float, float]:
        J, first = axial * side**2, axial**2 + 2 * side**2
        of_J = 2 * (J - 1) / law.D1 - law.C10 * 2 / 3 * J ** (-5 / 3) * first
        isochoric = 2 * law.C10 * J ** (-2 / 3)
        return isochoric * axial + of_J * side**2, 2 * (isochoric * side + of_J * axial * side)

    side = brentq(lambda s: slope(stretch, s)[1], 0.8 * stretch**-0.5, 1.2 * stretch**-0.5)
    return -slope(stretch, side)[0]


@pytest.mark.parametrize("law", [TIGHT, LOOSE], ids=["K = 1000 mu", "K = 5 mu"])
def test_a_cylinder_that_slides_is_compressed_homogeneously(law):
    wall = ContactSettings(tangential="frictionless", stiffness=2e7, onset=1e-7)
    steps = StepSettings(first=0.2, largest=0.5)
    settings = AxisymmetricSettings(MeridianMeshSettings(6.0, 0.0), wall, steps=steps)
    cylinder = CylinderCompression(CylinderBetweenPlates(), law, settings)
    solved = cylinder.solve(depth=12.0)
    assert solved.report.complete
    stretch = 1 - solved.curve.displacement[1:] / 30
    expected = np.pi * 25**2 * np.array([_uniaxial(law, s) for s in stretch])
    error = np.abs(solved.curve.force[1:] / expected - 1).max()
    print(error)
    assert error < 1e-6
    assert solved.report.reached == 12.0


def test_the_default_wall_costs_little():
    solved = CylinderCompression(CylinderBetweenPlates(), TIGHT).solve(depth=12.0)
    assert solved.curve.force[-1] == pytest.approx(np.pi * 625 * _uniaxial(TIGHT, 0.6), rel=1e-4)


def test_a_bonded_flat_cylinder_has_the_stiffness_of_its_shape():
    """E (1 + 2 S^2), S = R / 2h: A. N. Gent, P. B. Lindley, Proc. IMechE 173 (1959) 111-122.

    Their approximation neglects the edge: it is asymptotic for flat cylinders.
    """
    law = NeoHookean(C10, 1e-6 / C10)
    error = []
    for height in (10.0, 2.5):
        test = CylinderBetweenPlates(25.0, height, "bonded")
        depth = 1e-3 * height
        solved = CylinderCompression(test, law).solve(depth=depth)
        stiffness = solved.curve.force[-1] / (np.pi * 25**2 * 1e-3)
        error.append(stiffness / (6 * C10 * (1 + 2 * (25 / (2 * height)) ** 2)) - 1)
    print(error)
    assert abs(error[1]) < 0.05 and abs(error[1]) < abs(error[0]) < 0.15


def _ball(test: BallOnLayer, depth: float, finest: float) -> np.ndarray:
    """Return displacements and forces over Hertz' force, (2, n)."""
    settings = AxisymmetricSettings(
        mesh=MeridianMeshSettings(finest, far_size=20.0),
        contact=ContactSettings(tangential="frictionless", stiffness=4e3, onset=1e-4),
        # The volume of large elements, mm3 in the pressure's equations, is rounded by more than
        # the default tolerance at forces of millinewtons.
        newton=NewtonSettings(absolute_tolerance=1e-10),
        steps=StepSettings(first=depth / 4, largest=depth / 4),
    )
    law = TIGHT
    solved = BallIndentation(test, law, settings).solve(depth=depth)
    assert solved.report.complete, solved.report
    d = solved.curve.displacement[1:]
    hertz = 16 / 9 * 6 * C10 * test.ball_radius**0.5 * d**1.5
    return np.array([d, solved.curve.force[1:] / hertz])


def test_a_ball_on_a_thick_layer_is_hertz():
    deep = BallOnLayer(60.0, layer_radius=60.0, ball="frictionless")
    _, ratio = _ball(deep, depth=0.05, finest=0.08)
    print(ratio)
    assert ratio[-1] == pytest.approx(1.0, abs=0.01)


def test_a_ball_on_a_thin_layer_follows_dimitriadis():
    thin = BallOnLayer(1.5, layer_radius=12.0, ball="frictionless")
    d, ratio = _ball(thin, depth=0.02, finest=0.05)
    x = np.sqrt(5 * d) / 1.5
    expected = 1 + 1.133 * x + 1.283 * x**2 + 0.769 * x**3 + 0.0975 * x**4
    print(ratio / expected)
    assert expected[-1] > 1.2
    np.testing.assert_allclose(ratio[-1], expected[-1], rtol=0.02)


@pytest.fixture(scope="module")
def relaxing() -> BallIndentation:
    branch = Viscoelasticity("deep", TIGHT, ratio=0.8, relaxation_time=3.0)
    settings = AxisymmetricSettings(mesh=MeridianMeshSettings(2.0))
    test = BallOnLayer(12.0, layer_radius=15.0)
    return BallIndentation(test, TIGHT, settings, mechanisms=[branch])


def test_the_tangent_is_the_residual_s_derivative(relaxing):
    report = press(relaxing.system, relaxing.solver, [1.5])
    assert report.complete
    relaxing.system.set_displacement(1.9)
    relaxing.system.set_time(1.9, 0.4)
    orders = taylor_orders(relaxing.system)
    print(orders)
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_sensitivities_are_exact_along_ramp_and_hold(relaxing):
    names = ["deep.C10", "deep.viscoelasticity.ratio", "deep.viscoelasticity.relaxation_time"]
    held = Protocol.ramp_and_hold(2.0, rate=1.0, hold=8.0)
    system = relaxing.system
    values = relaxing.solve(depth=0.5).parameters
    assert worst_error(system, dict(values), names, held, 0.5) < 1e-5


def test_a_held_cylinder_relaxes_exponentially():
    """Incompressible and with free sides, the whole stress is of distortion."""
    law = NeoHookean(C10, 1e-6 / C10)
    branch = Viscoelasticity("deep", law, ratio=1.2, relaxation_time=3.0)
    coarse = AxisymmetricSettings(mesh=MeridianMeshSettings(6.0, 0.0))
    sudden = Protocol((0.0, 1e-6, 10.0), (0.0, 6.0, 6.0))
    test = CylinderBetweenPlates()
    held = CylinderCompression(test, law, coarse, mechanisms=[branch]).solve(None, sudden).path
    lasting = CylinderCompression(test, law, coarse).solve(None, sudden).path.force[-1]
    hold = held.displacement == 6.0
    expected = lasting * (1 + 1.2 * np.exp(-held.time[hold] / 3))
    np.testing.assert_allclose(held.force[hold], expected, rtol=1e-4)
