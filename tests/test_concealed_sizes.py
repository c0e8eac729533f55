"""The size of a concealed effect: what of it no other stiffness can stand for."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from making_sealed import square_truths

from legfem.common.errors import InputError
from legfem.data import segment_all
from legfem.inverse.observations import observe
from studies.concealed.cases import make_cases
from studies.concealed.diagnosing import Metric
from studies.concealed.making import change_at_stations, key_of_case, recorded, recorded_change
from studies.concealed.scoring import _changes
from studies.lab.recording import INSTRUMENT, Course

AT = np.linspace(0.1, 1, 30)
STIFF = np.linspace(0.0, 10.0, 21)[:, None]


def metric(family=STIFF * AT, force=5 * AT):
    n = len(AT)
    return Metric(
        force,
        0.01**2 * np.eye(n),
        family,
        np.zeros((n, 0)),
        0.01**2 * np.eye(n),
        AT[:, None],
        np.full(n, 0.01),
        np.zeros(n, dtype=bool),
        np.array([np.sin(9 * AT), np.cos(9.5 * AT)]),
        np.array(["a", "b"]),
    )


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


def test_a_key_holds_what_each_of_two_effects_adds(monkeypatch):
    truths = square_truths(monkeypatch)
    effects = (
        ("preconditioning", (("strength", 0.1), ("fading", 0.5), ("grading", 0.0))),
        ("force-drift", (("strength", 0.4), ("time", 30.0))),
    )
    case = replace(make_cases(20, 1, 2)[0], code="legfem", protocol="ramps", effects=effects, outside=())
    truth, parts = truths.of(case), truths.without_each(case)
    key = json.loads(json.dumps(key_of_case(case, truth, parts)))
    recordings = recorded(truth.trials, case.noise_seed)
    observed = observe(segment_all(recordings, INSTRUMENT))
    found = {
        name: change_at_stations(recordings, change, observed) for name, change in key["recorded_part_change_N"].items()
    }
    late = observed.time > 20.0
    for trial, excess in enumerate((0.1, 0.05, 0.025)):
        here = late & (observed.trial == trial)
        d, time = observed.displacement[here], observed.time[here]
        drift = found["force-drift"][here] / (0.4 * (1 - np.exp(-time / 30)))
        stiffer = found["preconditioning"][here] / (0.02 * d**2 * excess)
        # Each trial has a gain of its own, and air that may go unseen: what it is said to err by counts twice in d**2.
        off = 2 * observed.contacts[trial].displacement_error / d.mean()
        for ratio in (drift, stiffer):
            assert ratio.mean() == pytest.approx(1.0, abs=0.1 + off)
            assert ratio.std() < 0.03 + off / 4
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
    observed = observe(segment_all(recordings, INSTRUMENT))
    found = observe(segment_all(recorded(plain, 8), INSTRUMENT))
    pairs = zip(observed.contacts, found.contacts, strict=True)
    assert all(abs(there.displacement - here.displacement) > 1.5 for here, there in pairs)
    less = observed.force - change_at_stations(recordings, change, observed)

    def left(force):
        trials = [(observed.displacement[k], force[k]) for k in np.eye(3, dtype=bool)[observed.trial].T]
        return max(np.std(f - np.polyval(np.polyfit(x, f, 3), x)) for x, f in trials)

    assert left(observed.force) > 0.15
    assert left(less) < 2 * INSTRUMENT.force_sd


def test_keys_of_an_earlier_version_are_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="make the cases again"):
        _changes(tmp_path, {"change_N": []}, None)
