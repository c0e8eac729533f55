"""Thin fat, far softer than the muscle under it, beneath a narrow cylinder: it is drawn out to a film."""

from __future__ import annotations

import numpy as np
import pytest
from making import circle
from making_mechanics import pressed_block

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.fem.system import System
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.newton import RELAXED
from legfem.solve.path import SolveReport
from legfem.solve.stepping import BENDS

COARSE = SectionMeshSettings(contact_size=1.8, growth=0.35, far_size=12.0, layer_size=5.0)


def pressed(fat_kPa: float, depth: float) -> SolveReport:
    """Press 5 mm of fat over muscle of 3 kPa."""
    section = LegSection(
        circle(0, 0, 50, 120), circle(0, 0, 45, 120), {"tibia": circle(8, 12, 11), "fibula": circle(-17, 6, 5)}, 0.4
    )
    tissues = Tissues(NeoHookean(3e-3, 20.0), NeoHookean(1e-3 * fat_kPa, 22.0), NeoHookean(0.9, 22.0))
    indenter = Indenter(9.0, 50.0, np.zeros(2), 90.0)
    test = PlaneStrainIndentation(section, indenter, tissues, PlaneStrainSettings(mesh=COARSE))
    return test.solve(depth=depth).report


def led_nowhere(report: SolveReport) -> int:
    """Return factorisations of steps that failed and of creeping."""
    steps = (step for step in report.steps if step.reason == RELAXED or not step.converged)
    return sum(step.factorisations for step in steps if step.reason != BENDS)


def test_where_two_points_in_an_edge_of_skin_stop_three_go_on():
    report = pressed(0.15, 16.0)
    assert report.complete and report.compromise == "more points of integration than elsewhere"
    (first,) = report.earlier_attempts
    assert first.reached < 15.0 and "the superficial tissue is drawn out" in first.reason
    assert not any(step.reason == RELAXED for step in report.steps), "the path goes on, nothing jumps"


def test_fat_that_is_drawn_out_too_far_ends_a_solve_soon_and_the_reason_says_so():
    report = pressed(0.12, 17.0)
    assert not report.complete and 10.0 < report.reached < 17.0
    assert "the superficial tissue is drawn out" in report.reason and "use less depth" in report.reason
    (other,) = report.earlier_attempts
    most = PlaneStrainSettings().steps.most_astray
    for one in (report, other):
        assert led_nowhere(one) <= most + 12 + 40, "the last failure, or a creep"
    assert report.factorisations < 350


@pytest.mark.parametrize(("degree", "felt"), [(4, False), (6, True)])
def test_an_edge_of_skin_feels_its_middle_move_with_three_points(degree, felt):
    block = pressed_block()
    system = System(block.spaces, block.model, block.start, block.direction, degree)
    system.set_parameters(block.model.parameters)
    system.set_displacement(0.05)
    system.advance()
    spaces = system.spaces
    # In every edge xi^2 - 1/3, which vanishes at two points of Gauss: along the skin, 2/3 at its ends and -1/3 between.
    nodes = spaces.skin_space.tabulate_dof_coordinates()
    ends = np.isin(np.round(nodes[:, 0], 9), np.round(spaces.skin.geometry.x[:, 0], 9))
    system.unknown.x.array[spaces.trace[::2]] = 1e-4 * np.where(ends, 2 / 3, -1 / 3)
    before = system.nodal_contact_force().copy()
    system.unknown.x.array[:] = 0.0
    along = before[:, 0] - system.nodal_contact_force()[:, 0]
    assert (np.abs(along).max() > 1e-7) == felt
