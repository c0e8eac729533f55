r"""A suction cup against Love's half space, the balance of forces, and another code.

Love: a uniform pressure on a circle of a half space lifts its middle by
:math:`2 (1 - \nu^2) p a / E` and its edge by :math:`4 (1 - \nu^2) p a / (\pi E)`.
"""

from __future__ import annotations

import numpy as np
import pytest
from making_layers import OtherLayer, OtherLayers

from legfem.common.errors import InputError
from legfem.experiments.axisymmetric import AxisymmetricSettings, Layer
from legfem.experiments.bodies import CupOnLayer
from legfem.experiments.suction import SuctionTest
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.grid import Support
from legfem.meshing.structured import MeridianMeshSettings, supports
from legfem.solve.settings import NewtonSettings

MU = 0.01


def law(c10: float, bulk: float = 10.0) -> NeoHookean:
    """Return a law by its stiffness (MPa) and bulk over shear modulus."""
    return NeoHookean(c10, 1 / (bulk * c10))


class WithoutRim(SuctionTest):
    """Nothing holds the skin, as nothing does in the closed form."""

    @property
    def held(self) -> tuple[Support, ...]:
        return supports(self.test.base)


@pytest.mark.parametrize("bulk", [3.0, pytest.param(50.0, marks=pytest.mark.slow)])
def test_the_dome_of_a_half_space_is_that_of_love(bulk: float) -> None:
    radius, suction = 1.0, 1e-4
    poisson = (3 * bulk - 2) / (2 * (3 * bulk + 1))
    modulus = 2 * MU * (1 + poisson)
    expected = 2 * (1 - poisson**2) * suction * radius / modulus
    errors = []
    for far in (40.0, 80.0):
        cup = CupOnLayer(far, radius, 0.5, far)
        settings = AxisymmetricSettings(
            MeridianMeshSettings(0.1, 0.25, 0.1 * far),
            # Large elements round more than a small suction's forces.
            newton=NewtonSettings(absolute_tolerance=1e-10),
        )
        solved = WithoutRim(cup, law(MU / 2, bulk), settings).solve(depth=expected)
        pulled = float(solved.curve(expected)) / cup.opening
        errors.append(pulled / suction - 1)
    print(bulk, errors)
    # A body so large is stiffer than a half space by about the radius over its size.
    assert 0 < errors[1] < errors[0] < 1.5 / 40
    assert 2 * errors[1] - errors[0] == pytest.approx(0.0, abs=3e-3)


@pytest.fixture(scope="module")
def drawn() -> SuctionTest:
    layers = Layer("muscle", 12.0, law(8e-3)), Layer("fat", 5.0, law(2e-3))
    return SuctionTest(CupOnLayer(17.0, 5.0, 2.0, 40.0), layers)


def test_rim_and_base_bear_what_the_suction_pulls(drawn: SuctionTest) -> None:
    """On a rim that sticks the opening's area stays, however high the dome."""
    solved = drawn.solve(depth=1.5)
    balance = drawn.system.balance()
    pulled = float(solved.report.steps[-1].time) * drawn.test.opening
    assert balance.contact_force[1] == pytest.approx(pulled, rel=1e-9)
    assert balance.contact_work == pytest.approx(balance.internal_work, rel=1e-7)


def test_the_dome_is_that_of_another_code(drawn: SuctionTest) -> None:
    suction = np.linspace(0.5e-3, 4e-3, 8)
    other = OtherLayers([OtherLayer(12.0, 8e-3, 10.0), OtherLayer(5.0, 2e-3, 10.0)], 40.0, [5.0, 7.0], 0.3)
    risen = other.sucked(5.0, 2.0, suction)
    found = drawn.solve(depth=1.05 * risen[-1]).curve(risen) / drawn.test.opening
    print(risen, found / suction - 1)
    np.testing.assert_allclose(found, suction, rtol=5e-3)


def test_derivatives_are_those_of_differences_and_add_up(drawn: SuctionTest) -> None:
    names = ("fat.C10", "fat.D1", "muscle.C10", "muscle.D1")
    at, own = np.linspace(0.3, 1.2, 4), drawn.parameters
    solved = drawn.solve(None, 1.2, names).curve
    total = sum((-1 if name.endswith("D1") else 1) * own[name] * solved.sensitivity(name, at) for name in names)
    np.testing.assert_allclose(total, solved(at), rtol=1e-8)
    step = 2e-2
    for name in names[::2]:
        up, down = (drawn.solve({name: own[name] * f}, 1.2).curve(at) for f in (1 + step, 1 - step))
        slope = (up - down) / (2 * step * own[name])
        np.testing.assert_allclose(solved.sensitivity(name, at), slope, rtol=1e-3)


def test_a_rim_that_slides_lets_the_dome_rise_more(drawn: SuctionTest) -> None:
    sticking, sliding = (
        SuctionTest(CupOnLayer(17.0, 5.0, 2.0, 40.0, rim), law(4e-3)).solve(depth=1.0).curve(1.0)
        for rim in ("bonded", "sliding")
    )
    assert sliding < sticking


def test_a_cup_has_to_fit_on_the_layer() -> None:
    with pytest.raises(InputError, match="covers the layer"):
        CupOnLayer(10.0, 5.0, 2.0, 7.0)
    with pytest.raises(InputError, match="rim_width"):
        CupOnLayer(10.0, 5.0, 0.0)
