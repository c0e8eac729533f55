"""What kinds of channel see of a model: forces, and outlines that the line of travel crosses, with derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from legfem.common.units import FloatArray
from legfem.fem.outlines import Crossing, Outline, first_crossing, outline_between, outline_of_facets
from legfem.fem.points import PointsInside
from legfem.fem.system import System
from legfem.geometry.section import across
from legfem.meshing.section import BONE, DEEP, FASCIA, SKIN, SUPERFICIAL


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


@dataclass(frozen=True)
class Sight:
    """Places at which a channel is seen, each of which has a course of its own.

    Parameters
    ----------
    name
        Of the channel's kind.
    places
        What tells each from others, as its kind has it.
    """

    name: str
    places: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, eq=False)
class SeenModel:
    """A model that channels are read off.

    Parameters
    ----------
    system
        A section with its line of travel, or a leg with its axis along z, pressed square to that.
    sights
        Places at which kinds are seen that have no course without them.
    """

    system: System
    sights: tuple[Sight, ...] = ()

    @cached_property
    def outlines(self) -> dict[str, Outline]:
        """Of a section: its skin, the fascia's two faces, and the bones."""
        spaces = self.system.spaces
        return {
            "skin": outline_of_facets(spaces, SKIN),
            "fascia": outline_between(spaces, FASCIA, SUPERFICIAL),
            "deep": outline_between(spaces, DEEP, FASCIA),
            "bone": outline_of_facets(spaces, BONE),
        }

    @cached_property
    def _inside(self) -> dict[bytes, PointsInside]:
        return {}

    def inside(self, points: FloatArray) -> PointsInside:
        """Return points (m, 2) of a section, mm, in its mesh; found once."""
        key = points.tobytes()
        if key not in self._inside:
            self._inside[key] = PointsInside.found(self.system.spaces, points)
        return self._inside[key]


@dataclass(frozen=True, eq=False)
class Seen:
    """A state of a model, as kinds of channel see it; all turns with the line of travel.

    Parameters
    ----------
    model
        The model.
    state
        Of it.
    """

    model: SeenModel
    state: ReadState

    @property
    def left(self) -> FloatArray:
        """Unit vector to the left of the travel, in a leg in 3D square to its axis."""
        travel = self.model.system.direction
        return across(travel) if len(travel) == 2 else np.cross([0.0, 0.0, 1.0], travel)

    def places(self, name: str) -> FloatArray:
        """Return the places (s, q) at which a kind is seen; none where nobody looked."""
        return np.array([place for sight in self.model.sights if sight.name == name for place in sight.places])

    def moves(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return displacements (m, 2) of points (m, 2) of the undeformed section, mm, and derivatives (p, m, 2).

        NaN of those that lie outside the tissue.
        """
        inside, state, dofs = self.model.inside(points), self.state, self.model.system.spaces.displacement_dofs
        found = [inside.values(one[dofs].reshape(-1, 2)) for one in (state.unknown, *state.unknown_rates)]
        return found[0], np.array(found[1:]).reshape(-1, *found[0].shape)

    def force(self, way: FloatArray) -> tuple[float, FloatArray]:
        """Return the contact's force along a unit vector (N), and its derivatives (p,)."""
        return float(self.state.contact_force @ way), self.state.contact_force_rates @ way

    def line(self, name: str) -> CrossedOutline:
        """Return one of a section's outlines as the line of travel crosses it; see `SeenModel.outlines`."""
        return self._lines[name]

    @cached_property
    def _lines(self) -> dict[str, CrossedOutline]:
        model, state = self.model, self.state
        system = model.system
        dofs = system.spaces.displacement_dofs
        found = {}
        for name, outline in model.outlines.items():
            moved = [outline.values(one[dofs].reshape(-1, 2)) for one in (state.unknown, *state.unknown_rates)]
            places = outline.places
            found[name] = CrossedOutline(places, places + moved[0], moved[1:], system.start, system.direction)
        return found


@dataclass(frozen=True, eq=False)
class CrossedOutline:
    """An outline in one state, and the line of travel that crosses it.

    Parameters
    ----------
    places, points : (m, 3, 2) array
        Nodes of its edges, undeformed and deformed, mm.
    rates
        Derivatives of the points.
    origin, direction
        Of the line.
    """

    places: FloatArray
    points: FloatArray
    rates: list[FloatArray]
    origin: FloatArray
    direction: FloatArray

    def undeformed(self, beside: float) -> Crossing | None:
        """Return where the line, shifted to its left (mm), first meets the undeformed outline."""
        return first_crossing(self.places, self.origin, self.direction, beside)

    def place(self, beside: float = 0.0) -> tuple[float, FloatArray] | None:
        """Return where the shifted line first meets the deformed outline (mm), and the derivatives."""
        found = first_crossing(self.points, self.origin, self.direction, beside)
        if found is None:
            return None
        return found.along, np.array([found.rate(one, self.direction) for one in self.rates])
