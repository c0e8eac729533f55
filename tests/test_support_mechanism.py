"""A support that gives way: a frame in series, bones on springs, and what lies between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import coarse_leg, observations, ramps

from legfem.common.progress import Silent
from legfem.experiments.experiment import Solved
from legfem.geometry.section import CALF, LIMBS
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.intervals import NUMERICAL_ERROR
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import CHANGES_AT, rounded
from legfem.inverse.predictor import Predictor
from legfem.inverse.responses import SolvedResponses
from legfem.legs.finite_element_models import LegVariants
from legfem.mechanisms import mechanism_named
from legfem.mechanisms.rig import SupportCompliance
from legfem.solve.protocol import Protocol

DEPTH = 6.0
SOFT = (0.8e-3, 0.9e-3)
"""C10 and C20, kPa."""
SUPPORT = SupportCompliance(LIMBS[CALF])


@pytest.fixture(scope="module")
def variants():
    return coarse_leg()


@pytest.fixture(scope="module")
def solved(variants, tmp_path_factory):
    return SolvedResponses(variants, DEPTH, tmp_path_factory.mktemp("support"), {"test": 1})


@pytest.mark.parametrize("name", ["fat-sliding", "contact-slip"])
def test_a_tangent_that_is_kept_changes_no_other_model(variants, name):
    """Nor that of fat that slides, whose face meets other parts as it goes: as one that is assembled each time."""
    mechanism = mechanism_named(name)
    at = mechanism.parameters[0].name
    forces = []
    for keeps in (False, True):
        settings = variants.base.settings
        settings = replace(settings, newton=replace(settings.newton, keeps_body=keeps))
        solved = LegVariants(replace(variants.base, settings=settings)).follow(
            Protocol.ramp(14.0, 1.0), {DEEP_C10: 1e-3, DEEP_C20: 0.0}, mechanism.solution({at: 0.78})
        )
        assert solved.report.complete
        forces.append(solved.path.force_at(np.array([5.0, 14.0])))
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-5)


@pytest.mark.slow
def test_between_a_frame_and_bones_the_force_lies_between(solved):
    """In series the force at a displacement is the held leg's where the springs have left it."""
    observed, _ = observations(ramps(1))
    within = observed.displacement < DEPTH - 0.2
    predictor = Predictor(observed, solved, "reduced-polynomial")
    compliance = 0.5
    forces = {
        share: predictor(
            {
                DEEP_C10: SOFT[0],
                DEEP_C20: SOFT[1],
                "support-compliance.compliance": compliance,
                "support-compliance.at_bones": share,
            },
            (SUPPORT,),
        )[within]
        for share in (0.0, 0.5, 1.0)
    }
    at, frame = observed.displacement[within], forces[0.0]
    held = np.interp(at - compliance * frame, [0.0, *solved.grid], [0.0, *solved.curve(*SOFT)])
    np.testing.assert_allclose(frame, held, rtol=0.01, atol=0.002)
    np.testing.assert_allclose(forces[0.5], 0.5 * (frame + forces[1.0]), rtol=1e-9)
    springs = {f"{bone}.springs.{axis}": 1.0 for bone in ("tibia", "fibula") for axis in "xy"}
    deep = {"deep.C10": SOFT[0], "deep.C20": SOFT[1]}
    bones = solved.variants.model(SUPPORT.variant).solve({**deep, **springs}, DEPTH).curve(at)
    np.testing.assert_allclose(forces[1.0], bones, rtol=5e-3, atol=0.002)


@pytest.mark.slow
def test_without_compliance_nothing_changes(solved):
    change = solved.elastic_change(SUPPORT.solution({"compliance": 0.0, "at_bones": 1.0}), SOFT)["force"]
    np.testing.assert_array_equal(change, 0.0)


@pytest.mark.slow
def test_its_table_stands_in_for_solutions_between_the_strengths(solved):
    observed, _ = observations(ramps(1))
    library = build_library(solved, observed, [SUPPORT], 1, Silent(), rounded(SOFT[0]), 0.8)
    assert library.missing == {}
    c10 = library.middle * float(np.exp(CHANGES_AT[1]))
    at = c10, c10 * float(np.expm1(0.8))
    deep = (observed.displacement > 0.3 * DEPTH) & (observed.displacement < DEPTH)
    for compliance in (0.05, 0.2, 0.5, 1.2):
        values = {"compliance": compliance, "at_bones": 1.0}
        tabulated = library.relative_change((SUPPORT, values), at, observed)[deep]
        true = solved.relative_change((SUPPORT, values), at, observed)[deep]
        assert np.abs(tabulated - true).max() < NUMERICAL_ERROR, "over the force"


def test_where_springs_stop_the_frame_is_left(variants, solved, monkeypatch):
    """Very soft springs let a leg roll away; a frame's compliance needs no solution."""
    follow = LegVariants.follow

    def stops(self, protocol, deep, solution, *others):
        if solution.variant == SUPPORT.variant:
            return Solved.nothing("it rolls away")
        return follow(self, protocol, deep, solution, *others)

    monkeypatch.setattr(LegVariants, "follow", stops)
    observed, _ = observations(ramps(1))
    shallow = SolvedResponses(variants, 1.0, None, {"test": 2})
    library = build_library(shallow, observed, [SUPPORT], 1, Silent(), rounded(SOFT[0]), 0.8)
    assert library.missing == {}
    values = {"compliance": 0.3, "at_bones": 0.7}
    assert not np.any(library.relative_change((SUPPORT, values), SOFT, observed))
