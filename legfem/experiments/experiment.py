"""A test that follows a protocol: what those with an indenter, a cup or grips share."""

from __future__ import annotations

import typing
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from legfem.common.units import FloatArray
from legfem.fem.system import System
from legfem.jobs.key import code_fingerprint, key_of
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import ForceCurve, Path
from legfem.solve.protocol import Protocol
from legfem.solve.report import SolveReport
from legfem.solve.sensitivity import Trackers

ELSEWHERE = ("comm", "meshed")
"""Fields of an experiment that change no result."""


class Reported(typing.Protocol):
    """An outcome that says how far it came."""

    @property
    def report(self) -> SolveReport:
        """``report.complete`` tells whether it got there; giving up is a value."""


class Experiment[Load, Outcome: Reported](typing.Protocol):
    """A test of a body: numbers and a load in, an outcome out.

    The load is a `legfem.solve.protocol.Protocol` where an indenter moves, and a pressure where one
    acts on the skin. An experiment is picklable: its finite-element model is made when it is first
    needed, in whichever process.
    """

    @property
    def parameters(self) -> Mapping[str, float]:
        """Every number of the model by full name, at the value it has unless another is given."""

    def solve(self, values: Mapping[str, float] | None, load: Load, sensitivities: Sequence[str] = (), /) -> Outcome:
        """Solve.

        Parameters
        ----------
        values
            Numbers that differ from `parameters`, by full name.
        load
            What is done to the body.
        sensitivities
            Full names of parameters to differentiate by.
        """

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that an outcome depends on but what `solve` is given, as JSON types."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The outcome of one simulated test; ``report.complete`` tells whether it got there."""

    parameters: Mapping[str, float]
    """Of the model, by full name (MPa, 1/MPa)."""
    curve: ForceCurve
    """Force (N) on the whole indenter against displacement, in the first loading."""
    path: Path
    """All steps: holds, unloading and reloading too."""
    report: SolveReport


class cached_in_process[T](cached_property[T]):  # noqa: N801
    """A property made on first use, which stays behind when its object goes to another process."""


class Picklable:
    """A dataclass of which what is `made_when_needed` can't leave its process."""

    def __getstate__(self) -> dict[str, Any]:
        """Leave what can be made again."""
        kinds = (vars(kind).items() for kind in type(self).__mro__)
        made = {n for kind in kinds for n, value in kind if isinstance(value, cached_in_process)}
        return {name: value for name, value in self.__dict__.items() if name not in made}

    def fingerprint(self) -> Mapping[str, Any]:
        """Return the hash of all fields that change a result, and that of the code."""
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
        """Of sensitivities along a path."""
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
        """Follow a protocol; arguments as those of `PressingTest.solve`."""
        return self._driven(values, as_protocol(protocol if depth is None else depth), sensitivities)

    @abstractmethod
    def _driven(self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]) -> Solved:
        """Return the outcome of a protocol."""


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
        Of every straight part.
    until
        Greatest displacement that was reached (mm).
    """
    parts = [np.linspace(one.start, one.end, points) for one in protocol.segments]
    times = np.unique(np.concatenate(parts))
    at = protocol.displacement_at(times)
    beyond = np.flatnonzero(at > until)
    return (times[: beyond[0]], at[: beyond[0]]) if len(beyond) else (times, at)
