"""Following a protocol by adaptive steps."""

import math
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np

from legfem.common.units import FloatArray
from legfem.fem.system import System
from legfem.jobs.store import Checkpoint
from legfem.solve.newton import RELAXED, NewtonSolver, relax
from legfem.solve.path import NewtonOutcome, SolveReport, Step
from legfem.solve.protocol import Protocol, ProtocolSegment
from legfem.solve.settings import StepSettings

MOST_GROWTH = 4.0
"""Greatest growth of the divided difference from step to step that is taken into account."""
CLOSEST = 0.2
"""Least distance between steps over the new one's length: closer ones would amplify noise."""
FACTOR_UNIT = 1 / 32
"""Unit in which the factor of a step on the one before is rounded."""
FIRST_NOISE = 4.0
"""Over the tolerance: what the first divided difference may show, since the curve starts at a kink
and the skin's first nodes close one after another."""


class CurveWatch:
    """The solved steps of one loading, and the length of the next that keeps a spline near the curve.

    Parameters
    ----------
    tolerance
        Greatest error between steps, relative to the force there.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self.points: list[tuple[float, float]] = []
        """Displacement (mm) and force of the steps that are solved."""
        self.bends = False
        """Whether a step was too long: the next ones aren't longer than foreseen."""

    def start(self, displacement: float, force: float) -> None:
        """Begin a loading, or begin anew after a jump."""
        self.points, self.bends = [(displacement, force)], False

    def excess(self, displacement: float, force: float) -> float:
        """Return the error up to a new step over the tolerance; 0 where it can't be told."""
        d, f = np.array([*self._spread(displacement), (displacement, force)]).T
        if len(d) < 5 or f[-2:].min() <= 0:
            return 0.0
        noise = FIRST_NOISE if len(d) == 5 else 1.0
        return curve_error(d, f) / (noise * self._tolerance)

    def _spread(self, displacement: float) -> list[tuple[float, float]]:
        """Return the last five steps that aren't much closer together than the new one is long."""
        kept: list[tuple[float, float]] = []
        apart = CLOSEST * (displacement - self.points[-1][0])
        for point in reversed(self.points):
            if not kept or kept[-1][0] - point[0] >= apart:
                kept.append(point)
        return kept[4::-1]

    def factor(self, excess: float) -> float:
        """Return the factor on a step that brings its error to the tolerance, with some room.

        In coarse units, lest steps hang on the force's rounding.
        """
        factor = np.clip(0.9 * max(excess, 1e-3) ** -0.25, 0.4, 2.0)
        return float(np.round(factor / FACTOR_UNIT) * FACTOR_UNIT)


def curve_error(displacement: FloatArray, force: FloatArray) -> float:
    r"""Return the greatest relative error of a spline between the last two of five steps or six.

    Through the last four of them goes a cubic, whose error is

    .. math:: F(d) - p(d) = F[d_{n-4}, \ldots, d_n]\,(d - d_{n-3}) \cdots (d - d_n)

    with the divided difference of the last five. That one belongs to the middle of them: where the
    last two have the same sign and grow, as near a bone, it is taken to grow once more.

    Parameters
    ----------
    displacement, force : ndarray
        (5,) or (6,), mm and N.
    """
    order = 4
    differences = force
    for k in range(1, order + 1):
        differences = np.diff(differences) / (displacement[k:] - displacement[:-k])
    growth = max((now / before for before, now in pairwise(differences) if now * before > 0), default=1.0)
    within = np.linspace(displacement[-2], displacement[-1], 11)[1:-1]
    product = np.prod([within - d for d in displacement[-order:]], axis=0)
    between = np.interp(within, displacement[-2:], force[-2:])
    error = np.abs(differences[-1] * product / between).max()
    return float(error * np.clip(growth, 1.0, MOST_GROWTH))


BENDS = "the curve bends too much for so long a step"


def follow(
    system: System,
    solver: NewtonSolver,
    protocol: Protocol,
    settings: StepSettings | None = None,
    on_step: Callable[[float, float], None] | None = None,
    checkpoint: Checkpoint | None = None,
    recorded: dict[str, list[float]] | None = None,
    guess: FloatArray | None = None,
) -> SolveReport:
    """Move the indenter along a protocol, each waypoint reached exactly, from the undeformed state.

    Parameters
    ----------
    system, solver
        The model and its Newton solver; the system is reset first.
    protocol
        Motion of the indenter.
    settings
        Sizes of the steps.
    on_step
        Called after every accepted step with its time (s) and displacement (mm), the system being
        in that state and its history not yet advanced.
    checkpoint
        Where states are kept; the last one there is gone on from.
    recorded
        What ``on_step`` appends to, which is kept with the states and replaced by what is found.
    guess
        Guess of the unknown at the end of the first step, where the path to it doesn't matter.

    Returns
    -------
    SolveReport
        Giving up is part of it: a solution that stops short isn't an exception.
    """
    started = time.perf_counter()
    system.reset()
    if guess is not None:
        system.unknown.x.array[:] = guess
    walk = _Walk(system, solver, settings or StepSettings(), on_step)
    recorded = {} if recorded is None else recorded
    if checkpoint is not None:
        walk.keep_in(checkpoint, recorded)
    segments = tuple(enumerate(protocol.segments))[walk.segment :]
    stopped = next(filter(None, (walk.through(number, one) for number, one in segments)), None)
    return SolveReport(
        reached=max((step.displacement for step in walk.steps if step.converged), default=0.0),
        target=protocol.depth,
        complete=stopped is None,
        reason=stopped or "the target is reached",
        steps=tuple(walk.steps),
        seconds=time.perf_counter() - started,
        unknowns=system.spaces.unknowns,
    )


class _Walk:
    """Progress along a protocol: the last converged state, and its last change as a prediction of the next."""

    def __init__(
        self,
        system: System,
        solver: NewtonSolver,
        settings: StepSettings,
        on_step: Callable[[float, float], None] | None,
    ) -> None:
        self._system, self._solver, self._settings = system, solver, settings
        self._on_step = on_step
        self.steps: list[Step] = []
        self._state = system.unknown.x.array.copy()
        # Last change of the state, and over how many mm or s; of motion and of a hold apart.
        self._changes: dict[str, tuple[FloatArray, float]] = {}
        self._size = settings.first
        self.segment = 0
        """Number of the protocol's segment that it is in."""
        self._resumed: tuple[float, float] | None = None
        self._checkpoint: Checkpoint | None = None
        self._recorded: dict[str, list[float]] = {}
        self._watch = CurveWatch(settings.curve_tolerance)

    def keep_in(self, checkpoint: Checkpoint, recorded: dict[str, list[float]]) -> None:
        """Go on from the last state kept, if there is one, and keep those to come."""
        self._checkpoint, self._recorded = checkpoint, recorded
        shapes = {name: values.shape for name, values in self._system.state().items()}
        found = checkpoint.load(shapes)
        if found is None:
            return
        arrays, plain = found
        self._system.restore(arrays, plain["displacement"])
        self._state = arrays["unknown"]
        self._changes = {unit: (arrays[f"change.{unit}"], over) for unit, over in plain["changes"].items()}
        self.steps = [Step(**step) for step in plain["steps"]]
        self.segment, self._size = plain["segment"], plain["motion_size"]
        self._resumed = plain["position"], plain["size"]
        curve = plain["curve"]
        self._watch.points[:] = [(at, force) for at, force in curve["points"]]
        self._watch.bends = curve["bends"]
        for name, values in plain["recorded"].items():
            recorded[name][:] = values

    def _keep(self, segment: ProtocolSegment, position: float, size: float) -> None:
        if self._checkpoint is None or not self._checkpoint.due:
            return
        changes = {f"change.{unit}": change for unit, (change, _) in self._changes.items()}
        plain = {
            "displacement": _place(segment, position)[1],
            "changes": {unit: over for unit, (_, over) in self._changes.items()},
            "steps": [asdict(step) for step in self.steps],
            "segment": self.segment,
            "motion_size": self._size,
            "position": position,
            "size": size,
            "recorded": self._recorded,
            "curve": {"points": self._watch.points, "bends": self._watch.bends},
        }
        self._checkpoint.save({**self._system.state(), **changes}, plain)

    def through(self, number: int, segment: ProtocolSegment) -> str | None:
        """Step to the end of a segment; return the reason where that failed, else None."""
        self.segment = number
        holds = segment.phase == "hold"
        sizes, unit = self._sizes(segment), "s" if holds else "mm"
        position, target = (segment.start, segment.end) if holds else (segment.first, segment.last)
        size, sign = sizes.first, 1.0 if target > position else -1.0
        if self._resumed is not None:
            (position, size), self._resumed = self._resumed, None
        else:
            self._watch.start(position, self._system.force() if self.steps else 0.0)
            if holds:
                self._changes.pop(unit, None)
        while position != target:
            length = _fitted(size, abs(target - position))
            end = target if length == abs(target - position) else position + sign * length
            outcome = self._attempt(segment, position, end, unit)
            force = self._system.force() if outcome.converged else 0.0
            excess = self._watch.excess(end, force) if segment.phase == "loading" else 0.0
            if outcome.converged and excess > 1 and length > 0.1 * self._settings.first:
                self._watch.bends = True
                outcome = replace(outcome, converged=False, reason=BENDS)
            self.steps.append(_step(*_place(segment, end), length, outcome))
            if not outcome.converged:
                self._system.unknown.x.array[:] = self._state
                self._move(segment, position, position)
                if outcome.reason == BENDS:
                    size = length * self._watch.factor(excess)
                    continue
                size = length * self._settings.cut
                if self._astray > self._settings.most_astray:
                    return f"{self._astray} factorisations were of steps that failed: {outcome.reason}"
                if size >= sizes.smallest:
                    continue
                snapped = self._snap(segment, position)
                if snapped is None:
                    return f"no step above {sizes.smallest:g} {unit} converges: {outcome.reason}"
                position, size = snapped, self._settings.first
                continue
            self._watch.points.append((end, force))
            self._accept(segment, end, end - position, unit)
            position = end
            if outcome.factorisations <= self._settings.easy:
                size = min(sizes.largest, max(size, length * sizes.growth))
            elif outcome.factorisations >= self._settings.hard:
                size = length * self._settings.shrink
            if self._watch.bends:
                size = min(size, length * self._watch.factor(excess))
            if not holds:
                self._size = size
            self._keep(segment, position, size)
        return None

    @property
    def _astray(self) -> int:
        """Factorisations so far of steps that failed and of creeping, but for those that were too long for a spline."""
        return sum(
            s.factorisations for s in self.steps if s.reason != BENDS and not (s.converged and s.reason != RELAXED)
        )

    def _sizes(self, segment: ProtocolSegment) -> StepSettings:
        """Return sizes of a segment's steps: mm, or s in a hold."""
        given = self._settings
        if segment.phase != "hold":
            return replace(given, first=self._size)
        first = min(given.hold_first * segment.duration, given.hold_first_time)
        return replace(given, first=first, largest=segment.duration, smallest=1e-3 * first, growth=given.hold_growth)

    def _attempt(self, segment: ProtocolSegment, start: float, end: float, unit: str) -> NewtonOutcome:
        self._move(segment, start, end)
        self._system.unknown.x.array[:] = self._state
        if unit in self._changes:
            change, over = self._changes[unit]
            self._system.unknown.x.array[:] += change * ((end - start) / over)
        return self._solver.solve()

    def _snap(self, segment: ProtocolSegment, start: float) -> float | None:
        """Go on beyond the end of a path of equilibria; return where, or None."""
        if not self._settings.relaxes or segment.phase == "hold":
            return None
        length = _fitted(self._settings.first, abs(segment.last - start))
        whole = length == abs(segment.last - start)
        end = segment.last if whole else start + math.copysign(length, segment.rate)
        self._move(segment, start, end)
        outcome = relax(self._system, self._solver)
        self.steps.append(_step(*_place(segment, end), length, outcome))
        if not outcome.converged:
            self._system.unknown.x.array[:] = self._state
            self._move(segment, start, start)
            return None
        self._watch.start(end, self._system.force())
        self._accept(segment, end, end - start, "mm")
        self._changes.pop("mm")
        return end

    def _move(self, segment: ProtocolSegment, start: float, end: float) -> None:
        now, displacement = _place(segment, end)
        self._system.set_displacement(displacement)
        self._system.set_time(now, now - _place(segment, start)[0] or 1.0)

    def _accept(self, segment: ProtocolSegment, end: float, change: float, unit: str) -> None:
        if self._on_step is not None:
            self._on_step(*_place(segment, end))
        self._system.advance()
        state = self._system.unknown.x.array.copy()
        self._changes[unit] = state - self._state, change
        self._state = state


def _place(segment: ProtocolSegment, position: float) -> tuple[float, float]:
    """Return time and displacement at a position along a segment."""
    if segment.phase == "hold":
        return position, segment.last
    if position == segment.last:
        return segment.end, position
    return segment.start + (position - segment.first) / segment.rate, position


def _fitted(size: float, remaining: float) -> float:
    """Return a step that doesn't leave a sliver before the target."""
    if remaining <= size:
        return remaining
    return min(size, remaining / 2) if remaining < 2 * size else size


def _step(now: float, end: float, length: float, outcome: NewtonOutcome) -> Step:
    return Step(**vars(outcome), displacement=end, time=now, size=length)
