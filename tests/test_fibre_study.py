"""The study of fibres: its cases aren't the table's, and its count counts."""

from __future__ import annotations

import numpy as np
from making_diagnosed import diagnosed

from legfem.inverse.correction import read_correction
from legfem.inverse.fibre_correction import read_fibres
from legfem.legs.correction_of_leg import REFERENCE
from legfem.solve.path import ForceCurve
from studies.fibres.concealed import CASES, HEADER, cells, score
from studies.fibres.table import AT_RATIO, base_case, fibrous, smooth_log, varied


def test_concealed_truths_are_of_other_legs_and_meshes_than_the_tables():
    table, correction = read_fibres().given, read_correction(REFERENCE).given
    for one in CASES:
        mesh, leg = one.case.settings.mesh, one.case.leg
        assert mesh.contact_size not in (table["mesh"]["contact_size"], correction["numerics"]["mesh"]["contact_size"])
        assert leg.fat == 0.0 != table["leg"]["fat"]
        assert one.case.material.mechanisms
    assert len({(one.ratio, one.in_air) for one in CASES}) == len(CASES) == 10


def test_what_is_listed_is_counted():
    asked = ("support-compliance", "force-drift")
    found = {True: diagnosed({"support-compliance.compliance": 0.4}, asked=asked), False: diagnosed({}, asked=asked)}
    row = cells(CASES[0], found)
    assert len(row) == len(HEADER)
    assert "support-compliance" in row[3] and row[-1] == "consistent"
    assert score([(CASES[0], found)]).startswith("of 1: fibres listed by the base model with ends in 0")


def test_the_tables_errors_come_from_one_change_each():
    base = base_case()
    for name, group in varied().items():
        for case in group:
            parts = (case.leg != base.leg, case.material != base.material, case.settings != base.settings)
            assert sum(parts) == 1, name
            assert fibrous(case, 1.0).material.mechanisms == ()
            assert fibrous(case, AT_RATIO).material.mechanisms


def test_the_ratio_of_two_forces_is_smooth_and_level_before_it_can_be_told():
    d = np.linspace(0.0, 20.0, 60)
    plain = ForceCurve(d, d**1.5)
    fibres = ForceCurve(d, d**1.5 * np.exp(0.1 + 0.005 * d) * np.where(d < 1.0, 1.5, 1.0))
    at = np.array([0.0, 1.0, 2.5, 10.0, 20.0])
    expected = 0.1 + 0.005 * np.maximum(at, 2.5)
    np.testing.assert_allclose(smooth_log(fibres, plain, at), expected, atol=1e-3)
