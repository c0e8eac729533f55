"""Newton's method for one step: how fast, and what it says when it fails."""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import fixed_steps, nodal, press, pressed_block

from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import NewtonSettings


def _at_one_millimetre(settings: NewtonSettings | None = None) -> tuple[System, NewtonSolver]:
    """A block pressed 1 mm, and its solver."""
    system = pressed_block("mixed", ContactSettings(onset=0.02))
    solver = NewtonSolver(system, settings)
    assert press(system, solver, [1.0], fixed_steps(0.5)).complete
    return system, solver


class Watched(NewtonSolver):
    """Notes the residual's norm of every iteration."""

    norms: list[float]

    def _converged(self, snes, iteration, norms) -> int:
        self.norms = [] if iteration == 0 else self.norms
        self.norms.append(norms[2])
        return super()._converged(snes, iteration, norms)


def test_convergence_is_quadratic_with_a_fresh_tangent():
    system, _ = _at_one_millimetre()
    system.set_displacement(1.02)
    solver = Watched(system, NewtonSettings(reuse=0.0, relative_tolerance=1e-12))
    assert solver.solve().converged
    falls = np.log(np.array(solver.norms) / solver.norms[0])
    inner = [k for k in range(1, len(falls)) if -23 < falls[k] < -2]
    assert len(inner) >= 2
    print(np.exp(falls))
    assert falls[inner[-1]] / falls[inner[-2]] > 1.7


def test_factors_are_used_again_while_that_pays():
    outcomes = []
    for reuse in (0.0, 0.3):
        system, solver = _at_one_millimetre(NewtonSettings(reuse=reuse))
        system.set_displacement(1.2)
        outcomes.append(solver.solve())
    fresh, reused = outcomes
    assert fresh.converged and reused.converged
    assert fresh.factorisations == fresh.iterations
    assert reused.factorisations < fresh.factorisations
    assert reused.iterations >= reused.factorisations


def test_mixing_takes_fewer_iterations_to_the_same_state():
    found = []
    for mixing in (0, 10):
        system, solver = _at_one_millimetre(NewtonSettings(reuse=0.9, mixing=mixing))
        system.set_displacement(1.2)
        found.append((solver.solve(), system.force()))
    (plain, force), (mixed, same) = found
    assert plain.converged and mixed.converged
    assert mixed.iterations < 0.5 * plain.iterations
    assert same == pytest.approx(force, rel=1e-8)


def test_a_converged_state_is_in_equilibrium():
    system, solver = _at_one_millimetre()
    system.set_displacement(1.3)
    outcome = solver.solve()
    assert outcome.converged and outcome.reason == "the residual is small"
    system.assemble_residual()
    assert system.residual_norm() == pytest.approx(outcome.residual, rel=1e-3)
    assert system.residual_norm() < 1e-9 * system.contact_scale() + 1e-13
    assert system.minimum_volume_ratio() > 0


def test_too_few_factorisations_are_a_value():
    system, _ = _at_one_millimetre()
    system.set_displacement(1.9)
    solver = NewtonSolver(system, NewtonSettings(max_factorisations=1, relative_tolerance=1e-18))
    outcome = solver.solve()
    assert not outcome.converged
    assert outcome.reason == "the residual stays large"
    assert outcome.residual > 0


def test_an_impossible_step_is_not_accepted():
    """In one step the indenter is to sink into the block by half of its height."""
    system, solver = _at_one_millimetre()
    system.set_displacement(10.0)
    outcome = solver.solve()
    assert not outcome.converged
    assert outcome.reason != "the residual is small"


def test_an_inverted_start_is_not_accepted():
    system, solver = _at_one_millimetre()
    nodes, dofs = nodal(system)
    free = ~np.isin(dofs[:, 0], system.spaces.pinned)
    system.unknown.x.array[dofs[free, 1]] = -3 * (nodes[free, 1] + 20)
    assert system.minimum_volume_ratio() < 0
    outcome = solver.solve()
    assert not outcome.converged or system.minimum_volume_ratio() > 0


def test_the_least_volume_ratio_is_that_of_the_worst_point():
    system = pressed_block()
    nodes, dofs = nodal(system)
    system.unknown.x.array[dofs[:, 1]] = 0.25 * (nodes[:, 1] + 20)
    assert system.minimum_volume_ratio() == pytest.approx(1.25, rel=1e-12)
    system.unknown.x.array[:] = np.nan
    assert system.minimum_volume_ratio() == -np.inf


def test_the_linear_solver_solves_the_tangent():
    system, solver = _at_one_millimetre()
    solver.refactor()
    K = system.assemble_tangent()
    right, solution = K.createVecs()
    right.setRandom()
    solver.linear_solver.solve(right, solution)
    residual = right.duplicate()
    K.mult(solution, residual)
    residual.axpy(-1.0, right)
    assert residual.norm() < 1e-9 * right.norm()
