"""Instruments' files as their programs write them are read right, and mangled ones refused.

xlsx, TDMS, MAT and HDF5 are written by these formats' own libraries, LVM after National
Instruments' specification. The text exports of Bluehill, MTS, testXpert and WinTest are written by
hand after descriptions in manuals and in readers of others: none came from a machine.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
from making import press, write_subject
from nptdms import ChannelObject, TdmsWriter
from openpyxl import Workbook
from scipy.io import savemat
from typer.testing import CliRunner

from legfem.commands.data import app
from legfem.recording import read_instrument_file
from legfem.recording.formats.workbook import read_workbook
from legfem.subjects.loading import load_subject
from legfem.subjects.schema import RecordingsEntry

MADE = press(air=2.0, hold=20.0, force_sd=0.02, displacement_sd=0.005, offset=0.1, seed=4)
T, D, F = MADE.time, MADE.displacement, MADE.force


def rows(*columns, delimiter=",", decimal=".", form="%.5f", quoted=False, end="") -> str:
    def cell(value: float) -> str:
        text = (form % value).replace(".", decimal)
        return f'"{text}"' if quoted else text

    lines = [delimiter.join(map(cell, row)) + end for row in np.column_stack(columns)]
    return "\r\n".join(lines) + "\r\n"


def plain_csv(path: Path) -> Path:
    path = path / "plain.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + rows(T, D, F))
    return path


def semicolons_and_decimal_commas(path: Path) -> Path:
    path = path / "semicolons.csv"
    text = "Prüfung 12;;\nProband;7;\nZeit [ms];Weg [µm];Kraft [mN]\n"
    path.write_bytes((text + rows(1e3 * T, 1e3 * D, -1e3 * F, delimiter=";", decimal=","))
                     .encode("cp1252"))  # fmt: skip
    return path


def bluehill(path: Path) -> Path:
    path = path / "Specimen_RawData_1.csv"
    head = '"Specimen label","calf 3"\r\n"Rate 1","0.4"\r\n\r\n"Time","Extension","Load"\r\n'
    path.write_text(head + '"(s)","(mm)","(N)"\r\n' + rows(T, -D, -F, quoted=True))
    return path


def bluehill_compression(path: Path) -> Path:
    path = path / "Specimen_RawData_2.csv"
    head = "Time (s),Extension (mm),Load (N),Compressive extension (mm),Compressive load (N)\n"
    path.write_text(head + rows(T, -D, -1 * F, D, F))
    return path


def mts_testsuite(path: Path) -> Path:
    path = path / "mts.csv"
    head = "Test Name:,Indent\nTest Run Name:,run 4\n\nTime,Axial Displacement,Axial Force,Count\n"
    path.write_text(head + "sec,mm,kN,cycles\n" + rows(T, -D, -1e-3 * F, 0 * T, form="%.8f"))
    return path


def mts_testworks(path: Path) -> Path:
    path = path / "specimen.dat"
    head = "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\nData Acquisition: Timed\n"
    head += "Running Time\tAxial Displacement\tAxial Force\nSec\tmm\tN\n"
    path.write_text(head + rows(T, 50.0 - D, F, delimiter="\t"))
    return path


def zwick(path: Path) -> Path:
    path = path / "Probe 1.TRA"
    head = "Prüfzeit;Standardweg;Standardkraft;Nennspannung\ns;mm;N;MPa\n"
    text = head + rows(T, D, F, F / 700.0, delimiter=";", decimal=",")
    path.write_text(text, encoding="utf-8-sig")
    return path


def zwick_workbook(path: Path) -> Path:
    path = path / "Zwick.xlsx"
    book = Workbook()
    book.active.title = "Parameter"
    book.active.append(["Prüfer", "Meier"])
    page = book.create_sheet("Probe 1")
    page.append(["Probe 1", None, None])
    page.append(["Prüfzeit", "Traversenweg", "Kraft"])
    page.append(["s", "mm", "N"])
    for row in np.column_stack([T, 300.0 - D, F]).tolist():
        page.append(row)
    book.save(path)
    return path


def workbook(path: Path) -> Path:
    path = path / "trial.xlsx"
    book = Workbook()
    book.active.append(["Elapsed time (min)", "Indentation (cm)", "Force (kgf)", "Temp (°C)"])
    for row in np.column_stack([T / 60, D / 10, F / 9.80665, 0 * T + 21]).tolist():
        book.active.append(row)
    book.save(path)
    return path


def wintest(path: Path) -> Path:
    path = path / "wintest.txt"
    head = b'"WinTest Data File"\0\r\n"Points: 721"\r\n"Elapsed Time","Disp","Load",\r\n'
    head += b'"Sec","mm","N",\r\n'
    path.write_bytes(head + rows(T, D, -F, end=",").encode())
    return path


def wintest_utf16(path: Path) -> Path:
    path = path / "wintest2.csv"
    text = '"Elapsed Time ","Disp ","Load "\r\n"Sec ","mm ","N "\r\n' + rows(T, -D, F)
    path.write_text(text, encoding="utf-16")
    return path


def tdms_waveforms(path: Path) -> Path:
    path = path / "waveforms.tdms"
    step = {"wf_increment": float(T[1]), "wf_start_offset": 0.0}
    with TdmsWriter(path) as file:
        file.write_segment([
            ChannelObject("Measured", "Position", D, {**step, "unit_string": "mm"}),
            ChannelObject("Measured", "Load cell force", F, {**step, "unit_string": "N"}),
        ])  # fmt: skip
    return path


def tdms_columns(path: Path) -> Path:
    path = path / "columns.tdms"
    with TdmsWriter(path) as file:
        file.write_segment([
            ChannelObject("Log", name, values)
            for name, values in (("Time (s)", T), ("Depth (m)", D / 1e3), ("Load (N)", F))
        ])  # fmt: skip
    return path


def lvm(path: Path, decimal: str = ".", columns: str = "One", name: str = "one.lvm") -> Path:
    path = path / name
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    head += f"Decimal_Separator\t{decimal}\nMulti_Headings\tNo\nX_Columns\t{columns}\n"
    head += "Time_Pref\tRelative\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
    head += f"Samples\t{len(T)}\t{len(T)}\t\nY_Unit_Label\tmm\tN\t\nX_Dimension\tTime\tTime\t\n"
    step = f"{T[1]:.6f}".replace(".", decimal)
    zero = f"{0:.6f}".replace(".", decimal)
    head += f"X0\t{zero}\t{zero}\t\nDelta_X\t{step}\t{step}\t\n***End_of_Header***\t\t\t\n"
    head += "X_Value\tDisplacement\tForce\tComment\n"
    text = rows(T, D, F, delimiter="\t", decimal=decimal, form="%.6f").replace("\r", "")
    if columns == "No":
        text = "".join("\t" + line.split("\t", 1)[1] + "\n" for line in text.splitlines())
    path.write_text(head + text)
    return path


def lvm_without_times(path: Path) -> Path:
    return lvm(path, ",", "No", "none.lvm")


def matlab(path: Path) -> Path:
    path = path / "trial.mat"
    savemat(path, {"t_s": T, "disp_mm": D, "force_N": F, "subject": "7"})
    return path


def matlab_structure(path: Path) -> Path:
    path = path / "structure.mat"
    units = {"time": "s", "position": "mm", "load": "N"}
    savemat(path, {"data": {"time": T, "position": -D, "load": -F, "units": units}})
    return path


def hdf5_attributes(path: Path) -> Path:
    path = path / "trial.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("run1")
        for name, values, unit in (("time", T, "s"), ("stroke", D, "mm"), ("load", F, "N")):
            group.create_dataset(name, data=values).attrs["units"] = unit
    return path


def hdf5_table(path: Path) -> Path:
    path = path / "table.hdf5"
    kinds = [("time_s", "f8"), ("position_mm", "f4"), ("force_N", "f4")]
    table = np.zeros(len(T), dtype=kinds)
    table["time_s"], table["position_mm"], table["force_N"] = T, D, F
    with h5py.File(path, "w") as file:
        file["log"] = table
    return path


def bluehill_german(path: Path) -> Path:
    path = path / "Probe_RawData_1.csv"
    head = '"Probe","1"\r\n\r\n"Zeit","Traversenweg","Last"\r\n"(s)","(mm)","(N)"\r\n'
    lines = (
        ",".join(f'"{number:.6f}"'.replace(".", ",") for number in row)
        for row in zip(T, D, F, strict=True)
    )
    path.write_text(head + "\r\n".join(lines))
    return path


def numpy_text(path: Path) -> Path:
    path = path / "trial.txt"
    np.savetxt(path, np.column_stack([T, D, F]), "%.6f", header="time_s displacement_mm force_N")
    return path


def matlab_import(path: Path) -> Path:
    path = path / "import.mat"
    names = np.array(["time_s", "displacement_mm", "force_N"], dtype=object)
    savemat(path, {"test": {"data": np.column_stack([T, D, F]), "colheaders": names}})
    return path


def matlab_73(path: Path) -> Path:
    """As HDF5 with MATLAB's own head in front."""
    path = path / "trial73.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("time_s", T), ("displacement_mm", D), ("force_N", F)):
            made = file.create_dataset(name, data=values[None, :])
            made.attrs["MATLAB_class"] = np.bytes_("double")
    content = bytearray(path.read_bytes())
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 ."
    content[:128] = head.ljust(124) + b"\x00\x02IM"
    path.write_bytes(content)
    return path


def hdf5_matrix(path: Path) -> Path:
    path = path / "matrix.h5"
    with h5py.File(path, "w") as file:
        made = file.create_dataset("data", data=np.column_stack([T, D, F]))
        made.attrs["columns"] = ["time_s", "displacement_mm", "force_N"]
    return path


REAL = [
    plain_csv, semicolons_and_decimal_commas, bluehill, bluehill_compression, mts_testsuite,
    mts_testworks, zwick, zwick_workbook, workbook, wintest, wintest_utf16, tdms_waveforms,
    tdms_columns, lvm, lvm_without_times, matlab, matlab_structure, hdf5_attributes, hdf5_table,
    bluehill_german, numpy_text, matlab_import, matlab_73, hdf5_matrix,
]  # fmt: skip


def look(*arguments: object):
    """Run the command without its pictures, which take most of its time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("legfem.report.look.draw_look", lambda *_: Path("left-out.png"))
        return CliRunner().invoke(app, ["look", *map(str, arguments)])


@pytest.mark.parametrize("make", REAL, ids=lambda make: make.__name__)
def test_a_file_as_instruments_write_it_is_read_right_without_a_hand(tmp_path, make):
    path = make(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 0, run.output
    block = tomllib.loads((tmp_path / "out" / "recordings.toml").read_text())["recordings"]
    read = read_instrument_file(path, RecordingsEntry.model_validate(block).channels())
    away = read.displacement - read.displacement[0]
    np.testing.assert_allclose(read.time, T, atol=2e-5)
    np.testing.assert_allclose(away, D - D[0], atol=1e-4)
    np.testing.assert_allclose(read.force, F, atol=1e-4)
    assert f"{path.name}: grade A" in run.output
    for word in ("time: '", "displacement: '", "force: '", "directions: it moves by"):
        assert word in run.output


def test_a_picture_of_each_file_is_made(tmp_path):
    run = CliRunner().invoke(app, ["look", str(plain_csv(tmp_path)), "--out", str(tmp_path)])
    assert f"picture: {tmp_path / 'plain.png'}" in run.output
    assert (tmp_path / "plain.png").stat().st_size > 20_000


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


def written(name: str, content: bytes):
    def write(path: Path) -> Path:
        (path / name).write_bytes(content)
        return path / name

    return write


def table(header: str, *columns: np.ndarray, name: str = "trial.csv"):
    return written(name, (header + "\n" + rows(*columns)).encode())


ROW = rows(T, D, F).split("\r\n")[300]
TWO_TRIALS = [np.concatenate([c, c]) for c in (T, D, F)]
MANGLED = {
    "empty": (written("a.csv", b""), "is empty"),
    "no such kind": (written("a.is_comp", b"TDAT"), "'.is_comp' is no kind"),
    "cut workbook": (truncated, "can't be read as .xlsx"),
    "picture for TDMS": (written("a.tdms", b"\x89PNG" + bytes(99)), "can't be read as .tdms"),
    "binary for text": (written("a.txt", bytes(range(256)) * 9), "null bytes"),
    "no units": (table("time,position,force", T, D, F), "'time' states no unit"),
    "unit of mass": (table("time_s,position_mm,load_kg", T, D, F), "'kg' of 'load' is no unit"),
    "no force": (table("time_s,position_mm,temperature_C", T, D, F), "no column is named"),
    "three forces": (
        table("time_s,position_mm,Fx_N,Fy_N,Fz_N", T, D, 0.1 * F**2, np.sin(T), F),
        "force"),
    "two forces": (
        table("time_s,position_mm,Force 1 (N),Force 2 (N)", T, D, F, np.sin(T)),
        "'Force 1', 'Force 2', which differ"),
    "overload": (changed(plain_csv, ROW, ROW.rpartition(",")[0] + ",OVERLOAD"), "'OVERLOAD'"),
    "a missing cell": (changed(plain_csv, ROW, ROW.rpartition(",")[0] + ","), "2 cells"),
    "not a number": (changed(plain_csv, ROW, ROW.rpartition(",")[0] + ",NaN"), "isn't finite"),
    "two trials": (table("time_s,position_mm,force_N", *TWO_TRIALS), "time runs backwards"),
    "two headers": (
        changed(plain_csv, ROW, "time_s,displacement_mm,force_N"), "'time_s' where 3 numbers"),
    "coarse clock": (
        table("time_s,position_mm,force_N", np.floor(T), D, F), "time repeats"),
    "in air": (
        table("time_s,position_mm,force_N", T, D, 0.02 * np.sin(37 * T)), "doesn't follow"),
    "clock": (
        written("a.csv", b"time,position_mm,force_N\n" + b"10:59:58.001,1.5,2.5\n" * 60),
        "are a clock's ('10:59:58.001')"),
    "thousands": (
        written("a.csv", b"time_s;position_mm;force_mN\n" + b"1.5;2.5;1,234.5\n" * 60),
        "thousands' separators ('1,234.5')"),
    "no names": (written("a.csv", rows(T, D, F).encode()), "no row with the names"),
}  # fmt: skip


@pytest.mark.parametrize("name", MANGLED)
def test_a_mangled_file_is_refused_with_the_cause(tmp_path, name):
    make, cause = MANGLED[name]
    path = make(tmp_path)
    run = look(path, "--out", tmp_path / "out")
    assert run.exit_code == 2
    assert cause in run.output
    assert run.output.count("\n") == 1 and str(path) in run.output
    assert not (tmp_path / "out").exists()


def test_decimal_commas_between_commas_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + rows(T, D, F, decimal=","))
    run = look(path)
    assert run.exit_code == 2 and "no row with the names of 6 columns" in run.output


def test_columns_may_be_named_by_hand(tmp_path):
    path = table("clock,position,Force 1 (N),Force 2 (N)", T, D, F, np.sin(T))(tmp_path)
    run = look(path, "--time", "clock:s", "--displacement", "position:mm", "--force", "Force 1",
               "--out", tmp_path / "out")  # fmt: skip
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
