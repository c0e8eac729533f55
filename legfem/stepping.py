"""Pressing the indenter in: adaptive steps, and a typed report of every one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from legfem.newton import NewtonOutcome, NewtonSolver
from legfem.system import System
from legfem.units import FloatArray


@dataclass(frozen=True)
class StepSettings:
    """Sizes of the steps of displacement (mm) and how they adapt.

    A step grows by ``growth`` when Newton needed at most ``easy`` factorisations, shrinks when it
    needed ``hard`` or more, and is cut by ``cut`` when it failed.
    """

    first: float = 0.2
    largest: float = 1.5
    smallest: float = 1e-3
    growth: float = 1.6
    shrink: float = 0.7
    cut: float = 0.4
    easy: int = 5
    hard: int = 8


@dataclass(frozen=True)
class Step:
    """One attempted step."""

    displacement: float
    """At its end (mm)."""
    size: float
    """mm."""
    accepted: bool
    reason: str
    factorisations: int
    iterations: int
    residual: float
    """N/mm in 2D, N in 3D."""


@dataclass(frozen=True)
class SolveReport:
    """What a solution took and how far it came."""

    reached: float
    """Greatest displacement (mm)."""
    target: float
    """Greatest displacement asked for (mm)."""
    complete: bool
    """Whether the whole path was followed."""
    reason: str
    """Why it stopped."""
    steps: tuple[Step, ...] = ()
    seconds: float = 0.0
    unknowns: int = 0
    contact_stiffness_factor: float = 1.0
    """1 unless the contact had to be softened to go on."""
    earlier_attempts: tuple[SolveReport, ...] = ()

    @property
    def factorisations(self) -> int:
        """Of all steps, accepted or not, and of all attempts."""
        own = sum(step.factorisations for step in self.steps)
        return own + sum(report.factorisations for report in self.earlier_attempts)

    @property
    def iterations(self) -> int:
        """Newton iterations of all steps."""
        return sum(step.iterations for step in self.steps)

    @property
    def rejected(self) -> int:
        """Number of rejected steps."""
        return sum(not step.accepted for step in self.steps)

    def __str__(self) -> str:
        """Return one line for a log."""
        end = "complete" if self.complete else f"stopped: {self.reason}"
        return (
            f"{self.reached:.2f} of {self.target:.2f} mm ({end}); {len(self.steps)} steps, "
            f"{self.rejected} rejected, {self.factorisations} factorisations, {self.seconds:.1f} s"
        )


@dataclass
class _Path:
    """The last converged states, for the predictor."""

    displacement: list[float] = field(default_factory=list)
    state: list[FloatArray] = field(default_factory=list)

    def add(self, displacement: float, state: FloatArray) -> None:
        self.displacement = [*self.displacement[-1:], displacement]
        self.state = [*self.state[-1:], state]

    def predict(self, displacement: float) -> FloatArray:
        if len(self.state) < 2:
            return self.state[-1]
        (d0, d1), (u0, u1) = self.displacement, self.state
        return u1 + (u1 - u0) * ((displacement - d1) / (d1 - d0))


def press(
    system: System,
    solver: NewtonSolver,
    targets: Sequence[float],
    settings: StepSettings | None = None,
    on_step: Callable[[float], None] | None = None,
) -> SolveReport:
    """Move the indenter through displacements, each reached exactly, from the undeformed state.

    Parameters
    ----------
    system, solver
        The model and its Newton solver; the system is reset first.
    targets
        Displacements (mm) where the motion turns or ends: one for loading, more for unloading and
        reloading.
    settings
        Of the steps.
    on_step
        Called after every accepted step with its displacement (mm), the system being in that state
        and its history not yet advanced.

    Returns
    -------
    SolveReport
        Giving up is part of it: a solution that stops short isn't an exception.
    """
    settings = settings or StepSettings()
    started = time.perf_counter()
    system.reset()
    path = _Path()
    path.add(0.0, system.unknown.x.array.copy())
    position, size, steps = 0.0, settings.first, []
    reason = "the target is reached"
    for target in targets:
        sign = np.sign(target - position)
        while abs(target - position) > 1e-9:
            length = _fitted(size, abs(target - position))
            end = position + sign * length
            outcome = _attempt(system, solver, path, end)
            steps.append(_step(end, length, outcome))
            if not outcome.converged:
                system.unknown.x.array[:] = path.state[-1]
                system.set_displacement(position)
                size = length * settings.cut
                if size < settings.smallest:
                    reason = f"no step above {settings.smallest:g} mm converges: {outcome.reason}"
                    break
                continue
            if on_step is not None:
                on_step(end)
            system.advance()
            path.add(end, system.unknown.x.array.copy())
            position = end
            if outcome.factorisations <= settings.easy:
                size = min(settings.largest, max(size, length * settings.growth))
            elif outcome.factorisations >= settings.hard:
                size = length * settings.shrink
        else:
            continue
        break
    return SolveReport(
        reached=max((step.displacement for step in steps if step.accepted), default=0.0),
        target=max(targets),
        complete=bool(abs(position - targets[-1]) < 1e-9),
        reason=reason,
        steps=tuple(steps),
        seconds=time.perf_counter() - started,
        unknowns=system.spaces.unknowns,
    )


def _fitted(size: float, remaining: float) -> float:
    """Return a step that doesn't leave a sliver before the target."""
    if remaining <= size:
        return remaining
    return min(size, remaining / 2) if remaining < 2 * size else size


def _attempt(
    system: System, solver: NewtonSolver, path: _Path, displacement: float
) -> NewtonOutcome:
    system.set_displacement(displacement)
    system.unknown.x.array[:] = path.predict(displacement)
    return solver.solve()


def _step(end: float, length: float, outcome: NewtonOutcome) -> Step:
    return Step(
        end,
        length,
        outcome.converged,
        outcome.reason,
        outcome.factorisations,
        outcome.iterations,
        outcome.residual,
    )
