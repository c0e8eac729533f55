"""States of a leg that is pressed in 3D, as pictures need them: its surfaces, what presses them."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from legfem.common.units import FloatArray
from legfem.experiments.indenter_pose import IndenterInPose
from legfem.experiments.leg_3d import LegIndentation3D
from legfem.fem.fields import FieldReader
from legfem.fem.spaces import BodySurface, hull_surface
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.leg_surface import TriangleSurface
from legfem.jobs.checkpoint import read_arrays, write_arrays
from legfem.solve.path import ForceCurve

_STATES = 10
"""About how many are kept, between which pictures interpolate."""
_LEVELS, _POINTS = 41, 120
"""Heights, and points of a contour at most, at which a leg is looked at."""
_FIELDS = ("skin", "hull", "pressure")
_QUARTERS = np.array([(0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)])
"""A second-order triangle as four, in the order of DOLFINx' nodes."""


@dataclass(frozen=True, eq=False)
class LegState:
    """A leg's surfaces at one displacement of the cylinder."""

    displacement: float
    """mm."""
    skin: FloatArray
    """Movement of the skin's points (mm), (n_levels, n_points, 3)."""
    hull: FloatArray
    """Of the muscles' outer face, likewise."""
    pressure: FloatArray
    """Of the cylinder on the skin (kPa), (n_levels, n_points)."""


@dataclass(frozen=True, eq=False)
class PressedLeg:
    """A leg's solve in 3D, to be looked at."""

    shape: LegShape
    """At the levels and points of the states."""
    posed: IndenterInPose[Any]
    """What presses it."""
    touch: FloatArray
    """Its middle (3,), mm, at first contact."""
    curve: ForceCurve
    states: tuple[LegState, ...]


def seen(shape: LegShape) -> LegShape:
    """Return a leg's shape at the levels and points at which it is looked at."""
    levels = np.linspace(shape.levels[0], shape.levels[-1], _LEVELS)
    fine = shape.at_levels(levels)
    return LegShape(levels, {part: xy[:, :: -(-xy.shape[1] // _POINTS)] for part, xy in fine.contours.items()})


@dataclass(eq=False)
class LegFilm:
    """States of solves under their keys: in memory, and in a folder if one is given.

    A solve that was killed and goes on adds to the states that it had. What is missing or cut short
    counts as absent: pictures are no result.
    """

    folder: Path | None = None
    _taken: dict[str, list[LegState]] = field(default_factory=dict)

    def states(self, key: str) -> list[LegState]:
        """Return a solve's states, in their order."""
        if key not in self._taken:
            self._taken[key] = [] if self.folder is None else _read(self.folder / f"{key}.npz")
        return self._taken[key]

    def add(self, key: str, state: LegState) -> None:
        """Add a state; those at greater displacements are of an attempt that was given up."""
        before = [one for one in self.states(key) if one.displacement < state.displacement]
        self._taken[key] = [*before, state]
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            _write(self.folder / f"{key}.npz", self._taken[key])


@dataclass(eq=False)
class LegCamera:
    """Takes states of a leg while it is solved, about evenly along its way."""

    experiment: LegIndentation3D
    depth: float
    """mm, to which it is pressed."""
    film: LegFilm

    def take(self, key: str, at: float) -> None:
        """Keep the state at a displacement (mm) for a solve, unless one near before it is there."""
        known = [s.displacement for s in self.film.states(key) if s.displacement < at]
        last = known[-1] if known else 0.0
        if at - last < self.depth / _STATES and not np.isclose(at, self.depth):
            return
        system = self.experiment.system
        nodal = system.unknown.x.array[system.spaces.displacement_dofs].reshape(-1, 3)
        hull = self._to_hull @ self._hull.values(nodal)
        pressure, movement = self._reader.on_skin()
        skin = self._to_skin[1] @ movement.x.array.reshape(-1, 3)
        on_points = self._to_skin[0] @ pressure.x.array
        levels, points, _ = self.shape.points(SKIN).shape
        self.film.add(
            key,
            LegState(
                at, skin.reshape(levels, points, 3), hull.reshape(levels, -1, 3), on_points.reshape(levels, points)
            ),
        )

    @cached_property
    def shape(self) -> LegShape:
        """The leg as it is looked at."""
        return seen(self.experiment.shape)

    @cached_property
    def _reader(self) -> FieldReader:
        return FieldReader(self.experiment.system)

    @cached_property
    def _hull(self) -> BodySurface:
        return hull_surface(self.experiment.system.spaces)

    @cached_property
    def _to_hull(self) -> csr_matrix:
        return self._hull.surface.weights(self.shape.points(HULL).reshape(-1, 3))

    @cached_property
    def _to_skin(self) -> tuple[csr_matrix, csr_matrix]:
        """From the pressure, linear in every facet, and from the movement, at its midsides too."""
        pressure, movement = (field.function_space for field in self._reader.on_skin())
        points = self.shape.points(SKIN).reshape(-1, 3)
        facets = TriangleSurface(pressure.tabulate_dof_coordinates(), pressure.dofmap.list)
        quarters = movement.dofmap.list[:, _QUARTERS].reshape(-1, 3)
        fine = TriangleSurface(movement.tabulate_dof_coordinates(), quarters)
        return facets.weights(points), fine.weights(points)


def _write(path: Path, states: list[LegState]) -> None:
    columns = {name: np.array([getattr(state, name) for state in states], dtype=np.float32) for name in _FIELDS}
    displacement = np.array([state.displacement for state in states])
    write_arrays(path, {"displacement": displacement, **columns}, compressed=True)


def _read(path: Path) -> list[LegState]:
    kept = read_arrays(path)
    try:
        return [
            LegState(float(at), *(kept[name][k] for name in _FIELDS))
            for k, at in enumerate(kept.get("displacement", ()))
        ]
    except (ValueError, LookupError, TypeError):
        return []
