"""Instruments' files as their programs write them, all of one recording.

xlsx, TDMS, MAT and HDF5 are written by these formats' own libraries, LVM after National
Instruments' specification. The text exports of Bluehill, MTS, testXpert and WinTest are written by
hand after descriptions in manuals and in readers of others: none came from a machine.
"""

from __future__ import annotations

import struct
import zipfile
from datetime import datetime, timedelta
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


def clocks(start: float = 43_230.0, digits: int = 3, mark: str = ".") -> list[str]:
    """The recording's times as a clock shows them that is at a number of seconds since midnight."""
    found = []
    for time in np.round(start + T, 6) % 86_400:
        minutes, seconds = divmod(float(time), 60.0)
        found.append(f"{int(minutes // 60):02d}:{int(minutes % 60):02d}:{seconds:0{3 + digits}.{digits}f}")
    return [one.replace(".", mark) for one in found]


def timed(head: str, times: list[str], delimiter: str = ",", decimal: str = ".") -> str:
    body = rows(D, F, delimiter=delimiter, decimal=decimal).splitlines()
    return head + "\n" + "\n".join(f"{time}{delimiter}{line}" for time, line in zip(times, body, strict=True)) + "\n"


def _tabs(head: str, *columns) -> str:
    return head + "\n" + rows(*(columns or (T, D, F)), delimiter="\t")


def _semicolons(head: str, *columns) -> str:
    return head + "\n" + rows(*(columns or (T, D, F)), delimiter=";", decimal=",")


def _commas(head: str, *columns, **ways) -> str:
    return head + "\n" + rows(*(columns or (T, D, F)), **ways)


def _spared(head: str) -> str:
    return head + "".join(f"\n20.0\t\t{line}" for line in rows(D, F, T, delimiter="\t").splitlines())


def _mach1() -> str:
    head = "<Mach-1 File>\n<INFO>\nTime:\t12:03:11 PM\nMach-1:\tV500css\n<END INFO>\n<Stress Relaxation>\n<DATA>\n"
    names = "Time, s\tPosition (z), mm\tPosition (x), mm\tFx, N\tFz, N"
    return head + _tabs(names, T, D, 0 * T + 3, 0 * T, F) + "<END DATA>\n"


def _swiss(mark: str) -> str:
    lines = (f"{1e3 * t:,.3f};{1e3 * d:,.2f};{f:.5f}".replace(",", mark) for t, d, f in zip(T, D, F, strict=True))
    return "Time (ms);Position (um);Force (N)\n" + "\n".join(lines) + "\n"


def _wave_matrix() -> str:
    names = (
        '"Total Time (s)","Cycle Elapsed Time (s)","Step","Position(Linear:Digital Position) (mm)","Load(Linear) (N)"'
    )
    return _commas(names, T, T % 10, 0 * T + 1, D, F)


def _of_r() -> str:
    lines = (f'"{k}" {line.replace(",", " ")}' for k, line in enumerate(rows(T, D, F).splitlines(), 1))
    return '"Time (s)" "Position (mm)" "Force (N)"\n' + "\n".join(lines) + "\n"


def _among(text: str) -> str:
    """With a line among the numbers."""
    before, after = rows(T[:300], D[:300], F[:300]), rows(T[300:], D[300:], F[300:])
    return f"Time (s),Position (mm),Force (N)\n{before}{text}\n{after}"


def _as_formulas() -> str:
    lines = (",".join(f'="{cell}"' for cell in line.split(",")) for line in rows(T, D, F).splitlines())
    return "Time (s),Position (mm),Force (N)\n" + "\n".join(lines) + "\n"


def _femto_tools() -> str:
    """As a fixed width leaves one space of a gap, behind the stroke marks of a comment."""
    names = "//    Index    Time [s] Displacement [um]    Pos Z [V]    Force B [uN]"
    head = f"// ====\n// 2024-11-06, 10:04:19\n{names}\n// ====\n"
    return head + rows(1.001 + 0 * T, T, 1e3 * D, -D, 1e6 * F, delimiter="    ")


def _acq_knowledge() -> str:
    channels = "2 channels\nLoad cell - DA100C\nN\nTravel - LVDT\nmm\nmin\tCH1\tCH2\t\n\t751\t751\t\n"
    head = f"calf.acq\n100 msec/sample\n{channels}"
    return head + rows(T / 60, F, D, delimiter="\t", form="%.7f", end="\t")


def _gauge() -> str:
    samples = (f"{t:.3f},{f:.5f},N,{d:.5f},mm" for t, f, d in zip(T, F, D, strict=True))
    return "Time (s),Tracking Value,Units,Displacement,Units\n" + "\n".join(samples) + "\n"


def _test_xpert_in_french() -> str:
    head = '"Épaisseur éprouvette",1,"mm"\n"Section",5.96,"mm²"\n"Date/heure",43173.4,""\n"v1",1,"mm/min"\n'
    names = '"Temps","Traverse absolue","Force standard","Course standard"\n"s","mm","N","mm"\n'
    return head + names + rows(T + 5.5, D - 794.8, F, D)


def _dion() -> str:
    names = "S/No;C_1_Temps[s];C_1_Force[kN];C_1_Valeur de consigne[];C_1_Cycles[];C_1_Valeur de commande[%];"
    columns = (1.0 + 10 * np.arange(len(T)), T, F / 1e3, D / 30, 0 * T, 5 + np.sin(T), D)
    return f"{names}C_1_Déplacement[mm]\n" + rows(*columns, delimiter=";", form="%.8f")


_FULL_WIDTH = {ord(c): 0xFEE0 + ord(c) for c in "0123456789."}
G = 9.80665
ODD = {
    "a clock": timed("Time,Displacement (mm),Force (N)", clocks()),
    "a German clock": timed("Uhrzeit;Weg [mm];Kraft [N]", clocks(mark=","), ";", ","),
    "midnight": timed("Clock\tPosition (mm)\tLoad (N)", clocks(86_380.0), "\t"),
    "a date and a clock": timed("Timestamp,Position_mm,Force_N", [f"2024-05-03T{c}Z" for c in clocks(digits=6)]),
    "a German date": timed("Date/Time,Position (mm),Force (N)", [f"03.05.2024 {c}" for c in clocks()]),
    "half a day": timed("Time,Position (mm),Force (N)", [f"{c} PM" for c in clocks(1800.0)]),
    "minutes and seconds": timed(
        "Time,Position (mm),Force (N)", [f"{int(t // 60):02d}:{t % 60:06.3f}" for t in T.tolist()]
    ),
    "a clock of milliseconds": timed("Time,Position (mm),Force (N)", clocks(mark=":")),
    "units after semicolons": _tabs("Time; s\tPosition; mm\tForce; N"),
    "cells of units": _semicolons("Time; s;Position; mm;Force; N"),
    "units after a stroke": _tabs("Time/s\tPosition/mm\tForce/N"),
    "units after a dash": _tabs("Time - s\tPosition - mm\tForce - N"),
    "units after in": _tabs("Zeit [in s]\tWeg [in mm]\tKraft in N"),
    "units with dots": _semicolons("Time [sec.];Position [mm.];Force [N.]"),
    "a comma before a bracket": _commas('"Time, [s]","Position, [mm]","Force, [N]"'),
    "a remark behind the unit": _commas("Time [s],Displacement (mm) [LVDT],Load [N] (filtered)"),
    "names as R writes them": _commas("Time..s.,Position..mm.,Load..N."),
    "letters": _semicolons("t/s;s/mm;F/N"),
    "units above": _commas("s,mm,N\nTime,Position,Force"),
    "units in words": _commas("Time,Position,Force\nSeconds,Millimeters,Newtons"),
    "Trapezium": _commas('"1 _ 1","","",\n"Time","Force","Stroke",\n"sec","N","mm",', T, F, D, end=","),
    "Exponent": _tabs("Gel1\n\nForce\tDistance\tTime\ng\tmm\tsec", 1e3 * F / G, D, T),
    "kilograms": _commas("Time (s),Position (mm),Load (kg)", T, D, F / G, form="%.8f"),
    "pounds": _commas("Time (s),Position (in),Load (lbs)", T, D / 25.4, F / 4.4482216152605, form="%.8f"),
    "centinewtons": _semicolons("Zeit [s];Weg [mm];Kraft [cN]", T, D, 100 * F),
    "decanewtons": _commas("Temps (s);Déplacement (mm);Effort (daN)", T, D, F / 10, delimiter=";", form="%.7f"),
    "Mach-1": _mach1(),
    "UniVert": _commas("Cycle,Time_S,Size_mm,Displacement_mm,Force_N", 0 * T + 1, T, 20 - D, D, F),
    "WaveMatrix": _wave_matrix(),
    "Bluehill Universal": _commas(
        'Results Table 1\n,Maximum Force,Modulus\n,[N],[MPa]\n1,12,0\nMean,12,0\n"Time","Displacement","Force"\n'
        '"(s)","(mm)","(N)"'
    ),
    "Nexygen": _tabs("Load (N)\tMachine Extension (mm)\tExtension from Preload (mm)\tTime (s)", F, D, D - 0.1, T),
    "testXpert in English": _semicolons('"Test time";"Standard travel";"Standard force"\n"s";"mm";"N"'),
    "TestWorks Elite": _tabs("Load\tTime\tExtension\tStrain\nN\ts\tmm\tmm/mm", F, T, D, D / 20),
    "wide gaps": "Time (s)   Position (mm)   Force (N)\n" + rows(T, D, F, delimiter="   "),
    "single gaps": "# Time (s) Position (mm) Force (N)\n" + rows(T, D, F, delimiter=" "),
    "seconds unsaid": _commas("Time,Position (mm),Force (N)"),
    "milliseconds unsaid": _commas("Time,Position (mm),Force (N)", 1e3 * T, D, F),
    "Dutch": _semicolons("Tijd (s);Verplaatsing (mm);Kracht (N)"),
    "Japanese": _commas("時間(s),変位(mm),荷重(N)"),
    "Russian": _semicolons("Время, с;Перемещение, мм;Сила, Н"),
    "lines in quotes": "".join(f'"{line}"\n' for line in _commas("Time (s),Position (mm),Force (N)").splitlines()),
    "apostrophes": _swiss("'"),
    "spaces": _swiss(" "),
    "a cell that is never loaded": _commas("Time (s),Position (mm),Force 1 (N),Force 2 (N)", T, D, F, 0 * T),
    "an empty column between tabs": _spared("Temperature (°C)\tSpare\tPosition (mm)\tLoad (N)\tTime (s)"),
    "statistics below": _commas("Time (s),Position (mm),Force (N)") + "Max,22.0,11.1\nMean,10.0,2.0\n",
    "a spreadsheet's first line": "sep=;\n" + _semicolons("Time (s);Position (mm);Force (N)"),
    "names of two lines": _commas('"Time\n(s)","Position\n(mm)","Force\n(N)"'),
    "a line of names in quotes": _commas('"Time (s),Position (mm),Force (N)"'),
    "names in apostrophes": _commas("'Time (s)','Position (mm)','Force (N)'"),
    "row numbers of R": _of_r(),
    "a comment among the numbers": _among("# marker 1: hold"),
    "a sample that was commented out": _among("# 29.95,99.0,99.0"),
    "a heading on each page": _among("Time (s),Position (mm),Force (N)"),
    "minus signs": _commas("Time (s),Position (mm),Force (N)", T, -D, -F).replace("-", "\u2212"),
    "dashes for minus": _commas("Time (s),Position (mm),Force (N)", T, -D, -F).replace("-", "\u2013"),
    "exponents as Fortran writes them": _commas("Time (s),Position (mm),Force (N)", form="%.7e").replace("e", "D"),
    "figures of full width": _commas("時間(s),変位(mm),荷重(N)").translate(_FULL_WIDTH),
    "cells as formulas": _as_formulas(),
    "invisible characters": _commas("\ufeff\u200bTime (s),Posi\u00adtion (mm),Force (N)"),
    "days of a spreadsheet": _commas("Time,Position (mm),Force (N)", 45415.5 + T / 86400, D, F, form="%.10f"),
    "FemtoTools": _femto_tools(),
    "AcqKnowledge": _acq_knowledge(),
    "a gauge's units behind its numbers": _gauge(),
    "testXpert in French": _test_xpert_in_french(),
    "dion": _dion(),
    "Trapezium in Korean": _commas(
        '"1 _ 1",,,,\n"Time","Force","스트로크","Stress","스트로크 (신율)"\n"sec","N","mm","N/mm2","%"',
        T,
        F,
        D,
        F / 700,
        5 * D,
    ),
    "names in quotes after spaces": '"Time [s]", "Position [mm]", "Force [N]"\n' + rows(T, D, F, delimiter=", "),
    "microseconds unsaid": _commas("timestamp,Position (mm),Force (N)", 1e6 * T, D, F),
    "rows written twice": _commas("Time (s),Position (mm),Force (N)", *(np.repeat(c, 2) for c in (T, D, F))),
    "a step's own time": _commas("Segment,Time (s),Step time (s),Position (mm),Force (N)", T // 10, T, T % 10, D, F),
}
"""Text files that are odd and honest, and are read without a hand."""


def workbook_beside_other_cells(path: Path) -> Path:
    """With times of day, a corner that isn't A1, and a result beside the table."""
    path = path / "corner.xlsx"
    book = Workbook()
    page = book.active
    page["A1"], page["H8"], page["I8"] = "My lab", "peak", 12.3
    for column, name in zip("DEF", ("Time", "Position (mm)", "Force (N)"), strict=True):
        page[f"{column}6"] = name
    noon = datetime(2024, 5, 3, 23, 59, 50)
    for row, (t, d, f) in enumerate(zip(T.tolist(), D.tolist(), F.tolist(), strict=True), 7):
        page[f"D{row}"], page[f"E{row}"], page[f"F{row}"] = (noon + timedelta(seconds=t)).time(), d, f
    book.save(path)
    return path


def open_document(path: Path, body: str = "") -> Path:
    """As LibreOffice saves it: times of day as durations, and empty rows repeated to the page's end."""
    path = path / "sheet.ods"
    names = {"office": "office", "table": "table", "text": "text"}
    spaces = " ".join(f'xmlns:{k}="urn:oasis:names:tc:opendocument:xmlns:{v}:1.0"' for k, v in names.items())

    def words(*texts: str) -> str:
        cells = (f"<table:table-cell><text:p>{text}</text:p></table:table-cell>" for text in texts)
        return f"<table:table-row>{''.join(cells)}</table:table-row>"

    def cell(kind: str, value: object) -> str:
        field = "time-value" if kind == "time" else "value"
        return f'<table:table-cell office:value-type="{kind}" office:{field}="{value}"/>'

    rows = words("Elapsed", "Position (mm)", "Force (N)")
    for t, d, f in zip(T.tolist(), D.tolist(), F.tolist(), strict=True):
        span = f"PT00H{int(t // 60):02d}M{t % 60:09.6f}S"
        rows += f"<table:table-row>{cell('time', span)}{cell('float', d)}{cell('float', f)}</table:table-row>"
    rest = '<table:table-cell table:number-columns-repeated="16384"/>'
    rows += f'{body}<table:table-row table:number-rows-repeated="1047974">{rest}</table:table-row>'
    text = f'<?xml version="1.0"?><office:document-content {spaces}><table:table table:name="S">{rows}</table:table>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("content.xml", f"{text}</office:document-content>")
    return path


def tdms_with_times_of_day(path: Path) -> Path:
    path = path / "stamped.tdms"
    stamps = np.datetime64("2024-05-03T12:00:00", "us") + np.round(1e6 * T).astype("timedelta64[us]")
    units = [{}, {"NI_UnitDescription": "mm"}, {"NI_UnitDescription": "N"}]
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("g", name, values, unit)
                for name, values, unit in zip(("Stamp", "Displacement", "Load"), (stamps, D, F), units, strict=True)
            ]
        )
    return path
