"""Creeping to an equilibrium that Newton's method doesn't find."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from making_mechanics import fixed_steps, press, pressed_block

from legfem.fem.system import System
from legfem.solve import newton
from legfem.solve.newton import RELAXED, Damping, NewtonSolver, RelaxationSettings, relax
from legfem.solve.path import NewtonOutcome
from legfem.solve.settings import NewtonSettings, StepSettings


class OnlyFromNearby(NewtonSolver):
    """Fails beyond 1 mm unless a damped step at that place has succeeded before."""

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self._at, self._near = [0.0], -1.0
        move = system.set_displacement
        system.set_displacement = lambda at: (self._at.append(at), move(at))[1]

    def solve(self, damping: Damping | None = None) -> NewtonOutcome:
        at = self._at[-1]
        if damping is None and 1.0 < at < 1.3 and at != self._near:
            self._system.unknown.x.array[:] = 1e6
            return NewtonOutcome(False, "told to fail", 7, 9, 1.0)
        outcome = super().solve(damping)
        if damping is not None and outcome.converged:
            self._near = at
        return outcome


def test_a_body_creeps_to_the_equilibrium_that_small_steps_reach():
    stepped, crept = pressed_block(), pressed_block()
    assert press(stepped, NewtonSolver(stepped), [1.0], fixed_steps(1.0)).complete
    crept.reset()
    crept.set_displacement(1.0)
    outcome = relax(crept, NewtonSolver(crept))
    assert outcome.converged and outcome.reason == RELAXED and outcome.residual < 1e-9
    assert outcome.factorisations > 3
    assert crept.force() == pytest.approx(stepped.force(), rel=1e-6)
    np.testing.assert_allclose(
        crept.unknown.x.array, stepped.unknown.x.array, atol=1e-6 * np.ptp(stepped.unknown.x.array)
    )


def test_a_damped_step_lies_between_its_anchor_and_the_equilibrium():
    system = pressed_block()
    solver = NewtonSolver(system)
    lengths = []
    for strength in (10.0, 1.0, 0.1):
        system.reset()
        system.set_displacement(0.5)
        assert solver.solve(Damping(system.unknown.x.array.copy(), strength)).converged
        moved = system.unknown.x.array[system.spaces.displacement_dofs]
        lengths.append(float(np.linalg.norm(moved)))
    system.reset()
    system.set_displacement(0.5)
    assert solver.solve().converged
    moved = system.unknown.x.array[system.spaces.displacement_dofs]
    assert lengths == sorted(lengths) and lengths[-1] < np.linalg.norm(moved)


def test_where_a_path_ends_the_walk_goes_on_beyond_only_if_asked():
    settings = StepSettings(first=0.4, smallest=0.1)
    system = pressed_block()
    stopped = press(system, OnlyFromNearby(system), [2.0], settings)
    assert not stopped.complete and stopped.reached <= 1.0
    system = pressed_block()
    asked = StepSettings(first=0.4, smallest=0.1, relaxes=True)
    report = press(system, OnlyFromNearby(system), [2.0], asked)
    assert report.complete
    jumps = [step for step in report.steps if step.reason == RELAXED]
    assert jumps and all(step.converged for step in jumps)
    smooth = pressed_block()
    press(smooth, NewtonSolver(smooth), [2.0], settings)
    assert system.force() == pytest.approx(smooth.force(), rel=5e-3)


def test_what_never_settles_is_given_up():
    system = pressed_block()
    system.reset()
    system.set_displacement(1.0)
    outcome = relax(system, NewtonSolver(system), RelaxationSettings(most=2))
    assert not outcome.converged and outcome.reason == "creeps on"


class Folding(NewtonSolver):
    """Never gets anywhere without damping stiffer than a strength; keeps the strengths that were tried."""

    def __init__(self, system: System, least: float) -> None:
        super().__init__(system)
        self._least, self.tried = least, []

    def solve(self, damping: Damping | None = None) -> NewtonOutcome:
        self.tried.append(0.0 if damping is None else damping.strength)
        found = self.tried[-1] > self._least
        return NewtonOutcome(found, "told", 1 if found else 5, 1, 0.0)


def test_a_creep_that_folds_faster_than_it_is_damped_is_given_up_at_once():
    system = pressed_block()
    system.set_displacement(1.0)
    solver = Folding(system, least=100.0)
    outcome = relax(system, solver)
    assert not outcome.converged and outcome.factorisations == 30
    assert solver.tried == pytest.approx([1e-3 * 4**k for k in range(6)]), "each four times as strong, and none above 4"


def test_a_creep_that_finds_nothing_takes_less_than_a_curves_work():
    system = pressed_block()
    system.set_displacement(1.0)
    solver, settings = Folding(system, least=0.01), RelaxationSettings()
    outcome = relax(system, solver)
    assert not outcome.converged and outcome.reason == "creeps on"
    assert settings.most <= outcome.factorisations < settings.most + 12
    after = [later / now for now, later in pairwise(solver.tried) if now <= 0.01]
    assert settings.most < 50 and after == pytest.approx([settings.raised] * len(after))


def test_without_damping_it_is_tried_again_only_where_a_tenth_of_the_residual_is_left(monkeypatch):
    system = pressed_block()
    solver, norms, tried = Folding(system, least=0.0), [0.6**k for k in range(50)], []
    left = iter(norms)
    monkeypatch.setattr(newton, "_norm", lambda _: tried.append(len(solver.tried)) or next(left))
    monkeypatch.setattr(system, "contact_scale", lambda: 1.0)
    relax(system, solver)
    plain = [k for k, strength in enumerate(solver.tried) if not strength]
    at = [norms[sum(when <= k for when in tried) - 1] for k in plain]
    assert len(at) > 1 and at[0] <= 0.01 and all(now <= 0.1 * was for was, now in pairwise(at))


def test_damping_follows_the_residual_within_bounds(monkeypatch):
    system = pressed_block()
    solver, given = Folding(system, least=0.0), RelaxationSettings(first=0.1, most=6)
    norms = iter([1.0, 2.0, 20.0, 10.0, 1.0, 1.0, 1.0])
    monkeypatch.setattr(newton, "_norm", lambda _: next(norms))
    monkeypatch.setattr(system, "contact_scale", lambda: 1.0)
    relax(system, solver, given)
    factors = [later / now for now, later in pairwise(solver.tried)]
    assert factors == pytest.approx([1.4, 2.0, 0.35, 0.25, 0.7])


def test_damping_stays_strong_enough_to_slow_what_is_unstable(monkeypatch):
    system = pressed_block()
    solver = Folding(system, least=0.0)
    monkeypatch.setattr(newton, "_norm", lambda _: 1.0)
    monkeypatch.setattr(system, "contact_scale", lambda: 1.0)
    relax(system, solver)
    assert min(solver.tried) == solver.tried[-1] == RelaxationSettings().weakest


def test_a_damped_step_is_given_up_sooner_than_a_plain_one():
    system = pressed_block()
    settings = NewtonSettings(
        damped_factorisations=1, damped_tolerance=0.0, relative_tolerance=1e-18, absolute_tolerance=1e-25
    )
    solver, spent = NewtonSolver(system, settings), []
    for strength in (1e-3, None):
        system.reset()
        system.set_displacement(1.0)
        damping = None if strength is None else Damping(system.unknown.x.array.copy(), strength)
        outcome = solver.solve(damping)
        spent.append(outcome.factorisations)
        assert not outcome.converged
    assert spent[0] < spent[1]
