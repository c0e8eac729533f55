"""How the indenter moves in time: waypoints, straight in between."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from legfem.common.errors import InputError
from legfem.common.units import FloatArray


@dataclass(frozen=True)
class ProtocolSegment:
    """The straight way between two waypoints."""

    start: float
    """Time at its start, s."""
    end: float
    """Time at its end, s."""
    first: float
    """Displacement at its start, mm."""
    last: float
    """Displacement at its end, mm."""

    @property
    def phase(self) -> Literal["loading", "hold", "unloading"]:
        """Kind of phase that it belongs to."""
        if self.last == self.first:
            return "hold"
        return "loading" if self.last > self.first else "unloading"

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.end - self.start

    @property
    def rate(self) -> float:
        """Speed of the indenter (mm/s), positive inwards."""
        return (self.last - self.first) / self.duration


@dataclass(frozen=True)
class Protocol:
    """The path of the indenter, from the undeformed leg on.

    Parameters
    ----------
    time : tuple of float
        Times of the waypoints (s), increasing.
    displacement : tuple of float
        Displacements of the indenter at the waypoints (mm), zero at first touch, positive inwards. The first
        isn't positive: nothing is deformed at the start.

    Raises
    ------
    InputError
        For waypoints that aren't such a path.
    """

    time: tuple[float, ...]
    displacement: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the waypoints, and make them tuples of numbers."""
        object.__setattr__(self, "time", tuple(float(t) for t in self.time))
        object.__setattr__(self, "displacement", tuple(float(d) for d in self.displacement))
        if len(self.time) < 2 or len(self.time) != len(self.displacement):
            counts = f"{len(self.time)} times and {len(self.displacement)} displacements"
            raise _wrong("time", counts, "give as many of both, two or more")
        if not np.isfinite([self.time, self.displacement]).all():
            raise _wrong("time", "a waypoint is not finite", "give finite numbers")
        for k, (before, after) in enumerate(pairwise(self.time), 2):
            if after <= before:
                problem = f"waypoint {k} at {after:g} s is not after {before:g} s"
                raise _wrong("time", problem, "give times that increase")
        if self.displacement[0] > 0:
            problem = f"starts at {self.displacement[0]:g} mm, in the leg"
            raise _wrong("displacement", problem, "start at first touch (0 mm) or before it")

    @classmethod
    def through(cls, displacements: Sequence[float], rate: float) -> "Protocol":
        """Return the path from 0 mm through displacements (mm) at one speed (mm/s)."""
        _check("rate", rate)
        at = [0.0]
        at += [float(d) for k, d in enumerate(displacements) if d != ([0.0, *displacements])[k]]
        walked = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(at)))])
        return cls(tuple(walked / rate), tuple(at))

    @classmethod
    def ramp(cls, depth: float, rate: float) -> "Protocol":
        """Return loading to a depth (mm) at a rate (mm/s)."""
        _check("depth", depth)
        return cls.through([depth], rate)

    @classmethod
    def ramp_and_hold(cls, depth: float, rate: float, hold: float) -> "Protocol":
        """Return loading to a depth (mm) at a rate (mm/s), then a hold (s)."""
        _check("hold", hold)
        loaded = cls.ramp(depth, rate)
        return cls((*loaded.time, loaded.duration + hold), (*loaded.displacement, depth))

    @classmethod
    def cycle(cls, depth: float, rate: float, hold: float = 0.0, unloading_rate: float | None = None) -> "Protocol":
        """Return loading, a hold (s; 0 for none), and unloading to 0 mm (rates in mm/s)."""
        back = rate if unloading_rate is None else unloading_rate
        _check("unloading_rate", back)
        loaded = cls.ramp(depth, rate) if hold == 0 else cls.ramp_and_hold(depth, rate, hold)
        end = loaded.duration + depth / back
        return cls((*loaded.time, end), (*loaded.displacement, 0.0))

    @property
    def duration(self) -> float:
        """Time from the first waypoint to the last, s."""
        return self.time[-1] - self.time[0]

    @property
    def depth(self) -> float:
        """Greatest displacement (mm)."""
        return max(self.displacement)

    @property
    def segments(self) -> tuple[ProtocolSegment, ...]:
        """The ways between the waypoints."""
        spans = zip(pairwise(self.time), pairwise(self.displacement), strict=True)
        return tuple(ProtocolSegment(*times, *ends) for times, ends in spans)

    def displacement_at(self, time: ArrayLike) -> FloatArray:
        """Return the displacement (mm) at times (s); the ends hold beyond them."""
        return np.interp(np.asarray(time, dtype=float), self.time, self.displacement)


def _check(field: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise _wrong(field, f"is {value:g}", "give a finite value of more than zero")


def _wrong(field: str, problem: str, remedy: str) -> InputError:
    return InputError("protocol", field, problem, remedy)
