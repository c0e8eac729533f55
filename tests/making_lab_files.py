"""Files as further programs of labs write them, all of one recording: nanoindenters, rheometers, loggers, bridges.

Those named with a repository have the heading of a public file; the others are after manuals and readers of others.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
from making_instrument_files import D, F, T, rows
from openpyxl import Workbook
from scipy.io import savemat

GRAVITY = 9.80665
COUNT = np.arange(len(T))


def _commas(head: str, *columns: np.ndarray, **ways: object) -> str:
    return head + "\n" + rows(*(columns or (T, D, F)), **ways)


def _tabs(head: str, *columns: np.ndarray, **ways: object) -> str:
    return _commas(head, *columns, delimiter="\t", **ways)


def _semicolons(head: str, *columns: np.ndarray) -> str:
    return _commas(head, *columns, delimiter=";", decimal=",")


def _lines(head: str, line: str) -> str:
    return head + "".join(line.format(k=k, t=t, d=d, f=f) for k, (t, d, f) in enumerate(zip(T, D, F, strict=True)))


def _clock(time: float) -> str:
    return f"0:{int(time // 60)}:{time % 60:.3f}"


def _events() -> str:
    cells = (
        f"{t:.3f},{d:.5f},{f:.5f},{'touched' * (k == 20)}" for k, (t, d, f) in enumerate(zip(T, D, F, strict=True))
    )
    return "Time (s),Depth (mm),Force (N),Event\n" + "\n".join(cells) + "\n"


def _blocks() -> str:
    """As MTS' Station Manager writes each time that it begins anew."""
    names = "Running Time\tAxial Displacement\tAxial Force\nSec\tmm\tN\n"
    head = "Data Header:\tTime:\t{}\tSec\t3/5/2024 2:11:{} PM\nData Acquisition:\tTimed Data\n" + names
    parts = [rows(T[part], D[part], F[part], delimiter="\t") for part in (slice(375), slice(375, None))]
    return f"MTS793|BTW|ENU|1|0|/|:|1|0|0|A\n{head.format(0.1, 9)}{parts[0]}\n{head.format(37.5, 46)}{parts[1]}"


_UNHT = "Indentation\n\n + Advanced\n   Max load :\t1000.00 \tµN\n   Fn contact : 25 µN\nMeasured values\n"
_WAVE = (
    '"Total Time (s)","Cycle Elapsed Time (s)","Total Cycles","Step","Total Cycle Count(Linear Waveform)",'
    '"Position (mm)","Force (kN)","Stress (MPa)","Digital Position (mm)","Rotation (deg)","Torque (N·m)",'
)
_DIMENSIONS = "Dimension : Length,50,mm\nDimension : Thickness,0.04470,mm\n\n"
_QUOTED = 'Specimen properties : Anvil height,"3,11",mm\nSpecimen properties : Area,"100,0",mm^2\n\n'
_DMA = "Version\t5.1\nInstrument\tDMA Q800\nNsig\t4\nSig1\tTime (min)\nSig2\tTemperature (°C)\nSig3\tStatic Force (N)\n"
_RHEO = "Project:;gel\nInterval and data points:;1;751\nInterval data:;Point No.;Time;Gap;Normal Force;Status\n"
_LABCHART = "Interval=\t0.1 s\nTimeFormat=\tStartOfBlock\nChannelTitle=\tLength\tForce\nRange=\t50.00 mm\t20.00 N"
_STAMP = "14:03:22.{k:03d} -> "

TEXTS: dict[str, str] = {
    "Anton Paar UNHT (artorg-unibe-ch/CartilageIndentationAnalysis)": _tabs(
        f"{_UNHT}Time (s)\tPd (µm)\tFn (µN)\tFnRef (µN)\tSegmentID\n",
        T,
        1e3 * D,
        1e6 * F,
        5.4 + 0 * T + 0.01 * np.sin(T),
        0 * T + 1,
    ),
    "WaveMatrix, axial and torsion (WhiteRabbit2006/instron_data_processing)": _commas(
        _WAVE,
        T,
        T % 10,
        T // 10,
        0 * T + 1,
        T / 10,
        D - 15,
        -F / 1e3,
        -F,
        D - 15.00001,
        np.sin(T),
        np.cos(T),
        form="%.9f",
        end=",",
    ),
    "Bluehill with sizes above (test-fixtures of readers)": _commas(
        f"{_DIMENSIONS}Time,Extension,Load,Tensile strain,Tensile extension\n(sec),(mm),(N),(mm/mm),(mm)",
        T,
        D,
        F,
        D / 50,
        D,
    ),
    "Bluehill whose last column has no unit": _commas(
        f"{_QUOTED}Time,Extension,Load,Compressive stress,Cycle count\n(s),(mm),(N),(MPa),",
        T,
        -D,
        -F,
        F,
        0 * T,
        decimal=",",
        quoted=True,
    ),
    "blocks of Station Manager": _blocks(),
    "a command beside the reading": _tabs(
        "Time\tAxial Displacement\tAxial Disp. Command\tAxial Force\nSec\tmm\tmm\tN", T, D, D.round(1), F
    ),
    "one channel twice": _commas("Time (sec),Crosshead (mm),Load (N),Load (N)", T, D, F, F),
    "TRIOS of an RSA-G2": _tabs(
        "Filename\tgel.tri\n[step]\nCompression - 1\nTime\tStep time\tAxial force\tGap\ns\ts\tN\tmm", T, T, -F, 30 - D
    ),
    "a DMA whose signals are listed": _tabs(
        f"{_DMA}Sig4\tDisplacement (µm)\nOrgFile\tgel.001\nStartOfData", T / 60, 0 * T + 25, F, 1e3 * D, form="%.6f"
    ),
    "RheoCompass": _lines(f"{_RHEO};;;;;\n;;[s];[mm];[N];\n", ";{k};{t:.3f};{d:.5f};{f:.5f};M-\n"),
    "UniVert, whose cycles are text": _lines(
        "SetName,Cycle,Time_S,Displacement_mm,Force_N\n", "S1,1-Compress,{t:.3f},{d:.4f},{f:.5f}\n"
    ),
    "MESUR gauge": _commas(
        "Reading,Load [lbF],Travel [in],Time [sec]", COUNT, F / 4.4482216152605, D / 25.4, T, form="%.7f"
    ),
    "LoadVUE": _lines("LoadVUE PRO\nElapsed (s),Load (N),Displacement (mm),Status\n", "{t:.3f},{f:.5f},{d:.5f},OK\n"),
    "an Arduino's millis": _commas("millis,position_mm,force_g", 1e3 * T, D, 1e3 * F / GRAVITY),
    "a scale's weight": _commas("time_ms,position_mm,weight_g", 1e3 * T, D, 1e3 * F / GRAVITY),
    "a serial monitor's stamps": _lines(
        "14:03:21.900 -> time_s,pos_mm,force_N\n", _STAMP + "{t:.3f},{d:.4f},{f:.4f}\n"
    ),
    "labels beside values": _lines("", "t={t:.3f} s, x={d:.4f} mm, F={f:.4f} N\n"),
    "a serial plotter": _lines("HX711 ready\n", "time_s:{t:.3f}\tpos_mm:{d:.4f}\tforce_N:{f:.4f}\n"),
    "Logger Pro": _commas('"Latest: Time (s)","Latest: Force (N)","Latest: Position (m)"', T, F, D / 1e3, form="%.7f"),
    "Capstone": _commas('"Time (s) Run #1","Position (m) Run #1","Force (N) Run #1"', T, D / 1e3, F, form="%.7f"),
    "clocks without zeros": "Time;Depth (mm);Force (N)\n"
    + "".join(f"{_clock(t)};{d:.5f};{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True)),
    "an event's remark": _events(),
    "LabChart": _tabs(_LABCHART, T, D, F),
    "MATLAB's writetable": _commas("Time_s_,Displacement_mm_,Force_N_"),
    "pandas' index": _lines(",time_s,displacement_mm,force_N\n", "{k},{t:.3f},{d:.5f},{f:.5f}\n"),
    "pandas' to_string": _lines("  time_s  displacement_mm  force_N\n", "{k:4d}  {t:8.3f}  {d:12.5f}  {f:9.5f}\n"),
    "decimetres and decinewtons": _commas("Time (ks),Position (dm),Force (dN)", T / 1e3, D / 100, 10 * F, form="%.8f"),
    "piconewtons and picometres": _commas(
        "Time (ns),Position (pm),Force (pN)", 1e9 * T, 1e9 * D, 1e12 * F, form="%.1f"
    ),
    "dynes": _commas("Time (s),Indentation (Å),Force (dyn)", T, 1e7 * D, 1e5 * F),
    "ounces and mils": _commas("Time (s),Travel (mil),Force (ozf)", T, D / 0.0254, F / 0.278013850953781, form="%.7f"),
    "two depths of which one is in volts": _tabs(
        "Depth (nm)\tLoad (µN)\tTime (s)\tDepth (V)\tLoad (V)", 1e6 * D, 1e6 * F, T, D / 1e3, F / 1e3, form="%.6f"
    ),
}
"""Text files that are read without a hand."""
PAGES: dict[str, tuple[str, str]] = {
    "Shift-JIS": ("cp932", _commas("時間（s）,変位（mm）,荷重（N）")),
    "GB 18030": ("gb18030", _commas("时间,位移,力\n秒,毫米,牛")),
    "EUC-KR": ("cp949", _commas("시간(s),변위(mm),하중(N)")),
    "Windows-1251": ("cp1251", _semicolons("Время, с;Перемещение, мм;Сила, Н")),
    "EUC-JP": ("euc_jp", _commas("時間[秒],変位[mm],荷重[N]")),
    "Big5": ("big5", _commas("時間(秒),位移(毫米),力(牛頓)")),
    "KOI8-R": ("koi8-r", _semicolons("Время, с;Перемещение, мм;Нагрузка, Н")),
    "kilograms in Russian": ("cp1251", _semicolons("Время, с;Деформация, мм;Усилие, кгс", T, D, F / GRAVITY)),
    "Windows-1250": ("cp1250", _semicolons("Czas [s];Przemieszczenie [mm];Siła [N]")),
    "Mac OS Roman": ("mac_roman", _semicolons("Prüfzeit (s);Weg (mm);Kraft (N)")),
}
"""Encoding and text."""


def _with_units(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values, unit in (("Time", T, np.bytes_("s")), ("Position", D / 1e3, np.array(["m"], dtype=object))):
            file.create_dataset(f"run/{name}", data=values).attrs["Unit"] = unit
        file.create_dataset("run/Force", data=1e3 * F).attrs["UNITS"] = "mN"


def _rows_with_names(path: Path) -> None:
    with h5py.File(path, "w") as file:
        made = file.create_dataset("channels", data=np.vstack([T, D, F]))
        made.attrs["names"], made.attrs["units"] = ["Time", "Displacement", "Force"], ["s", "mm", "N"]


def _of_pandas(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("df")
        group["axis1"], group["block0_values"] = COUNT, np.column_stack([T, D, F])
        group["block0_items"] = np.array([b"time_s", b"displacement_mm", b"force_N"])


def _row_of_structures(path: Path) -> None:
    """As dSPACE and others keep channels."""
    made = np.zeros(2, dtype=[("Name", "O"), ("Unit", "O"), ("Data", "O")])
    made[0], made[1] = ("Displacement", "mm", D), ("Force", "N", F)
    savemat(path, {"X": {"Data": T, "Unit": "s", "Name": "Time"}, "Y": made})


def _structures(path: Path) -> None:
    fields = (("t", T, "s"), ("disp", D, "mm"), ("force", F, "N"))
    savemat(path, {"S": {name: {"data": values, "unit": unit} for name, values, unit in fields}})


def _date_and_clock(path: Path) -> None:
    book = Workbook()
    assert book.active is not None
    book.active.append(["Datum", "Uhrzeit", "Weg [mm]", "Kraft [N]"])
    day = datetime(2024, 5, 3)
    for t, d, f in zip(T.tolist(), D.tolist(), F.tolist(), strict=True):
        book.active.append([day, (day + timedelta(hours=14, seconds=t)).time(), d, f])
    book.save(path)


def _sent(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Thumbs.db", b"\0")
        archive.writestr("from the lab/readme.md", "of the calf")
        archive.writestr("from the lab/trial.csv", _commas("Time (s),Position (mm),Force (N)"))


BINARY: dict[str, Callable[[Path], None]] = {
    "units.h5": _with_units,
    "rows.h5": _rows_with_names,
    "pandas.h5": _of_pandas,
    "dspace.mat": _row_of_structures,
    "structures.mat": _structures,
    "clock.xlsx": _date_and_clock,
    "sent.zip": _sent,
}
