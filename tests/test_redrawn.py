"""The study of another code's legs recorded anew: what it reads, draws and counts."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from studies.redrawn import drawing
from studies.redrawn.__main__ import page, run
from studies.redrawn.drawing import Redrawer, RedrawnOutcome, RedrawnTask, diagnose_each, foreign_case

CROSSCHECK = Path(__file__).parent / "data" / "crosscheck"
OUTCOME = RedrawnOutcome(
    "case-1",
    ("contact-slip",),
    "named",
    (("contact-slip",),),
    ((("contact-slip",), False, 0.9),),
    1.2,
    1.45,
    (1.3, 1.55),
    1.5,
    0.01,
    5.0,
)


@pytest.fixture
def foreign(tmp_path):
    """Return a folder of one case: two trials, the second after 0.6 mm of air."""
    folder = tmp_path / "foreign"
    shutil.copytree(CROSSCHECK / "neo-hookean", folder / "case-1")
    d = np.arange(0.0, 20.01, 0.04)
    rows = ["trial,time_s,displacement_mm,force_N"]
    for trial, air in ((1, 0.0), (2, 0.6)):
        rows += [f"{trial},{x / 0.4:.2f},{x:.4f},{0.3 * max(x - air, 0.0):.5f}" for x in d]
    (folder / "case-1" / "clean.csv").write_text("\n".join(rows) + "\n")
    truth = {"effects": ["contact-onset", "contact-slip"], "true_C10_kPa": 1.5}
    (folder / "truth.json").write_text(json.dumps({"cases": {"case-1": truth, "case-2": truth}}))
    return folder


def test_a_case_is_read_from_first_touch_on_and_air_is_no_effect(foreign):
    case = foreign_case(foreign, "case-1")
    assert case.effects == ("contact-slip",) and case.c10 == 1.5
    first, second = case.courses
    assert second.displacement[-1] == pytest.approx(19.4)
    for course in (first, second):
        np.testing.assert_allclose(course.force, 0.3 * course.displacement, atol=1e-5)


def test_sets_differ_and_are_the_same_again(foreign):
    redrawer = Redrawer(foreign, None)
    task = RedrawnTask("case-1", 0, 1)
    one, other = redrawer.subject(task)[0], redrawer.subject(replace(task, turn=1))[0]
    again = Redrawer(foreign, None).subject(task)[0]
    assert len(one.recordings) == 2 and not one.starts_at_contact
    assert not np.array_equal(one.recordings[0].force[:50], other.recordings[0].force[:50])
    for mine, same in zip(one.recordings, again.recordings, strict=True):
        np.testing.assert_array_equal(mine.force, same.force)


def test_what_is_kept_is_not_diagnosed_again(foreign, tmp_path, monkeypatch):
    asked = []

    def outcome(self, task):
        asked.append(task)
        return OUTCOME

    monkeypatch.setattr(Redrawer, "outcome", outcome)
    tasks = [RedrawnTask("case-1", k, 1) for k in range(3)]
    redrawer = Redrawer(foreign, None)
    assert diagnose_each(tasks[:2], redrawer, tmp_path, 1, Silent()) == [OUTCOME] * 2
    assert diagnose_each(tasks, redrawer, tmp_path, 1, Silent()) == [OUTCOME] * 3
    assert asked == tasks and drawing.MODULES


def test_the_page_counts_what_is_first_listed_and_held():
    missed = replace(
        OUTCOME,
        verdict="ambiguous",
        models=(("dermis",), ("contact-slip",)),
        statements=((("dermis",), False, 0.6), (("contact-slip",), False, 0.4)),
        interval=(1.52, 1.7),
        c10=1.6,
    )
    null = replace(OUTCOME, case="case-2", effects=(), verdict="consistent", models=(), statements=(((), False, 0.9),))
    rows = {line.split(" | ")[0].strip("| "): line for line in page([OUTCOME, missed, null]).split("\n")}
    assert "| 1/2 = 50%" in rows["case-1"] and "| 2/2 = 100%" in rows["case-1"]
    assert "contact-slip: 1, dermis: 1" in rows["case-1"]
    assert "nothing that shows: 1" in rows["case-2"]
    assert rows["all"].count("2/3 = 67%") == 2 and rows["all"].count("3/3 = 100%") == 1


def test_a_folder_without_truths_and_an_unknown_case_are_refused(foreign, tmp_path):
    asked = 1, 1, tmp_path, tmp_path, 1, Silent()
    with pytest.raises(InputError, match="truth"):
        run(tmp_path, asked[0], (), *asked[1:])
    with pytest.raises(InputError, match="no case there"):
        run(foreign, asked[0], ("case-2",), *asked[1:])
