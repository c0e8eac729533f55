"""The study of recordings without effect: its draws, its page, and that it goes on."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from studies.nulls import counting
from studies.nulls.__main__ import page
from studies.nulls.counting import (
    CONDITIONS,
    NullCounter,
    NullOutcome,
    NullTask,
    clean_curve,
    clean_folders,
    condition_named,
    count,
    kept,
    null_tasks,
)

CROSSCHECK = Path(__file__).parent / "data" / "crosscheck"
OUTCOME = NullOutcome(
    "all", "neo-hookean", 1, "named", (("preconditioning",),), 0.2, 1.4, (1.3, 1.45), 1.5, 0.01, 4.0, 5.0
)


def test_every_condition_has_recordings_of_every_curve():
    tasks = null_tasks(300, ("a", "b"), 4, 1)
    assert len({*tasks}) == 300
    counts = Counter(task.condition for task in tasks)
    assert set(counts) == {condition.name for condition in CONDITIONS}
    assert counts["all"] == pytest.approx(3 * counts["scatter 1 %"], abs=3)
    for condition in CONDITIONS:
        mine = [task for task in tasks if task.condition == condition.name]
        assert {task.curve for task in mine} == {"a", "b"}
        legs = {task.leg for task in mine}
        assert legs == {0} if condition.exact else len(legs) in (4, 16)


def test_more_recordings_keep_the_first_ones():
    assert null_tasks(40, ("a", "b"), 2, 1) == null_tasks(90, ("a", "b"), 2, 1)[:40]


def test_recordings_differ_and_share_their_leg():
    counter = NullCounter(clean_folders(CROSSCHECK, None), None)
    first = NullTask("outlines 0.6 mm", "neo-hookean", 1, 0, 1)
    one, true, gain, air = counter.subject(first)
    other, *_ = counter.subject(replace(first, turn=1))
    assert (true, gain, air) == (1.5, 0.0, 0.0)
    np.testing.assert_array_equal(one.section.skin, other.section.skin)
    assert not np.array_equal(one.recordings[0].force, other.recordings[0].force)
    stated = clean_curve(CROSSCHECK / "neo-hookean").subject
    off = np.linalg.norm(one.section.skin - stated.section.skin, axis=1)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(0.6, rel=1e-6)
    assert not condition_named("outlines 0.6 mm").exact


def test_what_is_no_null_is_refused(tmp_path):
    with pytest.raises(InputError, match="none of a leg without effect"):
        clean_curve(tmp_path)


def test_a_count_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    done = []

    def outcome(counter, task):
        done.append(task)
        return replace(OUTCOME, condition=task.condition, leg=task.leg)

    monkeypatch.setattr(counting, "_outcome", outcome)
    tasks = null_tasks(12, ("neo-hookean",), 1, 1)
    counter = NullCounter((), None)
    count(tasks[:5], counter, tmp_path, 1, Silent())
    count(tasks, counter, tmp_path, 1, Silent())
    assert sorted(done, key=tasks.index) == tasks
    assert [o.condition for o in kept(tasks, tmp_path)] == [t.condition for t in tasks]
    assert kept(null_tasks(12, ("neo-hookean",), 1, 2), tmp_path) == []


def test_the_page_counts_false_alarms_and_what_they_are_called():
    sound = replace(OUTCOME, verdict="consistent", models=(), interval=(1.4, 1.6))
    text = page([OUTCOME, sound, replace(sound, leg=2)])
    assert "| all | 2 | 1/3 = 33% " in text
    assert "| 2/3 = 67% " in text
    assert "preconditioning: 1" in text
    assert OUTCOME.false_alarm and not OUTCOME.covered
