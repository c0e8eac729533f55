"""Forces on specimens with fibres: closed forms, exact derivatives, another code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_fibres import BALL, BLOCK, C10, PLATES, RATIO, TISSUE, forward, pulled
from making_layers import OtherLayer, OtherLayers
from making_specimens import AREA, LENGTH

from legfem.common.errors import InputError
from legfem.experiments.bodies import PunchOnLayer, UniaxialSpecimen
from legfem.experiments.homogeneous import HomogeneousTest
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.mechanics.terms import Fibres
from legfem.specimens.kind import AXES
from legfem.specimens.laws import SpecimenTissue
from legfem.specimens.sizes import Sizes
from studies.making.pressing import BULK, OtherMuscle, pulled_bar


@pytest.mark.parametrize("direction", ["load", "across"])
@pytest.mark.parametrize("ratio", [1.0, 3.0, 8.0])
def test_a_bar_pulled_along_its_fibres_or_across_has_its_closed_form(direction, ratio) -> None:
    fibres = Fibres.of_ratio("deep", C10, ratio, AXES[direction])
    test = HomogeneousTest(UniaxialSpecimen(LENGTH, AREA, "tension"), NeoHookean(C10, 1e-4), fibres)
    curve = test.solve(depth=6.0).curve
    closed = pulled(ratio, direction, curve.displacement)
    np.testing.assert_allclose(curve.force, closed, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(("direction", "modulus"), [("load", 11.0), ("across", 11 / 3)])
def test_a_bar_s_young_s_modulus_at_small_strain_is_linear_elasticity_s(direction, modulus) -> None:
    """Of a ratio 3: E_L = 4 mu_L - mu_T, and 4 mu_T E_L / (E_L + mu_T)."""
    fibres = Fibres.of_ratio("deep", C10, 3.0, AXES[direction])
    for pull in ("tension", "compression"):
        test = HomogeneousTest(UniaxialSpecimen(LENGTH, AREA, pull), NeoHookean(C10, 1e-4), fibres)
        curve = test.solve(depth=1e-4 * LENGTH).curve
        found = curve.force[-1] / AREA / 1e-4
        assert found == pytest.approx(2 * C10 * modulus, rel=1e-3)


def test_a_bar_of_a_stiffening_law_keeps_equilibrium_across() -> None:
    law, fibres = ReducedPolynomial(C10, 1e-4, C20=2e-3), Fibres.of_ratio("deep", C10, 2.0)
    fibres = replace(fibres, axis=AXES["across"])
    curve = HomogeneousTest(UniaxialSpecimen(LENGTH, AREA, "tension"), law, fibres).solve(depth=4.0).curve
    closed = pulled(2.0, "across", curve.displacement, c20=2e-3)
    np.testing.assert_allclose(curve.force, closed, rtol=1e-6, atol=1e-9)
    with pytest.raises(InputError, match="oblique"):
        HomogeneousTest(UniaxialSpecimen(LENGTH, AREA), law, Fibres("deep", axis=(0.6, 0.8, 0.0)))


@pytest.mark.parametrize(
    ("sizes", "depth"),
    [
        pytest.param(Sizes(UniaxialSpecimen(10.0, 100.0), fibres="load"), 3.0, id="bar-along"),
        pytest.param(Sizes(UniaxialSpecimen(10.0, 100.0), fibres="across"), 3.0, id="bar-across"),
        pytest.param(Sizes(PLATES, fibres="load"), 2.0, id="plates", marks=pytest.mark.slow),
        pytest.param(Sizes(BALL, fibres="load"), 1.0, id="ball"),
        pytest.param(Sizes(BLOCK, fibres="across"), 2.0, id="block", marks=pytest.mark.slow),
    ],
)
def test_derivatives_by_stiffness_and_ratio_are_exact(sizes, depth: float) -> None:
    """Taylor: what a linear prediction misses falls with the square of the step."""
    model, at = forward(sizes, depth), np.linspace(0.3, 1.0, 4) * depth
    values = {"deep.C10": 5e-3, RATIO: 2.0}
    curve = model.solve(values, list(values)).curves[0]
    for name, value in values.items():
        left = []
        for step in (4e-2, 2e-2):
            moved = model.solve({**values, name: (1 + step) * value}, ()).curves[0]
            left.append(moved(at) - curve(at) - step * value * curve.sensitivity(name, at))
        order = np.log2(np.linalg.norm(left[0]) / np.linalg.norm(left[1]))
        # The force is in proportion to the stiffness, and along a bar linear in the ratio.
        scale = np.linalg.norm(curve(at))
        assert order > 1.9 or np.linalg.norm(left[0]) < 1e-5 * scale, (name, order)


@pytest.mark.parametrize(
    ("sizes", "depth"),
    [
        (Sizes(UniaxialSpecimen(10.0, 100.0), fibres="across"), 3.0),
        (Sizes(PLATES, fibres="load"), 2.0),
        (Sizes(BALL, fibres="load"), 1.0),
        (Sizes(BLOCK, fibres="across"), 2.0),
    ],
)
def test_a_ratio_of_one_is_the_isotropic_model(sizes, depth: float) -> None:
    at = np.linspace(0.3, 1.0, 4) * depth
    one = forward(sizes, depth).solve({"deep.C10": 5e-3, RATIO: 1.0}, ()).curves[0]
    plain = forward(replace(sizes, fibres=None), depth, SpecimenTissue(law="neo-hookean"))
    isotropic = plain.solve({"deep.C10": 5e-3}, ()).curves[0]
    # Newton's method ends at 1e-9 of the forces, by other forms at another rounding.
    np.testing.assert_allclose(one(at), isotropic(at), rtol=1e-8)


def test_fibres_along_the_cylinder_change_nothing_in_plane_strain_and_across_they_do() -> None:
    at, values = np.array([1.0, 2.0]), {"deep.C10": 5e-3, RATIO: 3.0}
    along = forward(Sizes(BLOCK, fibres="cylinder"), 2.0).solve(values, [RATIO]).curves[0]
    plain = forward(Sizes(BLOCK), 2.0, SpecimenTissue(law="neo-hookean"))
    isotropic = plain.solve({"deep.C10": 5e-3}, ()).curves[0]
    np.testing.assert_allclose(along(at), isotropic(at), rtol=1e-12)
    np.testing.assert_array_equal(along.sensitivity(RATIO, at), 0.0)
    for direction in ("across", "load"):
        in_plane = forward(Sizes(BLOCK, fibres=direction), 2.0).solve(values, ()).curves[0]
        assert (in_plane(at) > 1.8 * isotropic(at)).all()


def test_in_plane_strain_along_the_travel_and_across_are_one_level() -> None:
    shallow, values = 0.05, {"deep.C10": 5e-3, RATIO: 3.0}
    punched = [
        forward(Sizes(BLOCK, fibres=direction), shallow).solve(values, ()).curves[0].force[-1]
        for direction in ("load", "across")
    ]
    assert punched[0] == pytest.approx(punched[1], rel=0.03)
    assert Sizes(BLOCK, fibres="load").level == Sizes(BLOCK, fibres="across").level
    assert Sizes(BLOCK, fibres="load").level != Sizes(BLOCK, fibres="cylinder").level


@pytest.mark.parametrize("direction", ["load", "across"])
def test_another_code_pulls_a_bar_by_the_same_force(direction) -> None:
    law = ReducedPolynomial(C10, 1 / (BULK * C10), C20=2e-3)
    fibres = Fibres.of_ratio("deep", C10, 2.5, AXES[direction])
    curve = HomogeneousTest(UniaxialSpecimen(1.0, 1.0, "tension"), law, fibres).solve(depth=0.3).curve
    at = np.array([0.1, 0.3])
    axis = (1.0, 0.0, 0.0) if direction == "load" else (0.0, 1.0, 0.0)
    other = pulled_bar(OtherMuscle.of_ratio(C10, 2e-3, 2.5, axis), 1 + at)
    np.testing.assert_allclose(curve(at), other, rtol=1e-5)


@pytest.mark.slow
def test_another_code_s_fibres_raise_a_punch_s_force_by_as_much() -> None:
    """By felupe, with a tangent of its own, and no rounding of the edge, which a quotient omits."""
    bulk, at = 10.0, np.array([0.5, 1.0])
    poisson = (3 * bulk - 2) / (2 * (3 * bulk + 1))
    tissue = replace(TISSUE, poisson_ratio=poisson)
    punch = Sizes(PunchOnLayer(12.0, 6.0, 0.15, 30.0), fibres="load")
    own, other = [], []
    for ratio in (1.0, 3.0):
        layer = OtherLayer(12.0, C10, bulk, ratio)
        other.append(OtherLayers([layer], 30.0, [6.0], 0.3).punched(6.0, at.tolist(), 0.1))
        solved = forward(punch, 1.05, tissue).solve({"deep.C10": C10, RATIO: ratio}, ())
        own.append(solved.curves[0](at))
    print(own[1] / own[0], other[1] / other[0])
    np.testing.assert_allclose(own[1] / own[0], other[1] / other[0], rtol=0.01)
