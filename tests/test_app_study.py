"""A study in the app: its table as it is pasted, and the run that it becomes."""

import pytest
from making import write_subject

from legfem.app.runs import Run
from legfem.app.study import TABLE, begin_study, legs_of, members_of, table_of
from legfem.app.workspace import Workspace
from legfem.common.errors import InputError


@pytest.fixture
def workspace(tmp_path):
    """Return a workspace with two pressed legs and something that isn't one."""
    found = Workspace.opened(tmp_path / "workspace")
    for wish in ("P01 left", "P01 right"):
        write_subject(found.input(found.new_input(wish)))
    found.new_input("nothing yet")
    return found


@pytest.fixture
def kept(monkeypatch):
    """Start nothing; return the runs that would have been."""
    begun = []
    monkeypatch.setattr(Run, "resume", lambda self: begun.append(self) or True)
    return begun


def test_a_table_begins_with_all_pressed_legs_and_is_read_as_it_stands(workspace):
    assert legs_of(workspace) == ["P01 left", "P01 right"]
    text = table_of(workspace)
    assert text.splitlines() == [
        "folder,subject,group,side,session,date", "P01 left,P01 left,,,,", "P01 right,P01 right,,,,"
    ]  # fmt: skip
    assert [one.person for one in members_of(workspace, text).every] == ["P01 left", "P01 right"]


def test_a_table_is_pasted_from_a_spreadsheet(workspace):
    pasted = "folder\tsubject\tgroup\tside\tdate\tage\nP01 right\tP01\tpatient\tR\t2026-03-01\t43,5\n"
    (one,) = members_of(workspace, pasted).every
    assert one.person == "P01" and one.folder == workspace.input("P01 right")
    assert one.given == {"subject": "P01", "group": "patient", "side": "right", "date": "2026-03-01", "age": 43.5}


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("P01 lefd,P01,,", "did you mean 'P01 left'?"),
        ("nothing yet,P01,,", "contains no subject.toml"),
        ("P01 left,P01,,1.3.2026", "write 2026-01-31"),
        ("P01 left,P01,,\nP01 left,P01,,", "is in line 3 too"),
        ("../../elsewhere,P01,,", "is not a leg of this workspace"),
        (f"{'x' * 5000},P01,,", "file name too long"),
    ],
)
def test_a_row_that_is_wrong_gets_one_line_that_names_the_table_alone(workspace, tmp_path, row, said):
    write_subject(tmp_path / "elsewhere")
    with pytest.raises(InputError) as refused:
        members_of(workspace, f"folder,subject,side,date\nP01 right,P01,right,\n{row}\n")
    line = str(refused.value)
    assert said in line and "\n" not in line and "/tmp" not in line.replace(str(workspace.folder), "")


def test_a_leg_that_reads_other_folders_is_refused(workspace):
    toml = workspace.input("P01 left") / "subject.toml"
    toml.write_text(toml.read_text().replace('"contours.csv"', '"../P01 right/contours.csv"'))
    with pytest.raises(InputError, match="lies in another folder"):
        members_of(workspace, table_of(workspace))


def test_a_study_is_a_run_of_a_cohort_that_goes_on_with_another_table(workspace, kept):
    name = begin_study(workspace, table_of(workspace), "identify", "neo-hookean")
    run = Run(workspace.run(name))
    table = run.folder / TABLE
    inputs = str(workspace.folder / "inputs")
    given = [inputs, "--table", str(table), "--out", str(run.results), "--do", "identify", "--law", "neo-hookean"]
    assert run.asked.arguments[1:] == ["-m", "legfem.cohort", *given]
    assert table_of(workspace, name) == table_of(workspace)
    one = "folder,subject\nP01 left,P01\n"
    assert begin_study(workspace, one, "diagnose", "neo-hookean", name) == name
    assert table.read_text() == one and "--law" not in run.asked.arguments and kept == [run, run]


def test_a_study_that_is_wrong_or_runs_changes_nothing(workspace, kept, monkeypatch):
    with pytest.raises(InputError):
        begin_study(workspace, "folder\nnobody\n", "identify", "")
    assert not workspace.runs
    name = begin_study(workspace, table_of(workspace), "identify", "")
    monkeypatch.setattr(Run, "alive", True)
    with pytest.raises(InputError, match="stop it first"):
        begin_study(workspace, "folder\nP01 left\n", "identify", "", name)
    assert table_of(workspace, name) == table_of(workspace)
