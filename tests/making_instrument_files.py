"""Instruments' files as their programs write them, all of one recording.

xlsx, TDMS, MAT and HDF5 are written by these formats' own libraries, LVM after National
Instruments' specification. The text exports of Bluehill, MTS, testXpert and WinTest are written by
hand after descriptions in manuals and in readers of others: none came from a machine.
"""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import h5py
import numpy as np
from making import press
from nptdms import ChannelObject, TdmsWriter
from openpyxl import Workbook
from scipy.io import savemat

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
    path.write_bytes((text + rows(1e3 * T, 1e3 * D, -1e3 * F, delimiter=";", decimal=",")).encode("cp1252"))
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
        file.write_segment(
            [
                ChannelObject("Measured", "Position", D, {**step, "unit_string": "mm"}),
                ChannelObject("Measured", "Load cell force", F, {**step, "unit_string": "N"}),
            ]
        )
    return path


def tdms_columns(path: Path) -> Path:
    path = path / "columns.tdms"
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("Log", name, values)
                for name, values in (("Time (s)", T), ("Depth (m)", D / 1e3), ("Load (N)", F))
            ]
        )
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
    lines = (",".join(f'"{number:.6f}"'.replace(".", ",") for number in row) for row in zip(T, D, F, strict=True))
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


def thousands_in_quotes(path: Path) -> Path:
    """As Bluehill writes what is 1,000 or more."""
    path = path / "long.csv"
    lines = (f'"{1e3 * t:,.5f}","{1e3 * d:,.4f}","{f:.6f}"' for t, d, f in zip(T, D, F, strict=True))
    path.write_text('"Time (ms)","Extension (um)","Load (N)"\n' + "\n".join(lines) + "\n")
    return path


def thousands_in_german_quotes(path: Path) -> Path:
    path = path / "lang.csv"
    swap = str.maketrans(",.", ".,")
    lines = (f'"{1e3 * t:,.5f}";"{1e3 * d:,.4f}";"{f:.6f}"'.translate(swap) for t, d, f in zip(T, D, F, strict=True))
    path.write_text("Zeit (ms);Weg (um);Kraft (N)\n" + "\n".join(lines) + "\n")
    return path


def unknown_unit_in_the_row(path: Path) -> Path:
    path = path / "mts2.csv"
    head = "Time,Axial Displacement,Axial Torque,Axial Force\nsec,mm,kipf·ft,N\n"
    path.write_text(head + rows(T, D, 0.3 * T, F), encoding="utf-8")
    return path


def empty_and_text_columns(path: Path) -> Path:
    path = path / "columns.csv"
    cells = zip(rows(T, D).split("\r\n"), rows(F, F).split("\r\n"), strict=True)
    lines = [f"{a},,RUN-{k % 7},{b.partition(',')[0]},14:0{k % 6}:09" for k, (a, b) in enumerate(cells) if a]
    path.write_text("Time (s),Depth (mm),Spare,State,Force (N),Clock\n" + "\n".join(lines) + "\n")
    return path


def first_sample_twice(path: Path) -> Path:
    path = path / "twice.txt"
    text = rows(T, D, F, delimiter="\t")
    path.write_text("Time (s)\tStroke (mm)\tLoad (N)\r\n" + text.partition("\r\n")[0] + "\r\n" + text)
    return path


def metadata_below_the_names(path: Path) -> Path:
    path = path / "meta.csv"
    head = "Channel,Elapsed time,Position,Load cell force\nUnit,s,mm,N\nSerial,none,A-331,B-17\nSlope,1,0.25,12.5\n"
    body = "\n".join(f"{k},{line}" for k, line in enumerate(rows(T, D, F).split("\r\n")) if line)
    path.write_text(head + body + "\nend of test,,,\n")
    return path


def lvm_with_equal_times(path: Path) -> Path:
    path = lvm(path, columns="Multi", name="multi.lvm")
    head, _, body = path.read_text().partition("X_Value\tDisplacement\tForce\tComment\n")
    lines = (line.split("\t") for line in body.splitlines())
    text = "\n".join(f"{t}\t{d}\t{t}\t{f}" for t, d, f in lines)
    head = head.replace("Y_Unit_Label\tmm\tN\t\n", "Y_Unit_Label\tmm\t\tN\t\n")
    path.write_text(head + "X_Value\tDisplacement\tX_Value\tForce\tComment\n" + text + "\n")
    return path


def lvm_with_equal_times_and_units_in_turn(path: Path) -> Path:
    path = lvm_with_equal_times(path)
    path.write_text(path.read_text().replace("Y_Unit_Label\tmm\t\tN\t\n", "Y_Unit_Label\tmm\tN\t\n"))
    return path


def without_an_ending(path: Path) -> Path:
    made = tdms_columns(path)
    return made.rename(path / "measurement_04")


def text_without_an_ending(path: Path) -> Path:
    return wintest(path).rename(path / "export")


def small_units(path: Path) -> Path:
    path = path / "nano.txt"
    head = "Time (s)\tIndentation (nm)\tLoad (µN)\n"
    path.write_text(head + rows(T, 1e6 * D, 1e6 * F, delimiter="\t", form="%.3f"), encoding="utf-8")
    return path


def zipped(path: Path) -> Path:
    made = workbook(path)
    with zipfile.ZipFile(path / "sent.zip", "w") as archive:
        archive.write(made, "from the lab/trial.xlsx")
        archive.writestr("__MACOSX/from the lab/._trial.xlsx", b"\0\5\x16\7")
    made.unlink()
    return path / "sent.zip"


def old_workbook(path: Path) -> Path:
    """As Excel 2 wrote it (BIFF2): records of a code, a length and cells."""

    def record(code: int, *parts: bytes) -> bytes:
        body = b"".join(parts)
        return struct.pack("<HH", code, len(body)) + body

    def place(row: int, column: int) -> bytes:
        return struct.pack("<HH3x", row, column)

    names = [name.encode() for name in ("Time (s)", "Position (mm)", "Force (N)")]
    cells = [record(4, place(0, k), bytes([len(name)]), name) for k, name in enumerate(names)]
    for row, values in enumerate(np.column_stack([T, 40.0 - D, F]), 1):
        cells += [record(3, place(row, k), struct.pack("<d", value)) for k, value in enumerate(values)]
    path = path / "archive.xls"
    path.write_bytes(record(9, struct.pack("<HH", 2, 0x10)) + b"".join(cells) + record(10))
    return path


def text_called_xls(path: Path) -> Path:
    path = path / "export.xls"
    path.write_text("Time (s)\tDisplacement (mm)\tForce (N)\n" + rows(T, D, F, delimiter="\t"))
    return path


REAL = [
    thousands_in_quotes,
    thousands_in_german_quotes,
    unknown_unit_in_the_row,
    empty_and_text_columns,
    first_sample_twice,
    metadata_below_the_names,
    lvm_with_equal_times,
    lvm_with_equal_times_and_units_in_turn,
    without_an_ending,
    text_without_an_ending,
    small_units,
    zipped,
    old_workbook,
    text_called_xls,
    plain_csv,
    semicolons_and_decimal_commas,
    bluehill,
    bluehill_compression,
    mts_testsuite,
    mts_testworks,
    zwick,
    zwick_workbook,
    workbook,
    wintest,
    wintest_utf16,
    tdms_waveforms,
    tdms_columns,
    lvm,
    lvm_without_times,
    matlab,
    matlab_structure,
    hdf5_attributes,
    hdf5_table,
    bluehill_german,
    numpy_text,
    matlab_import,
    matlab_73,
    hdf5_matrix,
]
