"""Instruments' files as their programs write them are read right, and mangled ones refused.

What they are written by, and after what, `making_instrument_files` says.
"""

from __future__ import annotations

import gzip
import lzma
import re
import tomllib
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from making import write_subject
from making_instrument_files import REAL, D, F, T, plain_csv, rows, workbook, zwick
from making_odd_files import (
    ODD,
    PLAIN,
    look,
    open_document,
    table,
    tdms_with_times_of_day,
    workbook_beside_other_cells,
    written,
)
from openpyxl import Workbook, load_workbook
from typer.testing import CliRunner

from legfem.channels.kinds import CHANNELS
from legfem.commands.data import app
from legfem.common.errors import InputError
from legfem.data import read_samples
from legfem.data.channel_reader import read_channel
from legfem.data.columns import propose
from legfem.data.folder import RecordingsEntry
from legfem.data.formats import read_sheets
from legfem.data.formats.workbook import read_workbook
from legfem.data.recording import recording_of
from legfem.legs.loading import load_subject


@pytest.mark.parametrize("make", REAL, ids=lambda make: make.__name__)
def test_a_file_as_instruments_write_it_is_read_right_without_a_hand(tmp_path, make):
    path = make(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 0, run.output
    block = tomllib.loads((tmp_path / "out" / "recordings.toml").read_text())["recordings"]
    read = read_samples(path, RecordingsEntry.model_validate(block).channels())
    away = read.displacement - read.displacement[0]
    np.testing.assert_allclose(read.time, T, atol=2e-5)
    np.testing.assert_allclose(away, D - D[0], atol=1e-4)
    np.testing.assert_allclose(read.force, F, atol=1e-4)
    assert f"{path.name}: grade A" in run.output
    for word in ("time: '", "displacement: '", "force: '", "directions: the displacement changes by"):
        assert word in run.output


@pytest.mark.parametrize("name", ODD)
def test_an_odd_and_honest_text_is_read_right(tmp_path, name):
    path = tmp_path / "odd.txt"
    path.write_text(ODD[name], encoding="utf-8")
    _check_read(path)


@pytest.mark.parametrize("make", [workbook_beside_other_cells, open_document, tdms_with_times_of_day])
def test_times_of_day_are_read_in_other_files_too(tmp_path, make):
    _check_read(make(tmp_path))


def test_labview_s_numbers_are_read_without_its_heading(tmp_path):
    path = tmp_path / "bare.lvm"
    path.write_text("X_Value\tForce (N)\tPosition (mm)\tComment\n" + rows(T, F, D, delimiter="\t"))
    _check_read(path)


def _check_read(path: Path) -> None:
    sheets = read_sheets(path)
    read = recording_of(path, sheets, propose(path, sheets).channels)
    assert len(read) == len(T)
    np.testing.assert_allclose(read.time - read.time[0], T, atol=1e-3)
    np.testing.assert_allclose(read.displacement - read.displacement[0], D - D[0], atol=5e-4)
    np.testing.assert_allclose(read.force, F, atol=1e-4)


def test_what_is_small_is_looked_at_as_a_specimen_s_and_a_pull_is_called_no_press(tmp_path):
    path = table("Time (s),Tensile extension (mm),Tensile load (N)", T, 0.1 * D, 0.01 * F)(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 0 and "displacement changes by 2.2 mm in all: judged as a specimen's" in run.output
    assert "for specimen.toml" in run.output and "grade D" not in run.output
    report = (tmp_path / "out" / "report.txt").read_text()
    assert not re.search("press|touch|contact|air|cylinder", report.replace(str(tmp_path), ""))


def test_a_picture_of_each_file_is_made(tmp_path):
    run = CliRunner().invoke(app, ["look", str(plain_csv(tmp_path)), "--out", str(tmp_path)])
    assert f"picture: {tmp_path / 'plain.png'}" in run.output
    assert (tmp_path / "plain.png").stat().st_size > 20_000


BYTES = {
    "gzip": ("a.csv.gz", gzip.compress(PLAIN)),
    "xz": ("a.csv.xz", lzma.compress(PLAIN)),
    "UTF-16 that doesn't say so": ("a.csv", PLAIN.decode().encode("utf-16-le")),
    "UTF-32": ("a.csv", PLAIN.decode().encode("utf-32")),
    "UTF-8 taken for cp1252": ("a.csv", PLAIN.decode("cp1252").encode()),
    "DOS": ("a.csv", PLAIN.decode().encode("cp437")),
    "line ends of an old Mac": ("a.csv", PLAIN.replace(b"\r\n", b"\r")),
    "line ends that were translated twice": ("a.csv", PLAIN.replace(b"\n", b"\r\n")),
    "nulls after a loss of power": ("a.csv", PLAIN + bytes(4096)),
}


@pytest.mark.parametrize("name", BYTES)
def test_a_text_is_read_however_its_bytes_are_written(tmp_path, name):
    file, content = BYTES[name]
    _check_read(written(file, content)(tmp_path))


@pytest.mark.parametrize("cut", [1, 3, 6, 9])
def test_a_last_line_that_breaks_off_is_no_sample(tmp_path, cut):
    text = "time_s;position_mm;force_N\n" + rows(T, D, F, delimiter=";").strip()
    path = written("a.csv", text[:-cut].encode())(tmp_path)
    (sheet,) = read_sheets(path)
    assert len(sheet.columns[0].values) == len(T) - 1
    assert any(f"line {len(T) + 1}, the last, breaks off" in remark for remark in sheet.remarks)
    whole = written("b.csv", text.encode())(tmp_path)
    assert len(read_sheets(whole)[0].columns[0].values) == len(T)


@pytest.mark.parametrize(
    ("make", "called"), [(workbook, "a.csv"), (zwick, "a.xlsx"), (tdms_with_times_of_day, "a.dat")]
)
def test_a_file_is_read_as_what_it_is_whatever_it_is_called(tmp_path, make, called):
    made = make(tmp_path)
    _check_read(made.rename(tmp_path / called))


def test_another_file_s_index_beside_a_tdms_is_not_trusted(tmp_path):
    path = tdms_with_times_of_day(tmp_path)
    path.with_suffix(".tdms_index").write_bytes(path.read_bytes()[:200])
    _check_read(path)


def test_integers_that_stand_for_scaled_numbers_are_scaled(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values, unit in (("time", T, "seconds since 2024-05-03"), ("position", D, "mm"), ("force", F, "N")):
            packed = file.create_dataset(name, data=np.round(2e4 * (values - 1.0)).astype("i4"))
            packed.attrs.update({"units": unit, "scale_factor": 5e-5, "add_offset": 1.0})
    _check_read(tmp_path / "a.h5")


def test_columns_without_names_are_named_by_their_places(tmp_path):
    path = written("a.txt", rows(T, D, F).encode())(tmp_path)
    given = ["--time", "column 1:s", "--displacement", "column 2:mm", "--force", "column 3:N"]
    run = look(path, *given, "--out", tmp_path / "out")
    assert run.exit_code == 0, run.output
    block = tomllib.loads((tmp_path / "out" / "recordings.toml").read_text())["recordings"]
    np.testing.assert_allclose(read_samples(path, RecordingsEntry.model_validate(block).channels()).force, F, atol=1e-4)


@pytest.mark.parametrize("since", [3.7811e9, 1.7e9], ids=["1904", "1970"])
def test_a_clock_that_counts_from_a_date_counts_from_the_first_sample(tmp_path, since):
    path = table("TimeStamp (s),Depth (mm),Load (N)", since + T, D, F)(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 0, run.output
    block = tomllib.loads((tmp_path / "out" / "recordings.toml").read_text())["recordings"]
    own = table("time_s,displacement_mm,force_N", since + T, D, F, name="own.csv")(tmp_path)
    for read in (read_samples(path, RecordingsEntry.model_validate(block).channels()), read_samples(own)):
        np.testing.assert_allclose(read.time, T - T[0], atol=1e-4)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_a_channel_s_file_of_few_rows_is_read_in_any_dialect(tmp_path, count):
    thick = 12.0 - 0.3 * np.arange(count)
    path = tmp_path / "us.csv"
    body = rows(1e3 * np.arange(count), thick / 10, delimiter=";", decimal=",")
    path.write_text("Zeit [ms];Fat thickness [cm]\n" + body)
    time_, values = read_channel(path, CHANNELS["fat_thickness"])
    np.testing.assert_allclose(time_, np.arange(count))
    np.testing.assert_allclose(values, thick)


def test_columns_may_be_named_by_hand(tmp_path):
    path = table("clock,position,Force 1 (N),Force 2 (N)", T, D, F, np.sin(T))(tmp_path)
    run = look(
        path, "--time", "clock:s", "--displacement", "position:mm", "--force", "Force 1", "--out", tmp_path / "out"
    )
    assert run.exit_code == 0, run.output
    assert "force: 'Force 1' in N, as you say" in run.output


@pytest.mark.parametrize(
    ("force", "kept", "grade", "reason"),
    [
        (np.minimum(F, 8.0), slice(None), "D", "saturated"),
        (np.round(F / 0.5) * 0.5, slice(None), "C", "comes in steps of 0.5 N"),
        (np.where(T > 40.0, F - 4.0, F), slice(None), "C", "drops suddenly at 40"),
        (F, np.r_[0:100, 103:400, 405 : len(T)], "B", "8 samples dropped"),
        (F, np.r_[0:100], "D", "too short to identify from"),
    ],
)
def test_what_is_wrong_with_an_instrument_lowers_the_grade(tmp_path, force, kept, grade, reason):
    path = table("time_s,displacement_mm,force_N", T[kept], D[kept], force[kept])(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 0, run.output
    assert f"trial.csv: grade {grade}" in run.output
    assert reason in run.output


def test_a_subject_is_read_from_an_instruments_files(tmp_path):
    folder = write_subject(tmp_path / "leg", trials=0)
    (folder / "recordings").mkdir(exist_ok=True)
    zwick(folder / "recordings")
    look(folder / "recordings" / "Probe 1.TRA", "--out", tmp_path / "out")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + (tmp_path / "out" / "recordings.toml").read_text())
    (recording,) = load_subject(folder).recordings
    assert recording.trial == "Probe 1"
    np.testing.assert_allclose(recording.force, F, atol=1e-4)


def test_a_workbook_s_numbers_may_be_text_with_decimal_commas(tmp_path: Path) -> None:
    """As Excel keeps what was pasted under another country's settings."""
    book = Workbook()
    assert book.active is not None
    book.active.append(["Zeit [s]", "Kraft [N]"])
    for k in range(12):
        book.active.append([f"{0.25 * k:.2f}".replace(".", ","), f"{k:d},000"])
    book.save(tmp_path / "a.xlsx")
    (sheet,) = read_workbook(tmp_path / "a.xlsx")
    np.testing.assert_allclose(sheet.columns[0].values, 0.25 * np.arange(12))
    np.testing.assert_allclose(sheet.columns[1].values, np.arange(12.0))
    assert "decimal commas" in sheet.remarks[0]
    # Thousands, or three decimals: it can't be told.
    for row in book.active.iter_rows(min_row=2):
        for cell in row:
            cell.value = "1,250"
    book.save(tmp_path / "b.xlsx")
    assert read_workbook(tmp_path / "b.xlsx") == []


@pytest.mark.parametrize("stated", ["A1", "A1:D31", "A1:XFD1048576"])
def test_a_workbook_is_read_whole_whatever_size_its_sheet_states(tmp_path: Path, stated: str) -> None:
    path = workbook(tmp_path)
    with zipfile.ZipFile(path) as given:
        parts = {name: given.read(name) for name in given.namelist()}
    name = next(one for one in parts if one.startswith("xl/worksheets/"))
    parts[name] = re.sub(rb'<dimension ref="[^"]*"', b'<dimension ref="%s"' % stated.encode(), parts[name])
    with zipfile.ZipFile(path, "w") as changed:
        for one, content in parts.items():
            changed.writestr(one, content)
    (sheet,) = read_sheets(path)
    np.testing.assert_allclose(sheet.columns[0].values, T / 60)


def test_a_stray_cell_far_below_and_beside_is_passed_over(tmp_path: Path) -> None:
    path = workbook(tmp_path)
    book = load_workbook(path)
    book.active["XFD90000"] = 1.0
    book.save(path)
    (sheet,) = read_sheets(path)
    np.testing.assert_allclose(sheet.columns[0].values, T / 60)


def _leg_with(folder: Path, name: str, content: str) -> Path:
    folder = write_subject(folder, trials=0)
    (folder / "recordings").mkdir(exist_ok=True)
    (folder / "recordings" / name).write_text(content)
    return folder


@pytest.mark.parametrize(
    ("head", "delimiter", "factor"),
    [("time_s;displacement_mm;force_N", ";", 1.0), ("Zeit [ms];Weg [mm];Kraft [N]", ";", 1e3)],
)
def test_a_leg_s_csv_may_have_decimal_commas(tmp_path: Path, head: str, delimiter: str, factor: float) -> None:
    text = head + "\n" + rows(factor * T, D, F, delimiter=delimiter, decimal=",")
    (recording,) = load_subject(_leg_with(tmp_path / "leg", "t.csv", text)).recordings
    np.testing.assert_allclose(recording.time, T, atol=1e-4)
    np.testing.assert_allclose(recording.force, F, atol=1e-4)


def test_a_csv_whose_directions_are_to_be_told_is_refused_with_the_command(tmp_path: Path) -> None:
    text = "Zeit [s];Weg [mm];Kraft [N]\n" + rows(T, D, -F, delimiter=";", decimal=",")
    folder = _leg_with(tmp_path / "leg", "t.csv", text)
    with pytest.raises(InputError, match=r"data look .*t\.csv, whose recordings\.toml reads time from 'Zeit' in s"):
        load_subject(folder)


def test_what_systems_leave_beside_files_is_no_recording(tmp_path: Path) -> None:
    folder = write_subject(tmp_path / "leg", trials=2)
    for name in ("._trial1.csv", ".hidden.csv", "~$trial2.csv"):
        (folder / "recordings" / name).write_bytes(b"\0\5\x16\7")
    assert [one.trial for one in load_subject(folder).recordings] == ["trial1", "trial2"]
