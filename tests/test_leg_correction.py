"""A leg's own P(d) beside the table's: table, figure and page, from models with a known P."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making_legs_3d import cone_folder

from legfem.common.errors import InputError
from legfem.inverse.outcome import Outcome
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import ROUGHER, LegModels
from legfem.legs.placement import spatial_leg
from legfem.legs.subject import Subject
from legfem.study.correction import of_leg

DEPTH = 6.0


@dataclass
class WithEnds:
    """A section's force, times what a leg's ends make of it: 1 - P, with P linear in the depth."""

    section: PlaneStrainForward
    level: float
    stops: bool = False

    @property
    def nominal(self) -> Mapping[str, float]:
        return self.section.nominal

    def fingerprint(self) -> Mapping[str, Any]:
        return {"level": self.level}

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        flat = self.section.solve(values, sensitivities)
        d = flat.curve.displacement
        curve = replace(flat.curve, force=(1 - self.level + 0.01 * d) * flat.curve.force)
        return replace(flat, curves=(curve,), complete=not self.stops)


@pytest.fixture
def known_leg(monkeypatch: pytest.MonkeyPatch) -> dict[str, bool]:
    """Legs whose P is -0.1 - 0.01 d, 0.007 off by larger elements, 0.003 more if shorter."""
    asked = {"stops": False}

    def models(subject: Subject, depth: float, kept: Path, **_: Any) -> LegModels:
        section = PlaneStrainForward.of_subject(subject, depth)
        ends = [WithEnds(section, level, asked["stops"]) for level in (-0.1, -0.107, -0.104)]
        return LegModels(*ends, spatial_leg(subject), depth, kept)

    monkeypatch.setattr(of_leg.LegModels, "of_subject", staticmethod(models))
    return asked


def test_a_leg_s_own_correction_is_set_beside_the_table_s(known_leg, tmp_path, capsys):
    folder = tmp_path / "leg"
    folder.mkdir()
    cone_folder(folder, level=100.0)
    of_leg.run(folder, (1e-3, 0.0), DEPTH, tmp_path / "out")
    found = json.loads((tmp_path / "out" / "leg.json").read_text())
    d = np.array(found["displacement_mm"])
    late = d >= 2.5
    np.testing.assert_allclose(np.array(found["P"])[late], (-0.1 - 0.01 * d)[late], atol=1e-6)
    mesh = 0.007 / (ROUGHER**2 - 1)
    np.testing.assert_allclose(np.array(found["errors"]["mesh"])[late], mesh, atol=1e-6)
    np.testing.assert_allclose(np.array(found["errors"]["leg's length"])[late], 0.003, atol=1e-6)
    assert not found["extruded"] and "cone.csv" in found["shape"]
    own = load_subject(folder, need_recordings=False)
    table = of_leg.correction_of(own).correction(d, np.asarray(1e-3), np.asarray(0.0))
    np.testing.assert_allclose(found["table_P"], table)
    assert "table P" in capsys.readouterr().out
    page = (tmp_path / "out" / "report.html").read_text()
    assert "more force than plane strain" in page and "simulated" in page
    assert (tmp_path / "out" / "leg.png").stat().st_size > 5000


def test_a_leg_that_stops_short_is_one_line(known_leg, tmp_path):
    known_leg["stops"] = True
    cone_folder(tmp_path, level=100.0)
    with pytest.raises(InputError, match="press less deep"):
        of_leg.run(tmp_path, (1e-3, 0.0), DEPTH, tmp_path / "out")
    assert not (tmp_path / "out" / "leg.json").exists()
