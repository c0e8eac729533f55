r"""Meshes by sweeping grids: the idealised leg, round about a round bone, and the half plane of a round specimen.

A quarter of the leg is meshed, for the symmetry planes :math:`x = 0` and :math:`z = 0`
(mid-length). The cylinder stands above, at :math:`(0, R + r)`, and travels along :math:`-y`. A node
with numbers :math:`(i, j, k)` lies on ray :math:`\theta_i` from the bone to the skin, at fraction
:math:`t_j` of a layer and height :math:`z_k`:

.. math:: x = \rho\,(\sin\theta, \cos\theta) + (0, e),

with radius :math:`\rho` and centre :math:`e` interpolated between the layer's two circles. Without
:math:`z` the same grid is the leg's section, so that plane strain and 3D differ in nothing else.

A specimen's mesh is a rectangle of quadrilaterals; coordinates are the distance from the axis and the height above the
base.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI

from legfem.common.errors import AboveZero, Checked, InputError, ZeroOrMore
from legfem.common.units import FloatArray
from legfem.meshing.gmsh_mesh import MeshQuality
from legfem.meshing.grid import ElementSizes, Support, TaggedMesh, spaced, tagged, unit_cells
from legfem.meshing.section import BONE, DEEP, REGIONS, SKIN

MIRROR_X, MIRROR_Z, END = 13, 14, 15

Cells = Literal["hexahedra", "tetrahedra"]


@dataclass(frozen=True)
class IdealisedLeg(Checked):
    """A round leg about a round bone.

    Parameters
    ----------
    radius, bone_radius : float
        mm.
    length : float
        Length of the leg's segment, mm.
    bone_offset : float
        Offset of the bone's axis from the leg's, towards the cylinder (mm).
    fat, fascia : float
        Thickness of the superficial tissue and of the fascia (mm); without both the leg is of deep
        tissue alone, as the paper's.
    ends : {"free", "held"}
        Whether the end faces may move along the leg.
    """

    radius: AboveZero[float] = 57.0
    bone_radius: AboveZero[float] = 15.0
    length: AboveZero[float] = 120.0
    bone_offset: float = 0.0
    fat: ZeroOrMore[float] = 0.0
    fascia: ZeroOrMore[float] = 0.0
    ends: Literal["free", "held"] = "free"

    def __post_init__(self) -> None:
        """Check that the bone lies within the leg and its layers."""
        super().__post_init__()
        inner = self.radius - self.fat - self.fascia
        if abs(self.bone_offset) + self.bone_radius >= 0.98 * inner:
            problem = f"a bone of radius {self.bone_radius:g} mm, {self.bone_offset:g} mm off the axis, "
            problem += f"is not inside the deep tissue of radius {inner:g} mm"
            raise InputError("leg", "bone_radius", problem, "make the bone smaller or the leg thicker")

    @property
    def depth_to_bone(self) -> float:
        """Thickness of tissue between cylinder and bone (mm)."""
        return self.radius - self.bone_offset - self.bone_radius

    @property
    def layers(self) -> tuple[tuple[str, float], ...]:
        """Region and outer radius (mm) of every layer, from the bone outwards."""
        layers = [("deep", self.radius - self.fat - self.fascia)]
        if self.fascia:
            layers.append(("fascia", self.radius - self.fat))
        if self.fat:
            layers.append(("superficial", self.radius))
        return tuple(layers)

    @property
    def regions(self) -> dict[str, int]:
        """Tags of the layers."""
        return {name: REGIONS[name] for name, _ in self.layers}


@dataclass(frozen=True)
class LegMeshSettings(ElementSizes):
    """How fine the mesh of an idealised leg is; all lengths in mm.

    Parameters
    ----------
    contact_size : float
        Length of an element along the skin under the cylinder, around the leg.
    depth_size : float
        Along the rays at the skin.
    edge_size : float
        Along the leg at the cylinder's end.
    growth : float
        Growth of the lengths per mm of distance from there.
    far_size : float
        Greatest length.
    cells : {"hexahedra", "tetrahedra"}
        Tetrahedra are six a hexahedron.
    degree : int
        Degree of the displacement on these cells.
    """

    contact_size: AboveZero[float] = 3.0
    depth_size: AboveZero[float] = 5.0
    edge_size: AboveZero[float] = 2.5
    growth: AboveZero[float] = 0.3
    far_size: AboveZero[float] = 15.0
    cells: Cells = "hexahedra"
    degree: int = 2


@dataclass(frozen=True, eq=False)
class LegMesh(TaggedMesh):
    """A meshed leg, a quarter of one, or half of its section.

    Its facets' tags are `SKIN`, `BONE`, `MIRROR_X`, `MIRROR_Z` and `END`.
    """

    regions: Mapping[str, int]
    supports: tuple[Support, ...]
    copies: int
    """Number of mirror images that make the whole."""
    quality: MeshQuality | None = None
    """Quality of the elements, where the mesh is not a bent grid."""


def mesh_leg(
    leg: IdealisedLeg,
    cylinder_radius: float,
    cylinder_length: float | None,
    settings: LegMeshSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
) -> LegMesh:
    """Mesh a quarter of the leg, fine where the cylinder of given size (mm) will press; half of its section without.

    Parameters
    ----------
    cylinder_length
        None for the section alone, which has the same grid.
    """
    settings = settings or LegMeshSettings()
    around, circles, layer = _section_grid(leg, cylinder_radius, settings)
    along = None if cylinder_length is None else _along(leg, cylinder_length, settings)
    counts = [len(axis) - 1 for axis in (around, circles[0], along) if axis is not None]
    made = unit_cells(comm, counts, settings.cells == "tetrahedra")
    tags = {(0, 0): MIRROR_X, (0, counts[0]): MIRROR_X, (1, 0): BONE, (1, counts[1]): SKIN}
    supports = [Support(BONE, tuple(range(len(counts)))), Support(MIRROR_X, (0,))]
    if along is not None:
        tags |= {(2, 0): MIRROR_Z, (2, counts[2]): END}
        supports += [Support(MIRROR_Z, (2,)), *([Support(END, (2,))] if leg.ends == "held" else [])]
    cell_tags, facet_tags = tagged(made, layer, tags)
    nodes = made.geometry.x
    if along is not None:
        nodes[:, 2] = np.interp(nodes[:, 2], np.arange(len(along)), along)
    theta = np.interp(nodes[:, 0], np.arange(len(around)), around)
    radius, centre = (np.interp(nodes[:, 1], np.arange(len(one)), one) for one in circles)
    nodes[:, 0], nodes[:, 1] = radius * np.sin(theta), centre + radius * np.cos(theta)
    return LegMesh(made, cell_tags, facet_tags, leg.regions, tuple(supports), 2 if along is None else 4)


def grid_counts(
    leg: IdealisedLeg, cylinder_radius: float, cylinder_length: float, settings: LegMeshSettings
) -> tuple[int, int, int]:
    """Return the numbers of hexahedra around, through and along the mesh of `mesh_leg`."""
    around, circles, _ = _section_grid(leg, cylinder_radius, settings)
    return len(around) - 1, circles.shape[1] - 1, len(_along(leg, cylinder_length, settings)) - 1


def _section_grid(
    leg: IdealisedLeg, cylinder_radius: float, settings: LegMeshSettings
) -> tuple[FloatArray, FloatArray, list[int]]:
    """Return the rays' angles, the circles' radii and centres (2, n), and the region's tag of every ring of cells."""
    # The skin wraps the cylinder up to 1.4 of its radius from the middle, measured along the skin.
    reach = 1.4 * cylinder_radius

    def along_skin(s: FloatArray) -> FloatArray:
        distance = np.maximum(s - reach, 0)
        return np.minimum(settings.contact_size + settings.growth * distance, settings.far_size)

    around = spaced(np.pi * leg.radius, along_skin) / leg.radius
    radius, centre, layer = [leg.bone_radius], [leg.bone_offset], []
    for name, outer in leg.layers:
        inner, start = radius[-1], centre[-1]

        def along_ray(t: FloatArray, outer: float = outer, above: float = leg.radius - outer) -> FloatArray:
            return np.minimum(settings.depth_size + settings.growth * (above + t), settings.far_size)

        inward = spaced(outer - inner, along_ray)
        fraction = 1 - inward[::-1] / (outer - inner)
        radius.extend(inner + (outer - inner) * fraction[1:])
        centre.extend(start * (1 - fraction[1:]))
        layer.extend([leg.regions[name]] * (len(fraction) - 1))
    return around, np.array([radius, centre]), layer


def _along(leg: IdealisedLeg, cylinder_length: float, settings: LegMeshSettings) -> FloatArray:
    """Return the heights of the nodes from mid-length on, finest at the cylinder's end."""
    half, edge = leg.length / 2, min(cylinder_length, leg.length) / 2

    def size(z: FloatArray) -> FloatArray:
        growing = settings.edge_size + settings.growth * np.abs(z - edge)
        return np.minimum(growing, settings.far_size)

    return spaced(half, size, stops=(edge,))


AXIS, BASE, SIDE, RIM, OUTSIDE = 13, BONE, 17, 18, 19


@dataclass(frozen=True)
class MeridianMeshSettings(ElementSizes):
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

    size: AboveZero[float]
    growth: ZeroOrMore[float] = 0.3
    far_size: AboveZero[float] = 6.0


def mesh_meridian(
    radius: float,
    height: float,
    fine: tuple[float, float],
    settings: MeridianMeshSettings,
    side: Literal["skin", "free"] = "free",
    comm: MPI.Intracomm = MPI.COMM_SELF,
    interfaces: Sequence[float] = (),
    rings: Sequence[tuple[int, float]] = (),
) -> TaggedMesh:
    """Mesh the half plane of a specimen of a radius and height (mm).

    Its cells' tags are `DEEP`, and one more at each interface from the base up; its facets' `SKIN` above, `BASE` below,
    `AXIS`, and `SKIN` or `SIDE` at the side.

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
        skin = facet_tags.find(SKIN)
        number = np.searchsorted([outer for _, outer in rings], dolfinx_mesh.compute_midpoints(made, 1, skin)[:, 0])
        values = facet_tags.values.copy()
        values[facet_tags.values == SKIN] = np.array([*(tag for tag, _ in rings), OUTSIDE])[number]
        facet_tags = dolfinx_mesh.meshtags(made, 1, facet_tags.indices, values)
    return TaggedMesh(made, cell_tags, facet_tags)


def supports(base: Literal["bonded", "sliding"]) -> tuple[Support, ...]:
    """Return the supports of the axis (radially) and of the base (``"bonded"`` in all directions, else axially)."""
    return Support(AXIS, (0,)), Support(BASE, (0, 1) if base == "bonded" else (1,))
