"""What is concealed on a sealed leg: every effect has a form, and does what it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import mechanisms
from legfem.solve.protocol import Protocol
from studies.cases.forms import FORMS, ON_COURSE, OUTSIDE_ON_COURSE, Pressed
from studies.cases.sealed_case import DEPTH_MM
from studies.cases.sealed_draw import channel_cases
from studies.cases.truth import ELASTIC_RATE, LUMPS, ForceCourse, Truths


def test_cases_depend_on_the_seed_alone_and_hold_every_form():
    cases = channel_cases(6, 1)
    assert cases == channel_cases(6, 1) != channel_cases(6, 2)
    assert {name for case in cases for name, _ in case.effects} == set(FORMS)
    assert set(FORMS) < {mechanism.name for mechanism in mechanisms()}
    assert {name for case in cases for name, _ in case.outside} == {*OUTSIDE_ON_COURSE, *LUMPS}
    assert sum(case.code == "felupe" for case in cases) > len(cases) / 3


def pressed(trial=0):
    time = np.linspace(0.0, 100.0, 501)
    d = np.concatenate([np.linspace(0, 20, 251), np.linspace(20, 0, 251)[1:]])
    return Pressed(trial, time, d, 0.03 * d**2, lambda at: 0.03 * at**2)


def test_a_series_spring_takes_up_what_it_says():
    trial = pressed()
    given = {"strength": 0.5, "hardening": 0.1}
    force = ON_COURSE["support-compliance"](trial, given)
    deepest = int(np.argmax(trial.displacement))
    taken = 0.5 * force[deepest] / (1 + 0.1 * force[deepest])
    assert force[deepest] == pytest.approx(0.03 * (20.0 - taken) ** 2, rel=1e-3)


def test_preconditioning_fades_and_is_graded():
    given = {"strength": 0.1, "fading": 0.5, "grading": 0.3}
    excess = [ON_COURSE["preconditioning"](pressed(k), given)[1:-1] / pressed(k).force[1:-1] - 1 for k in range(3)]
    np.testing.assert_allclose(excess[2], 0.25 * excess[0])
    assert excess[0].max() == pytest.approx(0.13, rel=1e-3)
    assert excess[0].min() == pytest.approx(0.07, rel=1e-3)


@pytest.mark.parametrize("name", ["muscle-contraction", "force-drift"])
def test_effects_vanish_with_their_strength(name):
    numbers = {key: float(np.mean(ends)) for key, ends in FORMS[name][1].items()}
    trial = pressed()
    still = ON_COURSE[name](trial, {"strength": 0.0, **numbers})
    np.testing.assert_allclose(still, trial.force)
    moved = ON_COURSE[name](trial, {"strength": FORMS[name][0][1], **numbers})
    assert np.abs(moved - trial.force).max() > 0.01 * trial.force.max()


@pytest.mark.parametrize("name", list(OUTSIDE_ON_COURSE))
def test_effects_outside_the_library_matter(name):
    trial = pressed(1)
    away = np.abs(OUTSIDE_ON_COURSE[name](trial, 1.0) - trial.force).max()
    assert 0.02 < away / trial.force.max() < (0.3 if name in ("rig-bends", "twitch") else 0.1)


def test_effects_act_on_the_course_that_a_programme_drives(monkeypatch):
    """On a leg whose force is 0.02 N/mm2 times the depth's square."""
    d = np.linspace(0.0, DEPTH_MM, 201)
    monkeypatch.setattr(Truths, "_elastic", lambda self, case, effects: ForceCourse.of(d / ELASTIC_RATE, 0.02 * d**2))
    leg = load_subject(SUBJECTS.find("3"), need_recordings=False)
    case = next(one for one in channel_cases(6, 1) if dict(one.effects).keys() == {"preconditioning"})
    values = dict(case.effects[0][1]) | {"grading": 0.0}
    case = replace(case, effects=(("preconditioning", tuple(values.items())),))
    found = Truths(leg, SUBJECTS.find("3")).of(case, (Protocol.ramp(10.0, 0.4), Protocol.ramp(DEPTH_MM, 0.4)))
    assert found is not None
    for k, (trial, depth) in enumerate(zip(found, (10.0, DEPTH_MM), strict=True)):
        assert trial.displacement[-1] == pytest.approx(depth)
        excess = values["strength"] * values["fading"] ** k
        assert trial.force[-1] == pytest.approx(0.02 * depth**2 * (1 + excess), rel=1e-3)
