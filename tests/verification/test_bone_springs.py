"""Bones on springs: held, balanced, rigid, all but free, and beside another code."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from making import SHARED
from making_mechanics import COARSE, subject_3
from scipy.interpolate import CubicSpline

from legfem.common.errors import InputError
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.geometry.section import CALF, LIMBS
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.mechanics.terms import BoneSprings

DEPTH = 8.0
FOREIGN = SHARED / "foreign" / "case-05"
SOFT = {f"{bone}.springs.{axis}": k for bone, k in zip(LIMBS[CALF], (3.0, 1.5), strict=True) for axis in "xy"}


def springs(section, length):
    return [BoneSprings(bone, section.polygon(bone).area, length) for bone in section.bones]


def made(formulation="mixed"):
    section, indenter, tissues = subject_3()
    settings = PlaneStrainSettings(mesh=COARSE, formulation=formulation, defences=False)
    held = PlaneStrainIndentation(section, indenter, tissues, settings)
    both = springs(section, indenter.length)
    free = PlaneStrainIndentation(section, indenter, tissues, settings, mechanisms=both)
    return held, free


@pytest.fixture(scope="module")
def tests():
    return made()


def moved(test, bone):
    """Return a bone's mean displacement, mm."""
    body = test.system.body.domain
    shape = test.section.polygon(bone).area
    parts = [body.displacement[k] * body.regions[bone] for k in (0, 1)]
    return np.array([fem.assemble_scalar(fem.form(part)) for part in parts]) / shape


@pytest.mark.parametrize("formulation", ["mixed", pytest.param("displacement", marks=pytest.mark.slow)])
def test_stiff_springs_hold_the_bones(formulation, tests):
    held, free = tests if formulation == "mixed" else made(formulation)
    at = np.linspace(1.0, DEPTH, 8)
    forces = [test.solve(depth=DEPTH).curve(at) for test in (held, free)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-3)


def test_the_springs_bear_what_the_cylinder_presses_with(tests):
    """And the bones move as wholes, the softer one's springs further."""
    _, free = tests
    solved = free.solve(SOFT, depth=DEPTH)
    assert solved.report.complete
    length = free.indenter.length
    away = {bone: moved(free, bone) for bone in LIMBS[CALF]}
    borne = sum(SOFT[f"{bone}.springs.x"] * away[bone] for bone in LIMBS[CALF]) / length
    assert borne == pytest.approx(free.system.balance().contact_force, rel=2e-3, abs=1e-6)
    body = free.system.body.domain
    for bone in LIMBS[CALF]:
        turn = ufl.inner(ufl.grad(body.displacement), ufl.grad(body.displacement))
        strain = fem.assemble_scalar(fem.form(turn * body.regions[bone]))
        area = free.section.polygon(bone).area
        assert np.sqrt(strain / area) < 1e-4
        assert np.linalg.norm(away[bone]) > 0.05


def test_stiff_springs_take_off_what_their_energy_says(tests):
    """Castigliano: to first order springs lower the work by half of what the bones press, squared.

    The skin sticks, so that the work isn't quite a function of where the cylinder is.
    """
    _, free = tests
    stiffness, seen = 200.0, []

    def record(at):
        pressed = [stiffness * moved(free, bone) for bone in LIMBS[CALF]]
        seen.append((at, sum(float(one @ one) for one in pressed)))

    at = np.array([2.0, 4.0, 6.0])
    sprung = free.solve(dict.fromkeys(SOFT, stiffness), depth=DEPTH, on_step=record).curve(at)
    held = free.solve(depth=DEPTH).curve(at)
    energy = CubicSpline(*np.array([(0.0, 0.0), *seen]).T)
    assert held - sprung == pytest.approx(0.5 * energy(at, 1) / stiffness, rel=0.03)


def test_derivatives_by_a_spring_are_exact(tests):
    _, free = tests
    name, step = "tibia.springs.y", 1e-3
    exact = free.solve(SOFT, DEPTH, [name]).path.sensitivity_at(name, np.array([DEPTH]))[0]
    ends = [
        free.solve({**SOFT, name: SOFT[name] + side * step}, depth=DEPTH).curve(np.array([DEPTH]))[0]
        for side in (-1, 1)
    ]
    assert exact == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-3)
    assert exact > 0


@pytest.mark.parametrize("wrong", [{"area": 0.0}, {"length": -1.0}, {"x": 0.0}, {"y": np.nan}])
def test_numbers_that_no_bone_has_are_refused(wrong):
    with pytest.raises(InputError):
        BoneSprings(**{"region": "tibia", "area": 400.0, "length": 50.0, **wrong})


def test_one_bone_on_springs_and_one_without_is_refused():
    section, indenter, tissues = subject_3()
    one = springs(section, indenter.length)[:1]
    with pytest.raises(InputError, match="not every bone is on springs"):
        PlaneStrainIndentation(section, indenter, tissues, mechanisms=one)


@pytest.mark.skipif(not FOREIGN.is_dir(), reason="the other code's recordings are not there")
def test_another_code_s_bones_give_way_as_these_do():
    """FEBio's rigid bodies on springs of 5 N/mm, the fibula's of 3.5 across."""
    subject = load_subject(FOREIGN)
    both = springs(subject.section, subject.indenter.length)
    free = plane_strain_test(subject, mechanisms=both)
    stiffness = dict.fromkeys(SOFT, 5.0) | {"fibula.springs.y": 3.5}
    values = {**stiffness, "deep.C10": 1.7e-3, "deep.C20": 0.0}
    rows = np.genfromtxt(FOREIGN / "clean.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    first = rows[rows["trial"] == rows["trial"][0]]
    loading = first[: int(np.argmax(first["displacement_mm"])) + 1]
    at = np.array([4.0, 8.0, 12.0, 16.0, 20.0])
    theirs = np.interp(at, loading["displacement_mm"], loading["force_N"])
    ours = free.solve(values, depth=20.0).curve(at)
    assert ours == pytest.approx(theirs, rel=2e-3)
    held = plane_strain_test(subject).solve({name: values[name] for name in ("deep.C10", "deep.C20")}, depth=20.0)
    assert held.curve(at)[-1] > 1.15 * theirs[-1]
