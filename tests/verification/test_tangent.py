"""Taylor tests: the tangent is the residual's derivative, to second order, wherever contact is."""

from __future__ import annotations

import numpy as np
import pytest
from making_derivatives import taylor_orders
from making_mechanics import at_skin, fixed_steps, nodal, press, pressed_block

from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.solve.newton import NewtonSolver

STATES = [
    pytest.param("displacement", "stiff", "rough"),
    pytest.param("mixed", "stiff", "rough"),
    pytest.param("mixed", "stiff", "frictionless"),
    pytest.param("mixed", "exponential", "coulomb"),
    pytest.param("displacement", "exponential", "rough", marks=pytest.mark.slow),
    pytest.param("displacement", "stiff", "coulomb", marks=pytest.mark.slow),
]


def _within_a_step(formulation: str, normal: str, tangential: str) -> System:
    """Return a system in the midst of a step: off equilibrium, with points old and new."""
    contact = ContactSettings(normal, tangential, onset=0.02, friction=0.15)
    system = pressed_block(formulation, contact, direction=(0.28, -0.96))
    report = press(system, NewtonSolver(system), [1.5], fixed_steps(0.5))
    assert report.complete
    system.set_displacement(1.9)
    # A guess of the motion, so that points come into contact but none is at its solution.
    nodes, dofs = nodal(system)
    dent = np.exp(-((nodes[:, 0] / 6.5) ** 2)) * (1 + nodes[:, 1] / 20)
    system.unknown.x.array[dofs] += 0.4 * dent[:, None] * system.direction
    system.assemble_residual()
    return system


@pytest.mark.parametrize("formulation, normal, tangential", STATES)
def test_the_remainder_is_of_second_order(formulation, normal, tangential):
    system = _within_a_step(formulation, normal, tangential)
    orders = taylor_orders(system)
    print(orders)
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_the_states_hold_every_kind_of_contact():
    """Old and new points under rough contact; sticking and slipping ones under friction."""
    system = _within_a_step("mixed", "exponential", "coulomb")
    domain, variables = system.skin.domain, system.skin.history.variables
    friction = system.model.term("friction")
    history = {name: variables[f"friction.{name}"] for name in ("anchor", "touching")}
    touched = variables["friction.touching"].x.array > 0.5
    touching = at_skin(system, friction.updated(domain, history)["touching"]) > 0.5
    assert (touching & touched).any() and (touching & ~touched).any()
    slip = np.linalg.norm(at_skin(system, friction.slip(domain, history)), axis=1)
    law = domain.symbols.of("friction", friction.law)
    pressure = friction.normal.pressure(domain)
    traction = at_skin(system, law.traction(friction.slip(domain, history), pressure))
    elastic = np.linalg.norm(traction, axis=1) / 0.2
    sliding = touching & (slip > 1.01 * elastic)
    sticking = touching & (slip > 0) & (slip < 1.0001 * elastic)
    assert sliding.any() and sticking.any()


def test_the_tangent_is_symmetric_without_friction():
    system = _within_a_step("mixed", "stiff", "frictionless")
    K = system.assemble_tangent()
    difference = K.copy()
    difference.axpy(-1.0, K.transpose())
    assert difference.norm() < 1e-12 * K.norm()
