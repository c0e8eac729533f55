"""Viscoelasticity: null, tangent, relaxation in closed form, and sensitivities."""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem
from making_derivatives import forces, taylor_orders, worst_error
from making_mechanics import block, boundary_pinned, free_of_contact, nodal, one_tissue, pressed_block

from legfem.fem.system import System
from legfem.mechanics.terms import Viscoelasticity
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.settings import StepSettings
from legfem.solve.stepping import follow

TISSUES = one_tissue(1e-3, 28.0, C20=0.5e-3)
SMALL = block(np.linspace(-20, 20, 11), np.linspace(-20, 0, 6))
HELD = Protocol.ramp_and_hold(2.0, rate=1.0, hold=8.0)


def _branch(ratio: float = 0.0, time: float = 3.0, branch: str = "") -> Viscoelasticity:
    return Viscoelasticity("deep", TISSUES.deep, ratio, time, branch)


@pytest.fixture(scope="module")
def system() -> System:
    return pressed_block("mixed", tissues=TISSUES, meshed=SMALL, mechanisms=[_branch(0.8)])


def _values(system: System, **changed: float) -> dict[str, float]:
    more = {f"deep.viscoelasticity.{name}": value for name, value in changed.items()}
    return {**system.model.parameters, **more}


def test_it_vanishes_at_its_null(system):
    elastic = pressed_block("mixed", tissues=TISSUES, meshed=SMALL)
    cycle = Protocol.cycle(2.0, rate=1.0, hold=8.0)
    without = forces(elastic, elastic.model.parameters, cycle, 0.5)
    null = forces(system, _values(system, ratio=0.0), cycle, 0.5)
    np.testing.assert_allclose(null, without, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("formulation", ["displacement", "mixed"])
def test_the_tangent_is_the_residual_s_derivative(formulation):
    system = pressed_block(formulation, meshed=SMALL, mechanisms=[_branch(0.8), _branch(2, 1, "2")])
    assert follow(system, NewtonSolver(system), Protocol.ramp(1.5, rate=1.0)).complete
    system.set_displacement(1.9)
    system.set_time(1.9, 0.4)
    orders = taylor_orders(system)
    print(orders)
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def _sheared(terms: list[Viscoelasticity]) -> System:
    plain = free_of_contact(block([0, 1], [0, 1]), TISSUES, "displacement", terms)
    pinned = boundary_pinned(plain.spaces)
    return System(pinned, plain.model, np.array([0.0, 1e3]), np.array([0.0, -1.0]))


def _nodal_forces(system: System) -> np.ndarray:
    found = fem.Function(system.spaces.space)
    fem.assemble_vector(found.x.array, system.body.residual)
    return found.x.array.copy()


def _held_after(system: System, gradient: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Deform at once, hold, and return the nodal forces at times."""
    system.reset()
    nodes, dofs = nodal(system)
    system.unknown.x.array[dofs] = nodes @ gradient.T
    now, found = 0.0, []
    for time in times:
        system.set_time(time, time - now)
        found.append(_nodal_forces(system))
        system.advance()
        now = time
    return np.array(found)


@pytest.mark.parametrize("gradient", [[[0, 0.6], [0, 0]], [[0.25, 0], [0, -0.2]]], ids=["simple shear", "stretch"])
def test_a_held_shape_relaxes_exponentially(gradient):
    """J = 1: all of the stress is of distortion, 1 + sum of ratio exp(-t/tau) times what lasts."""
    terms = [_branch(0.7, 3.0), _branch(1.9, 0.4, "2")]
    times = np.array([1e-9, 0.1, 0.5, 3.0, 10.0, 60.0])
    relaxing = _held_after(_sheared(terms), np.array(gradient), times)
    lasting = _held_after(_sheared([]), np.array(gradient), times[:1])[0]
    expected = 1 + 0.7 * np.exp(-times / 3) + 1.9 * np.exp(-times / 0.4)
    error = relaxing / expected[:, None] - lasting
    print(np.abs(error).max() / np.abs(lasting).max())
    assert np.abs(error).max() < 1e-8 * np.abs(lasting).max()


def test_a_small_shear_at_a_constant_rate_follows_the_closed_form():
    """1 + ratio tau/t (1 - exp(-t/tau)) of the elastic stress, whatever the steps."""
    system, elastic = _sheared([_branch(0.7)]), _sheared([])
    system.reset()
    nodes, dofs = nodal(system)
    now = 0.0
    for time in (0.2, 1.0, 4.0, 12.0):
        for tested in (system, elastic):
            tested.unknown.x.array[dofs] = nodes @ np.array([[0, 1e-6 * time], [0, 0]]).T
        system.set_time(time, time - now)
        ratio = np.linalg.norm(_nodal_forces(system)) / np.linalg.norm(_nodal_forces(elastic))
        assert ratio == pytest.approx(1 + 0.7 * 3 / time * (1 - np.exp(-time / 3)), rel=1e-6)
        system.advance()
        now = time


def test_sensitivities_are_exact_along_ramp_and_hold(system):
    names = ["deep.C10", "deep.C20", "deep.viscoelasticity.ratio"]
    names.append("deep.viscoelasticity.relaxation_time")
    assert worst_error(system, _values(system), names, HELD, 0.5) < 1e-5


def test_the_sensitivity_at_the_null_is_there(system):
    """What a diagnosis needs: the signature of an effect that the model has but doesn't use."""
    names = ["deep.viscoelasticity.ratio"]
    assert worst_error(system, _values(system, ratio=0.0), names, HELD, 0.5) < 1e-5


def test_the_force_depends_on_the_rate_relaxes_and_is_lost_at_lift_off(system):
    system.set_parameters(_values(system))
    peaks = []
    for rate in (0.1, 10.0):
        seen = []
        protocol = Protocol.cycle(2.0, rate=rate, hold=8.0, unloading_rate=1.0)
        report = follow(
            system,
            NewtonSolver(system),
            protocol,
            StepSettings(largest=0.5),
            lambda now, at, seen=seen: seen.append((now, at, system.force())),
        )
        assert report.complete, report
        time, at, force = np.array(seen).T
        held = (at == 2.0) & (time > time[at == 2.0][0])
        assert (np.diff(force[held]) < 0).all()
        assert force[-1] == 0.0
        peaks.append(force[at == 2.0][0])
    assert 1.3 < peaks[1] / peaks[0] < 1.8
