"""Sensitivities of the force against central differences, along paths with memory."""

from __future__ import annotations

import numpy as np
import pytest
from making_derivatives import PRECISE, sensitivities, worst_error
from making_mechanics import COARSE, fixed_steps, pressed_block, subject_3

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.mechanics.contact import ContactSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.sensitivity import SensitivityTracker
from legfem.solve.stepping import follow

UP_AND_DOWN = Protocol.through((2.0, 1.25), rate=1.0)


def test_sensitivities_of_a_block_pressed_and_released():
    system = pressed_block("mixed", ContactSettings(onset=0.02), direction=(0.28, -0.96))
    names = ["deep.C10", "deep.C20", "deep.D1", "contact.stiffness", "friction.stiffness"]
    assert worst_error(system, system.model.parameters, names, UP_AND_DOWN, 0.2) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["displacement", "mixed"])
@pytest.mark.parametrize("tangential", ["coulomb", "frictionless"])
def test_sensitivities_with_other_tangents(formulation, tangential):
    """Coulomb's anchors move, so their own derivatives count."""
    contact = ContactSettings("exponential", tangential, onset=0.02, friction=0.1)
    system = pressed_block(formulation, contact, direction=(0.28, -0.96))
    names = ["deep.C10", "deep.C20", "contact.p0"]
    if tangential == "coulomb":
        names += ["friction.friction", "friction.stiffness"]
    # A greater change lets points slip that stuck: the force has a kink there.
    change = 1e-5
    assert worst_error(system, system.model.parameters, names, UP_AND_DOWN, 0.2, change) < 1e-4


def test_sensitivities_of_a_leg():
    test = PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(mesh=COARSE))
    values = dict(test.solve(depth=0.5).parameters)  # with the contact's stiffness
    names = ["deep.C10", "deep.C20", "superficial.C10", "fascia.C10"]
    assert worst_error(test.system, values, names, Protocol.ramp(8.0, rate=1.0), 1.0) < 1e-4


@pytest.mark.parametrize("normal", ["stiff", "exponential"])
def test_the_penalty_s_dependence_on_the_tissue_counts(normal):
    """A soft contact, whose penalty grows with the tissue's stiffness as the settings say."""
    settings = PlaneStrainSettings(
        mesh=COARSE, contact=ContactSettings(normal, stiffness=10.0, onset=0.05), newton=PRECISE, steps=fixed_steps(0.5)
    )
    test = PlaneStrainIndentation(*subject_3(), settings)
    values = {"deep.C10": 0.7e-3, "deep.C20": 0.8e-3, "superficial.C10": 2e-3, "fascia.C10": 0.1}
    exact = test.solve(values, 3.0, tuple(values)).path
    for name, value in values.items():
        ahead, behind = (test.solve({**values, name: value * (1 + by)}, 3.0).path.force for by in (1e-4, -1e-4))
        difference = (ahead - behind) / (2e-4 * value)
        error = np.abs(exact.sensitivities[name] - difference).max() / np.abs(difference).max()
        print(name, f"{error:.1e}")
        assert error < 1e-5


def test_history_counts():
    """Leaving the anchors' derivatives out is wrong by far more than the tolerance above."""
    system = pressed_block("mixed", ContactSettings(onset=0.02), direction=(0.28, -0.96))
    names = ["friction.stiffness"]
    exact = sensitivities(system, names, UP_AND_DOWN, 0.25)[-1, 0]
    tracker, rows = SensitivityTracker(system, names), []
    solver = NewtonSolver(system, PRECISE)

    def forgetful(*_: float) -> None:
        tracker.reset()
        rows.append(tracker.step(solver)[0])

    follow(system, solver, UP_AND_DOWN, fixed_steps(0.25), forgetful)
    assert abs(rows[-1] / exact - 1) > 0.5


def test_stiffnesses_scale_the_force():
    """All stiffnesses times k is the force times k, so sum m dF/dm = F (Euler)."""
    system = pressed_block("mixed", ContactSettings(onset=0.02))
    values = system.model.parameters
    names = ["deep.C10", "deep.C20", "deep.D1", "contact.stiffness", "friction.stiffness"]
    rows = sensitivities(system, names, Protocol.ramp(2.0, rate=1.0), 0.5)
    weights = np.array([values[name] for name in names]) * [1, 1, -1, 1, 1]
    assert rows[-1] @ weights == pytest.approx(system.force(), rel=1e-7)


def test_an_unknown_parameter_is_refused():
    with pytest.raises(KeyError, match="muscle"):
        SensitivityTracker(pressed_block(), ["muscle.C10"])
