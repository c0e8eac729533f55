"""Files of further programs are read right; what can't be is refused with its cause, and with what would read it."""

from __future__ import annotations

import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from making_instrument_files import D, F, T, rows
from making_lab_files import BINARY, PAGES, TEXTS
from openpyxl import Workbook
from scipy.io import savemat

from legfem.common.errors import InputError
from legfem.data import Recording, read_samples, segment
from legfem.data.columns import propose
from legfem.data.formats import lines, read_sheets
from legfem.data.formats.labels import name_and_unit, unit_named
from legfem.data.plausibility import magnitude_doubts
from legfem.data.recording import recording_of


def read(path: Path) -> Recording:
    sheets = read_sheets(path)
    return recording_of(path, sheets, propose(path, sheets).channels)


def check(path: Path) -> None:
    found = read(path)
    assert len(found) == len(T)
    np.testing.assert_allclose(found.time - found.time[0], T, atol=1e-3)
    np.testing.assert_allclose(found.displacement - found.displacement[0], D - D[0], atol=5e-4)
    np.testing.assert_allclose(found.force, F, atol=1e-3)


@pytest.mark.parametrize("name", TEXTS)
def test_a_lab_s_text_is_read_right(tmp_path: Path, name: str) -> None:
    path = tmp_path / "export.txt"
    path.write_text(TEXTS[name], encoding="utf-8")
    check(path)


@pytest.mark.parametrize("name", PAGES)
def test_a_text_in_a_country_s_code_page_is_read_right(tmp_path: Path, name: str) -> None:
    encoding, text = PAGES[name]
    path = tmp_path / "export.csv"
    path.write_bytes(text.encode(encoding))
    check(path)


@pytest.mark.parametrize("name", BINARY)
def test_channels_are_found_wherever_a_format_keeps_their_units(tmp_path: Path, name: str) -> None:
    BINARY[name](tmp_path / name)
    check(tmp_path / name)


RUNS = "Run 1: Time (s),Run 1: Force (N),Run 1: Position (mm),Run 2: Time (s),Run 2: Force (N),Run 2: Position (mm)\n"
AXES = "Time_S,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN\n"
RATES = "ADC: sampling rate 1000 Hz\nfile: sampling rate 10 Hz\nForce (N),Position (mm)\n"


def _sexagesimal(form) -> str:
    times = [form(*divmod(float(t), 60.0)) for t in np.round(T, 6)]
    return "".join(f"{t},{d:.5f},{f:.5f}\n" for t, d, f in zip(times, D, F, strict=True))


REFUSED = {
    "a clock as one number": (
        "Time,Position (mm),Force (N)\n" + _sexagesimal(lambda m, s: f"{141100 + 100 * m + s:.2f}"),
        "jumps from 141159.9 to 141200: it may count hours, minutes and seconds",
    ),
    "minutes and seconds as one number": (
        "Time (min),Position (mm),Force (N)\n" + _sexagesimal(lambda m, s: f"{m + s / 100:.3f}"),
        "jumps from 0.599 to 1: it may count minutes and seconds",
    ),
    "a film's frames": (
        "Timecode,Position (mm),Force (N)\n"
        + _sexagesimal(lambda m, s: f"00:{m:02.0f}:{int(s):02d}:{round(s % 1 * 25):02d}"),
        "the last two figures of '00:00:00:00' may count frames",
    ),
    "a date as one number": (
        "Time,Position (mm),Force (N)\n" + rows(20240305141109000 + 1e3 * T, D, F, form="%.4f"),
        "column 'Time': has dates as numbers (20240305141109",
    ),
    "thousands among whole numbers": (
        "Time (ms)\tDisp (µm)\tForce (mN)\n"
        + "".join(f"{1e3 * t:,.0f}\t{1e3 * d:,.0f}\t{1e3 * f:,.0f}\n" for t, d, f in zip(T, D, F, strict=True)),
        "line 12: '1,000' seems to have a thousands' separator",
    ),
    "trials of two lengths side by side": (
        "Probe 1,,,Probe 2,,\nZeit (s),Weg (mm),Kraft (N),Zeit (s),Weg (mm),Kraft (N)\n"
        + "".join(f"{k},{k},{k},{f'{k},{k},{k}' if k < 30 else ',,'}\n" for k in range(99)),
        "2 trials stand side by side",
    ),
    "numbers in volts": (
        "Sample Frequency (Hz): 10\nUnits\tmm\tmN\nTest Data in Volts:\n\nSample\tLength\tForce\n"
        + rows(np.arange(len(T)), D, F, delimiter="\t"),
        "are in volts, as the heading says ('Test Data in Volts:')",
    ),
    "fewer samples than are counted": (
        f"gel.acq\n100 msec/sample\n2 channels\nForce\nN\nTravel\nmm\nCH1\tCH2\n{len(T)}\t{len(T)}\n"
        + rows(F[50:], D[50:], delimiter="\t"),
        f"its heading counts {len(T)} samples, and {len(T) - 50} follow: their times are not known",
    ),
    "two sampling rates": (RATES + rows(F, D), "add a column Time (s)"),
    "runs side by side": (RUNS + rows(T, F, D, T, 1.1 * F, 0.9 * D), "2 trials stand side by side: 'Run 1:"),
    "two axes": (AXES + rows(T, 1e3 * D, 900 * D + np.sin(T), 1e3 * F, 2e3 * F + np.sin(T)), "may be any of"),
    "two blocks": (
        "".join(f"Specimen {k}\nTime (s),Extension (mm),Load (N)\n{rows(T, D, k * F)}\n" for k in (1, 2)),
        "time runs backwards",
    ),
    "a factor before a run": ("Time (s),Position (mm),Force (N) x10\n" + rows(T, D, F), "has no unit"),
    "two units of one column": ("Time_s,Position_mm,Force_N\ns,mm,mN\n" + rows(T, D, F), "'N or mN' of 'Force'"),
    "thousands without quotes": (
        "Zeit [ms];Kraft [N];Weg [µm]\n" + "".join(f"{k},5;1,0;1.{k:03d},25\n" for k in range(60)),
        "line 2: '1.000,25' has a thousands' separator without quotes (60 such numbers)",
    ),
    "a force that was read less often": (
        "Time (s),Depth (mm),Force (N)\n" + "".join(f"{k},{k},{'' if k % 2 else k + 0.5}\n" for k in range(60)),
        "column 'Force (N)': is empty in many rows: it was recorded less often than the others",
    ),
    "results": ("Specimen,Fmax (N),Modulus (kPa)\n1,12.1,3.1\n2,12.2,3.0\n3,11.9,3.2\n", "export all three columns"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_can_be_read_in_two_ways_is_refused_with_the_cause(tmp_path: Path, name: str) -> None:
    text, cause = REFUSED[name]
    path = tmp_path / "export.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read(path)
    assert cause in str(caught.value)


@pytest.mark.parametrize("name", ["runs side by side", "two axes"])
def test_the_command_in_a_refusal_reads_columns_that_belong_together(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a b.csv"
    path.write_text(REFUSED[name][0])
    with pytest.raises(InputError) as caught:
        read(path)
    words = shlex.split(caught.value.remedy.partition("legfem data ")[2])
    given = {key.removeprefix("--"): value for key, value in zip(words[2::2], words[3::2], strict=True)}
    sheets = read_sheets(path)
    found = recording_of(path, sheets, propose(path, sheets, given).channels)
    np.testing.assert_allclose(found.force, F, atol=1e-3)
    np.testing.assert_allclose(found.displacement, D, atol=1e-3)


def test_a_sheet_of_charts_without_a_chart_is_passed_over(tmp_path: Path) -> None:
    book = Workbook()
    assert book.active is not None
    for row in [["Time (s)", "Position (mm)", "Force (N)"], *np.column_stack([T, D, F]).tolist()]:
        book.active.append(row)
    book.create_chartsheet("Chart")
    book.save(tmp_path / "a.xlsx")
    check(tmp_path / "a.xlsx")


def test_a_text_of_too_many_lines_is_thinned_by_the_refusal_s_command(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(lines, "_MOST_LINES", 500)
    path = tmp_path / "a b.csv"
    path.write_text("Rig 2\nTime (s),Position (mm),Force (N)\n" + rows(T, D, F))
    with pytest.raises(InputError, match="contains 753 lines; at most 500 are read") as caught:
        read(path)
    subprocess.run(caught.value.remedy.partition(": ")[2], shell=True, check=True)
    thin = read(tmp_path / "a b-thin.csv")
    assert 200 < len(thin) < 400
    np.testing.assert_allclose(np.interp(thin.time, T, F), thin.force, atol=1e-4)


def test_a_time_by_a_heading_s_rate_has_gaps_where_samples_are_missing_and_says_its_source(tmp_path: Path) -> None:
    path, kept = tmp_path / "a.csv", np.r_[0:100, 140 : len(T)]
    path.write_text("Sampling rate,10 Hz\nSample,Force (N),Position (mm)\n" + rows(kept, F[kept], D[kept]))
    np.testing.assert_allclose(read(path).time, T[kept], atol=1e-9)
    assert any(
        "the time is counted from the heading's 'Sampling rate 10 Hz'" in r
        for r in propose(path, read_sheets(path)).reasons
    )
    # Beside a leg it is not taken without a look.
    with pytest.raises(InputError, match="legfem data look"):
        read_samples(path)


def test_of_several_tables_the_refusal_s_command_names_one(tmp_path: Path) -> None:
    book = Workbook()
    for name in ("Probe 1", "Probe 2"):
        page = book.create_sheet(name)
        page.append(["Prüfzeit (s)", "Standardweg (mm)", "Standardkraft (N)"])
        for row in np.column_stack([T, D, F]).tolist():
            page.append(row)
    book.save(tmp_path / "two.xlsx")
    with pytest.raises(
        InputError, match=r"2 tables contain recordings.*legfem data look .*two\.xlsx --sheet 'Probe 1'"
    ):
        read(tmp_path / "two.xlsx")


@pytest.mark.parametrize(("factor", "said"), [(1e3, "multiply it by 0.001"), (1e-3, "multiply it by 1000"), (1.0, "")])
def test_a_stated_unit_that_isn_t_true_is_doubted(tmp_path: Path, factor: float, said: str) -> None:
    path = tmp_path / "trial.mat"
    savemat(path, {"time_s": T, "displacement_mm": D, "force_N": factor * F})
    told = [str(doubt) for doubt in magnitude_doubts(segment(read(path)))]
    assert len(told) == bool(said) and all("force_N" in line and said in line for line in told)


@pytest.mark.parametrize("kind", ["Tensile", "Compressive"])
def test_a_pull_that_is_taken_for_a_leg_s_press_is_doubted(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "trial.csv"
    path.write_text(f"Time (s),{kind} extension (mm),{kind} load (N)\n" + rows(T, D, F))
    told = [str(doubt) for doubt in magnitude_doubts(segment(read(path)))]
    assert len(told) == (kind == "Tensile")
    assert all("has a pull's column names" in line for line in told)


@pytest.mark.parametrize(
    ("label", "name", "unit"),
    [
        ("Force (N) Run #2", "Force Run #2", "N"),
        ("Force (N) x10", "Force (N) x10", None),
        ("Load_kN_", "Load", "kN"),
        ("millis", "millis", "millis"),
        ("Position(Linear:Digital Position) (mm)", "Position(Linear:Digital Position)", "mm"),
        ("Stress (N/mm²)", "Stress", "N/mm²"),
    ],
)
def test_a_label_is_parted_into_name_and_unit(label: str, name: str, unit: str | None) -> None:
    assert name_and_unit(label) == (name, unit)


def test_newtons_a_square_are_pressures_and_meganewtons_unknown() -> None:
    assert unit_named("N/mm²") == ("pressure", 1.0) and unit_named("MN") is None
    assert unit_named("pN") == ("force", 1e-12) and unit_named("GPa") == ("pressure", 1e3)
