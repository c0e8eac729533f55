"""Work of a curve, counted: what doesn't depend on the machine; and what the bench makes of counts."""

import pytest
import typer

from legfem.__main__ import command
from studies.bench.__main__ import grown, work_table
from studies.bench.work import TASKS, curve_work
from studies.counting import Work, counted


@pytest.fixture(scope="module")
def work(subject_3_test) -> Work:
    return curve_work(subject_3_test)


def test_a_30_mm_curve_takes_at_most_60_factorisations(work):
    assert 40 < work.counts["factorisations"] <= 60
    assert work.counts["iterations"] <= 280
    # SNES' own evaluations at states just evaluated are saved.
    assert work.counts["iterations"] < work.counts["residuals"] <= 1.3 * work.counts["iterations"]
    assert work.counts["solves"] == 1


def test_what_is_counted_is_what_the_solution_reports(subject_3_test):
    solved, work = counted(lambda: subject_3_test.solve({}, 3.0))
    report = solved.report
    assert report.complete and report.contact_stiffness_factor == 1.0 and report.rejected == 0
    assert (work.counts["factorisations"], work.counts["iterations"]) == (report.factorisations, report.iterations)
    assert 0.5 < sum(work.shares.values()) < 1.0 and min(work.shares.values()) > 0.0


def test_counts_that_grow_by_more_than_a_twentieth_are_told(work):
    kept = {"curve": dict(work.counts)}
    assert not grown({"curve": work}, kept) and not grown({"other": work}, kept)
    kept["curve"]["residuals"] = round(work.counts["residuals"] / 1.04)
    assert not grown({"curve": work}, kept)
    kept["curve"]["residuals"] = round(work.counts["residuals"] / 1.06)
    (line,) = grown({"curve": work}, kept)
    assert line == f"curve: residuals were {kept['curve']['residuals']}, are {work.counts['residuals']}"
    (row,) = zip(*(column.cells for column in work_table({"curve": work}, kept, 0.5).columns), strict=True)
    assert f"({kept['curve']['residuals']})" in row[3] and "else" in row[-1]


@pytest.mark.parametrize("name", [name for name, words in TASKS.items() if words])
def test_a_task_s_command_takes_its_words(name):
    for words in TASKS[name]:
        first, *rest = words.split()
        asked = typer.main.get_command(command(first))
        asked = asked.commands[rest.pop(0)] if hasattr(asked, "commands") else asked
        with asked.make_context(first, rest) as context:
            assert str(context.params["out"]).startswith("FOLDER/"), "a fresh folder, so that nothing is found there"
