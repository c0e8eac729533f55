"""Sections of a leg's surfaces, made into a subject folder, meshed and pressed 25 mm.

The surfaces are a drawn leg's, and a real one's where they are at hand.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from making_mechanics import REAL_LEG

from legfem.imaging.leg_source import LegSource
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.folder import folder_of_leg
from legfem.legs.loading import load_subject
from studies.making.shapes import parametric_leg, read_legs
from studies.stockings.command import LEGS

real_leg = pytest.mark.skipif(not REAL_LEG.is_file(), reason="needs ../shared/data/leg_geometry")


def drawn_sections(path: Path, level: float) -> Path:
    """Write a leg of ours as the cross-sections of its surfaces."""
    shape = parametric_leg(read_legs(LEGS)["2"]).at_levels(np.array([level, level + 5.0]))
    rows = [
        (at, "muscle_hull" if part == "hull" else part, 0, i, x, y)
        for part, contours in shape.contours.items()
        for at, contour in zip(shape.levels, contours, strict=True)
        for i, (x, y) in enumerate(contour)
    ]
    columns = ["level_mm", "part", "loop", "i", "x_mm", "y_mm"]
    pd.DataFrame(rows, columns=columns).to_csv(path, index=False)
    return path


def test_a_drawn_leg_is_pressed_25_mm_at_its_back(tmp_path):
    pressed_at_its_back(drawn_sections(tmp_path / "sections.csv", 100.0), 100.0, tmp_path)


@real_leg
@pytest.mark.slow
@pytest.mark.parametrize("level", [260.0, 300.0, 340.0])
def test_a_real_leg_is_pressed_25_mm_at_its_back(level, tmp_path):
    pressed_at_its_back(REAL_LEG, level, tmp_path)


def pressed_at_its_back(sections: Path, level: float, folder: Path) -> None:
    source = LegSource(str(sections), contours=sections)
    subject = load_subject(folder_of_leg(source, level, folder / "leg"), need_recordings=False)
    test = plane_strain_test(subject)
    assert test.section_mesh.quality.worst > 0.1
    balances = []
    solved = test.solve(
        {"deep.C10": 1e-3, "superficial.C10": 1e-3},
        depth=25.0,
        on_step=lambda _: balances.append(test.system.balance()),
    )
    print(level, solved.report, solved.curve(np.array([5.0, 10.0, 20.0, 25.0])))
    assert solved.report.complete and solved.report.contact_stiffness_factor == 1.0
    assert solved.report.factorisations <= 120
    assert (np.diff(solved.curve.force) > 0).all()
    assert 1.0 < solved.curve(25.0) < 50.0
    for balance in balances:
        np.testing.assert_allclose(
            -balance.bone_reaction, balance.contact_force, atol=1e-8 * np.linalg.norm(balance.contact_force)
        )
