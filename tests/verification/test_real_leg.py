"""A section of a real leg's surfaces, made into a subject folder, meshed and pressed 25 mm."""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import REAL_LEG

from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.geometry.subject_folder import convert_cross_sections
from legfem.subject import load_subject

pytestmark = pytest.mark.skipif(not REAL_LEG.is_file(), reason="needs ../shared/data/leg_geometry")


@pytest.mark.parametrize(
    "level", [300.0, pytest.param(260.0, marks=pytest.mark.slow),
              pytest.param(340.0, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_real_leg_is_pressed_25_mm_at_its_back(level, tmp_path):
    subject = load_subject(
        convert_cross_sections(REAL_LEG, level, tmp_path / "leg"), need_recordings=False
    )
    test = PlaneStrainIndentation.of_subject(subject)
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
            -balance.bone_reaction,
            balance.contact_force,
            atol=1e-8 * np.linalg.norm(balance.contact_force),
        )
