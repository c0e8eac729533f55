"""Files that hold a trial in each of several tables, as a lab's workbook with a sheet a trial."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from making import TOML, press, write_subject
from making_odd_files import look
from making_specimens import BAR, PLANTED, compressed, ramp
from openpyxl import Workbook, load_workbook

import legfem as lf
from legfem.app.description import shown_errors
from legfem.common.errors import InputError
from legfem.data.formats import read_sheets
from legfem.data.reader import stamps_of, trials_in
from legfem.legs.loading import load_subject, trial_files
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS, subject_entry
from legfem.report.preview import preview_of

COLUMNS = """
[recordings.time]
column = "Time"
unit = "s"
[recordings.displacement]
column = "Extension"
unit = "mm"
[recordings.force]
column = "Load"
unit = "N"
"""
HEAD = ["Time (s)", "Extension (mm)", "Load (N)"]
NAMES = ["Trial 1", "0.1 mms", "0.5 mms"]


def pressed(number: int) -> np.ndarray:
    """Return samples (n, 3) of a press of the made leg, with noise of its own."""
    one = press(force_sd=0.03, displacement_sd=0.02, seed=number)
    return np.column_stack([one.time, one.displacement, one.force])


def write_book(path: Path, sheets: dict[str, np.ndarray], head: list[str] = HEAD) -> Path:
    """Write a workbook with a page of notes and a sheet a trial."""
    book = Workbook()
    assert book.active is not None
    book.active.title = "Notes"
    book.active.append(["Operator", "A. B."])
    for name, rows in sheets.items():
        page = book.create_sheet(name)
        page.append(head)
        for row in rows.tolist():
            page.append(row)
    book.save(path)
    return path


@pytest.fixture
def leg(tmp_path: Path) -> Path:
    """A leg whose trials are a workbook's sheets."""
    made = write_subject(tmp_path / "leg", TOML + COLUMNS)
    (made / "recordings" / "trial1.csv").unlink()
    write_book(made / "recordings" / "visit.xlsx", {name: pressed(k) for k, name in enumerate(NAMES)})
    return made


def test_each_sheet_of_a_workbook_is_a_trial_of_a_leg(leg: Path) -> None:
    subject = load_subject(leg)
    assert [one.trial for one in subject.recordings] == NAMES
    for k, one in enumerate(subject.recordings):
        np.testing.assert_allclose(one.force, pressed(k)[:, 2])
    assert not any("not read" in str(doubt) for doubt in doubts_about(subject))


def test_a_sheet_that_is_hidden_is_no_trial(leg: Path) -> None:
    path = leg / "recordings" / "visit.xlsx"
    book = load_workbook(path)
    book[NAMES[1]].sheet_state = "hidden"
    book.save(path)
    assert [one.trial for one in load_subject(leg).recordings] == [NAMES[0], NAMES[2]]


def test_a_sheet_that_is_named_is_the_only_trial(leg: Path) -> None:
    toml = leg / "subject.toml"
    toml.write_text(toml.read_text().replace("[recordings.time]", '[recordings]\nsheet = "0.1 mms"\n[recordings.time]'))
    (one,) = load_subject(leg).recordings
    np.testing.assert_allclose(one.force, pressed(1)[:, 2])


def test_two_sheets_of_the_same_readings_are_refused_as_copies(leg: Path) -> None:
    write_book(leg / "recordings" / "visit.xlsx", {"a": pressed(0), "All": pressed(0)})
    with pytest.raises(InputError, match=r"visit.xlsx/All: force_N: is a copy of a"):
        load_subject(leg)


def test_a_channel_s_file_a_trial_lies_beside_the_workbook(leg: Path) -> None:
    for k, name in enumerate(NAMES):
        rows = "".join(f"{t},{0.1 * k + 0.02 * t:.3f}\n" for t in range(0, 50, 5))
        (leg / "recordings" / f"side-{name}.csv").write_text("time_s,lateral_force_N\n" + rows)
    toml = leg / "subject.toml"
    toml.write_text(toml.read_text() + '[channels.lateral_force]\nfile = "side-{trial}.csv"\n')
    read = load_subject(leg).recordings
    assert [one.trial for one in read] == NAMES
    assert [float(one.channels[0].values[0]) for one in read] == [0.0, 0.1, 0.2]


def test_sheets_are_watched_and_seen_as_files_are(leg: Path, tmp_path: Path) -> None:
    files = trial_files(leg, subject_entry(leg / SUBJECTS.file, ""))
    stamps = stamps_of(files)
    assert len(stamps) == 3
    assert len({*stamps.values()}) == 1
    seen = preview_of(leg, tmp_path)
    assert not seen.trouble
    assert [one.file for one in seen.recordings] == NAMES
    toml = leg / "subject.toml"
    toml.write_text(toml.read_text().partition("[instrument]")[0] + COLUMNS)
    shown = shown_errors(leg)
    assert shown is not None
    assert shown[0] == pytest.approx(0.03, rel=0.2)


def test_the_app_is_offered_each_sheet_with_its_columns_before_anything_is_described(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    write_book(tmp_path / "in" / "visit.xlsx", {name: pressed(k) for k, name in enumerate(NAMES)})
    seen = preview_of(tmp_path / "in", tmp_path)
    assert [(one.file, one.trouble) for one in seen.recordings] == [(name, "") for name in NAMES]
    channels = seen.recordings[0].channels
    assert channels is not None
    assert (channels.sheet, channels.force.column) == (None, "Load")


def test_a_look_reads_all_sheets_and_writes_what_reads_them(tmp_path: Path) -> None:
    book = write_book(tmp_path / "visit.xlsx", {name: pressed(k) for k, name in enumerate(NAMES)})
    ran = look(book, "--out", tmp_path / "seen")
    assert ran.exit_code == 0, ran.output
    assert all(f"{name}: grade" in ran.output for name in NAMES)
    assert "sheet" not in (tmp_path / "seen" / "recordings.toml").read_text()


def test_each_sheet_of_a_workbook_is_a_specimen_s_recording(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "specimen.toml").write_text(BAR + COLUMNS)
    drawn = np.random.default_rng(0)
    for file in ("one.xlsx", "two.xlsx"):
        rows = {}
        for name, duration in (("fast", 0.6), ("slow", 60.0)):
            time, d = ramp(3.0, duration)
            rows[name] = np.column_stack([time, d, compressed(PLANTED, d) + drawn.normal(0.0, 2e-3, len(d))])
        write_book(tmp_path / "recordings" / file, rows)
    folder = lf.load_specimen(tmp_path)
    assert [one.name for one in folder.recordings] == [
        f"recordings/{book}.xlsx/{name}" for book in ("one", "two") for name in ("fast", "slow")
    ]
    assert not any("not read" in str(doubt) for doubt in folder.doubts)
    of_each = """[[specimen]]
name = "thin"
recordings = ["recordings/one.xlsx/f*"]
[[specimen]]
name = "thick"
recordings = ["recordings/two.xlsx/slow"]
length_mm = 20.0
"""
    (tmp_path / "specimen.toml").write_text(BAR + COLUMNS + of_each)
    assert [(one.specimen, one.name) for one in lf.load_specimen(tmp_path).recordings] == [
        ("thin", "fast"),
        ("thick", "slow"),
    ]


def test_each_group_of_an_array_file_is_a_trial_and_one_table_stays_the_file(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(2):
            for column, label in enumerate(("time_s", "extension_mm", "load_N")):
                file[f"runs/{k}/{label}"] = pressed(k)[:, column]
    paths = trials_in([tmp_path / "a.h5"])
    assert [path.relative_to(tmp_path).as_posix() for path in paths] == ["a.h5/runs/0", "a.h5/runs/1"]
    force = next(one for one in read_sheets(paths[1])[0].columns if one.name == "load")
    np.testing.assert_allclose(force.values, pressed(1)[:, 2])
    single = write_book(tmp_path / "b.xlsx", {"only": pressed(0)})
    assert trials_in([single]) == [single]
    assert read_sheets(single / "none") == []
