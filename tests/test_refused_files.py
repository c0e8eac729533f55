"""What can't be read rightly is refused, with the cause and the remedy: mangled files, and what holds no table."""

from __future__ import annotations

import gzip
import os
import shlex
import time
import zipfile
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
from making_instrument_files import D, F, T, plain_csv, rows, workbook
from making_odd_files import PLAIN, clocks, look, open_document, table, timed, written
from openpyxl import Workbook


def truncated(path: Path) -> Path:
    path = workbook(path)
    path.write_bytes(path.read_bytes()[:20_000])
    return path


def changed(make, old: str, new: str, count: int = -1, encoding: str = "utf-8"):
    def mangle(path: Path) -> Path:
        path = make(path)
        text = path.read_bytes().decode(encoding)
        assert old in text
        path.write_bytes(text.replace(old, new, count).encode(encoding))
        return path

    return mangle


ROW = rows(T, D, F).split("\r\n")[300]


TWO_TRIALS = [np.concatenate([c, c]) for c in (T, D, F)]


ALL = list(zip(T, D, F, strict=True))


ON_ITS_SIDE = "".join(
    f"{name},{','.join(map(str, one))}\n"
    for name, one in zip(("Time (s)", "Position (mm)", "Force (N)"), (T, D, F), strict=True)
)


MANGLED = {
    "empty": (written("a.csv", b""), "is empty"),
    "no such kind": (written("a.is_comp", b"TDAT"), "'.is_comp' is not a kind"),
    "cut workbook": (truncated, "can't be read as .xlsx"),
    "noise for TDMS": (written("a.tdms", b"\x89\x01" + bytes(99)), "can't be read as .tdms"),
    "binary for text": (written("a.txt", bytes(range(256)) * 9), "null bytes"),
    "no units": (table("time,position,force", T, D, F), "'position' has no unit"),
    "unit of an angle": (table("time_s,position_mm,load_deg", T, D, F), "'deg' of 'load' is not a unit"),
    "two trials abreast": (
        table("Time (s),Stroke (mm),Load (N),Time (s),Stroke (mm),Load (N)", T, D, F, T, 0.9 * D, 2 * F),
        "2 trials stand side by side",
    ),
    "strain and stress over time": (
        table("Time (s),Strain (%),Stress (kPa)", T, D, F),
        "contains strain ('Strain') and stress ('Stress') over time and no force",
    ),
    "units in the cells": (
        written("a.csv", b"Time,Position,Force\n" + b"1.5 s,2.5 mm,3.5 N\n" * 60),
        "its cells contain units beside the numbers ('1.5 s')",
    ),
    "names that are shifted": (table(",Time (s),Stroke (mm),Load (N)", T, D, F), "4 names, the first of them empty"),
    "names of two words": (
        written("a.txt", ("load cell force time_s position_mm\n" + rows(F, T, D, delimiter=" ")).encode()),
        "no row with the names of the 3 columns",
    ),
    "hours or minutes": (
        written("a.csv", timed("Time,Position (mm),Force (N)", ["12:30"] * len(T)).encode()),
        "its times are a clock's without seconds ('12:30')",
    ),
    "no force": (table("time_s,position_mm,temperature_C", T, D, F), "no column is named"),
    "three forces": (table("time_s,position_mm,Fx_N,Fy_N,Fz_N", T, D, 0.1 * F**2, np.sin(T), F), "force"),
    "two forces": (
        table("time_s,position_mm,Force 1 (N),Force 2 (N)", T, D, F, np.sin(T)),
        "'Force 1', 'Force 2', which differ",
    ),
    "overload": (changed(plain_csv, ROW, ROW.rpartition(",")[0] + ",OVERLOAD"), "'OVERLOAD'"),
    "a missing cell": (changed(plain_csv, ROW, ROW.rpartition(",")[0] + ","), "an empty cell"),
    "not a number": (changed(plain_csv, ROW, ROW.rpartition(",")[0] + ",NaN"), "no finite number"),
    "two trials": (table("time_s,position_mm,force_N", *TWO_TRIALS), "time runs backwards"),
    "other names among the numbers": (changed(plain_csv, ROW, "time_s,displacement_mm,load_N"), "'time_s' where 3"),
    "coarse clock": (table("time_s,position_mm,force_N", np.floor(T), D, F), "time repeats"),
    "in air": (table("time_s,position_mm,force_N", T, D, 0.02 * np.sin(37 * T)), "doesn't follow"),
    "clock": (written("a.csv", timed("Time,Position (mm),Force (N)", clocks(digits=0)).encode()), "time repeats"),
    "thousands": (
        written("a.csv", b"time_s;position_mm;force_mN\n" + b"1.5;2.5;1,234.5\n" * 60),
        "line 2: '1,234.5' has a thousands' separator without quotes (60 such numbers)",
    ),
    "thousands in two cells": (
        written(
            "a.csv",
            "".join(["t (s),d (um),F (N)\n", *(f"{t:.2f},{1e3 * d:,.1f},{f:.3f}\n" for t, d, f in ALL)]).encode(),
        ),
        "has a thousands' separator without quotes (",
    ),
    "one force, twice as large": (
        table("time_s,position_mm,Force 1 (N),Force 2 (N)", T, D, F, 2.0 * F),
        "'Force 1', 'Force 2', which differ",
    ),
    "stretch and stress": (
        table("Stretch,Nominal stress (kPa)", 1.0 + 0.01 * D, 0.4 * D**2),
        "a table of stretch and stress ('Stretch' and 'Nominal stress' in kPa) without a time",
    ),
    "no names": (written("a.csv", rows(T, D, F).encode()), "its 3 columns have no names; write a line of names"),
    "no names, of a microscope": (
        written("a.txt", rows(np.linspace(-8e3, 0, 90), D[:90], D[:90], delimiter="\t", decimal=",").encode()),
        "the first goes up to 0 in equal steps, as a microscope's height does and no time",
    ),
    "on its side": (written("a.csv", ON_ITS_SIDE.encode()), "its numbers are in rows of 751, not in columns"),
    "one column": (written("a.csv", b"Force (N)\n" + rows(F).encode()), "contains one column of numbers"),
    "names alone": (written("a.csv", b"Time (s),Force (N)\n"), "contains no numbers; export the recording again"),
    "a factor in the unit": (
        table("Time (s),Position (mm),Force (x10 N)", T, D, 0.1 * F),
        "export 'Force' in N: 'x10 N' has a factor in it",
    ),
    "counts of a converter": (table("Time (s),Position (mm),Force (counts)", T, D, F), "export 'Force' in N, or"),
    "a unit that an encoding lost": (
        table("Time (s),Position (?m),Force (N)", T, 1e3 * D, F),
        "if displacement is 'Position' in um: legfem data look",
    ),
    "samples counted": (
        table("Sample,Position (mm),Force (N)", np.arange(len(T)), D, F),
        "add a column Time (s): the number of the sample over the samples taken in a second",
    ),
    "dates without a time": (
        written("a.csv", timed("Fecha,Position (mm),Force (N)", ["03/05/2024"] * len(T)).encode()),
        "column 'Fecha': contains '03/05/2024'",
    ),
    "a block that was never written": (
        written("a.csv", b"time_s,position_mm,force_N\n" + b"1,2,3\n" * 40 + bytes(999) + b"4,5,6\n" * 40),
        "line 42: 999 null bytes are in the place of text: part of the file is lost",
    ),
    "no quantity": (table("a,b,Width", T, D, F), "is not a recording: none of its columns ('a', 'b', 'Width')"),
    "few samples": (table("time_s,position_mm,force_N", T[:5], D[:5], F[:5]), "5 samples are not a whole press"),
    "no displacement": (
        table("time_s,Excitation (Newtons),Response (m/s^2)", T, F, D),
        "record displacement, too, and export all three columns",
    ),
    "a length without a unit": (table("time_s,L,force_N", T, D, F), "name displacement (of 'L'): legfem data look"),
    "a force in volts": (table("time_s,position_mm,load_V", T, D, F), "not a unit of force; export 'load' in N"),
    "two forces of one name": (
        table("time_s,position_mm,Force (N),Force (N)", T, D, F, np.sin(T)),
        "give the columns 'Force' names of their own",
    ),
    "readings of a channel": (
        table("time_s,fat_thickness_mm", T[:3], D[:3]),
        "3 readings of fat_thickness and no force: it goes with a recording; give in subject.toml",
    ),
}


@pytest.mark.parametrize("name", MANGLED)
def test_a_mangled_file_is_refused_with_the_cause(tmp_path, name):
    make, cause = MANGLED[name]
    path = make(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 2
    assert cause in run.output
    assert run.output.count("\n") == 1 and str(path) in run.output
    assert not (tmp_path / "out").exists()


NO_TABLES = {
    "a PDF": ("a.csv", b"%PDF-1.4\n%\xe2\xe3" + bytes(99)),
    "formatted text (RTF)": ("a.txt", b"{\\rtf1\\ansi Time (s),Force (N)\\\n}"),
    "a web page, perhaps of a sign-in": ("a.csv", b"<!DOCTYPE html>\n<html><title>Sign in</title></html>"),
    "a web page with a table": ("a.xls", b"<html><table><tr><td>Time (s)</td></tr></table></html>"),
    "JSON": ("a.json", b'{"time_s": [0.0, 0.1], "force_N": [0.0, 0.1]}'),
    "a link to a Google document": ("a.gsheet", b'{"url": "https://docs.google.com/open?id=1"}'),
    "a pointer of Git LFS": ("a.csv", b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"),
    "an archive (RAR)": ("a.csv", b"Rar!\x1a\x07\x01\0" + bytes(99)),
    "packed (gz) and called .csv": ("a.csv", gzip.compress(PLAIN)),
    "a picture (PNG)": ("a.tdms", b"\x89PNG\r\n" + bytes(99)),
    "a workbook with a password": (
        "a.xlsx",
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(999) + "EncryptedPackage".encode("utf-16-le"),
    ),
}


@pytest.mark.parametrize("what", NO_TABLES)
def test_what_holds_no_table_is_refused_as_what_it_is(tmp_path, what):
    file, content = NO_TABLES[what]
    run = look(written(file, content)(tmp_path), "--out", tmp_path / "out")
    assert run.exit_code == 2 and run.output.count("\n") == 1
    assert f"file: is {what}" in run.output


def _in_cells(path: Path, cell) -> Path:
    book = Workbook()
    book.active.append(["Time (s)", "Position (mm)", "Force (N)"])
    for k, (t, d, f) in enumerate(zip(T.tolist(), D.tolist(), F.tolist(), strict=True), 2):
        book.active.append([t, d, cell(k, f)])
    book.save(path / "a.xlsx")
    return path / "a.xlsx"


@pytest.mark.parametrize(
    ("cell", "cause"),
    [
        (lambda k, f: f"=A{k}*0+{f}", "its 751 formulas were never calculated; open it in a spreadsheet, and save it"),
        (lambda k, f: datetime(2024, 5, 3) if k == 40 else f, "'2024-05-03' is a date, which a spreadsheet took"),
        (lambda k, f: f"{f:.3f} N", "its cells contain units beside the numbers ('"),
        (lambda k, f: -9999.0 if k % 90 == 0 else f, "8 readings are -9999, which stands for missing ones"),
    ],
)
def test_what_spreadsheets_make_of_numbers_is_told(tmp_path, cell, cause):
    run = look(_in_cells(tmp_path, cell), "--out", tmp_path / "out")
    assert run.exit_code == 2 and cause in run.output


def _a_folder(path: Path) -> None:
    path.mkdir()


def _a_link(path: Path) -> None:
    path.symlink_to("gone.csv")


@pytest.mark.parametrize(
    ("make", "cause"), [(_a_folder, "is a folder"), (_a_link, "is a link to a file that isn't"), (os.mkfifo, "a pipe")]
)
def test_what_is_no_file_is_called_what_it_is(tmp_path, make, cause):
    make(tmp_path / "a.csv")
    run = look(tmp_path / "a.csv", "--out", tmp_path / "out")
    assert run.exit_code == 2 and cause in run.output


def _archive_of_jpk(path: Path) -> Path:
    with zipfile.ZipFile(path / "curve-03", "w") as archive:
        archive.writestr("header.properties", "#Mon\njpk-data-file=spm-forcefile\n")
        archive.writestr("segments/0/channels/height.dat", bytes(512))
    return path / "curve-03"


def _curves_in_hdf5(path: Path) -> Path:
    with h5py.File(path / "curves.h5", "w") as file:
        group = file.create_group("0")
        group.attrs.update({"imaging mode": "force-distance", "spring constant": 0.03})
        for name, unit, values in (("force", "N", 1e-9 * F), ("height (piezo)", "m", 1e-6 * D), ("time", "s", T)):
            group.create_dataset(name, data=values).attrs["unit"] = unit
    return path / "curves.h5"


def _below(head: str, name: str):
    body = rows(T, 1e3 * D, F)
    return written(name, (head + "\n" + body).encode())


CURVES = {
    "Asylum Research": written("gel.ibw", b"\5\0" + bytes(300)),
    "JPK": _archive_of_jpk,
    "Bruker": _below("\\*Force file list\n\\Version: 0x09", "gel.002"),
    "afmformats": _curves_in_hdf5,
    "a heading": _below("Force-Distance Curve\n\nTime (s),Z-Sense(nm),Force (nN)", "gel.csv"),
    "NT-MDT's text": written(
        "gel_6B_Curve_DFL_Height_5.txt", rows(np.linspace(-8e3, 0, 90), D[:90], F[:90], delimiter="\t").encode()
    ),
    "JPK's text": _below("# springConstant: 0.04\n# columns: time height vDeflection\ntime_s,z_nm,force_nN", "gel.txt"),
}


@pytest.mark.parametrize("whose", CURVES)
def test_a_microscope_s_force_curve_is_named_and_not_read(tmp_path, whose):
    run = look(CURVES[whose](tmp_path), "--out", tmp_path / "out")
    assert run.exit_code == 2 and run.output.count("\n") == 1
    assert "is a force curve of an atomic force microscope" in run.output
    assert "export Time (s), Indentation (nm) and Force (nN)" in run.output


def test_decimal_commas_between_commas_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + rows(T, D, F, decimal=","))
    run = look(path)
    assert run.exit_code == 2 and "3 names are above 6 cells: commas separate both" in run.output


def test_a_refusal_ends_with_the_command_that_reads_the_file(tmp_path: Path) -> None:
    path = table("clock time,ram position,Load cell (kN)", T, D, 1e-3 * F, name="a 1.csv")(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 2 and "if displacement is 'ram position' in mm" in run.output
    command = shlex.split(run.output.strip().partition("legfem data ")[2])
    assert command[:2] == ["look", str(path)]
    again = look(*command[1:], "--out", tmp_path / "out")
    assert again.exit_code == 0 and "force: 'Load cell' in kN" in again.output


def test_what_is_far_too_large_is_refused_at_once(tmp_path: Path) -> None:
    book = tmp_path / "rows.xlsx"
    with zipfile.ZipFile(book, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", bytes(250_000_000))
    sparse = tmp_path / "sparse.h5"
    with h5py.File(sparse, "w") as file:
        for name in ("time_s", "position_mm", "force_N"):
            file.create_dataset(name, shape=(3_000_000_000,), dtype="f8", chunks=True)
    repeated = '<table:table-cell office:value-type="float" office:value="1" table:number-columns-repeated="900"/>'
    opened = open_document(
        tmp_path, f'<table:table-row table:number-rows-repeated="900000">{repeated}</table:table-row>'
    )
    for path in (book, sparse, opened):
        start = time.monotonic()
        run = look(path)
        assert run.exit_code == 2 and "at most 200 MB are read" in run.output
        assert time.monotonic() - start < 5.0
