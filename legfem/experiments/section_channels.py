"""What is seen of a pressed leg beside the force: other forces, and of its section thicknesses and the skin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from legfem.common.units import FloatArray
from legfem.fem.outlines import Crossing, Outline, first_crossing, outline_between, outline_of_facets
from legfem.fem.system import System
from legfem.geometry.section import across
from legfem.meshing.section import BONE, DEEP, FASCIA, SKIN, SUPERFICIAL
from legfem.solve.sensitivity import SensitivityTracker

BESIDE_MM = (-40.0, -25.0, 25.0, 40.0)
"""Distances to the left of the travel at which the skin's rise is told (mm); negative ones lie to the right."""


def skin_rise(beside: float) -> str:
    """Return the name of the channel of the skin's rise at a distance to the left of the travel (mm)."""
    return f"skin_rise_{'left' if beside > 0 else 'right'}_{abs(beside):g}"


@dataclass(frozen=True, eq=False)
class ReadState:
    """A state that a step came to, with its derivatives by parameters.

    Parameters
    ----------
    unknown : (n,) array
        Of the system.
    unknown_rates : (p, n) array
        Its derivatives.
    contact_force : (d,) array
        Of the cylinder on the skin in d dimensions, N: that of its whole length.
    contact_force_rates : (p, d) array
        Its derivatives.
    """

    unknown: FloatArray
    unknown_rates: FloatArray
    contact_force: FloatArray
    contact_force_rates: FloatArray


Channels = Mapping[str, tuple[float, FloatArray]]
"""Value and derivatives (p,) by a channel's name."""


@dataclass(frozen=True, eq=False)
class SectionChannels:
    """Reads a section's channels; all turn with the line of travel.

    Parameters
    ----------
    system
        The section, with the line of travel it is pressed along.
    """

    system: System

    @cached_property
    def _outlines(self) -> dict[str, Outline]:
        spaces = self.system.spaces
        return {
            "skin": outline_of_facets(spaces, SKIN),
            "fascia": outline_between(spaces, FASCIA, SUPERFICIAL),
            "deep": outline_between(spaces, DEEP, FASCIA),
            "bone": outline_of_facets(spaces, BONE),
        }

    def read(self, state: ReadState) -> Channels:
        """Return the channels there are in a state; collective over the system's ranks.

        A channel whose line meets no outline isn't there.
        """
        travel = self.system.direction
        sideways = across(travel)
        read: dict[str, tuple[float, FloatArray]] = {
            "lateral_force": (float(state.contact_force @ sideways), state.contact_force_rates @ sideways)
        }
        lines = {name: self._line(name, state) for name in self._outlines}
        places = {name: line.place(0.0) for name, line in lines.items()}
        for name, upper, lower in (("fat_thickness", "skin", "fascia"), ("muscle_thickness", "deep", "bone")):
            above, below = places[upper], places[lower]
            if above is not None and below is not None:
                read[name] = (below[0] - above[0], below[1] - above[1])
        for beside in BESIDE_MM:
            now, first = lines["skin"].place(beside), lines["skin"].undeformed(beside)
            if now is not None and first is not None:
                read[skin_rise(beside)] = (first.along - now[0], -now[1])
        return read

    def _line(self, name: str, state: ReadState) -> _Line:
        outline, spaces = self._outlines[name], self.system.spaces
        moved = [
            outline.values(one[spaces.displacement_dofs].reshape(-1, 2))
            for one in (state.unknown, *state.unknown_rates)
        ]
        return _Line(outline.places, outline.places + moved[0], moved[1:], self.system.start, self.system.direction)


class ChannelReader(Protocol):
    """Reads what is seen of a pressed model beside the force."""

    @property
    def system(self) -> System:
        """The model."""
        ...

    def read(self, state: ReadState) -> Channels:
        """Return the channels there are in a state; collective over the system's ranks."""
        ...


@dataclass(frozen=True, eq=False)
class ContactForces:
    """Reads the cylinder's force in 3D beside that along its travel: to the left of the travel, and along the leg.

    Parameters
    ----------
    system
        The leg, its axis along z, pressed square to that.
    """

    system: System

    def read(self, state: ReadState) -> Channels:
        """Return both forces."""
        up = np.array([0.0, 0.0, 1.0])
        ways = {"lateral_force": np.cross(up, self.system.direction), "axial_force": up}
        return {name: (float(state.contact_force @ way), state.contact_force_rates @ way) for name, way in ways.items()}


class ChannelLog:
    """Channels along a path, from the undeformed state on.

    Parameters
    ----------
    reader
        What reads them; without one there are none.
    parameters
        Full names of what they are differentiated by.
    """

    def __init__(self, reader: ChannelReader | None, parameters: Sequence[str]) -> None:
        self._reader, self._parameters = reader, tuple(parameters)
        self.values: dict[str, list[float]] = {}
        """By name, NaN where a channel isn't there."""
        self._rates: dict[str, list[FloatArray]] = {}
        if reader is not None:
            number, size = len(self._parameters), len(reader.system.direction)
            at_rest = np.zeros_like(reader.system.unknown.x.array)
            first = reader.read(
                ReadState(at_rest, np.zeros((number, len(at_rest))), np.zeros(size), np.zeros((number, size)))
            )
            self.values = {name: [value] for name, (value, _) in first.items()}
            self._rates = {name: [rates] for name, (_, rates) in first.items()}

    def take(
        self, contact_force: FloatArray, tracker: SensitivityTracker | None, chain: FloatArray, whole: float
    ) -> None:
        """Read the state that a step came to.

        Parameters
        ----------
        contact_force
            On the model, N.
        tracker
            Derivatives there, by the names that the chain rule starts from.
        chain
            Derivatives of those by the parameters, (names, parameters).
        whole
            Force of the whole cylinder over that on the model.
        """
        if self._reader is None:
            return
        unknown = self._reader.system.unknown.x.array
        rates: FloatArray = np.zeros((0, len(unknown)))
        force_rates: FloatArray = np.zeros((0, len(contact_force)))
        if tracker is not None:
            rates = chain.T @ np.array(list(tracker.state_rates().values()))
            force_rates = chain.T @ tracker.contact_force_rates
        read = self._reader.read(ReadState(unknown, rates, whole * contact_force, whole * force_rates))
        for name, values in self.values.items():
            value, by = read.get(name, (np.nan, np.full(len(self._parameters), np.nan)))
            values.append(value)
            self._rates[name].append(by)

    def channels(self) -> tuple[dict[str, FloatArray], dict[str, dict[str, FloatArray]]]:
        """Return the channels that are there at every step, and their derivatives by channel and parameter."""
        there = {name: np.array(values) for name, values in self.values.items() if np.isfinite(values).all()}
        if not self._parameters:
            return there, {}
        columns = {name: np.array(self._rates[name]).T for name in there}
        return there, {name: dict(zip(self._parameters, by, strict=True)) for name, by in columns.items()}


@dataclass(frozen=True, eq=False)
class _Line:
    """An outline in one state, and the line of travel that crosses it."""

    places: FloatArray
    points: FloatArray
    rates: list[FloatArray]
    origin: FloatArray
    direction: FloatArray

    def undeformed(self, beside: float) -> Crossing | None:
        return first_crossing(self.places, self.origin, self.direction, beside)

    def place(self, beside: float) -> tuple[float, FloatArray] | None:
        """Return where the shifted line first meets the deformed outline (mm), and the derivatives."""
        found = first_crossing(self.points, self.origin, self.direction, beside)
        if found is None:
            return None
        return found.along, np.array([found.rate(one, self.direction) for one in self.rates])
