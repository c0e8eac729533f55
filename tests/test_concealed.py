"""Sealed cases: reproducible, sealed, with the effects stated, and scored as stated."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from legfem.common.errors import InputError
from legfem.correction.choice import REFERENCE
from legfem.correction.tabulated import read_correction
from legfem.diagnose.mechanisms import mechanisms
from legfem.diagnose.observations import observe
from legfem.diagnose.weighing import PRIOR_NONE, PRIOR_SINGLE
from legfem.subjects.loading import SUBJECTS, load_subject
from studies.concealed.cases import DEPTH_MM, SealedCase, make_cases
from studies.concealed.change import change_at_stations, recorded, recorded_change
from studies.concealed.forms import FORMS, NAMED, ON_COURSE, OUTSIDE, OUTSIDE_ON_COURSE, Pressed
from studies.concealed.making import key_of_case
from studies.concealed.metric import Metric
from studies.concealed.page import cases_page, figure, page, scored_document
from studies.concealed.reliability import Explained, at_base_rates
from studies.concealed.scoring import Scored, _changes
from studies.concealed.seal import read_sealed, write_sealed
from studies.concealed.summary import reliability, summarise
from studies.concealed.truth import ELASTIC_RATE, ForceCourse, Truths
from studies.lab.recording import INSTRUMENT, Course


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
    excess = [
        ON_COURSE["preconditioning"](pressed(k), given)[1:-1] / pressed(k).force[1:-1] - 1
        for k in range(3)
    ]
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
    trial = pressed()
    away = np.abs(OUTSIDE_ON_COURSE[name](trial, 1.0) - trial.force).max()
    assert 0.02 < away / trial.force.max() < 0.1


AT = np.linspace(0.1, 1, 30)
STIFF = np.linspace(0.0, 10.0, 21)[:, None]


def metric(family=STIFF * AT, force=5 * AT):
    n = len(AT)
    return Metric(
        force, 0.01**2 * np.eye(n), family, np.zeros((n, 0)),
        0.01**2 * np.eye(n), AT[:, None], np.full(n, 0.01), np.zeros(n, dtype=bool),
        np.array([np.sin(9 * AT), np.cos(9.5 * AT)]), np.array(["a", "b"]),
    )  # fmt: skip


def beyond(values, *columns):
    basis = np.linalg.qr(np.column_stack(columns))[0]
    return values - basis @ (basis.T @ values)


def test_a_metric_measures_what_a_refit_leaves(tmp_path):
    assert metric().size(3 * AT) == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(metric().shown(3 * AT), 0, atol=1e-12)
    across = np.cos(9 * AT)
    size = metric(force=5 * AT + 0.02 * across).size(0.02 * across)
    assert size == pytest.approx(2 * np.linalg.norm(beyond(across, AT)))
    np.testing.assert_allclose(metric().shown(0.02 * across), 0.02 * beyond(across, AT))
    used = metric()
    used.size(0.1 * AT)
    used.write(tmp_path / "case.npz")
    again = Metric.read(tmp_path / "case.npz")
    np.testing.assert_array_equal(again.covariance, metric().covariance)
    assert again.size(0.02 * across) == pytest.approx(used.size(0.02 * across))


def test_what_another_stiffness_does_has_no_size_however_large_it_is():
    """A tissue that stiffens: along a line about either leg the change is eighty errors off."""
    family = STIFF * AT + 0.3 * STIFF**2 * AT**2
    change = family[12] - family[4]
    assert np.linalg.norm(beyond(change, AT + 0.6 * 6.0 * AT**2)) > 80 * 0.01
    assert metric(family, family[12]).size(change) == pytest.approx(0, abs=1e-3)
    ripple = 0.05 * np.cos(9 * AT)
    seen = metric(family, family[12] + ripple).size(change + ripple)
    line = AT + 0.6 * 6.0 * AT**2
    assert seen == pytest.approx(5 * np.linalg.norm(beyond(np.cos(9 * AT), line)), rel=1e-2)


def test_first_contacts_stand_for_an_effect_too():
    touch = np.exp(-5 * AT)
    given = replace(metric(force=5 * AT + 0.3 * touch), onsets=touch[:, None])
    assert given.size(0.3 * touch) == pytest.approx(0, abs=1e-6)


def test_a_second_effect_is_measured_beside_the_first():
    first, second = np.cos(9 * AT), np.sin(9 * AT)
    recorded = metric(force=5 * AT + 0.02 * first)
    assert recorded.size(0.02 * first, 0.5 * first) == pytest.approx(0, abs=1e-6)
    # Twice what the base model and the other one leave of it, at errors of half its size.
    beside = recorded.size(0.02 * first, 0.3 * second)
    assert beside == pytest.approx(2 * np.linalg.norm(beyond(first, AT, second)))
    assert beside < recorded.size(0.02 * first)


def test_an_effect_is_measured_beside_the_nearest_mechanism_but_its_own():
    across = 0.02 * np.cos(9 * AT)
    recorded = metric(force=5 * AT + across)
    by_each = [recorded.size(across, rival) for rival in recorded.rivals]
    assert by_each[1] < 0.5 * by_each[0]
    assert recorded.told_apart(across, ["c"]) == by_each[1]
    assert recorded.told_apart(across, ["b"]) == by_each[0]
    assert np.isnan(recorded.told_apart(across, ["a", "b"]))


def scored(number, names, *models, kind="single", twin_of=None, size=9.0, sure=0.95, **changed):
    """Return a scored case; its C10 was 20 % off before repair."""
    case = replace(make_cases(20, 1, 2)[0], number=number, kind=kind, twin_of=twin_of, outside=(),
                   effects=tuple((name, (("strength", 1.0),)) for name in names))  # fmt: skip
    if kind == "pair":
        changed = {"parts": tuple((name, 9.0) for name in names), **changed}
    verdict = ("consistent", "named", "ambiguous")[min(len(models), 2)]
    rest = (1 - sure) / max(len(models) - 1, 1)
    explanations = tuple(
        Explained(model, False, sure if k == 0 else rest) for k, model in enumerate(models or ((),))
    )
    usual = Scored(
        case, verdict, models, explanations, size, 0.05, (8, 1, 1), 0.2, 0.01, True, 12.0, 3, 0.05,
        explanations,
    )  # fmt: skip
    return replace(usual, **changed)


def everything():
    return [
        scored(0, ["a"], ("a",)),
        scored(1, ["a"], ("b",), ("a",), sure=0.7, bias_after=0.05),
        scored(2, ["a"], ("b",)),
        scored(3, ["a", "b"], ("b", "a"), kind="pair", covered=False),
        scored(4, [], kind="none", size=0.0),
        scored(5, ["a"], size=1.0),
        scored(6, ["a"], ("a",), twin_of=0),
        scored(7, ["a"], ("a",), ("b",), twin_of=1),
    ]


def test_scores_count_what_they_say():
    summary = summarise(everything())
    alone, _, pairs, _, both, _ = summary.named
    assert (both.first.count, both.first.total) == (2, 4)
    assert (both.in_set.count, both.in_set.total) == (3, 4)
    assert (alone.first.count, alone.in_set.count, alone.first.total) == (1, 2, 3)
    assert (pairs.first.count, pairs.in_said.count, pairs.first.total) == (1, 1, 1)
    assert summary.median_set == 1 and summary.median_said == 1
    assert (summary.false_alarms.count, summary.false_alarms.total) == (0, 1)
    assert (summary.covered.count, summary.covered.total) == (5, 6)
    assert summary.same_answer.count == 2
    assert summary.f1 == pytest.approx(0.8 * 2 / (0.8 * 2 + 0.2))
    assert summary.bias_before == pytest.approx(0.2)
    assert summary.bias_after == pytest.approx(0.01)
    sizes = {(low, high): first.total for low, high, first, _ in summary.by_size}
    assert sizes[0.0, 2.0] == 1 and sizes[8.0, 16.0] == 4
    near = [replace(s, apart=(1.0, 9.0)[s.first]) for s in everything()]
    apart = [(first.count, first.total, held.count) for *_, first, held in summarise(near).by_apart]
    # One alone is named first, one listed, one neither; pairs and what is small don't count.
    assert apart == [(0, 2, 1), (0, 0, 0), (0, 0, 0), (1, 1, 1), (0, 0, 0)]


@pytest.mark.parametrize(
    ("sizes", "right"),
    [
        ((9.0, 9.0), {"ab"}),
        ((9.0, 1.0), {"ab", "a"}),
        ((1.0, 9.0), {"ab", "b"}),
        ((1.0, 1.0), {"ab", "a", "b"}),
    ],
)
def test_of_two_effects_those_are_asked_for_that_show_beside_the_other(sizes, right):
    for called in ("a", "b", "ab", "ac", "c"):
        parts = tuple(zip("ab", sizes, strict=True))
        one = scored(0, ["a", "b"], tuple(called), kind="pair", parts=parts)
        found, right_now = summarise([one]), called in right
        whole, shows = found.named[2:4]
        assert shows.first.count == shows.in_set.count == shows.in_said.count == right_now
        assert whole.first.count == whole.in_set.count == whole.in_said.count == (called == "ab")
        assert one.first_shows == one.in_said == right_now
        assert found.reliability_shows[-1].right.count == right_now
        assert found.reliability[-1].right.count == (called == "ab")


def test_two_effects_that_do_not_show_together_are_asked_for_whole():
    parts = (("a", 1.0), ("b", 1.0))
    one = scored(0, ["a", "b"], ("a",), kind="pair", size=2.0, parts=parts)
    assert not one.first_shows and not one.in_said


def test_the_reports_set_is_what_it_says_until_ninety_percent():
    said = tuple(Explained(names, False, p) for names, p in (
        (("b",), 0.6), (("a",), 0.31), ((), 0.09),
    ))  # fmt: skip
    every = tuple(Explained((*names, k), False, 0.12) for names in (("a",), ("b",)) for k in "cdef")
    found = summarise([scored(0, ["a"], ("b",), ("a",), said=said, explanations=every)])
    assert (found.median_set, found.median_said) == (8, 2)
    alone = found.named[0]
    assert (alone.in_set.count, alone.in_said.count, alone.first.count) == (0, 1, 0)


def test_reliability_sets_probabilities_beside_what_is_right():
    one, other = reliability(everything()[:6])[2:]
    assert (one.right.count, one.right.total) == (0, 1)
    assert one.stated == pytest.approx(0.7)
    # Two names are right, and that nothing shows is of the null and the effect too small to see.
    assert (other.right.count, other.right.total) == (4, 5)


def test_priors_are_exchanged_for_the_studys_shares():
    assumed = [
        Explained((), False, PRIOR_NONE),
        Explained(("a",), False, PRIOR_SINGLE),
        Explained(("b",), False, 0),
    ]
    shares, first = at_base_rates(assumed)
    # Of 0.15 cases without effect and 0.58 single ones, and a third of 0.15 that have a name.
    np.testing.assert_allclose(shares, [0.15 / 0.78, 0.63 / 0.78, 0])
    assert first == 1


def test_that_nothing_shows_is_right_of_what_is_too_small_to_see():
    small = scored(0, ["a"], size=1.0, nothing_shows=0.95)
    large = scored(1, ["a"], size=9.0, nothing_shows=0.9)
    found = summarise([small, large]).nothing_shows[-1]
    assert (found.right.count, found.right.total) == (1, 2)
    assert found.stated == pytest.approx(0.925)


def test_stiffness_is_counted_by_leg():
    cases = [scored(k, ["a"], ("a",), covered=k > 0, bias_after=0.1 * k) for k in range(4)]
    cases = [replace(s, case=replace(s.case, leg=k // 2)) for k, s in enumerate(cases)]
    (one, first, error), (other, second, _) = summarise(cases).by_leg
    assert (one, first.count, first.total) == (0, 1, 2)
    assert (other, second.count, second.total) == (1, 2, 2)
    assert error == pytest.approx(0.05)


def test_outside_the_library_only_unexplained_is_right():
    unknown = (Explained((), True, 0.9),)
    unexplained = scored(0, [], kind="outside", verdict="unexplained", explanations=unknown)
    ambiguous = scored(1, [], ("a",), ("b",), kind="outside")
    summary = summarise([unexplained, ambiguous, scored(2, ["a"], ("a",))])
    assert (summary.outside.count, summary.outside.total) == (1, 2)
    assert unexplained.in_set and not ambiguous.in_set


def test_a_key_holds_what_each_of_two_effects_adds(monkeypatch):
    d = np.linspace(0.0, DEPTH_MM, 201)
    monkeypatch.setattr(
        Truths, "_elastic",
        lambda self, case, effects: ForceCourse.of(d / ELASTIC_RATE, 0.02 * d**2),
    )  # fmt: skip
    leg = load_subject(SUBJECTS.find("3"), need_recordings=False)
    truths = Truths(leg, SUBJECTS.find("3"), read_correction(REFERENCE))
    effects = (
        ("preconditioning", (("strength", 0.1), ("fading", 0.5), ("grading", 0.0))),
        ("force-drift", (("strength", 0.4), ("time", 30.0))),
    )
    case = replace(make_cases(20, 1, 2)[0], code="legfem", protocol="ramps", effects=effects,
                   outside=())  # fmt: skip
    truth, parts = truths.of(case), truths.without_each(case)
    key = json.loads(json.dumps(key_of_case(case, truth, parts)))
    recordings = recorded(truth.trials, case.noise_seed)
    observed = observe(recordings, INSTRUMENT, starts_at_contact=False)
    found = {
        name: change_at_stations(recordings, change, observed)
        for name, change in key["recorded_part_change_N"].items()
    }
    late = observed.time > 20.0
    for trial, excess in enumerate((0.1, 0.05, 0.025)):
        here = late & (observed.trial == trial)
        d, time = observed.displacement[here], observed.time[here]
        drift = found["force-drift"][here] / (0.4 * (1 - np.exp(-time / 30)))
        stiffer = found["preconditioning"][here] / (0.02 * d**2 * excess)
        # Each trial has a gain of its own, and its first contact isn't found exactly.
        for ratio in (drift, stiffer):
            assert ratio.mean() == pytest.approx(1.0, abs=0.1)
            assert ratio.std() < 0.03
    whole = change_at_stations(recordings, key["recorded_change_N"], observed)
    np.testing.assert_allclose(whole, sum(found.values()), atol=1e-9)
    assert truths.without_each(replace(case, effects=effects[:1])) == {}


def test_what_an_effect_changes_is_taken_off_where_it_was_recorded():
    """A ripple misplaces first contact; without it a smooth leg is left, but for the noise."""
    time = np.linspace(0.0, 50.0, 501)
    d, smooth = 0.4 * time, 0.02 * (0.4 * time) ** 2 + 0.02 * time
    waves = np.sin(2 * np.pi * d / 3.0)
    plain = [Course(time, d, smooth)] * 3
    rippled = [Course(time, d, smooth + 0.3 * waves)] * 3
    recordings, change = recorded(rippled, 8), recorded_change(rippled, plain, 8)
    observed = observe(recordings, INSTRUMENT, starts_at_contact=False)
    found = observe(recorded(plain, 8), INSTRUMENT, starts_at_contact=False)
    pairs = zip(observed.contacts, found.contacts, strict=True)
    assert all(there.displacement - here.displacement > 1.5 for here, there in pairs)
    less = observed.force - change_at_stations(recordings, change, observed)

    def left(force):
        trials = [
            (observed.displacement[k], force[k]) for k in np.eye(3, dtype=bool)[observed.trial].T
        ]
        return max(np.std(f - np.polyval(np.polyfit(x, f, 3), x)) for x, f in trials)

    assert left(observed.force) > 0.15
    assert left(less) < 2 * INSTRUMENT.force_sd


def test_keys_of_an_earlier_version_are_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="make the cases again"):
        _changes(tmp_path, {"change_N": []}, None)


def test_pages_and_figure_show_every_case():
    cases = everything()[1:5] + everything()[7:]
    named = [replace(s, case=replace(s.case, effects=tuple(
        ({"a": "force-drift", "b": "contact-slip"}[name], v) for name, v in s.case.effects
    ))) for s in cases]  # fmt: skip
    summary = summarise(named)
    assert "| force-drift | a load cell that warms up" in page(named, summary)
    pair = [s for s in named if s.parts]
    pair = [replace(s, parts=(("contact-slip", 1.5), ("force-drift", 7.0))) for s in pair]
    assert "| force-drift + contact-slip | 5.0%, 9.0 (7.0, 1.5) |" in cases_page(pair)
    assert "| ambiguous: b or a | ambiguous: a or b | +20.0%, +5.0% | yes |" in cases_page(named)
    assert len(figure(named, summary).axes) == 2
    assert json.loads(json.dumps(scored_document(named, summary)))["origin"] == "simulated"
