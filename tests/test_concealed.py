"""Sealed cases: reproducible, sealed, and recorded with the errors stated."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import norm

from legfem.errors import InputError
from legfem.progress import Silent
from legfem.study.concealed import command
from legfem.study.concealed.cases import INSTRUMENT, Case, make_cases, protocols_of, weakened
from legfem.study.concealed.kept import Kept
from legfem.study.concealed.page import cases_page, page
from legfem.study.concealed.power import RATIOS, Trial, Tried, power_curve
from legfem.study.concealed.scoring import Scored, summarise
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


def test_a_weakened_case_keeps_its_shape():
    case = next(c for c in make_cases(80, 1) if c.names == ("viscoelasticity",))
    half = weakened(case, 0.5)
    before, after = dict(case.effects[0][1]), dict(half.effects[0][1])
    assert after["ratio"] == pytest.approx(0.5 * before["ratio"])
    assert after["relaxation_time"] == before["relaxation_time"]


def test_power_is_read_from_counts():
    generator = np.random.default_rng(3)
    outcomes = []
    for ratio in RATIOS:
        for _ in range(300):
            found = bool(np.log(ratio) + 0.4 * generator.normal() > 0.1)
            outcomes.append((Trial(None, "force-drift", ratio), Tried(ratio * 0.01, found)))
    curve = power_curve("force-drift", "ramps", outcomes)
    expected = np.exp(0.1 + 0.4 * norm.ppf(0.8))
    assert curve.ratio_found == pytest.approx(expected, rel=0.08)
    assert curve.smallest[0] == pytest.approx(0.01 * expected, rel=0.08)
    assert curve.counted(RATIOS[0])[1] == 300


def test_a_count_goes_on_where_it_was_stopped(tmp_path):
    library = _Library(np.arange(3.0), {("contact-slip", ""): _Values(np.ones(4))})
    kept = Kept(tmp_path, "power", [library])
    kept.add("a", {"strength": 0.5, "found": True})
    kept.add("b", None)
    with kept.path.open("a") as file:
        file.write('\n["c", {"stren')
    again = Kept(tmp_path, "power", [library])
    assert again["a"] == {"strength": 0.5, "found": True}
    assert "b" in again
    assert "c" not in again
    again.add("c", 1.0)
    assert Kept(tmp_path, "power", [library])["c"] == 1.0
    other = replace(library, changes={("contact-slip", ""): _Values(np.zeros(4))})
    assert "a" not in Kept(tmp_path, "power", [other])


def test_p_values_are_not_drawn_twice(tmp_path, monkeypatch):
    drawn = []

    def p_values(context, task):
        drawn.append(task.seed)
        return task.seed / 100, 0.5

    monkeypatch.setattr(command, "_null", p_values)
    kinds = [(_Library(np.arange(3.0), {}), "neo-hookean", "ramps")]
    command.calibrate(kinds, 10, 3, 1, Silent(), tmp_path)
    found = command.calibrate(kinds, 14, 3, 1, Silent(), tmp_path)
    assert drawn == list(range(3, 17))
    np.testing.assert_allclose(found.verdict.p_values, np.arange(3, 17) / 100)


def scored(number, names, *models, kind="single", twin_of=None, covered=True, after=0.01):
    """Return a scored case; its C10 was 20 % off before repair."""
    case = replace(make_cases(20, 1)[0], number=number, kind=kind, twin_of=twin_of, outside=(),
                   effects=tuple((name, (("size", 1.0),)) for name in names))  # fmt: skip
    verdict = ("consistent", "named", "ambiguous")[min(len(models), 2)]
    return Scored(case, verdict, models, 0.995, (8, 1, 1), {"c10_deep": 0.2}, {"c10_deep": after},
                  covered, (0.1, 0.01, 0.01), 12.0, 3)  # fmt: skip


def test_scores_count_what_they_say():
    everything = [
        scored(0, ["a"], ("a",)),
        scored(1, ["a"], ("b",), ("a",), after=0.05),
        scored(2, ["a"], ("b",)),
        scored(3, ["a", "b"], ("b", "a"), kind="pair", covered=False),
        scored(4, [], kind="none"),
        scored(5, [], kind="outside"),
        scored(6, ["a"], ("a",), twin_of=0),
        scored(7, ["a"], ("a",), ("b",), twin_of=1),
    ]
    summary = summarise(everything)
    assert (summary.first.count, summary.first.total) == (1, 3)
    assert summary.in_set.count == 2
    assert (summary.pairs.count, summary.false_alarms.count, summary.outside.count) == (1, 0, 0)
    assert (summary.same_name.count, summary.same_answer.count) == (1, 2)
    assert summary.same_verdict.count == 2
    assert summary.f1 == pytest.approx(0.8 * 2 / (0.8 * 2 + 0.2))
    assert summary.bias_before["c10_deep"] == pytest.approx(0.2)
    assert summary.bias_after["c10_deep"] == pytest.approx(0.01)
    assert (summary.covered.count, summary.covered.total) == (1, 2)
    assert "| a | 3 | 1 | 2 |" in page(everything, summary)
    assert "| ambiguous: b or a | ambiguous: a or b | +20.0%, +5.0% | yes |" in cases_page(
        everything
    )


@dataclass(frozen=True)
class _Values:
    values: np.ndarray


@dataclass(frozen=True)
class _Library:
    grid: np.ndarray
    changes: dict

    def curve(self, c10, c20):
        """Return a force (3,)."""
        return c10 * self.grid + c20
