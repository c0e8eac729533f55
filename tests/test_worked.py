"""Worked examples: their cases, their base model, and their table."""

from __future__ import annotations

import json

import numpy as np
import pytest
from making_diagnosed import BASE, diagnosed
from typer.testing import CliRunner

from legfem.data import segment_all
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.correction import read_correction
from legfem.inverse.observations import observe
from legfem.legs.correction_of_leg import REFERENCE
from legfem.mechanisms import Solution
from legfem.solve.path import ForceCurve
from legfem.solve.protocol import Protocol
from legfem.study.correction.cases import CorrectionCase
from studies.lab.recording import INSTRUMENT
from studies.worked.__main__ import QUANTITIES, app, cells, page
from studies.worked.ends import DEPTH_MM, NOT_OFFERED, PLANE, SPATIAL, PlaneLegVariants, offered, recorded
from studies.worked.example import WorkedTruth, row_of
from studies.worked.stiffening import protocol_named

CURVE = ForceCurve(np.linspace(0, 20, 41), np.linspace(0, 20, 41) ** 1.5 / 4)


@pytest.fixture(scope="module")
def stiffened():
    found = diagnosed({"strain-stiffening.coefficient": 1.5})
    return found, WorkedTruth(1e3 * BASE[DEEP_C10], 1e3 * BASE[DEEP_C20], "strain-stiffening", "closed form")


def test_the_leg_that_stiffens_is_recorded_as_sealed_cases_are():
    assert protocol_named("ramps") == Protocol.ramp(20.0, 0.4)
    assert len(protocol_named("holds").segments) == 3


def test_the_leg_in_3d_is_that_of_the_correction_but_for_mesh_and_stiffness():
    tabulated = read_correction(REFERENCE).given
    assert tabulated["leg"]["radius"] == SPATIAL.leg.radius
    assert SPATIAL.leg == PLANE.leg and SPATIAL.cylinder == PLANE.cylinder
    assert SPATIAL.material.C10_kPa != tabulated["material"]["C10_kPa"]
    assert SPATIAL.settings.mesh != PLANE.settings.mesh
    assert SPATIAL.depth > DEPTH_MM


def test_recordings_in_3d_are_three_loadings_with_noise():
    recordings = recorded(CURVE)
    assert len(recordings) == 3
    for recording in recordings:
        air = recording.displacement[-1] - DEPTH_MM
        error = recording.force - CURVE(np.clip(recording.displacement - air, 0.0, None))
        assert -0.2 < air < 2.2 and 0.0 < np.std(error) < 0.5


def test_mechanisms_that_the_idealised_leg_lacks_are_missing_with_a_reason():
    observed = observe(segment_all(recorded(CURVE), INSTRUMENT))
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


def test_a_row_sets_the_diagnosis_beside_its_truth(stiffened):
    found, truth = stiffened
    row = row_of("stiffening", truth, found, 1.0)
    assert row.right
    assert row.held_out_after < row.held_out_before
    assert row.strength_interval[0] < 1.5 < row.strength_interval[1]
    document = json.loads(json.dumps(row.document()))
    assert document["origin"] == "simulated" and document["verdict"] == found.verdict


def test_the_page_has_every_quantity_and_says_simulated(stiffened):
    found, truth = stiffened
    row = row_of("stiffening", truth, found, 1.0)
    text = page([row], ["stiffening/example.png"])
    assert text.count("imulated data") == 2
    assert all(f"| {quantity} |" in text for quantity in QUANTITIES)
    assert len(cells(row)) == len(QUANTITIES)


def test_a_base_model_that_holds_has_no_repair():
    found = diagnosed({})
    row = row_of("none", WorkedTruth(1.0, 0.6, "end-effects", "closed form"), found, 1.0)
    assert row.verdict == "consistent"
    assert not row.right and row.repaired_c10 is None and row.held_out_after is None
    assert "-" in cells(row)


@pytest.mark.slow
def test_end_effects_are_named_end_to_end(tmp_path):
    asked = [
        "--example",
        "end-effects",
        "--out",
        str(tmp_path / "out"),
        "--library",
        str(tmp_path / "library"),
        "--jobs",
        "1",
    ]
    ran = CliRunner().invoke(app, asked)
    assert ran.exit_code == 0, ran.output
    row = json.loads((tmp_path / "out" / "result.json").read_text())["examples"][0]
    assert row["models"][0] == ["end-effects"]
    assert abs(row["repaired_c10"] / row["truth"]["c10_kpa"] - 1) < 0.05
    assert (tmp_path / "out" / "end-effects" / "diagnosis.json").is_file()
