"""A cohort: who is in it, what a failure costs, what is done again, and the table that comes of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest
from making import write_subject
from making_diagnosed import diagnosed
from making_pages import stocking as dressed_leg
from making_results import result
from making_stocking import COARSEST
from openpyxl import load_workbook
from typer.testing import CliRunner

import legfem as lf
from legfem.cohort.members import find_members
from legfem.cohort.rows import ExpectedRun, Judged, Row, cohort_frame, cohort_model, models_of, units_frame
from legfem.commands.cohort import app
from legfem.inverse.catalogue import key_of
from legfem.inverse.document import fit_document
from legfem.inverse.stored import StoredResult
from legfem.legs.schema import SUBJECTS


def folders(at: Path, *names: str, table: str = "") -> Path:
    for name in names:
        (at / name).mkdir(parents=True)
        (at / name / "subject.toml").write_text("")
    if table:
        (at / "cohort.csv").write_text(table)
    return at


def test_every_folder_with_a_subject_is_a_member_or_those_that_a_pattern_names(tmp_path: Path) -> None:
    folders(tmp_path, "P1/left", "P1/right", "P2/left", ".old/P3")
    assert [one.name for one in find_members(tmp_path, "identify").every] == ["P1/left", "P1/right", "P2/left"]
    assert [one.name for one in find_members(tmp_path, "identify", "P*/right").every] == ["P1/right"]
    assert [one.name for one in find_members(tmp_path / "P1" / "left", "identify").every] == ["left"]
    with pytest.raises(lf.InputError, match=r"no folder below it contains leg\.toml; check the path"):
        find_members(tmp_path, "stocking")


@pytest.mark.parametrize("form", ["csv", "semicolons", "xlsx"])
def test_a_table_says_what_is_known_of_each(tmp_path: Path, form: str) -> None:
    folders(tmp_path, "a", "b", "c")
    text = "Subject,folder,Group,side,Age,BMI,note\nAnn,a,patient,L,41,23.5,\nBob,b,,right,,24.1,first\n\n"
    if form == "csv":
        (tmp_path / "cohort.csv").write_text(text)
    elif form == "semicolons":
        (tmp_path / "cohort.csv").write_text(text.replace(",", ";").replace("23.5", "23,5"))
    else:
        header, *rows = (line.split(",") for line in text.split("\n")[:3])
        pd.DataFrame(rows, columns=header).to_excel(tmp_path / "cohort.xlsx", index=False)
    found = find_members(tmp_path, "identify")
    first, second = found.every
    assert (first.name, first.person, second.person) == ("a", "Ann", "Bob")
    assert first.given == {"subject": "Ann", "group": "patient", "side": "left", "age": 41.0, "bmi": 23.5}
    assert second.given == {"subject": "Bob", "side": "right", "bmi": 24.1, "note": "first"}
    assert found.notes == (f"Not in {found.table.name}, and so left out: c (1).",)


WRONG = {
    "twice": ("folder\na\nb\na\n", "folder, line 4: 'a' is in line 2 too; remove one"),
    "twice by another path": ("folder\na\n./a\n", "folder, line 3: './a' is in line 2 too"),
    "no name": ("folder,age\na,3\n,4\n", "folder, line 3: is empty; name a folder"),
    "no column": ("leg,age\na,3\n", "header: there is no column folder or subject; add a column called folder"),
    "a column twice": ("folder,Age,age\na,3,4\n", "header: column 'age' is there twice"),
    "none there": ("folder\nx\ny\n", "folder: none of 2 folders is there; write paths as seen from"),
    "no date": ("folder,date\na,1/2/26\n", "date, line 2: '1/2/26' is not a date; write 2026-01-31"),
    "no whole date": ("folder,date\na,2026-01\n", "date, line 2: '2026-01' is not a date; write 2026-01-31"),
    "negative": ("folder,age\na,41\nb,-41\n", "age, line 3: is -41; write a number above 0, or leave it empty"),
    "no number": ("folder,age\na,41\nb,41 y\n", "age, line 3: '41 y' is not a number; write the number alone"),
    "no rows": ("folder,date\n", "rows: there are none; add them below the header"),
    "empty": ("\n\n", "file: is empty; write a header, and rows below it"),
    "misspelt": ("foldr,age\na,3\n", "header: there is no column folder or subject; rename 'foldr' folder"),
    "folder misspelt": ("subject,fodler\nA,a\nA,b\n", "header: there is no column folder; rename 'fodler' folder"),
    "a cell too few": ("folder,side,age\na,left,30\nb,right\n", "line 3: has 2 cells, and the header 3"),
    "a cell too many": ("folder,note\na,x\nb,x,y\n", "line 3: has 3 cells, and the header 2"),
    "cells too many": ("folder,note\na,x,y\nb,x,y\n", "line 2: has 3 cells, and the header 2; quote texts"),
    "a column without a name": ("folder,\na,x\n", "header: column 2 has no name; name it, or remove it"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_with_a_table_is_one_line(tmp_path: Path, name: str) -> None:
    text, line = WRONG[name]
    folders(tmp_path, "a", "b", table=text)
    done = CliRunner().invoke(app, [str(tmp_path), "--out", str(tmp_path / "out"), "--jobs", "1"])
    assert done.exit_code == 2 and done.stderr.count("\n") == 1
    assert line in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_not_there_costs_its_own_row(tmp_path: Path) -> None:
    folders(tmp_path, "P1", "P22", table="folder\nP1\nP2\n")
    first, second = find_members(tmp_path, "identify").every
    assert not first.problem
    reason = "line 3: folder 'P2' is not there; did you mean 'P22'?"
    assert second.problem.endswith(reason)
    done = CliRunner().invoke(app, [str(tmp_path), "--out", str(tmp_path / "out"), "--jobs", "1", "--dry-run"])
    assert reason in next(line for line in done.stdout.splitlines() if line.startswith("missing"))


def test_merged_cells_are_refused(tmp_path: Path) -> None:
    folders(tmp_path, "a", "b")
    pd.DataFrame([["Ann", "a"], ["", "b"]], columns=["subject", "folder"]).to_excel(
        tmp_path / "cohort.xlsx", index=False
    )
    book = load_workbook(tmp_path / "cohort.xlsx")
    book.active.merge_cells("A2:A3")
    book.save(tmp_path / "cohort.xlsx")
    with pytest.raises(lf.InputError, match=r"cells A2:A3: are merged; split them, and fill each"):
        find_members(tmp_path, "identify")


def test_names_are_the_same_however_their_accents_are_stored(tmp_path: Path) -> None:
    composed, apart = "M\u00fcller", "Mu\u0308ller"
    folders(tmp_path, apart, table=f"folder\n{composed}\n")
    (one,) = find_members(tmp_path, "identify").every
    assert not one.problem and one.folder.name == apart and one.name == composed


def test_results_are_not_written_over_the_studys_own_table(tmp_path: Path) -> None:
    table = "folder,group\na,patient\n"
    folders(tmp_path, "a", table=table)
    done = CliRunner().invoke(app, [str(tmp_path), "--out", str(tmp_path / "a" / ".."), "--jobs", "1"])
    assert done.exit_code == 2 and done.stderr.count("\n") == 1
    assert "is where the study's own cohort.csv stands, or would; name another folder" in done.stderr
    assert (tmp_path / "cohort.csv").read_text() == table
    assert {path.name for path in tmp_path.iterdir()} == {"a", "cohort.csv"}


def test_windows_paths_are_found_and_capitals_are_hinted_at(tmp_path: Path) -> None:
    folders(tmp_path, "P1/left", "P2", table="folder\nP1\\left\np2\n")
    first, second = find_members(tmp_path, "identify").every
    assert not first.problem and second.problem.endswith("did you mean 'P2'?")


def test_a_table_under_another_name_is_not_passed_over_in_silence(tmp_path: Path) -> None:
    folders(tmp_path, "a")
    (tmp_path / "Cohort.ods").write_bytes(b"PK")
    unread = "Cohort.ods was not read: call it cohort.csv or cohort.xlsx, or name it by --table."
    assert find_members(tmp_path, "identify").notes == (unread,)
    with pytest.raises(lf.InputError, match=r"file: is neither CSV nor \.xlsx; save it as one of them"):
        find_members(tmp_path, "identify", table=tmp_path / "Cohort.ods")


def test_what_may_be_meant_otherwise_is_noted(tmp_path: Path) -> None:
    folders(tmp_path, "a", "b", table="folder,grop,side,comment\na,patient,links,x\nb,control,R,y\n")
    assert find_members(tmp_path, "identify").notes == (
        "cohort.csv has a column grop, which says nothing to legfem: is it group?",
        "cohort.csv: side is neither left nor right, but links.",
    )


def test_people_of_two_groups_and_sexes_in_many_spellings_are_noted(tmp_path: Path) -> None:
    rows = "A,a,patient,F\nA,b,control,F\nB,c,patient,female\nC,d,control,M\n"
    folders(tmp_path, *"abcd", table=f"subject,folder,group,sex\n{rows}")
    assert find_members(tmp_path, "identify").notes == (
        "cohort.csv: A (1) has more than one group.",
        "cohort.csv: sex is one of F, M, female: write each in one way.",
    )


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        (("--law", "neohookean"), "--law: 'neohookean': unknown law"),
        (("--depth", "-3"), "--depth: -3 mm: is too shallow"),
    ],
)
def test_an_option_that_no_member_can_be_done_with_is_one_line(tmp_path: Path, asked: tuple, line: str) -> None:
    for name in ("a", "b"):
        shutil.copytree(SUBJECTS.find("1"), tmp_path / "study" / name)
    out = tmp_path / "out"
    done = CliRunner().invoke(app, [str(tmp_path / "study"), *asked, "--out", str(out), "--jobs", "1", "--quiet"])
    assert done.exit_code == 2 and done.stderr.splitlines()[-1].startswith(line)
    assert not (out / "cohort.html").exists()


def document(law: str = "both") -> dict:
    laws = ("neo-hookean", "reduced-polynomial") if law == "both" else (law,)
    return fit_document([result(name) for name in laws])


def test_a_row_holds_what_the_documents_of_commands_hold() -> None:
    models = models_of(StoredResult.read(document()).laws)
    assert set(models) == {"neo-hookean", "reduced-polynomial"}
    given = document()["laws"]["reduced-polynomial"]["parameters"]["c20_deep"]
    c20 = models["reduced-polynomial"].measures["c20_deep"]
    assert (c20.value, [c20.low, c20.high], c20.unit) == (given["value"], given["ci95"], "kPa")
    assert c20.sd == given["standard_error"]
    curve = models["neo-hookean"].curve
    assert 20 < len(curve.displacement_mm) <= 40 and len(curve.measured_N) == len(curve.displacement_mm)


def test_legs_are_compared_under_the_law_that_most_of_them_ask_for() -> None:
    asked = ["neo-hookean", "reduced-polynomial", "reduced-polynomial"]
    rows = [Row(str(k), judged=Judged("sound", "", (), law)) for k, law in enumerate(asked)]
    assert cohort_model([*rows, Row("x", problem="broken"), Row("y", problem="broken")]) == "reduced-polynomial"


def test_the_table_has_a_unit_and_a_meaning_for_every_column(tmp_path: Path) -> None:
    folders(tmp_path, "a", "b", table="folder,group,age\na,=patient,41\nb,control,\n")
    members = find_members(tmp_path, "identify").every
    models = models_of(StoredResult.read(document()).laws)
    done = Row("a", judged=Judged("sound", "", (), "neo-hookean"), models=models)
    rows = [done, Row("b", problem="no")]
    frame = cohort_frame(members, rows)
    units = units_frame(frame, rows).set_index("column")
    assert list(units.index) == list(frame)
    assert units.loc["neo_hookean_c10_deep_low_kPa", "unit"] == "kPa"
    assert frame.loc[1, "problem"] == "no" and frame["neo_hookean_c10_deep_kPa"].notna().tolist() == [True, False]
    cohort = lf.Cohort(find_members(tmp_path, "identify"), None, tuple(rows))
    assert list(cohort.to_frame()) == list(frame)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two legs that come with legfem, and a broken one."""
    folder = tmp_path_factory.mktemp("study")
    for name in ("1", "3"):
        shutil.copytree(SUBJECTS.find(name), folder / f"P{name}")
    write_subject(folder / "broken")
    (folder / "broken" / "subject.toml").write_text("diameter = 3\n")
    return folder


def test_two_legs_are_identified_and_kept_and_a_broken_one_costs_its_row(study: Path, tmp_path: Path, capfd) -> None:
    asked = {"law": "neo-hookean", "depth": 5.0, "mesh": "coarse", "out": tmp_path / "out"}
    before = lf.cohort(study, dry_run=True, **asked)
    assert isinstance(before, ExpectedRun) and before.states == ("new",) * 3 and before.waiting == 3
    found = lf.cohort(study, progress=True, **asked)
    assert "1/3  P1: " in capfd.readouterr().err
    assert "do not rely on the values" in found.summary()
    assert [row.done for row in found.rows] == [True, True, False]
    assert found.rows[2].problem.startswith("subject.toml: ")
    found.write(tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "cohort.csv")
    assert found.plot().axes[0].get_xlabel() == "C10 of the muscle (kPa)"
    assert ((table["neo_hookean_c10_deep_low_kPa"] < table["neo_hookean_c10_deep_kPa"])[:2]).all()
    assert (tmp_path / "out" / table["report"][0]).is_file()
    # A date that changes changes nothing that is computed; a recording does.
    recording = next((study / "P3" / "recordings").glob("*.csv"))
    recording.write_text(recording.read_text() + "\n")
    (study / "cohort.csv").write_text("folder,date\nP1,2026-01-31\nP3,2026-02-28\nbroken,\n")
    again = lf.cohort(study, dry_run=True, **asked)
    assert again.states == ("known", "changed", "known") and "as of the 1 done here" in again.summary()
    other = lf.cohort(study, dry_run=True, **asked | {"depth": 6.0})
    assert other.states == ("changed",) * 3


def test_a_diagnosis_is_a_row_with_its_verdict(study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The diagnosis itself is one that was made of known numbers."""
    asked = ("contact-onset", "force-drift")

    def diagnose(given, library, out):
        return lf.Diagnosed(given, diagnosed({"contact-onset.offset": 0.3}, asked=asked), 1.0)

    monkeypatch.setattr("legfem.api.cohorts.diagnose", diagnose)
    shutil.copytree(study / "P1", tmp_path / "study" / "P1")
    (row,) = lf.cohort(tmp_path / "study", do="diagnose", out=tmp_path / "out").rows
    assert row.done, row.problem
    assert (row.verdict, row.judged.preferred) == ("named", "after repair") and len(row.recordings) == 3
    c10 = row.models["after repair"].measures["c10_deep"]
    assert c10.low < 1.0 < c10.high and c10.sd == pytest.approx((c10.high - c10.low) / 3.92)
    assert (tmp_path / "out" / row.report).is_file()


@pytest.mark.slow
def test_a_leg_in_its_stocking_is_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    leg = tmp_path / "study" / "L1"
    leg.mkdir(parents=True)
    (leg / "leg.toml").write_text("")
    fit = dressed_leg(COARSEST)
    found = lf.Identification(fit.details.leg, (fit,))
    monkeypatch.setattr("legfem.api.cohorts.stocking", lambda given, out, cells: found)
    (row,) = lf.cohort(tmp_path / "study", do="stocking", cells=20_000, out=tmp_path / "out").rows
    assert row.done, row.problem
    assert row.judged.tone and (tmp_path / "out" / row.report).is_file()
    assert set(row.models["neo-hookean"].measures) == set(map(key_of, fit.estimates)) | set(fit.computed)
    assert row.origin == "simulated" and row.settings["cells"]
