"""What every experiment holds: it pickles without its mesh, and knows what it depends on."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from making_legs_3d import round_leg
from making_mechanics import COARSE, subject_3

from legfem.experiments.axisymmetric import AxisymmetricSettings, BallIndentation, CylinderCompression
from legfem.experiments.bodies import BallOnLayer, CylinderBetweenPlates
from legfem.experiments.experiment import Experiment
from legfem.experiments.indentation import IndentationTest
from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.jobs.pool import Workers
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Fibres
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings, MeridianMeshSettings
from legfem.solve.protocol import Protocol
from legfem.solve.settings import StepSettings
from legfem.stockings.equilibrium import LegModel3D
from studies.reconstruct import solve_once

LAW = NeoHookean(5e-3, 0.2)
STEPS = StepSettings(first=0.5, largest=0.5)
ROUND = AxisymmetricSettings(MeridianMeshSettings(2.5), steps=STEPS)
FLAT = IdealisedLegSettings(
    mesh=LegMeshSettings(contact_size=8, depth_size=16, edge_size=8, growth=0.5, far_size=40), steps=STEPS
)
EXPERIMENTS: dict[str, IndentationTest] = {
    "plane strain": PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(mesh=COARSE, steps=STEPS)),
    "ball": BallIndentation(BallOnLayer(10.0), LAW, ROUND),
    "cylinder": CylinderCompression(CylinderBetweenPlates(10.0, 10.0), LAW, ROUND),
    "idealised leg": IdealisedLegIndentation(IdealisedLeg(length=60), Cylinder(), {"deep": LAW}, 2, FLAT),
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_it_solves_the_same_wherever_it_goes(name):
    """A number, a protocol and a depth by name are the same loading; giving up would be a value."""
    given = EXPERIMENTS[name]
    experiment: Experiment = given
    C10 = 1.1 * given.parameters["deep.C10"]
    solved = experiment.solve({"deep.C10": C10}, 1.0, ("deep.C10",))
    assert solved.report.complete and solved.parameters["deep.C10"] == C10
    assert solved.curve.depth == 1.0 and solved.curve.sensitivity("deep.C10", 1.0) > 0
    away = pickle.loads(pickle.dumps(experiment))
    assert "pressing" in given.__dict__ and "pressing" not in away.__dict__
    assert away.fingerprint() == experiment.fingerprint()
    again = away.solve({"deep.C10": C10}, Protocol.ramp(1.0, rate=1.0), ("deep.C10",))
    np.testing.assert_array_equal(again.curve.force, solved.curve.force)
    by_name = given.solve({"deep.C10": C10}, depth=1.0)
    np.testing.assert_allclose(by_name.curve.force, solved.curve.force, rtol=1e-9)


def test_its_fingerprint_is_that_of_what_it_depends_on():
    test = EXPERIMENTS["plane strain"]
    seen = [test.fingerprint()]
    assert test.fingerprint() == replace(test).fingerprint()
    indenter = test.indenter
    for change in (
        {"settings": PlaneStrainSettings(mesh=COARSE)},
        {"mechanisms": (Fibres("deep"),)},
        {"indenter": replace(indenter, aim=indenter.aim + 1e-9)},
        {"section": replace(test.section, fascia_thickness=0.7)},
    ):
        seen.append(replace(test, **change).fingerprint())
    assert len({str(one) for one in seen}) == len(seen)
    assert seen[0]["experiment"] == "PlaneStrainIndentation"


def test_nothing_is_meshed_before_it_is_needed():
    test = replace(EXPERIMENTS["plane strain"])
    assert "deep.C10" in test.parameters and test.fingerprint()
    assert not {"pressing", "section_mesh"} & set(test.__dict__)


def test_a_protocol_or_a_depth_has_to_be_given():
    with pytest.raises(TypeError, match="protocol or a depth"):
        EXPERIMENTS["ball"].solve()


def test_tests_are_work_for_processes():
    """In order, and without their meshes on the way back."""
    tests = [replace(EXPERIMENTS["ball"]), replace(EXPERIMENTS["idealised leg"])]
    here = [test.solve(None, 0.5).curve.force for test in tests]
    with Workers(solve_once, None, 2) as workers:
        away = list(workers.in_order([(test, 0.5) for test in tests]))
    for one, other in zip(here, away, strict=True):
        np.testing.assert_allclose(other.curve.force, one, rtol=1e-12)


def test_a_leg_under_a_pressure_is_one_too():
    leg = LegModel3D(
        round_leg(50, 42, 14, 40, n_levels=5, n_points=60),
        {"deep": NeoHookean(3e-3, 2.0), "superficial": NeoHookean(8e-3, 2.0)},
        SolidMeshSettings(skin_size=12, inside_size=14, bone_size=10),
    )
    experiment: Experiment = leg
    pressure = np.full(leg.shape.points("skin").shape[:2], 3e-3)
    solved = experiment.solve({"deep.C10": 3.1e-3}, pressure, ("deep.C10",))
    assert solved.report.complete and np.abs(solved.sensitivities["deep.C10"]).max() > 0
    away = pickle.loads(pickle.dumps(experiment))
    assert "compression" not in away.__dict__
    assert away.fingerprint() == experiment.fingerprint()
    again = away.solve({"deep.C10": 3.1e-3}, pressure)
    scale = np.abs(solved.unknown).max()
    np.testing.assert_allclose(again.unknown, solved.unknown, atol=1e-6 * scale)
    other = replace(leg, mesh=SolidMeshSettings(skin_size=11))
    assert other.fingerprint() != experiment.fingerprint()
