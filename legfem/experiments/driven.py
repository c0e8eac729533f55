"""A test that follows a protocol: what those with an indenter, a cup or grips share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.base import Homebound, Solved
from legfem.fem.system import System
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.sensitivity import Trackers


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


class DrivenTest(Homebound, ABC):
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
        return self._driven(values, motion(protocol if depth is None else depth), sensitivities)

    @abstractmethod
    def _driven(self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]) -> Solved:
        """Return the outcome of a protocol."""


def motion(given: Protocol | float | None) -> Protocol:
    """Return a protocol; a number is the depth (mm) of a loading at 1 mm/s.

    Raises
    ------
    TypeError
        If nothing is given.
    """
    if given is None:
        raise TypeError("give a protocol or a depth")
    return given if isinstance(given, Protocol) else Protocol.ramp(given, rate=1.0)


def sampled(protocol: Protocol, points: int, until: float) -> tuple[FloatArray, FloatArray]:
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
