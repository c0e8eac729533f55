"""The study of fibres: its cases aren't the table's, and its count counts."""

from __future__ import annotations

import numpy as np
import pytest
from making_diagnosed import diagnosed

from legfem.data import segment_all
from legfem.inverse.correction import read_correction, read_fibres
from legfem.inverse.observations import observe
from legfem.legs.correction_of_leg import REFERENCE
from legfem.mechanisms import Solution
from legfem.solve.path import ForceCurve
from legfem.solve.protocol import Protocol
from legfem.study.correction.cases import CorrectionCase
from studies.fibres.concealed import CASES, HEADER, cells, score
from studies.fibres.plane_base import NOT_OFFERED, PlaneLegVariants, offered
from studies.fibres.table import AT_RATIO, base_case, fibrous, smooth_log, varied
from studies.making.recording import INSTRUMENT, Course, LabErrors, record


def test_concealed_truths_are_of_other_legs_and_meshes_than_the_tables():
    table, correction = read_fibres().given, read_correction(REFERENCE).given
    for one in CASES:
        mesh, leg = one.case.settings.mesh, one.case.leg
        assert mesh.contact_size not in (table["mesh"]["contact_size"], correction["numerics"]["mesh"]["contact_size"])
        assert leg.fat == 0.0 != table["leg"]["fat"]
        assert one.case.material.mechanisms
    assert len({(one.ratio, one.in_air) for one in CASES}) == len(CASES) == 10


def test_mechanisms_that_the_idealised_leg_lacks_are_missing_with_a_reason():
    time = np.linspace(0.0, 47.5, 476)
    course = Course(time, 0.4 * time, (0.4 * time) ** 1.5 / 4)
    recordings = record([course] * 3, LabErrors(gain_sd=0.01, air=2.0), np.random.default_rng(2027))
    observed = observe(segment_all(recordings, INSTRUMENT))
    tabulated, missing = offered(observed, read_correction(REFERENCE))
    assert [m.name for m in tabulated] == ["compressibility"]
    assert missing == dict(NOT_OFFERED)


@pytest.mark.parametrize(
    ("protocol", "solution"),
    [
        (Protocol.ramp(5.0, 0.4), Solution()),
        (Protocol.ramp(5.0, 1.0), Solution("porous")),
        (Protocol.ramp(5.0, 1.0), Solution(parameters={"deep.C30": 1.0})),
        (Protocol.ramp(5.0, 1.0), Solution(tilt_deg=3.0)),
    ],
)
def test_the_idealised_leg_refuses_what_it_cannot_show(protocol, solution):
    with pytest.raises(ValueError, match="idealised leg"):
        PlaneLegVariants(CorrectionCase()).follow(protocol, {}, solution)


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
