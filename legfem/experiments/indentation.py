"""Indentation by a rigid body: what all tests with an indenter share, and their last solutions in memory."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np

from legfem.channels.log import ChannelLog, ChannelReader
from legfem.common.units import FloatArray
from legfem.experiments.experiment import Meshed, Picklable, Solved, as_protocol, cached_in_process
from legfem.fem.system import System
from legfem.jobs.store import Checkpoint, key_of
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import RigidIndenter
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Formulation, LegModel, named_parameters
from legfem.mechanics.terms import NormalContact, TangentialContact, Tissue
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import Path
from legfem.solve.protocol import Protocol
from legfem.solve.settings import StepSettings
from legfem.solve.stepping import follow

SOFTER = 0.2
"""Factor on the contact's stiffness where a solution stops short."""
OnStep = Callable[[float], None]


def leg_model(
    tissues: Mapping[str, Hyperelastic], indenter: RigidIndenter, contact: ContactSettings, formulation: Formulation
) -> LegModel:
    """Return the sum of tissues (law by region) and contact, the latter of unit stiffness."""
    normal = NormalContact(indenter, contact.pressure_law(1.0))
    along = TangentialContact(normal, contact.tangential_law(1.0))
    return LegModel((*(Tissue(region, law) for region, law in tissues.items()), normal, along), formulation)


@dataclass(frozen=True, eq=False)
class IndentationRequest:
    """Arguments of `IndentationTest.solve`."""

    values: Mapping[str, float] | None
    protocol: Protocol
    sensitivities: Sequence[str] = ()
    on_step: OnStep | None = None
    keep_in: FilePath | None = None


@dataclass(frozen=True, eq=False)
class IndentationModel(Meshed):
    """A model on its mesh with its solver, ready to be pressed with any parameters.

    Parameters
    ----------
    contact
        How contact is enforced.
    radius
        Radius of the indenter (mm), which the contact's stiffness is measured by.
    whole
        Force of the whole indenter over that of the model: the cylinder's length (mm) in plane
        strain, the number of mirror images in 3D.
    steps
        Sizes of the steps.
    reader
        What reads further channels beside the force; none by default.
    """

    contact: ContactSettings
    radius: float
    whole: float
    steps: StepSettings
    reader: ChannelReader | None = None

    @cached_property
    def relaxing(self) -> "IndentationModel":
        """The same model with steps that relax to another equilibrium where a path of equilibria ends."""
        return replace(self, steps=replace(self.steps, relaxes=True))

    def run(
        self, asked: IndentationRequest, softness: float = 1.0, keep_in: tuple[FilePath, str] | None = None
    ) -> Solved:
        """Follow a protocol, with a contact softened by a factor.

        States are kept in a folder, with the hash of what else they depend on, if one is given;
        derivatives aren't, so that a solution with sensitivities keeps none.
        """
        protocol, sensitivities, on_step = asked.protocol, asked.sensitivities, asked.on_step
        values = self.system.model.values(asked.values)
        values |= self._contact_numbers(softness * self.contact.penalty(values, self.radius))
        self.system.set_parameters(values)
        names, chain = self._chain(tuple(sensitivities), softness)
        tracker = self.trackers.fresh(names)
        time, displacement = [float(protocol.time[0])], [float(protocol.displacement[0])]
        force = [0.0]
        derivatives: list[FloatArray] = [np.zeros(len(sensitivities))]
        log = ChannelLog(self.reader, tuple(sensitivities), tracker)

        def record(now: float, at: float) -> None:
            time.append(now)
            displacement.append(at)
            contact = self.system.contact_force()
            force.append(float(contact @ self.system.direction) * self.whole)
            if tracker is not None:
                derivatives.append(tracker.step(self.solver) @ chain * self.whole)
            log.take(contact, chain, self.whole)
            if on_step is not None:
                on_step(at)

        checkpoint = None
        if keep_in is not None and not sensitivities:
            folder, key = keep_in
            given = key, values, protocol.time, protocol.displacement, self.steps
            checkpoint = Checkpoint(folder, key_of(given), self.system.comm)
        report = follow(
            self.system,
            self.solver,
            protocol,
            self.steps,
            record,
            checkpoint,
            {"time": time, "displacement": displacement, "force": force, **log.values},
        )
        if checkpoint is not None:
            checkpoint.clear()
        report = replace(report, contact_stiffness_factor=softness)
        columns = np.array(derivatives)
        path = Path(
            np.array(time),
            np.array(displacement),
            np.array(force),
            {name: columns[:, k] for k, name in enumerate(sensitivities)},
            *log.channels(),
        )
        return Solved(values, path.loading, path, report)

    def _contact_numbers(self, penalty: float) -> dict[str, float]:
        """Return the numbers of the contact's laws by full name."""
        model = self.system.model
        normal = next(term for term in model.at("skin") if isinstance(term, NormalContact))
        numbers = named_parameters(normal.name, self.contact.pressure_law(penalty))
        along = {"friction.stiffness": penalty}
        return numbers | {name: value for name, value in along.items() if name in model.parameters}

    def _chain(self, asked: tuple[str, ...], softness: float) -> tuple[tuple[str, ...], FloatArray]:
        """Return what to differentiate by, and the chain rule from that to what was asked for.

        The penalty is in proportion to the tissue's stiffness, so that a derivative by that one
        counts the penalty's too.

        Returns
        -------
        names : tuple of str
            Those asked for first.
        chain : ndarray
            (names, asked).
        """
        one, two = self._contact_numbers(1.0), self._contact_numbers(2.0)
        slopes = {name: two[name] - one[name] for name in one if two[name] != one[name]}
        raising = [name for name in asked if name in self.contact.stiffnesses]
        tied = [name for name in slopes if raising and name not in asked]
        names = (*asked, *tied)
        chain = np.eye(len(names), len(asked))
        rise = softness * self.contact.penalty_slope(self.radius)
        for parameter in raising:
            for name, slope in slopes.items():
                chain[names.index(name), asked.index(parameter)] += rise * slope
        return names, chain


@dataclass(frozen=True, eq=False)
class Attempt:
    """One way to solve a test; further ones are tried where it stops short."""

    pressing: IndentationModel
    softness: float = 1.0
    """Factor on the contact's stiffness."""
    more_points: bool = False
    """Whether it has more quadrature points than the settings say."""
    without_pressures: bool = False
    """Whether displacements are its only unknowns, although the settings have pressures too."""


class IndentationTest(Picklable, ABC):
    """A test in which a rigid indenter is pressed into a body, an `Experiment`.

    A subclass is a frozen dataclass of the test's inputs that builds its finite-element model from them.
    """

    @property
    @abstractmethod
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""

    @abstractmethod
    def _made(self) -> IndentationModel:
        """Return the finite-element model on a new mesh."""

    @cached_in_process
    def pressing(self) -> IndentationModel:
        """The finite-element model, meshed and compiled."""
        return self._made()

    @property
    def system(self) -> System:
        """The model on its mesh, in the state last solved for."""
        return self.pressing.system

    @property
    def solver(self) -> NewtonSolver:
        """Newton's solver of the system."""
        return self.pressing.solver

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by full name."""
        return self.model.parameters

    def attempts(self) -> Iterator[Attempt]:
        """Yield ways to solve the test, to be tried until a solution is complete."""
        yield Attempt(self.pressing)
        yield Attempt(self.pressing, SOFTER)

    def solve(
        self,
        values: Mapping[str, float] | None = None,
        protocol: Protocol | float | None = None,
        sensitivities: Sequence[str] = (),
        *,
        depth: float | None = None,
        on_step: OnStep | None = None,
        keep_in: FilePath | None = None,
    ) -> Solved:
        """Move the indenter along a protocol: loading, holds, unloading, at any rates.

        Parameters
        ----------
        values
            Numbers that differ from the model's own, by full name (``deep.C10`` in MPa).
        protocol
            Motion of the indenter; a number is the depth (mm) of a loading at 1 mm/s, since tissues
            without memory don't know of the rate.
        sensitivities
            Full names of parameters to differentiate the force by.
        depth
            Depth of a loading at 1 mm/s (mm), in place of a protocol.
        on_step
            Called with the displacement (mm) of every accepted step.
        keep_in
            Folder in which the states of a solution without sensitivities are kept: one that was
            killed goes on from the last, with the same number of ranks. They are removed at its
            end.

        Returns
        -------
        Solved
            Also where the end wasn't reached: that of the attempt that came farthest.
        """
        given = as_protocol(protocol if depth is None else depth)
        return self._farthest(self.attempts(), IndentationRequest(values, given, sensitivities, on_step, keep_in))

    def _farthest(self, attempts: Iterator[Attempt], asked: IndentationRequest) -> Solved:
        return farthest(self._trusted(self._tried(one, number, asked) for number, one in enumerate(attempts)))

    def _tried(self, attempt: Attempt, number: int, asked: IndentationRequest) -> Solved:
        folder = asked.keep_in
        kept = None if folder is None else (folder, key_of((self.fingerprint(), number)))
        solved = attempt.pressing.run(asked, attempt.softness, kept)
        report = replace(solved.report, more_points=attempt.more_points, without_pressures=attempt.without_pressures)
        return replace(solved, report=report)

    def _trusted(self, made: Iterator[Solved]) -> Iterator[Solved]:
        """Yield attempts as they are made, those that can't be trusted as incomplete."""
        return made


def farthest(attempts: Iterable[Solved]) -> Solved:
    """Return the first complete attempt, else that which came farthest, with others' reports."""
    made: list[Solved] = []
    for solved in attempts:
        made.append(solved)
        if solved.report.complete:
            break
    best = max(made, key=lambda solved: (solved.report.complete, solved.report.reached))
    others = tuple(solved.report for solved in made if solved is not best)
    return replace(best, report=replace(best.report, earlier_attempts=others))


_STATES = 16
"""Approximate number of states of a solution that are kept; a page interpolates between them."""
_SOLUTIONS = 4
"""Number of the last solutions that are kept, some MB each."""


def is_due(at: float, last: float, depth: float) -> bool:
    """Tell whether to keep the state at a displacement: about evenly to a depth, and there (mm)."""
    return at - last >= depth / _STATES or bool(np.isclose(at, depth))


@dataclass(eq=False)
class SolutionStates:
    """A solution and states on its way.

    Parameters
    ----------
    test
        The test that is solved.
    values
        Parameters that differ from the model's own, by full name.
    depth
        Depth to which it is pressed, mm.
    """

    test: IndentationTest
    values: Mapping[str, float]
    depth: float
    solved: Solved | None = None
    _states: list[tuple[float, dict[str, FloatArray]]] = field(default_factory=list)

    def take(self, at: float) -> None:
        """Keep the state at a displacement (mm), unless the last one is near."""
        if self._states and at < self._states[-1][0]:
            self._states.clear()  # the solution began anew
        if is_due(at, self._states[-1][0] if self._states else 0.0, self.depth):
            self._states.append((at, self.test.system.state()))

    def show(self) -> Iterator[float]:
        """Bring the test's system into one kept state after the other; yield displacements (mm)."""
        assert self.solved is not None
        self.test.system.set_parameters(dict(self.solved.parameters))
        for at, state in self._states:
            self.test.system.restore(state, at)
            yield at


@dataclass(eq=False)
class RecentSolutions:
    """The last solutions of a test in this process."""

    _kept: deque[SolutionStates] = field(default_factory=lambda: deque(maxlen=_SOLUTIONS))

    def add(self, one: SolutionStates) -> None:
        """Keep a solution."""
        self._kept.append(one)

    def find(self, values: Mapping[str, float], depth: float) -> SolutionStates | None:
        """Return what was solved for values to a depth (mm), None where that isn't kept."""
        return next((one for one in self._kept if one.values == dict(values) and one.depth == depth), None)
