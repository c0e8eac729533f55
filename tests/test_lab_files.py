"""Files of further programs are read right; what can't be is refused with its cause, and with what would read it."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest
from making_instrument_files import D, F, T, rows
from making_lab_files import BINARY, PAGES, TEXTS
from openpyxl import Workbook
from scipy.io import savemat

from legfem.common.errors import InputError
from legfem.data import Recording, segment
from legfem.data.columns import propose
from legfem.data.formats import read_sheets
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
REFUSED = {
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
    lines = [str(doubt) for doubt in magnitude_doubts(segment(read(path)))]
    assert len(lines) == bool(said) and all("force_N" in line and said in line for line in lines)


@pytest.mark.parametrize("kind", ["Tensile", "Compressive"])
def test_a_pull_that_is_taken_for_a_leg_s_press_is_doubted(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "trial.csv"
    path.write_text(f"Time (s),{kind} extension (mm),{kind} load (N)\n" + rows(T, D, F))
    lines = [str(doubt) for doubt in magnitude_doubts(segment(read(path)))]
    assert len(lines) == (kind == "Tensile")
    assert all("has a pull's column names" in line for line in lines)


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
