"""Steps: their sizes, what happens when one fails, and the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from making_mechanics import COARSE, fixed_steps, press, pressed_block, subject_3

from legfem.experiments import plane_strain
from legfem.experiments.experiment import Solved
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.model import Body
from legfem.solve.newton import Damping, NewtonSolver
from legfem.solve.path import NewtonOutcome, SolveReport, Step
from legfem.solve.protocol import Protocol
from legfem.solve.settings import NewtonSettings, StepSettings
from legfem.solve.stepping import follow


class FailingSolver(NewtonSolver):
    """Fails where it is told to, and leaves rubbish behind as a failed solve does."""

    def __init__(self, system: System, fails) -> None:
        super().__init__(system)
        self._fails, self._at = fails, []
        move = system.set_displacement
        system.set_displacement = lambda at: (self._at.append(at), move(at))[1]

    def solve(self, damping: Damping | None = None) -> NewtonOutcome:
        if self._fails(self._at[-1]):
            self._system.unknown.x.array[:] = 1e6
            return NewtonOutcome(False, "told to fail", 7, 9, 1.0)
        return super().solve(damping)


@pytest.fixture(scope="module")
def stuck() -> tuple[SolveReport, System, list[tuple[float, np.ndarray, float]]]:
    """A block that cannot be pressed beyond 1.1 mm."""
    system = pressed_block()
    accepted = []

    def record(at: float) -> None:
        accepted.append((at, system.unknown.x.array.copy(), system.force()))

    solver = FailingSolver(system, lambda at: at > 1.1)
    return press(system, solver, [2.0], on_step=record), system, accepted


def test_giving_up_is_a_value_with_depth_and_reason(stuck):
    report, _, accepted = stuck
    assert not report.complete
    assert report.target == 2.0
    assert report.reached == accepted[-1][0]
    smallest, cut = StepSettings().smallest, StepSettings().cut
    assert 1.1 - smallest / cut < report.reached <= 1.1
    assert report.reason == "no step above 0.001 mm converges: told to fail"
    assert "stopped: no step above" in str(report) and "of 2.00 mm" in str(report)


def test_a_failed_step_leaves_the_last_good_state(stuck):
    _, system, accepted = stuck
    _, state, force = accepted[-1]
    np.testing.assert_array_equal(system.unknown.x.array, state)
    assert system.force() == pytest.approx(force, rel=1e-12)
    balance = system.balance()
    np.testing.assert_allclose(-balance.bone_reaction, balance.contact_force, rtol=1e-8, atol=1e-12)


def test_every_step_is_reported(stuck):
    report, _, accepted = stuck
    assert all(isinstance(step, Step) for step in report.steps)
    assert [step.displacement for step in report.steps if step.converged] == [at for at, _, _ in accepted]
    assert report.rejected == sum(step.reason == "told to fail" for step in report.steps) > 2
    assert report.factorisations == sum(step.factorisations for step in report.steps)
    assert report.seconds > 0 and report.unknowns == stuck[1].spaces.unknowns
    for step in report.steps:
        if step.converged:
            assert step.reason == "the residual is small" and step.residual < 1e-9


def test_steps_are_cut_after_failures_and_grow_again():
    """A place that only small steps pass; the curve beyond it is the undisturbed one."""
    settings = StepSettings(first=0.5, largest=0.5)
    system = pressed_block()
    last = [0.0]

    def fails(at: float) -> bool:
        difficult = 0.9 < at < 1.2 and at - last[0] > 0.15
        if not difficult:
            last[0] = at
        return difficult

    report = press(system, FailingSolver(system, fails), [3.0], settings)
    assert report.complete and report.rejected > 0
    sizes = [step.size for step in report.steps if step.converged]
    assert min(sizes) <= 0.2 and sizes[-1] > 0.4
    disturbed = system.force()
    smooth = pressed_block()
    assert press(smooth, NewtonSolver(smooth), [3.0], settings).rejected == 0
    assert disturbed == pytest.approx(smooth.force(), rel=5e-3)


def test_steps_grow_where_newton_s_method_finds_it_easy():
    system = pressed_block()
    settings = StepSettings(first=0.1, largest=0.6, growth=2.0)
    report = press(system, NewtonSolver(system), [2.5], settings)
    sizes = [step.size for step in report.steps]
    assert sizes[0] == pytest.approx(0.1)
    assert max(sizes) <= 0.6 + 1e-12
    assert sizes[2] > 3 * sizes[0]


def test_targets_are_reached_exactly_and_in_order():
    system, seen = pressed_block(), []
    press(system, NewtonSolver(system), [0.8, 0.3, 1.0], fixed_steps(0.35), seen.append)
    assert [at for at in seen if at in (0.8, 0.3, 1.0)] == [0.8, 0.3, 1.0]
    assert np.abs(np.diff([0.0, *seen])).max() <= 0.35 + 1e-12


def test_pressing_starts_from_the_undeformed_state():
    system = pressed_block()
    solver = NewtonSolver(system)
    press(system, solver, [1.5], fixed_steps(0.5))
    first = system.force()
    press(system, solver, [2.0], fixed_steps(0.5))
    press(system, solver, [1.5], fixed_steps(0.5))
    assert system.force() == pytest.approx(first, rel=1e-12)


def test_a_protocol_is_followed_in_time():
    """Waypoints exactly; short steps where a hold starts; the clock goes with the indenter."""
    protocol = Protocol.cycle(1.5, rate=2.0, hold=30.0, unloading_rate=0.5)
    system, seen, clock = pressed_block(), [(0.0, 0.0)], []

    def record(time: float, displacement: float) -> None:
        seen.append((time, displacement))
        domain = system.body.domain
        clock.append((float(domain.time.value), float(domain.time_step.value)))

    settings = StepSettings(first=0.5, largest=0.5)
    report = follow(system, NewtonSolver(system), protocol, settings, record)
    assert report.complete and report.reached == report.target == 1.5
    time, displacement = np.array(seen).T
    assert set(protocol.time) <= set(time)
    np.testing.assert_allclose(displacement, protocol.displacement_at(time), atol=1e-12)
    np.testing.assert_array_equal(np.array(clock), np.column_stack([time[1:], np.diff(time)]))
    assert [step.time for step in report.steps] == list(time[1:])
    hold = time[(time >= protocol.time[1]) & (time <= protocol.time[2])]
    steps = np.diff(hold)
    assert steps[0] == pytest.approx(0.1)
    assert 8 < len(steps) < 25 and (np.diff(steps[:-2]) > 0).all()
    assert system.force() == 0.0


def test_a_hold_that_fails_is_told_in_seconds():
    system = pressed_block()
    solver = FailingSolver(system, lambda at: float(system.body.domain.time.value) > 3.0)
    report = follow(system, solver, Protocol.ramp_and_hold(1.0, rate=1.0, hold=10.0))
    assert not report.complete and report.reached == 1.0
    assert report.reason == "no step above 0.0001 s converges: told to fail"


def test_an_absurd_limit_gives_up_at_once():
    system = pressed_block()
    solver = NewtonSolver(system, NewtonSettings(max_factorisations=1, relative_tolerance=1e-18))
    report = press(system, solver, [2.0], StepSettings(first=1.0, smallest=0.2))
    assert (report.complete, report.reached) == (False, 0.0)
    assert "the residual stays large" in report.reason
    np.testing.assert_array_equal(system.unknown.x.array, 0.0)


def test_steps_that_fail_take_no_more_than_they_may():
    system = pressed_block()
    solver = FailingSolver(system, lambda at: at > 1.1)
    report = press(system, solver, [2.0], StepSettings(most_astray=10))
    failed = [step.factorisations for step in report.steps if not step.converged]
    assert failed == [7, 7] and report.reason == "14 factorisations were of steps that failed: told to fail"
    assert 0.5 < report.reached <= 1.1


# --- the second line of defence ---


@dataclass(frozen=True)
class Attempt:
    """What tells the attempts at one solution apart."""

    stiffness: float
    """Of the contact (MPa/mm)."""
    unknowns: int
    degree: int
    """Of the integration."""


def _solved(monkeypatch, reach: Callable[[Attempt], float], defences: bool) -> Solved:
    """Press subject 3 by 3 mm with a solver that fails beyond a depth (mm)."""

    class Limited(FailingSolver):
        def __init__(self, system: System, *_: object) -> None:
            super().__init__(system, lambda at: at > reach(self.attempt))
            domain = system.body.domain
            assert isinstance(domain, Body)
            self.attempt = Attempt(0.0, system.spaces.unknowns, domain.quadrature_degree)
            given = system.set_parameters

            def told(values: dict[str, float]) -> None:
                self.attempt = replace(self.attempt, stiffness=values["contact.stiffness"])
                given(values)

            system.set_parameters = told

    monkeypatch.setattr(plane_strain, "NewtonSolver", Limited)
    steps = StepSettings(first=0.5, smallest=0.2)
    settings = PlaneStrainSettings(mesh=COARSE, steps=steps, defences=defences)
    return PlaneStrainIndentation(*subject_3(), settings).solve(depth=3.0)


STIFF = 0.5 * ContactSettings().penalty({"deep.C10": 0.70e-3, "deep.C20": 0.80e-3, "superficial.C10": 2e-3}, 15.0)
"""Below subject 3's own contact and above the softer one (MPa/mm)."""


def _only_soft(attempt: Attempt) -> float:
    return 0.0 if attempt.stiffness > STIFF else np.inf


def test_a_softer_contact_is_tried_before_giving_up(monkeypatch):
    report = _solved(monkeypatch, _only_soft, defences=True).report
    assert report.complete and report.contact_stiffness_factor == 0.2
    first, well, other = report.earlier_attempts
    for attempt in (first, well, other):
        assert not attempt.complete and attempt.contact_stiffness_factor == 1.0
    assert first.unknowns == well.unknowns > other.unknowns, "the pressures' are missing"
    assert report.factorisations > sum(step.factorisations for step in report.steps)
    assert report.factorisations == sum(
        step.factorisations for one in (report, first, well, other) for step in one.steps
    )


def _only_without_pressures(attempt: Attempt) -> float:
    _UNKNOWNS.append(attempt.unknowns)
    return 2.0 if attempt.unknowns == _UNKNOWNS[0] and attempt.stiffness > STIFF else np.inf


_UNKNOWNS: list[int] = []


def test_more_points_of_integration_are_tried_first(monkeypatch):
    report = _solved(monkeypatch, lambda one: np.inf if one.degree > 4 else 2.0, True).report
    assert report.complete and report.compromise == "more points of integration than elsewhere"
    (first,) = report.earlier_attempts
    assert first.reached <= 2.0 and report.unknowns == first.unknowns
    assert "tissue is drawn out" in first.reason and " mm" in first.reason


def test_a_form_without_pressures_is_tried_next_and_its_force_is_alike(monkeypatch):
    _UNKNOWNS.clear()
    report = _solved(monkeypatch, _only_without_pressures, defences=True).report
    assert report.complete and report.contact_stiffness_factor == 1.0
    assert report.compromise == "a form without pressures of its own"
    first, _ = report.earlier_attempts
    assert first.reached <= 2.0 and report.unknowns < first.unknowns


def test_a_form_without_pressures_that_is_too_stiff_is_refused(monkeypatch):
    _UNKNOWNS.clear()
    monkeypatch.setattr(plane_strain, "_SAME_FORCE", 1e-6)
    report = _solved(monkeypatch, _only_without_pressures, defences=True).report
    assert report.compromise == "a contact 5 times softer", "the next attempt went on"
    assert "without pressures the force is off by" in report.earlier_attempts[2].reason


def test_nothing_else_is_tried_once_the_work_is_too_much(monkeypatch):
    monkeypatch.setattr(plane_strain, "_MOST_WORK", 1)
    report = _solved(monkeypatch, _only_soft, defences=True).report
    assert not report.complete and report.earlier_attempts == ()
    assert "tissue is drawn out" in report.reason and report.factorisations > 1


def test_without_defences_the_first_failure_stands(monkeypatch):
    report = _solved(monkeypatch, _only_soft, defences=False).report
    assert not report.complete and report.reached < report.target
    assert report.earlier_attempts == () and report.contact_stiffness_factor == 1.0


@pytest.mark.parametrize("best", ["the first", "softer"])
def test_the_farthest_attempt_is_returned_where_none_is_complete(monkeypatch, best):
    monkeypatch.setattr(plane_strain, "_MOST_WORK", 1000)
    sizes: list[int] = []

    def reach(attempt: Attempt) -> float:
        sizes.append(attempt.unknowns)
        other_form = attempt.unknowns < sizes[0] or attempt.degree > 4
        if other_form and attempt.stiffness > STIFF:
            return 0.5
        return 2.0 if best == ("softer" if attempt.stiffness < STIFF else "the first") else 1.0

    solved = _solved(monkeypatch, reach, defences=True)
    report = solved.report
    assert not report.complete and len(report.earlier_attempts) == 3
    attempts = [report, *report.earlier_attempts]
    assert sorted(attempt.contact_stiffness_factor for attempt in attempts) == [0.2, 1, 1, 1]
    assert 1.0 < report.reached == max(attempt.reached for attempt in attempts)
    assert report.contact_stiffness_factor == (1.0 if best == "the first" else 0.2)
    assert solved.curve.depth == report.reached
    assert report.factorisations == sum(s.factorisations for a in attempts for s in a.steps)
