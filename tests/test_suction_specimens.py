"""Folders of suction cups: the stiffness that another code's domes had, and units by magnitude."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from making_layers import OtherLayer, OtherLayers

import legfem as lf
from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.inverse.catalogue import DEEP_C10
from legfem.specimens.details import rms_percent
from legfem.specimens.diagnosis import SpecimenDiagnoser

C10, BULK = 4e-3, 10.0
POISSON = (3 * BULK - 2) / (2 * (3 * BULK + 1))
CUP = f"""\
id = "cup"
title = "Made by another code"
origin = "simulated"

[suction]
opening_mm = 10.0
rim_mm = 2.0
thickness_mm = 15.0
diameter_mm = 80.0

[tissue]
poisson_ratio = {POISSON}
"""
UNITS = {"kPa": 1e-3, "mbar": 1e-4, "mmHg": 133.322e-6}


def drawn(*layers: OtherLayer) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (s), suctions (MPa) and heights (mm) of layers by the other code."""
    knots = np.linspace(0.5e-3, 4e-3, 8)
    risen = OtherLayers(layers, 40.0, [5.0, 7.0], 0.4).sucked(5.0, 2.0, knots)
    time = np.linspace(0.0, 8.0, 161)
    suction = knots[-1] * time / 8.0
    curve = np.polynomial.Polynomial.fit([0.0, *knots], [0.0, *risen], 5)
    noise = np.random.default_rng(1).normal(0.0, 3e-3, len(time))
    return time, suction, curve(suction) - curve(0.0) + noise


@pytest.fixture(scope="module")
def suctions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return drawn(OtherLayer(15.0, C10, BULK))


def written(folder: Path, made, unit: str = "kPa", header: str | None = None, name="a") -> Path:
    time, suction, height = made
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    (folder / "specimen.toml").write_text(CUP)
    rows = np.column_stack([time, height, suction / UNITS[unit]])
    np.savetxt(
        folder / "recordings" / f"{name}.csv",
        rows,
        "%.6g",
        ",",
        comments="",
        header=header or f"time_s,displacement_mm,pressure_{unit}",
    )
    return folder


@pytest.mark.parametrize("unit", UNITS)
def test_a_suction_is_read_in_its_unit(tmp_path: Path, suctions, unit: str) -> None:
    (one,) = lf.load_specimen(written(tmp_path, suctions, unit)).recordings
    assert one.course.peak == pytest.approx(4e-3 * np.pi * 25.0, rel=0.02)
    assert not one.course.in_air


def test_an_instrument_s_suction_is_read_in_its_unit(tmp_path: Path, suctions) -> None:
    written(tmp_path, suctions, "mbar", "Time (s),Height (mm),Vacuum (mbar)")
    channels = "".join(
        f'[recordings.{quantity}]\ncolumn = "{column}"\nunit = "{unit}"\n'
        for quantity, column, unit in (
            ("time", "Time", "s"),
            ("displacement", "Height", "mm"),
            ("force", "Vacuum", "mbar"),
        )
    )
    (tmp_path / "specimen.toml").write_text(CUP + channels)
    (one,) = lf.load_specimen(tmp_path).recordings
    assert one.course.peak == pytest.approx(4e-3 * np.pi * 25.0, rel=0.02)
    (tmp_path / "specimen.toml").write_text((CUP + channels).replace('"mbar"', '"N"'))
    with pytest.raises(InputError, match="'N' is not a unit of pressure"):
        lf.load_specimen(tmp_path)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        # Pa, and mbar, called kPa.
        ((1000.0, 1.0), "more than the atmosphere's pressure"),
        ((30.0, 1.0), "as mbar it is 12 kPa"),
        # Micrometres called mm.
        ((1.0, 1000.0), "over an opening of 10 mm"),
    ],
)
def test_what_no_pump_and_no_skin_does_is_refused(tmp_path: Path, suctions, factor, words) -> None:
    time, suction, height = suctions
    written(tmp_path, (time, factor[0] * suction, factor[1] * height))
    with pytest.raises(InputError) as error:
        lf.load_specimen(tmp_path)
    assert words in str(error.value)


def test_an_unusual_suction_is_doubted_on_the_report(tmp_path: Path, suctions) -> None:
    time, suction, height = suctions
    folder = lf.load_specimen(written(tmp_path, (time, 0.1 * suction, height)))
    assert "0.4 kPa is unusual" in str(folder.doubts[0])
    said = " ".join(lf.identify(folder, "neo-hookean").summary().split())
    assert "CHECK THE DOUBTFUL INPUT FIRST. IF IT IS RIGHT: " in said and "Problems found: 1 input is doubtful" in said
    assert said.count("DOUBTFUL INPUT: ") == 1


def test_the_planted_stiffness_is_found(tmp_path: Path, suctions) -> None:
    found = lf.identify(lf.load_specimen(written(tmp_path, suctions)), "neo-hookean")["neo-hookean"]
    estimate = found.estimates["deep.C10"]
    print(estimate.value / C10, np.array(estimate.ci95) / C10, rms_percent(found))
    assert estimate.value == pytest.approx(C10, rel=0.02)
    assert estimate.ci95[0] < C10 < estimate.ci95[1]


@pytest.mark.slow
def test_the_muscle_under_a_fat_of_stated_stiffness_is_found(tmp_path: Path) -> None:
    layers = OtherLayer(12.0, 2 * C10, BULK), OtherLayer(3.0, 3e-3, BULK)
    written(tmp_path, drawn(*layers))
    fat = '[[layers]]\nname = "fat"\nthickness_mm = 3.0\nC10_kPa = 3.0\n'
    muscle = '[[layers]]\nname = "muscle"\nthickness_mm = 12.0\n'
    (tmp_path / "specimen.toml").write_text(CUP.replace("thickness_mm = 15.0\n", "") + fat + muscle)
    found = lf.identify(lf.load_specimen(tmp_path), "neo-hookean")["neo-hookean"]
    estimate = found.estimates["muscle.C10"]
    print(estimate.value, estimate.ci95)
    assert estimate.value == pytest.approx(2 * C10, rel=0.05)
    assert estimate.ci95[0] < 2 * C10 < estimate.ci95[1]


@pytest.mark.slow
def test_a_diagnosis_finds_a_sound_cup_sound(tmp_path: Path, suctions) -> None:
    shutil.copytree(written(tmp_path / "one", suctions), tmp_path / "two")
    stated = "[instrument]\nforce_sd_N = 0.002\ndisplacement_sd_mm = 0.003\n"
    (tmp_path / "two" / "specimen.toml").write_text(CUP + stated)
    (found,) = SpecimenDiagnoser(None, 1, Silent()).diagnosed(lf.load_specimen(tmp_path / "two"))
    assert found.diagnosis is not None, found.problem
    print(found.diagnosis.verdict, found.diagnosis.best.value(DEEP_C10))
    assert found.diagnosis.verdict == "consistent"
    assert found.diagnosis.best.value(DEEP_C10) == pytest.approx(C10, rel=0.05)
