"""Sealed cases: reproducible, sealed, with the effects stated."""

from __future__ import annotations

import json

import numpy as np
import pytest

from legfem.common.errors import InputError
from legfem.mechanisms import mechanisms
from studies.concealed.cases import SealedCase, make_cases
from studies.concealed.forms import FORMS, NAMED, ON_COURSE, OUTSIDE, OUTSIDE_ON_COURSE, Pressed
from studies.concealed.making import read_sealed, write_sealed


def test_cases_depend_on_the_seed_alone():
    assert make_cases(40, 1, 3) == make_cases(40, 1, 3)
    assert make_cases(40, 1, 3) != make_cases(40, 2, 3)


def test_cases_hold_all_kinds_and_mechanisms_and_thirty_are_another_codes():
    everything = make_cases(150, 1, 6)
    cases = [case for case in everything if case.twin_of is None]
    assert len(cases) == 150
    assert {case.kind for case in cases} == {"none", "single", "pair", "outside"}
    assert {name for case in cases for name, _ in case.effects} == set(FORMS)
    concealed = {name for case in cases for name in case.names}
    assert concealed == {*FORMS, *NAMED.values()}
    # Air is in all recordings, and fibres don't show in plane strain (`studies.fibres`).
    assert concealed == {m.name for m in mechanisms()} - {"contact-onset", "muscle-fibres"}
    assert all(case.judged == "single" for case in cases if "uneven-muscle" in case.names)
    assert {name for case in cases for name, _ in case.outside} == set(OUTSIDE)
    assert sum(case.code == "felupe" for case in cases) >= 30
    assert {case.leg for case in cases} == set(range(6))
    for case in cases:
        if any(FORMS[name].needs_time for name, _ in case.effects):
            assert case.protocol == "holds"


def test_a_case_survives_json():
    for case in make_cases(40, 3, 3):
        assert SealedCase.of(json.loads(json.dumps(case.document()))) == case


def test_a_key_opens_with_its_seed_alone(tmp_path):
    path = tmp_path / "case000.json"
    write_sealed(path, {"effect": "viscoelasticity"}, 7)
    assert "viscoelasticity" not in path.read_text()
    assert read_sealed(path, 7) == {"effect": "viscoelasticity"}
    with pytest.raises(InputError, match="does not open"):
        read_sealed(path, 8)


def test_a_changed_key_is_noticed(tmp_path):
    path = tmp_path / "case000.json"
    write_sealed(path, {"effect": "viscoelasticity"}, 7)
    sealed = json.loads(path.read_text())
    content = bytearray.fromhex(sealed["content"])
    content[-3] ^= 1
    path.write_text(json.dumps({**sealed, "content": content.hex()}))
    with pytest.raises(InputError, match="does not open"):
        read_sealed(path, 7)


def pressed(trial=0):
    time = np.linspace(0.0, 100.0, 501)
    d = np.concatenate([np.linspace(0, 20, 251), np.linspace(20, 0, 251)[1:]])
    return Pressed(trial, time, d, 0.03 * d**2, lambda at: 0.03 * at**2, lambda at: 0.001 * at)


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


@pytest.mark.parametrize("name", ["muscle-contraction", "force-drift", "end-effects"])
def test_effects_vanish_with_their_strength(name):
    numbers = {key: float(np.mean(ends)) for key, ends in FORMS[name].others.items()}
    trial = pressed()
    still = ON_COURSE[name](trial, {"strength": 0.0, **numbers})
    np.testing.assert_allclose(still, trial.force)
    moved = ON_COURSE[name](trial, {"strength": FORMS[name].strengths[1], **numbers})
    assert np.abs(moved - trial.force).max() > 0.01 * trial.force.max()


@pytest.mark.parametrize("name", list(OUTSIDE_ON_COURSE))
def test_effects_outside_the_library_matter(name):
    trial = pressed(1)
    away = np.abs(OUTSIDE_ON_COURSE[name](trial, 1.0) - trial.force).max()
    assert 0.02 < away / trial.force.max() < (0.3 if name in ("rig-bends", "twitch") else 0.1)
