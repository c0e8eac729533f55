"""The correction: smooth at first contact, its file, and its calibration on tiny meshes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.experiments.leg_3d import IdealisedLegSettings
from legfem.inverse.correction import TabulatedCorrection, read_correction, smooth_ratio
from legfem.legs.correction_of_leg import choose_correction
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
from legfem.solve.path import ForceCurve
from legfem.study.correction.calibration import Calibration, calibrate
from legfem.study.correction.cases import CorrectionCase

GRID = np.linspace(0, 25, 51)


def made() -> TabulatedCorrection:
    level = -0.15 + 0.004 * GRID
    values = np.array([[level, level + 0.02], [level + 0.05, level + 0.07]])
    errors = {"mesh": 0.01 * np.ones(51), "leg length": 0.001 * GRID}
    return TabulatedCorrection("a test", GRID, np.array([0.5e-3, 5e-3]), np.array([0.0, 0.5]), values, errors)


def test_p_is_smooth_where_both_forces_vanish():
    at = np.array([0, 0.2, 0.5, 1, 2, 3, 5, 7, 9, 12, 15, 18, 21, 25.0])
    plane = at + 0.02 * at**3
    P = -0.2 + 0.01 * at
    noise = np.where(at < 2.5, 0.1 * np.sin(50 * at), 0)
    spatial = (1 - P + noise) * plane
    found = smooth_ratio(ForceCurve(at, spatial), ForceCurve(at, plane), GRID)
    assert np.all(np.isfinite(found))
    assert found[GRID >= 2.5] == pytest.approx(-0.2 + 0.01 * GRID[GRID >= 2.5], abs=1e-3)
    assert abs(found[1] - found[0]) < 1e-3
    assert np.abs(np.diff(found, 2)).max() < 2e-3


def test_the_factor_interpolates_and_is_constant_beyond_the_table():
    correction = made()
    middle = correction.factor(GRID, np.array(1e-3 * np.sqrt(0.5 * 5)), np.array(0.0))
    assert middle == pytest.approx(1.15 - 0.004 * GRID - 0.025)
    assert correction.factor(GRID, np.array(0.05), np.array(0.0))[0] == pytest.approx(1.10)
    many = correction.factor(GRID, *np.full((2, 3, 2), 1e-3))
    assert many.shape == (3, 2, 51)


def test_the_covariance_is_that_of_the_relative_error():
    modes = made().relative_errors(GRID, 0.5e-3, 0.0).values()
    covariance = sum(np.outer(mode, mode) for mode in modes)
    assert covariance[0, 0] == pytest.approx((0.01 / 1.15) ** 2)
    assert np.linalg.eigvalsh(covariance).min() > -1e-12


def test_a_file_holds_all(tmp_path: Path):
    path = made().write(tmp_path / "correction.json")
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    found = choose_correction(str(path), subject)
    assert found is not None and found.name == "a test"
    c10, c20 = np.array(1e-3), np.array(0.3e-3)
    assert found.factor(GRID, c10, c20) == pytest.approx(made().factor(GRID, c10, c20))
    assert choose_correction("none", subject) is None


@pytest.mark.parametrize("break_it", ["missing", "text", "kind", "schema", "shape", "key", "nan"])
def test_a_bad_file_is_one_line(tmp_path: Path, break_it: str):
    path = made().write(tmp_path / "correction.json")
    content = json.loads(path.read_text())
    if break_it == "missing":
        path = tmp_path / "none.json"
    elif break_it == "text":
        path.write_text("no JSON")
    else:
        change = {
            "kind": {"kind": "other"},
            "schema": {"schema": 99},
            "shape": {"c10_kPa": [1.0]},
            "key": {"errors": None},
            "nan": {"c10_kPa": [5.0, 0.5]},
        }
        path.write_text(json.dumps(content | change[break_it]))
    with pytest.raises(InputError) as caught:
        read_correction(path)
    assert "\n" not in str(caught.value)


def test_a_calibration_is_kept_and_gone_on_with(tmp_path: Path):
    mesh = LegMeshSettings(contact_size=8, depth_size=16, edge_size=8, growth=0.5, far_size=40)
    case = CorrectionCase(IdealisedLeg(length=90), settings=IdealisedLegSettings(mesh=mesh), depth=6.0)
    given = Calibration(case, c10_kPa=(1.0, 4.0), stiffening=(0.0,), coarse=0.8, between=0.9)
    found = calibrate(given, tmp_path, 1, Silent())
    assert len(list(tmp_path.glob("*.json"))) == len(found.outcomes) == 7
    assert found.reference.balance < 1e-8
    again = calibrate(given, tmp_path, 1, Silent())
    assert again.correction.values == pytest.approx(found.correction.values)
    assert again.reference.seconds == found.reference.seconds
    P = found.correction.correction(np.array([0.0, 5.0]), np.array(2e-3), np.array(0.0))
    assert np.all(np.abs(P) < 0.5)
    read = read_correction(found.correction.write(tmp_path / "correction.json"))
    assert read.given["leg"]["length"] == 90
