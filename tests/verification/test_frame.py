"""The same test seen from another side: nothing depends on where the leg lies."""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import COARSE, FORMULATIONS, block, fixed_steps, leg_model, one_tissue, press, subject_3

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.mechanics.contact import ContactSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import NewtonSettings

RADIUS = 8.0


def _rotation(degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s], [s, c]])


def _forces(formulation: str, Q: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Press a turned and shifted block; return the force vectors in the block's own frame."""
    contact = ContactSettings(onset=0.02)
    meshed = block(form=lambda x: x @ Q.T + shift)
    model = leg_model(one_tissue(1e-3, 28.0, C20=0.5e-3), RADIUS, contact, 0.2, formulation)
    system = System(
        build_spaces(*meshed, formulation), model, Q @ np.array([0.0, RADIUS]) + shift, Q @ np.array([0.28, -0.96])
    )
    forces = []
    solver = NewtonSolver(system, NewtonSettings(relative_tolerance=1e-11))
    report = press(
        system, solver, [2.0, 1.0], fixed_steps(0.5), lambda _: forces.append(system.balance().contact_force @ Q)
    )
    assert report.complete
    return np.array(forces)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_turned_and_shifted_block_gives_turned_forces(formulation):
    upright = _forces(formulation, np.eye(2), np.zeros(2))
    turned = _forces(formulation, _rotation(127.0), np.array([30.0, -80.0]))
    error = np.abs(turned - upright).max() / np.abs(upright).max()
    print(error)
    assert error < 1e-9


def test_a_turned_leg_is_as_stiff():
    """Here the leg is meshed anew, so that the curves agree as well as meshes do."""
    section, indenter, tissues = subject_3()
    Q = _rotation(200.0)
    turned = LegSection.of_parts(
        {part: section.contour(part) @ Q.T for part in section.parts}, section.fascia_thickness
    )
    moved = Indenter(indenter.radius, indenter.length, Q @ indenter.aim, indenter.direction_deg + 200.0)
    settings = PlaneStrainSettings(mesh=COARSE)
    depths = np.array([4.0, 7.0, 10.0])
    a, b = (
        PlaneStrainIndentation(one, press_at, tissues, settings).solve(depth=10.0).curve(depths)
        for one, press_at in ((section, indenter), (turned, moved))
    )
    print(b / a - 1)
    np.testing.assert_allclose(b, a, rtol=1e-3)
