"""What every experiment is: parameters and a load in, a force curve with its derivatives out."""

import typing
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from legfem.common.units import FloatArray
from legfem.fem.system import System
from legfem.jobs.store import code_fingerprint, key_of
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import ForceCurve, Path, SolveReport
from legfem.solve.protocol import Protocol
from legfem.solve.sensitivity import Trackers

ELSEWHERE = ("comm", "meshed")
"""Fields of an experiment that change no result."""


class Experiment[Load, Outcome](typing.Protocol):
    """A test of a body: parameters and a load in, an outcome out.

    An outcome's ``report`` says how far the solution came: one that stops short raises nothing. The load is a
    `legfem.solve.protocol.Protocol` where an indenter moves, and a pressure where one acts on the skin. An experiment
    is picklable: its finite-element model is made when it is first needed, in whichever process.
    """

    @property
    def parameters(self) -> Mapping[str, float]:
        """Default values of all parameters by full name, MPa or 1/MPa."""

    def solve(self, values: Mapping[str, float] | None, load: Load, sensitivities: Sequence[str] = (), /) -> Outcome:
        """Return the outcome for a load, up to where the solution came.

        Parameters
        ----------
        values
            Parameters that differ from the defaults, by full name.
        load
            A protocol or a pressure, as the experiment says.
        sensitivities
            Full names of parameters to differentiate by.
        """

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that an outcome depends on beside the arguments of `solve`, as JSON types."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The outcome of one simulated test; ``report.complete`` tells whether it got there."""

    parameters: Mapping[str, float]
    """Parameters of the model by full name, MPa or 1/MPa."""
    curve: ForceCurve
    """Force (N) on the whole indenter against displacement, in the first loading."""
    path: Path
    """All steps: holds, unloading and reloading too."""
    report: SolveReport

    @classmethod
    def nothing(cls, reason: str, sensitivities: Sequence[str] = ()) -> "Solved":
        """Return the outcome of a test that breaks down before its first step."""
        none, by = np.zeros(1), dict.fromkeys(sensitivities, np.zeros(1))
        return cls({}, ForceCurve(none, none, by), Path(none, none, none, by), SolveReport(0.0, 0.0, False, reason))


class ExtendedTest(Experiment[Protocol | float, Solved], typing.Protocol):
    """A test with a protocol, or a depth (mm), that takes further terms."""

    def with_terms(self, terms: Sequence[Any]) -> typing.Self:
        """Return the test with more terms."""


class cached_in_process[T](cached_property[T]):  # noqa: N801
    """A `cached_property` that is left out when its object is pickled: each process computes its own."""


class Picklable:
    """A dataclass that pickles its fields alone: what is `cached_in_process` is computed anew where it arrives."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without what is `cached_in_process`."""
        kinds = (vars(kind).items() for kind in type(self).__mro__)
        made = {n for kind in kinds for n, value in kind if isinstance(value, cached_in_process)}
        return {name: value for name, value in self.__dict__.items() if name not in made}

    def fingerprint(self) -> Mapping[str, Any]:
        """Return hashes of the fields that change a result and of the code."""
        given: Any = self
        made_from = [f.name for f in fields(given) if f.init and f.name not in ELSEWHERE]
        return {
            "experiment": type(self).__qualname__,
            "given": key_of({name: getattr(self, name) for name in made_from}),
            "code": code_fingerprint(type(self).__module__),
        }


@dataclass(frozen=True, eq=False)
class Meshed:
    """A model on its mesh with its solver.

    Parameters
    ----------
    system, solver
        The model and its Newton solver.
    """

    system: System
    solver: NewtonSolver

    @cached_property
    def trackers(self) -> Trackers:
        """Solvers for sensitivities along a path, kept from solution to solution."""
        return Trackers(self.system)


class ProtocolTest(Picklable, ABC):
    """A test in which a displacement follows a protocol, an `Experiment`."""

    def solve(
        self,
        values: Mapping[str, float] | None = None,
        protocol: Protocol | float | None = None,
        sensitivities: Sequence[str] = (),
        *,
        depth: float | None = None,
    ) -> Solved:
        """Follow a protocol; arguments as those of `IndentationTest.solve`."""
        return self._follow(values, as_protocol(protocol if depth is None else depth), sensitivities)

    @abstractmethod
    def _follow(self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]) -> Solved:
        """Return the outcome of a protocol, up to where the solution came."""


def as_protocol(given: Protocol | float | None) -> Protocol:
    """Return a protocol; a number is the depth (mm) of a loading at 1 mm/s.

    Raises
    ------
    TypeError
        If nothing is given.
    """
    if given is None:
        raise TypeError("give a protocol or a depth")
    return given if isinstance(given, Protocol) else Protocol.ramp(given, rate=1.0)


def sample_protocol(protocol: Protocol, points: int, until: float) -> tuple[FloatArray, FloatArray]:
    """Return times and displacements along a protocol, until one lies beyond what was reached.

    Parameters
    ----------
    protocol
        To follow.
    points
        Number of points on every straight part.
    until
        Greatest displacement that was reached (mm).
    """
    parts = [np.linspace(one.start, one.end, points) for one in protocol.segments]
    times = np.unique(np.concatenate(parts))
    at = protocol.displacement_at(times)
    beyond = np.flatnonzero(at > until)
    return (times[: beyond[0]], at[: beyond[0]]) if len(beyond) else (times, at)
