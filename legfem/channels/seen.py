"""What channels see of a solved model, with derivatives: forces and outlines on the line of travel, along a path."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from legfem.channels import Sight
from legfem.common.units import FloatArray
from legfem.fem.outlines import Outline, PointsInside, first_crossings, outline_between, outline_of_facets
from legfem.fem.spaces import sum_over
from legfem.fem.system import System
from legfem.geometry.indenter import TravelLine
from legfem.geometry.section import across, cross
from legfem.mechanics.terms.contact import NormalContact
from legfem.meshing.section import BONE, FASCIA, OUTER_FASCIA, SKIN, SUPERFICIAL

_ROUND = 1e-9


@dataclass(frozen=True, eq=False)
class ReadState:
    """A state that a step came to, with its derivatives by parameters.

    Parameters
    ----------
    unknown : (n,) array
        Unknown of the system.
    unknown_rates : (p, n) array
        Its derivatives.
    contact_force : (d,) array
        Force of the whole cylinder on the skin in d dimensions, N.
    contact_force_rates : (p, d) array
        Its derivatives.
    nodal_force : (k, d) array
        What the rank adds to that on each of its skin's nodes; N per mm of the cylinder's length in a section.
    nodal_force_rates : (p, k, d) array
        Its derivatives.
    displacement
        Displacement of the cylinder, mm.
    whole
        Length of the cylinder over a section that forces at nodes are of, mm; 1 in a leg in 3D.
    """

    unknown: FloatArray
    unknown_rates: FloatArray
    contact_force: FloatArray
    contact_force_rates: FloatArray
    nodal_force: FloatArray
    nodal_force_rates: FloatArray
    displacement: float = 0.0
    whole: float = 1.0


@dataclass(frozen=True)
class SeenSpecimen:
    """What of a body with axial symmetry is seen.

    Parameters
    ----------
    layers
        By the name of each layer that a line along the axis crosses, the heights (mm) between which it lies.
    side
        Whether its side is seen; its height 0 is a mirror then.
    """

    layers: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    side: bool = False


@dataclass(frozen=True, eq=False)
class SeenModel:
    """A model that channels are read off.

    Parameters
    ----------
    system
        A section with its line of travel, or a leg with its axis along z, pressed square to that.
    sights
        Places at which kinds are seen that have no course without them.
    stated
        Line of travel that images of a section refer to, which they don't leave where the cylinder is tilted or aimed
        elsewhere; the cylinder's own without it.
    specimen
        What is seen of a specimen; None of a leg.
    """

    system: System
    sights: tuple[Sight, ...] = ()
    stated: TravelLine | None = None
    specimen: SeenSpecimen | None = None

    @cached_property
    def places(self) -> FloatArray:
        """Places of the displacement's nodes, (nodes, 2), mm."""
        return np.asarray(self.system.spaces.displacement_space.tabulate_dof_coordinates()[:, :2])

    @cached_property
    def outlines(self) -> dict[str, Outline]:
        """Outlines of a section: its skin, the fascia's two faces, and the bones, of those that it has."""
        spaces = self.system.spaces
        split = len(spaces.facet_tags.find(OUTER_FASCIA)) > 0
        within = [int(tag) for tag in np.hstack([*spaces.regions.values()]) if tag not in (SUPERFICIAL, FASCIA)]
        found = {
            "skin": outline_of_facets(spaces, SKIN),
            # What slides on the fascia has nodes of its own.
            "fascia": outline_of_facets(spaces, OUTER_FASCIA)
            if split
            else outline_between(spaces, [FASCIA], SUPERFICIAL),
            "deep": outline_between(spaces, within, FASCIA),
            "bone": outline_of_facets(spaces, BONE),
        }
        return {name: outline for name, outline in found.items() if len(outline.places)}

    @cached_property
    def crossings_at_rest(self) -> dict[str, dict[bytes, FloatArray]]:
        """Places along lines of their first crossings with the undeformed outlines, as far as they were asked for."""
        return {name: {} for name in self.outlines}

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
    """A state of a model, as kinds of channel see it: forces and layers turn with the line of travel, images don't.

    Parameters
    ----------
    model
        The model.
    state
        State of the model.
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
        """Return displacements (..., 2) of points (..., 2) of the undeformed section, mm, and derivatives (p, ..., 2).

        NaN of those that lie outside the tissue.
        """
        found = self.model.inside(points.reshape(-1, 2)).values(self._moved)
        return found[0].reshape(points.shape), found[1:].reshape(-1, *points.shape)

    @cached_property
    def _moved(self) -> FloatArray:
        """Displacements of a section's nodes, mm, and derivatives (1 + p, nodes, 2)."""
        dofs = self.model.system.spaces.displacement_dofs
        every = np.vstack([self.state.unknown[dofs], self.state.unknown_rates[:, dofs]])
        return every.reshape(len(every), -1, 2)

    def move(self, place: tuple[float, float], component: int) -> tuple[float, FloatArray]:
        """Return a component of the displacement (mm) of the node nearest to a place, and its derivatives (p,)."""
        node = int(np.argmin(np.linalg.norm(self.model.places - place, axis=1)))
        moved = self._moved[:, node, component]
        return float(moved[0]), moved[1:]

    def on_side(self, heights: FloatArray) -> FloatArray:
        """Return displacements at heights (m,) of a specimen's side, mm, and derivatives, (1 + p, m, 2)."""
        out, up = self.model.places.T
        side = np.flatnonzero(out > (1 - _ROUND) * out.max())
        side = side[np.argsort(up[side])]
        return np.asarray(make_interp_spline(up[side], self._moved[:, side], k=1, axis=1)(heights))

    @property
    def radius(self) -> float:
        """Radius of the cylinder, mm."""
        return self.model.system.model.parameters["indenter.radius"]

    @property
    def onset(self) -> float:
        """Gap below which the skin is pressed, mm."""
        terms = self.model.system.model.at("skin")
        return float(next(term.law.onset for term in terms if isinstance(term, NormalContact)))

    @property
    def centre(self) -> FloatArray:
        """The cylinder's axis, mm."""
        system = self.model.system
        return np.asarray(system.start + self.state.displacement * system.direction)

    @cached_property
    def _skin_from_axis(self) -> tuple[FloatArray, FloatArray]:
        """The rank's nodes of a section's skin from the cylinder's axis, (k, 2), mm, and derivatives (p, k, 2)."""
        spaces, state = self.model.system.spaces, self.state
        places = spaces.skin_space.tabulate_dof_coordinates()[:, :2]
        away = places + state.unknown[spaces.trace].reshape(-1, 2) - self.centre
        return away, state.unknown_rates[:, spaces.trace].reshape(-1, *away.shape)

    @property
    def face(self) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """The rank's nodes of a section's skin as the cylinder's face sees them: ways and loads, with derivatives.

        The ways (k,) along the face are from its deepest point to the left of the travel, mm; the loads (k,) are of the
        cylinder's normal pressure, N per mm of its length; derivatives are (p, k).
        """
        system, state = self.model.system, self.state
        away, moving = self._skin_from_axis
        ahead, sideways = away @ system.direction, away @ self.left
        squared = ahead**2 + sideways**2
        turning = (ahead * (moving @ self.left) - sideways * (moving @ system.direction)) / squared
        far = np.sqrt(squared)
        out = away / far[:, None]
        along = np.einsum("kd,pkd->pk", out, moving)
        swing = (moving - along[..., None] * out) / far[:, None]
        load = np.einsum("kd,kd->k", state.nodal_force, out)
        loading = np.einsum("pkd,kd->pk", state.nodal_force_rates, out)
        loading += np.einsum("kd,pkd->pk", state.nodal_force, swing)
        return (self.radius * np.arctan2(sideways, ahead), self.radius * turning), (load, loading)

    def force(self, way: FloatArray) -> tuple[float, FloatArray]:
        """Return the contact's force along a unit vector (N), and its derivatives (p,)."""
        return float(self.state.contact_force @ way), self.state.contact_force_rates @ way

    def over_ranks(self, values: ArrayLike) -> FloatArray:
        """Return the sum of values (...) over the ranks that share the model."""
        return sum_over(self.model.system.comm, values)

    def moment(self) -> tuple[float, FloatArray]:
        """Return the contact's moment about the cylinder's axis in a section (N mm), and its derivatives (p,)."""
        (away, moving), state = self._skin_from_axis, self.state
        total = self.over_ranks(np.sum(cross(away, state.nodal_force)))
        rates = cross(moving, state.nodal_force) + cross(away, state.nodal_force_rates)
        return state.whole * float(total), state.whole * self.over_ranks(rates.sum(axis=-1))

    @property
    def profile(self) -> "CrossedOutline":
        """A section's skin as an image of it has the stated line of travel cross it."""
        stated, skin = self.model.stated, self.lines["skin"]
        return skin if stated is None else replace(skin, origin=stated.origin, direction=stated.direction)

    @cached_property
    def lines(self) -> "dict[str, CrossedOutline]":
        """Outlines by name, crossed by the line of travel."""
        system, found = self.model.system, {}
        for name, outline in self.model.outlines.items():
            moved = outline.values(self._moved)
            places, line = outline.places, (system.start, system.direction)
            known = self.model.crossings_at_rest[name]
            found[name] = CrossedOutline(places, places + moved[0], moved[1:], *line, known)
        return found


@dataclass(frozen=True, eq=False)
class CrossedOutline:
    """An outline in one state, and the line of travel that crosses it.

    Parameters
    ----------
    places, points : (m, 3, 2) array
        Nodes of its edges, undeformed and deformed, mm.
    rates : (p, m, 3, 2) array
        Derivatives of the points.
    origin, direction
        Point and direction of the line.
    known
        Places along lines at which they met the undeformed outline in earlier states (k,), mm, by the lines.
    """

    places: FloatArray
    points: FloatArray
    rates: FloatArray
    origin: FloatArray
    direction: FloatArray
    known: dict[bytes, FloatArray]

    @cached_property
    def place(self) -> tuple[float, FloatArray]:
        """Where the line of travel first meets the deformed outline (mm), NaN if it doesn't, and derivatives (p,)."""
        along, rates = self._places(self.origin[None], self.direction[None])
        return float(along[0]), rates[:, 0]

    def rises(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far the outline rose against lines (k, 2) where they meet it first, mm: (k,), derivatives (p, k).

        NaN of a line that doesn't meet it, deformed and undeformed.
        """
        key = np.stack([origins, directions]).tobytes()
        if key not in self.known:
            self.known[key] = first_crossings(self.places, origins, directions).along
        along, rates = self._places(origins, directions)
        return self.known[key] - along, -rates

    def _places(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        found = first_crossings(self.points, origins, directions)
        return found.along, found.rates(self.rates, directions)
