"""Files as people and other programs make them: odd and honest texts, times of day, tables beside other cells."""

from __future__ import annotations

import zipfile
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from making_instrument_files import D, F, T, rows
from nptdms import ChannelObject, TdmsWriter
from openpyxl import Workbook
from typer.testing import CliRunner

from legfem.commands.data import app


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


def _toa5() -> str:
    """As a Campbell logger writes it: a unit of time that is none, and a row of what each reading is."""
    names = '"TOA5","CR1000"\n"TIMESTAMP","RECORD","Force","Disp"\n"TS","RN","N","mm"\n"","","Smp","Smp"\n'
    times = (f"2024-03-05 {clock}" for clock in clocks())
    return names + "".join(f'"{t}",{k},{f:.5f},{d:.5f}\n' for k, (t, f, d) in enumerate(zip(times, F, D, strict=True)))


def _flagged() -> str:
    samples = (f"{t:.3f},0,{d:.5f},0,{f:.5f},1" for t, d, f in zip(T, D, F, strict=True))
    return "Time (s),,Position (mm),,Force (N),\n" + "\n".join(samples) + "\n"


_RESULTS = ",Maximum load [N],Extension at max [mm],Modulus [MPa]\n" + "".join(f"{k},18,20,0.01\n" for k in range(9))
_CALIBRATION = "Point,Counts,Reference (N)\n1,0,0\n2,100,1\n3,200,2\n4,300,3\n\n"


_FULL_WIDTH = {ord(c): 0xFEE0 + ord(c) for c in "0123456789."}


G, POUND = 9.80665, 4.4482216152605


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
    "pounds": _commas("Time (s),Position (in),Load (lbs)", T, D / 25.4, F / POUND, form="%.8f"),
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
    "results above of as many columns": _commas(f"Results\n{_RESULTS}\nTime,Extension,Load\n(s),(mm),(N)"),
    "a calibration above": _commas(f"{_CALIBRATION}Time (s),Position (mm),Force (N)"),
    "a table below": _commas("Time (s),Position (mm),Force (N)") + f"\n{_RESULTS}",
    "Igor": "IGOR\nWAVES/D time_s, pos_mm, force_N\nBEGIN\n"
    + "".join(f"\t{line}\n" for line in rows(T, D, F, delimiter="\t").splitlines())
    + "END\n",
    "names between semicolons, numbers between tabs": _tabs("Zeit (s);Weg (mm);Kraft (N)"),
    "names between spaces, numbers between commas": _commas("time_s displacement_mm force_N"),
    "flags without names": _flagged(),
    "a logger's units": _toa5(),
    "a peak beside": _commas("Load (N),Peak load (N),Travel (mm),Time (s)", F, np.maximum.accumulate(F), D, T),
    "a list of channels": _commas("1,Time,s\n2,Position,mm\n3,Force,N\nDATA"),
    "a weight in Portuguese": _semicolons("Tempo (s);Posição (mm);Peso (g)", T, D, 1e3 * F / G),
    "pounds with a point": _commas("Time (sec.),Position (in.),Load (lb.)", T, D / 25.4, F / POUND, form="%.7f"),
    "AcqKnowledge without times": _tabs(
        f"gel.acq\n100 msec/sample\n2 channels\nForce\nN\nTravel\nmm\nCH1\tCH2\n{len(T)}\t{len(T)}", F, D
    ),
    "a sampling rate": _commas("Recorder,X2\nSampling rate,10 Hz\n\nForce (N),Position (mm)", F, D),
    "a sampling rate of each channel": _commas(
        "Ch1 sampling rate: 10 Hz\nCh2 sampling rate: 10 Hz\nForce (N),Position (mm)", F, D
    ),
    "a sampling interval": _semicolons("Abtastintervall;0,1 s\n\nKraft [N];Weg [mm]", F, D),
    "a sampling rate of counted samples": _commas(
        "Sampling frequency (Hz): 10\nSample,Force (N),Position (mm)", np.arange(len(T)), F, D
    ),
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


PLAIN = ("Time (s),Position (µm),Force (N)\n" + rows(T, 1e3 * D, F)).encode()


def look(*arguments: object):
    """Run the command without its pictures, which take most of its time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("legfem.report.instrument_file.draw_look", lambda *_: Path("left-out.png"))
        return CliRunner().invoke(app, ["look", *map(str, arguments)])


def written(name: str, content: bytes):
    def write(path: Path) -> Path:
        (path / name).write_bytes(content)
        return path / name

    return write


def table(header: str, *columns: np.ndarray, name: str = "trial.csv"):
    return written(name, (header + "\n" + rows(*columns)).encode())
