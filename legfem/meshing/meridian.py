"""Mesh of the meridional half plane of a round specimen: a rectangle of quadrilaterals.

Coordinates are the distance from the axis and the height above the base.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI

from legfem.common.errors import check_positive
from legfem.common.units import FloatArray
from legfem.meshing.grid import Support, TaggedMesh, spaced, tagged, unit_cells
from legfem.meshing.section import BONE, DEEP, SKIN

AXIS, BASE, SIDE, RIM, OUTSIDE = 13, BONE, 17, 18, 19


@dataclass(frozen=True)
class MeridianMeshSettings:
    """How fine the mesh of a specimen is.

    Parameters
    ----------
    size : float
        Size of an element where the specimen is pressed (mm).
    growth : float
        Growth of the size per mm of distance from there.
    far_size : float
        Greatest size (mm).
    """

    size: float
    growth: float = 0.3
    far_size: float = 6.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "size", "far_size")
        check_positive(self, "growth", zero_allowed=True)

    def refined(self, factor: float) -> "MeridianMeshSettings":
        """Return settings with all lengths divided by ``factor``."""
        return MeridianMeshSettings(self.size / factor, self.growth / factor, self.far_size / factor)


@dataclass(frozen=True, eq=False)
class MeridianMesh(TaggedMesh):
    """A meshed half plane.

    Its cells' tags are `DEEP`, and one more at each interface from the base up; its facets' `SKIN`
    above, `BASE` below, `AXIS`, and `SKIN` or `SIDE` at the side.
    """


def mesh_meridian(
    radius: float,
    height: float,
    fine: tuple[float, float],
    settings: MeridianMeshSettings,
    side: Literal["skin", "free"] = "free",
    comm: MPI.Intracomm = MPI.COMM_SELF,
    interfaces: Sequence[float] = (),
    rings: Sequence[tuple[int, float]] = (),
) -> MeridianMesh:
    """Mesh a specimen of a radius and height (mm).

    Parameters
    ----------
    radius, height
        Radius and height of the specimen, mm.
    fine
        Distances from the axis (mm) between which the mesh is fine, from the top down.
    settings
        Sizes.
    side
        Whether what presses may touch the side too.
    comm
        Ranks of the mesh.
    interfaces
        Heights (mm) at which one tissue meets the next, from the base up.
    rings
        Tags and outer radii (mm) of parts of the top, from the axis out, in place of `SKIN`; what
        is farther out has none.
    """

    def graded(distance: FloatArray) -> FloatArray:
        size = settings.size + settings.growth * np.maximum(distance, 0.0)
        return np.minimum(size, settings.far_size)

    def across(r: FloatArray) -> FloatArray:
        return graded(np.maximum(fine[0] - r, r - fine[1]))

    r = spaced(radius, across, tuple(outer for _, outer in rings))
    z = height - spaced(height, graded, tuple(height - z for z in reversed(interfaces)))[::-1]
    counts = [len(r) - 1, len(z) - 1]
    made = unit_cells(comm, counts)
    sides = {(0, 0): AXIS, (0, counts[0]): SKIN if side == "skin" else SIDE, (1, 0): BASE, (1, counts[1]): SKIN}
    middles = 0.5 * (z[1:] + z[:-1])
    rows = [DEEP + int(number) for number in np.searchsorted(list(interfaces), middles)]
    cell_tags, facet_tags = tagged(made, rows, sides)
    nodes = made.geometry.x
    nodes[:, 0] = np.interp(nodes[:, 0], np.arange(len(r)), r)
    nodes[:, 1] = np.interp(nodes[:, 1], np.arange(len(z)), z)
    if rings:
        facet_tags = _in_rings(made, facet_tags, rings)
    return MeridianMesh(made, cell_tags, facet_tags)


def _in_rings(made: Any, facet_tags: Any, rings: Sequence[tuple[int, float]]) -> Any:
    """Return facet tags with those of rings in place of `SKIN`."""
    skin = facet_tags.find(SKIN)
    middle = dolfinx_mesh.compute_midpoints(made, 1, skin)[:, 0]
    number = np.searchsorted([outer for _, outer in rings], middle)
    tags = np.array([*(tag for tag, _ in rings), OUTSIDE], dtype=np.int32)
    kept = facet_tags.values != SKIN
    facets = np.concatenate([facet_tags.indices[kept], skin])
    values = np.concatenate([facet_tags.values[kept], tags[number]])
    order = np.argsort(facets)
    return dolfinx_mesh.meshtags(made, 1, facets[order], values[order])


def supports(base: Literal["bonded", "sliding"]) -> tuple[Support, ...]:
    """Return the supports of the axis (radially) and of the base (``"bonded"`` in all directions, else axially)."""
    return Support(AXIS, (0,)), Support(BASE, (0, 1) if base == "bonded" else (1,))
