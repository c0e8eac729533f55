r"""A flat punch on a layer against the solution of linear elasticity, and what an experiment holds.

The force is :math:`F = 2 a \kappa E d / (1 - \nu^2)`, on a half space with
:math:`\kappa = 1` (I. N. Sneddon, Int. J. Engng Sci. 3 (1965) 47-57), on a layer bonded to its base
with that of W. C. Hayes, L. M. Keer, G. Herrmann, L. F. Mockros, J. Biomech. 5 (1972) 541-551.
"""

from __future__ import annotations

import numpy as np
import pytest
from making_derivatives import taylor_orders
from making_mechanics import fixed_steps

from legfem.common.errors import InputError
from legfem.experiments.axisymmetric import AxisymmetricSettings
from legfem.experiments.bodies import PunchOnLayer
from legfem.experiments.flat_punch import FlatPunchIndentation
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.settings import NewtonSettings

MU = 0.01
RADIUS, EDGE, DEPTH = 5.0, 0.1, 0.02
COARSE = AxisymmetricSettings(
    MeridianMeshSettings(0.5), newton=NewtonSettings(relative_tolerance=1e-12), steps=fixed_steps(0.5)
)


def law(poisson: float) -> NeoHookean:
    bulk = 2 * MU * (1 + poisson) / (3 * (1 - 2 * poisson))
    return NeoHookean(MU / 2, 2 / bulk)


def kappa(ratio: float, poisson: float, base: str) -> float:
    r"""Return the factor of a layer, by the radius of the contact over its thickness.

    A pressure of wave number :math:`s / h` moves the surface by T(s) times what it does to a half
    space; with :math:`G(u) = \int_0^\infty (1 - T(s)) \cos(s u)\, ds` and :math:`e = a / h`,
    :math:`\kappa = \int_0^1 \phi` of
    :math:`\phi(x) - \frac{e}{\pi} \int_0^1 \phi(t) [G(e(x - t)) + G(e(x + t))]\, dt = 1`.
    """
    s = np.linspace(1e-6, 20, 4001)
    if base == "bonded":
        k = 3 - 4 * poisson
        T = (2 * k * np.sinh(2 * s) - 4 * s) / (2 * k * np.cosh(2 * s) + 1 + k**2 + 4 * s**2)
    else:
        T = (np.cosh(2 * s) - 1) / (np.sinh(2 * s) + 2 * s)
    x, weights = np.polynomial.legendre.leggauss(40)
    x, weights = (x + 1) / 2, weights / 2
    G = {sign: np.trapezoid((1 - T) * np.cos(ratio * s * (x[:, None] + sign * x)[..., None]), s) for sign in (1, -1)}
    matrix = np.eye(len(x)) - ratio / np.pi * (G[1] + G[-1]) * weights
    return float(weights @ np.linalg.solve(matrix, np.ones_like(x)))


def linear_force(contact: float, thickness: float, poisson: float, base: str) -> float:
    """Return the force (N) at the depth, by the radius of the contact (mm)."""
    modulus = 2 * MU / (1 - poisson)  # E / (1 - nu^2)
    return 2 * contact * kappa(contact / thickness, poisson, base) * modulus * DEPTH


def pressed(thickness: float, poisson: float, base: str) -> float:
    """Return the force (N) at the depth, by finite elements with a frictionless punch."""
    settings = AxisymmetricSettings(
        MeridianMeshSettings(0.5 * EDGE, 0.25, 0.4 * thickness),
        ContactSettings(tangential="frictionless", stiffness=4e4, onset=1e-5),
        steps=fixed_steps(DEPTH),
    )
    given = PunchOnLayer(thickness, RADIUS, EDGE, RADIUS + 6 * thickness, "frictionless", base)
    solved = FlatPunchIndentation(given, law(poisson), settings).solve(depth=DEPTH)
    assert solved.report.complete
    return float(solved.curve.force[-1])


@pytest.mark.parametrize(
    ("ratio", "poisson", "published"),
    [(0.4, 0.30, 1.472), (1.0, 0.30, 2.480), (1.0, 0.45, 3.085), (1.0, 0.50, 3.609), (2.0, 0.45, 6.380)],
)
def test_the_layer_s_factors_are_those_of_the_paper(ratio, poisson, published):
    """As printed, up to 0.7 % from the converged ones where the layer is thin."""
    assert kappa(ratio, poisson, "bonded") == pytest.approx(published, rel=1e-2)


@pytest.mark.parametrize(
    ("thickness", "poisson", "base"),
    [
        (12.5, 0.3, "bonded"),
        (5.0, 0.45, "bonded"),
        (5.0, 0.499, "bonded"),
        (2.5, 0.3, "bonded"),
        (5.0, 0.3, "sliding"),
        (5.0, 0.499, "sliding"),
    ],
)
def test_the_force_is_between_those_of_the_flat_part_and_of_the_whole_face(thickness, poisson, base):
    force = pressed(thickness, poisson, base)
    least, most = (linear_force(a, thickness, poisson, base) for a in (RADIUS - EDGE, RADIUS))
    print(thickness, poisson, base, force / least - 1, force / most - 1)
    assert 0.99 * least < force < most


def test_a_thick_layer_is_a_half_space():
    """To the share of the contact's radius in the thickness, 2 %: 1 + 1.0 a/h at nu = 0.3."""
    settings = AxisymmetricSettings(
        MeridianMeshSettings(0.025, 0.25, 10.0),
        ContactSettings(tangential="frictionless", stiffness=4e3, onset=1e-4),
        steps=fixed_steps(DEPTH),
    )
    given = PunchOnLayer(50.0, 1.0, 0.05, 50.0, "frictionless")
    solved = FlatPunchIndentation(given, law(0.3), settings).solve(depth=DEPTH)
    assert solved.report.complete
    flat, whole = (2 * a * 2 * MU / 0.7 * DEPTH for a in (0.95, 1.0))
    print(solved.curve.force[-1] / flat - 1, solved.curve.force[-1] / whole - 1)
    assert flat < solved.curve.force[-1] < 1.02 * whole


@pytest.fixture(scope="module")
def shallow() -> FlatPunchIndentation:
    """A rough punch with a generous rounding on a thin bonded layer."""
    return FlatPunchIndentation(PunchOnLayer(8.0, 4.0, 1.0, 15.0), law(0.49), COARSE)


def test_forces_balance_and_grow_in_finite_strain(shallow):
    seen = []

    def check(_: float) -> None:
        balance = shallow.system.balance()
        assert balance.contact_force[1] < 0
        assert balance.bone_reaction[1] == pytest.approx(-balance.contact_force[1], rel=1e-8)
        seen.append(balance.contact_force[1])

    solved = shallow.solve(depth=3.0, on_step=check)
    assert solved.report.complete and len(seen) == len(solved.curve.force) - 1
    assert (np.diff(solved.curve.stiffness(solved.curve.displacement[1:])) > 0).all()


def test_the_derivative_by_stiffness_is_exact(shallow):
    C10 = shallow.parameters["deep.C10"]
    exact = shallow.solve({"deep.C10": C10}, 1.5, ("deep.C10", "deep.D1")).path
    for name, value in (("deep.C10", C10), ("deep.D1", shallow.parameters["deep.D1"])):
        ahead, behind = (shallow.solve({name: value * (1 + by)}, 1.5).path.force for by in (1e-4, -1e-4))
        difference = (ahead - behind) / (2e-4 * value)
        error = np.abs(exact.sensitivities[name] - difference).max() / np.abs(difference).max()
        print(name, error)
        assert error < 1e-6


def test_the_tangent_is_the_residual_s_derivative(shallow):
    """At a state where the skin touches the flat face, the rounding, and nothing."""
    shallow.solve(depth=1.5)
    np.testing.assert_allclose(taylor_orders(shallow.system), 2.0, atol=0.05)


def test_sizes_that_are_no_punch_are_refused():
    with pytest.raises(InputError, match="edge"):
        PunchOnLayer(10.0, radius=3.0, edge=3.0)
    with pytest.raises(InputError, match="layer_radius"):
        PunchOnLayer(10.0, radius=3.0, layer_radius=2.0)
