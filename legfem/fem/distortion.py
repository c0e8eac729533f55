"""Where a body is distorted most: what a solution that stops there is told by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.fem.system import System


@dataclass(frozen=True, eq=False)
class DrawnOut:
    """The element of a plane body that is drawn out most, on this rank."""

    region: int
    """Tag of its tissue."""
    stretch: float
    """Greatest, from its corners' displacements."""
    place: FloatArray
    """(2,): its middle before it moved, mm."""


def most_drawn_out(system: System) -> DrawnOut:
    """Return the triangle of a section whose corners were drawn apart most, in the last state."""
    spaces = system.spaces
    space = spaces.displacement_space
    moved = np.asarray(system.unknown.x.array[spaces.displacement_dofs]).reshape(-1, 2)
    places = space.tabulate_dof_coordinates()[:, :2]
    corners = space.dofmap.list[spaces.cell_tags.indices][:, :3]
    before = np.swapaxes(places[corners][:, 1:] - places[corners][:, :1], 1, 2)
    now = places[corners] + moved[corners]
    after = np.swapaxes(now[:, 1:] - now[:, :1], 1, 2)
    stretch = np.linalg.svd(after @ np.linalg.inv(before), compute_uv=False)[:, 0]
    worst = int(np.argmax(stretch))
    return DrawnOut(int(spaces.cell_tags.values[worst]), float(stretch[worst]), places[corners[worst]].mean(axis=0))
