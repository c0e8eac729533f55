"""Sealed cases: reproducible, sealed, and recorded with the errors stated."""

from __future__ import annotations

import json

import numpy as np
import pytest

from legfem.errors import InputError
from legfem.study.concealed.cases import INSTRUMENT, Case, make_cases, protocols_of
from legfem.study.concealed.seal import read_sealed, write_sealed
from legfem.study.concealed.truth import Truth, blank_observations, force_at, record


def test_cases_depend_on_the_seed_alone():
    assert make_cases(40, 1) == make_cases(40, 1)
    assert make_cases(40, 1) != make_cases(40, 2)


def test_cases_hold_all_kinds_and_ten_mechanisms_or_more():
    cases = make_cases(80, 1)
    assert len([case for case in cases if case.twin_of is None]) == 80
    assert {case.kind for case in cases} == {"none", "single", "pair", "outside"}
    assert len({case.names for case in cases if case.kind == "single"}) >= 10
    assert len({case.subject for case in cases}) == 3


def test_a_case_survives_json():
    for case in make_cases(40, 3):
        assert Case.of(json.loads(json.dumps(case.document()))) == case


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


def test_recordings_err_as_their_instruments_do():
    blank = blank_observations(protocols_of("rates"))
    truth = Truth(blank, blank.displacement**2 / 40)
    case = next(c for c in make_cases(20, 1) if c.protocol == "rates")
    recordings = record(truth, case)
    errors = np.concatenate(
        [r.force - force_at(truth, k, r.time) for k, r in enumerate(recordings)]
    )
    assert len(recordings) == 6
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(INSTRUMENT.force_sd, rel=0.3)
    protocol = blank.protocols[0].protocol
    away = recordings[0].displacement - protocol.displacement_at(recordings[0].time)
    assert np.std(away) == pytest.approx(INSTRUMENT.displacement_sd, rel=0.5)
