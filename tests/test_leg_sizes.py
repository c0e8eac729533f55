"""The correction of one's own leg: its table, and whom it is applied to."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import TOML, write_subject

from legfem.common.errors import InputError
from legfem.geometry.section import depth_to_bone
from legfem.inverse.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import (
    LegCorrections,
    choose_correction,
    correction_of,
    read_leg_corrections,
    why_uncorrected,
)
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject

GRID = np.linspace(0, 25, 51)
BASE = TabulatedCorrection(
    "a leg",
    GRID,
    np.array([0.5e-3, 5e-3]),
    np.array([0.0, 0.5]),
    np.full((2, 2, 51), -0.1),
    {"mesh": np.full(51, 0.01)},
)


def made() -> LegCorrections:
    """P changes by 0.01 a mm of radius and 0.2 a radius of depth."""
    radius, depth = np.array([50.0, 60.0]), np.array([0.75, 1.0, 1.25])
    change = 0.01 * (radius[:, None] - 55) + 0.2 * (depth[None, :] - 1)
    return LegCorrections(
        radius,
        depth,
        GRID,
        np.array([0.5e-3, 5e-3]),
        np.array([0.0]),
        np.broadcast_to(change[..., None, None, None], (2, 3, 2, 1, 51)),
        {"layers": np.full(51, 0.02)},
    )


def measured(folder: Path, toml: str = "") -> Subject:
    return load_subject(write_subject(folder, TOML.replace('"simulated"', '"measured"') + toml))


def test_p_of_a_leg_is_the_references_and_the_change():
    found = made().of_leg(BASE, 57.0, 57.0 * 1.1)
    P = found.correction(GRID, np.array(2e-3), np.array(1e-3))
    assert P == pytest.approx(-0.1 + 0.02 + 0.02)
    assert found.standard_deviation(GRID) == pytest.approx(np.hypot(0.01, 0.02))
    assert "57.0 mm" in found.name and "beyond" not in found.name


def test_a_leg_beyond_the_table_takes_its_nearest_entry_and_says_so():
    found = made().of_leg(BASE, 80.0, 20.0)
    assert found.correction(GRID, np.array(2e-3), np.array(0.0)) == pytest.approx(-0.1)
    assert "beyond the table" in found.name


def test_a_file_holds_the_table(tmp_path: Path):
    found = read_leg_corrections(made().write(tmp_path / "legs.json"))
    assert found.of_leg(BASE, 52.0, 50.0).values == pytest.approx(made().of_leg(BASE, 52.0, 50.0).values)


@pytest.mark.parametrize("break_it", ["missing", "text", "kind", "shape", "errors", "list"])
def test_a_bad_table_is_one_line(tmp_path: Path, break_it: str):
    path = made().write(tmp_path / "legs.json")
    content = json.loads(path.read_text())
    change = {"kind": {"kind": "other"}, "shape": {"radius_mm": [1.0]}, "errors": {"errors": None}}
    if break_it == "missing":
        path = tmp_path / "none.json"
    elif break_it in ("text", "list"):
        path.write_text({"text": "no JSON", "list": "[]"}[break_it])
    else:
        path.write_text(json.dumps(content | change[break_it]))
    with pytest.raises(InputError) as caught:
        read_leg_corrections(path)
    assert "\n" not in str(caught.value)


def test_depth_to_the_bone_is_measured_from_first_contact(tmp_path: Path):
    leg = measured(tmp_path)
    # From the skin at (0, -60) to the tibia about (-15, 30), radius 13.
    expected = np.hypot(15, 90) - 13
    found = depth_to_bone(leg.section, leg.indenter.aim, leg.indenter.direction)
    assert found == pytest.approx(expected, abs=0.1)


def test_a_measured_leg_gets_its_own_correction_by_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    leg = measured(tmp_path)
    assert why_uncorrected(leg) is None
    table = made().write(tmp_path / "legs.json")
    monkeypatch.setattr("legfem.legs.correction_of_leg.LEGS", table)
    found = choose_correction("auto", leg)
    assert found is not None and "60.0 mm" in found.name
    assert choose_correction("none", leg) is None


def test_recordings_simulated_in_plane_strain_get_none_by_default(tmp_path: Path):
    simulated = load_subject(write_subject(tmp_path / "simulated"))
    assert choose_correction("auto", simulated) is None
    assert "plane strain" in (why_uncorrected(simulated) or "")
    in_3d = write_subject(tmp_path / "3d", TOML + "[recordings]\nplane_strain = false\n")
    assert choose_correction("auto", load_subject(in_3d)) is not None
    flat = measured(tmp_path / "flat", "[recordings]\nplane_strain = true\n")
    assert choose_correction("auto", flat) is None


def test_another_cylinder_gets_none_by_default(tmp_path: Path):
    leg = measured(tmp_path)
    longer = replace(leg, indenter=replace(leg.indenter, length=80.0))
    assert choose_correction("auto", longer) is None
    command = "legfem study correction --cylinder-length 80 --out correction"
    assert command in (why_uncorrected(longer) or "")
    thicker = replace(leg, indenter=replace(leg.indenter, radius=25.0))
    assert "--model 3d" in (why_uncorrected(thicker) or ""), "no option has another diameter"


@pytest.mark.parametrize("name", SUBJECTS.names)
def test_legfem_s_own_subjects_get_none_unless_asked(name: str):
    subject = load_subject(SUBJECTS.find(name), need_recordings=False)
    assert choose_correction("auto", subject) is None
    assert choose_correction("own", subject) is not None
    assert "beyond" not in correction_of(subject).name
