"""The second code of the sealed cases: its law, and what its effects do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from legfem.legs.loading import load_subject
from studies.making.plane_leg import Lump, OtherCase, OtherCode
from studies.making.pressing import DeepTissue

CROSSCHECK = Path(__file__).parent / "data" / "crosscheck"


def test_the_other_codes_law_is_the_derivative_of_its_energy():
    law = DeepTissue(0.8, 0.5, 0.3, 0.7, 20.0, 15.0)
    generator = np.random.default_rng(3)
    F = np.eye(3)[:, :, None] + 0.2 * generator.normal(size=(3, 3, 1))

    def energy(F):
        J = np.linalg.det(F[:, :, 0])
        strain = J ** (-2 / 3) * np.sum(F**2) - 3
        shape = 0.8 * strain + 0.5 * strain**2 + 0.3 / 0.7 * (np.exp(0.7 * strain) - 1)
        return shape + 20 * (J - 1) ** 2 + 15 * (J - 1) ** 4

    stress, tangent = law.gradient([F, None])[0], law.hessian([F, None])[0]
    for i, j in np.ndindex(3, 3):
        step = np.zeros((3, 3, 1))
        step[i, j] = 1e-5
        slope = (energy(F + step) - energy(F - step)) / 2e-5
        assert stress[i, j, 0] == pytest.approx(slope, rel=1e-6, abs=1e-6)
        change = (law.gradient([F + step, None])[0] - law.gradient([F - step, None])[0]) / 2e-5
        np.testing.assert_allclose(tangent[:, :, i, j], change, rtol=1e-5, atol=1e-5)


def other_code(case, finer=1.0):
    return OtherCode(load_subject(CROSSCHECK / "neo-hookean", need_recordings=False), case, finer)


def clean(name):
    return np.loadtxt(CROSSCHECK / name / "clean.csv", delimiter=",", skiprows=1).T


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "case"), [("neo-hookean", OtherCase(1.5)), ("reduced-polynomial", OtherCase(0.72, 0.85))]
)
def test_the_other_code_agrees_with_a_third_within_one_percent(name, case):
    leg = load_subject(CROSSCHECK / name, need_recordings=False)
    curve = OtherCode(leg, case).solve(20.0, 0.8)
    assert curve.reached
    d, force = clean(name)
    deep = curve.displacement > 4.0
    expected = np.interp(curve.displacement[deep], d, force)
    np.testing.assert_allclose(curve.force[deep], expected, rtol=0.01)


@pytest.mark.slow
def test_the_other_codes_effects_change_the_force_the_way_they_should():
    at = {
        name: other_code(case).solve(4.0, 1.0).force[-1]
        for name, case in {
            "none": OtherCase(1.5),
            "slip": OtherCase(1.5, friction=0.05),
            "springs": OtherCase(1.5, springs=0.4),
            "stiff springs": OtherCase(1.5, springs=1e4),
            "fat": OtherCase(1.5, factors={"superficial": 2.0}),
            "lump": OtherCase(1.5, lumps=[Lump(14.0, 6.0, 6.0, 3.0)]),
        }.items()
    }
    assert at["slip"] < at["none"] and at["springs"] < at["none"]
    assert at["stiff springs"] == pytest.approx(at["none"], rel=1e-3)
    assert at["fat"] > 1.05 * at["none"] and at["lump"] > 1.001 * at["none"]
