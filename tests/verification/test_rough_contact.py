"""Rough contact enforced by a penalty: slip, penetration, and what they cost in force."""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import COARSE, at_skin, subject_3

from legfem.experiments.experiment import Solved
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.mechanics.contact import ContactSettings
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.settings import NewtonSettings

# Rounding of positions (1e-14 mm) times such a penalty is far above the usual tolerance.
NO_SLIP = PlaneStrainSettings(
    contact=ContactSettings(stiffness=2e7, onset=1e-4),
    newton=NewtonSettings(relative_tolerance=1e-6, max_factorisations=30),
    defences=False,
)


def _slip_and_penetration(test: PlaneStrainIndentation) -> tuple[float, float]:
    """Return the largest slip of a touching point and the largest overclosure (mm)."""
    system = test.system
    term, domain = system.model.term("friction"), system.skin.domain
    variables = system.skin.history.variables
    history = {name: variables[f"friction.{name}"] for name in ("anchor", "touching")}
    slip = np.linalg.norm(at_skin(system, term.slip(domain, history)), axis=1)
    gap = at_skin(system, term.normal.indenter.gap(domain.relative_position))
    touching = gap < test.settings.contact.onset
    assert touching.any() and (slip[~touching] == 0).all()
    return float(slip.max()), float(-gap.min())


def _pressed(settings: PlaneStrainSettings, depth: float) -> tuple[Solved, np.ndarray, np.ndarray]:
    """Return the solution with slip and penetration at every step."""
    test = PlaneStrainIndentation(*subject_3(), settings)
    seen = []
    solved = test.solve(depth=depth, on_step=lambda _: seen.append(_slip_and_penetration(test)))
    assert solved.report.complete, solved.report
    print(settings.contact, solved.report, "slip, penetration", np.max(seen, axis=0))
    return solved, *np.array(seen).T


def _with(mesh: SectionMeshSettings, **contact) -> PlaneStrainSettings:
    return PlaneStrainSettings(mesh=mesh, contact=ContactSettings(**contact))


def test_slip_and_penetration_fall_with_the_penalty():
    _, slip, penetration = _pressed(_with(COARSE, stiffness=1000.0), 8.0)
    _, less_slip, less_penetration = _pressed(_with(COARSE, stiffness=4000.0), 8.0)
    assert penetration.max() < 0.05
    assert less_slip.max() < 0.4 * slip.max()
    assert less_penetration.max() < 0.4 * penetration.max()


@pytest.mark.slow
def test_no_touching_point_slips():
    _, slip, penetration = _pressed(NO_SLIP, 30.0)
    assert slip.max() < 1e-6 * subject_3()[1].radius
    assert penetration.max() < 1e-4


@pytest.mark.slow
def test_a_contact_four_times_stiffer_changes_the_force_by_less_than_half_a_percent():
    depths = np.arange(2.0, 30.01, 0.5)
    default, _, penetration = _pressed(PlaneStrainSettings(), 30.0)
    stiffer, _, _ = _pressed(PlaneStrainSettings(contact=ContactSettings(stiffness=4000.0)), 30.0)
    change = stiffer.curve(depths) / default.curve(depths) - 1
    print(f"largest change {np.abs(change).max():.2%}, penetration {penetration.max():.3f} mm")
    assert np.abs(change).max() < 5e-3
    assert penetration.max() < 0.05


@pytest.mark.slow
def test_the_default_contact_is_as_good_as_no_slip():
    depths = np.arange(2.0, 30.01, 0.5)
    default, exact = _pressed(PlaneStrainSettings(), 30.0)[0], _pressed(NO_SLIP, 30.0)[0]
    change = exact.curve(depths) / default.curve(depths) - 1
    print(f"largest change {np.abs(change).max():.2%}")
    assert np.abs(change).max() < 5e-3


@pytest.mark.slow
def test_abaqus_exponential_law_gives_the_same_curve():
    depths = np.arange(2.0, 30.01, 0.5)
    default = _pressed(PlaneStrainSettings(), 30.0)[0]
    exponential = PlaneStrainSettings(contact=ContactSettings(normal="exponential"))
    change = _pressed(exponential, 30.0)[0].curve(depths) / default.curve(depths) - 1
    print(f"largest change {np.abs(change).max():.2%}")
    assert np.abs(change).max() < 5e-3
