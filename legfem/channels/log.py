"""Channels of a pressed model along a path: what reads them off each state, and the log of all of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import batched

import numpy as np

from legfem.channels import Sight
from legfem.channels.kind import ChannelFile, Channels
from legfem.channels.laid import IMAGES, WAYS, laid_course
from legfem.channels.seen import ReadState, Seen, SeenModel, SeenSpecimen
from legfem.common.units import FloatArray
from legfem.fem.system import System
from legfem.geometry.indenter import TravelLine
from legfem.solve.sensitivity import SensitivityTracker

_SHIFT = 1e-5
"""Of a shift, mm or degrees, by whose difference channels are differentiated."""


def _of_images(stated: Channels, laid: Sequence[Channels]) -> dict[str, tuple[float, FloatArray]]:
    """Return what a step in each of the ways does that images may lie elsewhere, laid to both sides in each.

    Where one to a side shows nothing, beyond the tissue, it is the step to the other; nothing where both don't.
    """
    found = {}
    for way, sides in zip(WAYS, batched(laid, 2), strict=True):
        for name in (name for name in stated if name in sides[0] or name in sides[1]):
            ahead, behind = (one[name] if name in one and math.isfinite(one[name][0]) else None for one in sides)
            (high, high_rates), (low, low_rates) = ahead or stated[name], behind or stated[name]
            span = 2.0 if ahead and behind else 1.0
            found[laid_course(name, way)] = (high - low) / span, (high_rates - low_rates) / span
    return found


@dataclass(frozen=True, eq=False)
class ChannelReader:
    """Reads what is seen of a pressed model beside the force.

    Parameters
    ----------
    system
        The model: a section with its line of travel, or a leg with its axis along z, pressed square to that.
    files
        Files of the kinds that the model gives.
    sights
        Places at which some kinds are seen.
    stated
        Line of travel that images refer to; the cylinder's own without it.
    specimen
        What is seen of a specimen; None of a leg.
    """

    system: System
    files: Sequence[ChannelFile]
    sights: tuple[Sight, ...] = ()
    stated: TravelLine | None = None
    specimen: SeenSpecimen | None = None

    @cached_property
    def _model(self) -> SeenModel:
        return SeenModel(self.system, self.sights, self.stated, self.specimen)

    def read(self, state: ReadState) -> Channels:
        """Return the channels there are in a state; collective over the system's ranks."""
        seen, found = Seen(self._model, state), dict[str, tuple[float, FloatArray]]()
        for file in self.files:
            stated, *laid = file.laid(seen, IMAGES) or [file.read(seen)]
            found |= {**stated, **(_of_images(stated, laid) if laid else {})}
        return found

    def read_as_stated(self, state: ReadState) -> dict[str, float]:
        """Return the values of the channels there are in a state, but of images laid elsewhere."""
        seen = Seen(self._model, state)
        return {name: value for file in self.files for name, (value, _) in file.read(seen).items()}


class ChannelLog:
    """Channels along a path, from the undeformed state on.

    Parameters
    ----------
    reader
        What reads them; without one there are none.
    parameters
        Full names of what they are differentiated by.
    tracker
        Of the derivatives by them; its first parameters are these.
    """

    def __init__(
        self, reader: ChannelReader | None, parameters: Sequence[str], tracker: SensitivityTracker | None = None
    ) -> None:
        self._reader, self._parameters, self._tracker = reader, tuple(parameters), tracker
        self._aside: dict[int, ChannelReader] = {}
        self.values: dict[str, list[float]] = {}
        """By name, NaN where a channel isn't there."""
        self._rates: dict[str, list[FloatArray]] = {}
        if reader is not None:
            size, nodes = len(reader.system.direction), len(reader.system.spaces.trace)
            unknown, force = np.zeros(len(reader.system.unknown.x.array)), np.zeros(size)
            nodal = np.zeros((nodes // size, size))
            rates = [np.zeros((0, *one.shape)) for one in (unknown, force, nodal)]
            self._at_rest = ReadState(unknown, rates[0], force, rates[1], nodal, rates[2])
            read = reader.read(self._at_rest)
            self.values = {name: [value] for name, (value, _) in read.items()}
            self._rates = {name: [by] for name, by in self._by_shifts(reader, self._at_rest, read).items()}

    def take(self, contact_force: FloatArray, chain: FloatArray, whole: float) -> None:
        """Read the state that a step came to.

        Parameters
        ----------
        contact_force
            On the model, N.
        chain
            Derivatives of what the tracker differentiates by, by the parameters, (names, parameters).
        whole
            Force of the whole cylinder over that on the model.
        """
        if self._reader is None:
            return
        system, tracker = self._reader.system, self._tracker
        state = replace(
            self._at_rest,
            unknown=system.unknown.x.array,
            contact_force=whole * contact_force,
            nodal_force=system.nodal_contact_force(),
            displacement=system.displacement,
            whole=whole,
        )
        moving = state
        if tracker is not None:
            moving = replace(
                state,
                unknown_rates=chain.T @ np.array(list(tracker.state_rates().values())),
                contact_force_rates=whole * (chain.T @ tracker.contact_force_rates),
                nodal_force_rates=np.tensordot(chain.T, tracker.nodal_force_rates, axes=1),
            )
        read = self._reader.read(moving)
        explicit = self._by_shifts(self._reader, state, read)
        missing = math.nan, np.full(len(self._parameters), np.nan)
        for name, values in self.values.items():
            value, by = read.get(name, missing)
            values.append(value)
            self._rates[name].append(by + explicit[name])

    def _by_shifts(self, reader: ChannelReader, state: ReadState, read: Channels) -> dict[str, FloatArray]:
        """Return derivatives (parameters,) of channels by shifts of the leg and the cylinder in a state that stays.

        What images show that lie elsewhere is a difference already, and is taken to stay.
        """
        found = np.zeros((len(self._parameters), len(self.values)))
        for place, shift in self._tracker.shifts.items() if self._tracker else ():
            if place not in self._aside:
                line = reader.stated and replace(reader.stated, origin=reader.stated.origin + _SHIFT * shift.stated)
                self._aside[place] = replace(reader, stated=line)
            with reader.system.shifted(shift, _SHIFT):
                aside = self._aside[place].read_as_stated(state)
            moves = [aside[name] - read[name][0] if name in aside and name in read else 0.0 for name in self.values]
            found[place] = np.array(moves) / _SHIFT
        return dict(zip(self.values, found.T, strict=True))

    def channels(self) -> tuple[dict[str, FloatArray], dict[str, dict[str, FloatArray]]]:
        """Return the channels that are there at every step, and their derivatives by channel and parameter."""
        there = {name: np.array(values) for name, values in self.values.items() if np.isfinite(values).all()}
        if not self._parameters:
            return there, {}
        columns = {name: np.array(self._rates[name]).T for name in there}
        return there, {name: dict(zip(self._parameters, by, strict=True)) for name, by in columns.items()}
