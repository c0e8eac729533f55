"""What goes in at the skin comes out at the bones: forces, virtual work and energy."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from making_mechanics import FORMULATIONS, fixed_steps, press, pressed_block

from legfem.fem.compiled import compiled
from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.terms import Tissue
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import NewtonSettings


def _pressed(formulation: str, tangential: str, depth: float = 3.0) -> System:
    contact = ContactSettings("stiff", tangential, onset=0.02)
    system = pressed_block(formulation, contact, direction=(0.28, -0.96))
    assert press(system, NewtonSolver(system), [depth], fixed_steps(0.5)).complete
    return system


def _relative(a, b) -> float:
    return float(np.linalg.norm(np.asarray(a) - b) / np.linalg.norm(b))


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("tangential", ["rough", "frictionless"])
def test_contact_force_and_bone_reaction_are_opposite(formulation, tangential):
    balance = _pressed(formulation, tangential).balance()
    assert _relative(-balance.bone_reaction, balance.contact_force) < 1e-8
    assert balance.contact_force @ [0.28, -0.96] > 0


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("tangential", ["rough", "frictionless"])
def test_the_works_of_contact_and_stress_are_equal(formulation, tangential):
    balance = _pressed(formulation, tangential).balance()
    assert balance.internal_work > 0
    assert _relative(balance.contact_work, balance.internal_work) < 1e-8


def test_leg_forces_and_works_balance(subject_3_test):
    errors = []

    def check(_: float) -> None:
        balance = subject_3_test.system.balance()
        errors.append(_relative(-balance.bone_reaction, balance.contact_force))
        errors.append(_relative(balance.contact_work, balance.internal_work))

    assert subject_3_test.solve(depth=12.0, on_step=check).report.complete
    print(max(errors))
    assert max(errors) < 1e-8


def _potential(system: System):
    """Return a function that gives the energy of tissue and contact (N mm per mm)."""
    body, skin = system.body.domain, system.skin.domain
    tissue = sum(
        term.energy_density(body, body.deformation_gradient) * body.regions[term.region]
        for term in system.model.terms
        if isinstance(term, Tissue)
    )
    contact = system.model.term("contact")
    law = skin.symbols.of("contact", contact.law)
    h, w, k = -contact.indenter.gap(skin.relative_position), law.width, law.stiffness
    rounded = k * ufl.max_value(h + w, 0) ** 3 / (12 * w)
    density = ufl.conditional(ufl.gt(h, w), k * h**2 / 2 + k * w**2 / 6, rounded)
    forms = compiled(tissue), compiled(density * skin.measure)
    return lambda: sum(fem.assemble_scalar(form) for form in forms)


def test_the_force_is_the_derivative_of_the_energy():
    """F = dE/dd without friction, by central differences over a thousandth of a millimetre."""
    contact = ContactSettings("stiff", "frictionless", onset=0.02)
    system = pressed_block("mixed", contact, direction=(0.28, -0.96))
    potential = _potential(system)
    force, energy = {}, {}

    def record(displacement: float) -> None:
        force[displacement] = system.force()
        energy[displacement] = potential()

    depths, step = (0.7, 1.4, 2.0), 1e-3
    targets = [depth + shift for depth in depths for shift in (-step, 0.0, step)]
    solver = NewtonSolver(system, NewtonSettings(relative_tolerance=1e-11))
    assert press(system, solver, targets, fixed_steps(0.5), on_step=record).complete
    for depth in depths:
        slope = (energy[depth + step] - energy[depth - step]) / (2 * step)
        print(depth, slope / force[depth] - 1)
        assert slope == pytest.approx(force[depth], rel=1e-6)
