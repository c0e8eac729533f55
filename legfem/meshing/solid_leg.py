"""Mesh of a segment of a leg in 3D: first-order tetrahedra in the fat and in the deep tissue.

The bones are holes whose surface is held. Elements are smaller where a layer of tissue is thin.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import gmsh
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial import cKDTree
from shapely import Polygon, contains_xy, prepare

from legfem.common.errors import InputError, check_positive
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.shape_checks import check_shape
from legfem.geometry.shape_measures import perimeter
from legfem.geometry.shape_surface import PartSurface
from legfem.meshing.gmsh_mesh import generate, gmsh_model, mesh_from_gmsh, raise_everywhere
from legfem.meshing.idealised_leg import END, LegMesh
from legfem.meshing.quality import MeshQuality, element_quality
from legfem.meshing.section import BONE, DEEP, SUPERFICIAL
from legfem.meshing.section import HULL as HULL_TAG
from legfem.meshing.section import SKIN as SKIN_TAG
from legfem.meshing.shell import Shell, Triangles, mesh_shell
from legfem.meshing.size_field import SizeField, trilinear
from legfem.meshing.support import Support

SOLID_REGIONS = {"superficial": SUPERFICIAL, "deep": DEEP}
WORST_QUALITY = 0.02
# Mean volume of a tetrahedron over its size cubed, as gmsh makes them: measured.
_FILL = 0.17


@dataclass(frozen=True)
class FineStrip:
    """A strip of skin with smaller elements: where an indenter presses.

    Parameters
    ----------
    ends : (3,) and (3,) tuple
        Of the line on the skin that the strip lies about (mm); they may be one point.
    reach : float
        From the line, to where elements are this small (mm).
    size : float
        Greatest edge length (mm).
    """

    ends: tuple[tuple[float, float, float], tuple[float, float, float]]
    reach: float
    size: float

    def holds(self, points: FloatArray) -> NDArray[np.bool_]:
        """Tell which points (n, 3) lie within reach."""
        start, end = np.array(self.ends)
        along = end - start
        share = np.clip((points - start) @ along / max(along @ along, 1e-12), 0.0, 1.0)
        away = np.linalg.norm(points - start - share[:, None] * along, axis=1)
        return np.asarray(away < self.reach)


@dataclass(frozen=True)
class SolidMeshSettings:
    """How fine the mesh of a leg's segment is; lengths in mm.

    Parameters
    ----------
    skin_size : float
        Greatest edge length on the skin and the hull.
    inside_size : float
        Greatest edge length inside.
    bone_size : float
        Greatest edge length on the bones.
    layer_elements : float
        Elements wanted across a layer of tissue where it is thin: edges there are at most the
        layer's thickness over this.
    turn_elements : float
        Least number of edges around a part.
    growth : float
        Growth of the edge length per mm of distance from the surfaces.
    clearance : float
        Least distance between the parts' surfaces that is meshed.
    z_range : (float, float), optional
        Part of the leg to mesh; the whole by default.
    strip : FineStrip, optional
        Of the skin, with smaller elements.
    enclosing : bool
        Whether flat facets enclose the volume that the smooth surfaces do, instead of having their
        corners on them.
    """

    skin_size: float = 5.0
    inside_size: float = 7.0
    bone_size: float = 4.0
    layer_elements: float = 0.8
    turn_elements: float = 12.0
    growth: float = 0.25
    clearance: float = 0.5
    z_range: tuple[float, float] | None = None
    strip: FineStrip | None = None
    enclosing: bool = False

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(
            self, "skin_size", "inside_size", "bone_size", "layer_elements", "turn_elements", "growth", "clearance"
        )

    def refined(self, factor: float) -> SolidMeshSettings:
        """Return settings with all edges ``factor`` times shorter."""
        return replace(
            self,
            skin_size=self.skin_size / factor,
            inside_size=self.inside_size / factor,
            bone_size=self.bone_size / factor,
            layer_elements=self.layer_elements * factor,
            turn_elements=max(min(10.0, self.turn_elements), self.turn_elements * factor),
            strip=self.strip and replace(self.strip, size=self.strip.size / factor),
        )


def settings_for_cells(shape: LegShape, cells: int, settings: SolidMeshSettings | None = None) -> SolidMeshSettings:
    """Return settings, refined or coarsened, that give about a number of tetrahedra.

    Raises
    ------
    InputError
        If the leg can't be meshed with so few.
    """
    settings = settings or SolidMeshSettings()
    shape = _segment(shape, settings)
    grid = _Grid.over(shape, spacing=5.0)

    def excess(log_factor: float) -> float:
        field = _size_field(shape, settings.refined(math.exp(log_factor)), spacing=6.0)
        return math.log(grid.cells(field) / cells)

    low, high = math.log(0.2), math.log(12.0)
    least, most = (cells * math.exp(excess(end)) for end in (low, high))
    if not least <= cells <= most:
        raise InputError(
            "mesh",
            "cells",
            f"{cells} tetrahedra can't be had for this leg",
            f"choose from {1000 * math.ceil(least / 1000)} to {1000 * math.floor(most / 1000)}",
        )
    return settings.refined(math.exp(brentq(excess, low, high, xtol=0.01)))


def mesh_solid_leg(
    shape: LegShape, settings: SolidMeshSettings | None = None, comm: MPI.Intracomm = MPI.COMM_SELF
) -> LegMesh:
    """Mesh a segment of a leg.

    Parameters
    ----------
    shape : LegShape
        The leg; its surfaces follow bicubic splines through the contours.
    settings : SolidMeshSettings, optional
        Sizes; see `settings_for_cells`.
    comm : MPI.Intracomm
        Of the mesh; gmsh runs on its rank 0.

    Returns
    -------
    LegMesh
        Facets `SKIN`, `HULL`, `BONE` (held) and `END`; regions superficial and deep.

    Raises
    ------
    InputError
        If the parts do not nest, or no mesh of sound quality can be made.
    """
    settings = settings or SolidMeshSettings()
    shape = _segment(shape, settings)
    shell = error = None
    if comm.rank == 0:
        try:
            check_shape(shape, "shape", settings.clearance, leg_sized=False)
            shell = mesh_shell(shape, _size_field(shape, settings, spacing=3.0), settings.enclosing)
        except InputError as found:
            error = found
    raise_everywhere(comm, error)
    with gmsh_model("leg") as model:
        quality = None
        if comm.rank == 0:
            assert shell is not None
            error = _fill(model, shape, shell, settings)
            if error is None:
                quality = element_quality(model, SOLID_REGIONS, dimension=3)
                error = _unsound(quality)
        raise_everywhere(comm, error)
        mesh, cell_tags, facet_tags = mesh_from_gmsh(model, comm, gdim=3)
    quality = comm.bcast(quality, root=0)
    supports = (Support(BONE, (0, 1, 2)),)
    return LegMesh(mesh, cell_tags, facet_tags, SOLID_REGIONS, supports, 1, quality)


def _segment(shape: LegShape, settings: SolidMeshSettings) -> LegShape:
    if settings.z_range is None:
        return shape
    low, high = settings.z_range
    inside = shape.levels[(shape.levels > low + 0.1) & (shape.levels < high - 0.1)]
    return shape.at_levels(np.concatenate([[low], inside, [high]]))


def _unsound(quality: MeshQuality) -> InputError | None:
    if quality.worst > WORST_QUALITY:
        return None
    return InputError(
        "shape",
        quality.worst_region,
        f"cannot be meshed soundly (worst element quality {quality.worst:.2g})",
        "smooth the shape, leave more room between its parts, or ask for a finer mesh",
    )


def _fill(model: Any, shape: LegShape, shell: Shell, settings: SolidMeshSettings) -> InputError | None:
    """Fill the shell with tetrahedra; return what went wrong."""
    model.mesh.addNodes(2, model.addDiscreteEntity(2), np.arange(1, len(shell.points) + 1), shell.points.ravel())
    tubes = {part: _add(model, triangles) for part, triangles in shell.tubes.items()}
    fat_ends, deep_ends = _add(model, shell.fat_ends), _add(model, shell.deep_ends)
    bones = [tubes[bone] for bone in shape.bones]
    geometry = model.geo
    fat = geometry.addVolume([geometry.addSurfaceLoop([tubes[SKIN], tubes[HULL], fat_ends])])
    deep = geometry.addVolume([geometry.addSurfaceLoop([tubes[HULL], *bones, deep_ends])])
    geometry.synchronize()
    grid = _Grid.over(shape, spacing=3.0)
    sizes = grid.sizes(_size_field(shape, settings, spacing=3.0))
    model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: sizes(x, y, z))
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    try:
        generate(model, 3)
    except InputError as error:
        return error
    except Exception as error:  # gmsh raises nothing more specific
        return InputError(
            "shape",
            "mesh",
            f"gmsh cannot fill the surfaces ({error})",
            "smooth the shape, leave more room between its parts, or ask for a finer mesh",
        )
    for volume, tag in ((fat, SUPERFICIAL), (deep, DEEP)):
        model.addPhysicalGroup(3, [volume], tag)
    for surfaces, tag in (
        ([tubes[SKIN]], SKIN_TAG),
        ([tubes[HULL]], HULL_TAG),
        (bones, BONE),
        ([fat_ends, deep_ends], END),
    ):
        model.addPhysicalGroup(2, surfaces, tag)
    return None


def _add(model: Any, triangles: Triangles) -> int:
    tag = int(model.addDiscreteEntity(2))
    model.mesh.addElementsByType(tag, 2, [], (triangles + 1).ravel())
    return tag


def _size_field(shape: LegShape, settings: SolidMeshSettings, spacing: float) -> SizeField:
    """Return sizes on the surfaces: as asked, smaller where a layer is thin or a part is small."""
    on = {part: _sampled(shape, part, spacing) for part in shape.parts}
    close = {part: cKDTree(_sampled(shape, part, 1.5)) for part in shape.parts}
    neighbours = {SKIN: (HULL,), HULL: (SKIN, *shape.bones)}
    points, sizes = [], []
    for part, xyz in on.items():
        size = settings.bone_size if part in shape.bones else settings.skin_size
        size = min(size, float(perimeter(shape, part).mean()) / settings.turn_elements)
        others = neighbours.get(part, (HULL, *(b for b in shape.bones if b != part)))
        gap = np.min([close[other].query(xyz)[0] for other in others], axis=0)
        points.append(xyz)
        sizes.append(np.minimum(size, gap / settings.layer_elements))
        if part == SKIN and settings.strip is not None:
            fine = settings.strip.holds(xyz)
            sizes[-1] = np.where(fine, np.minimum(sizes[-1], settings.strip.size), sizes[-1])
    return SizeField(np.vstack(points), np.concatenate(sizes), settings.growth, settings.inside_size)


def _sampled(shape: LegShape, part: str, spacing: float) -> FloatArray:
    surface = PartSurface(shape, part)
    turns = np.arange(0.0, 1.0, min(spacing / surface.perimeter, 1 / 16))
    levels = np.linspace(shape.levels[0], shape.levels[-1], max(4, math.ceil(shape.length / spacing) + 1))
    return surface(turns[:, None], levels[None, :]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class _Grid:
    """A regular grid over the leg's tissue."""

    low: FloatArray
    step: FloatArray
    points: FloatArray
    """(n_z, n_x, n_y, 3)."""
    inside: NDArray[np.bool_]
    """Whether a point is in tissue, (n_z, n_x, n_y)."""

    @staticmethod
    def over(shape: LegShape, spacing: float) -> _Grid:
        skin = shape.points(SKIN).reshape(-1, 3)
        low, high = skin.min(axis=0), skin.max(axis=0)
        axes = [np.linspace(low[k], high[k], max(3, math.ceil((high[k] - low[k]) / spacing) + 1)) for k in range(3)]
        step = np.array([axis[1] - axis[0] for axis in axes])
        z, x, y = np.meshgrid(axes[2], axes[0], axes[1], indexing="ij")
        inside = np.zeros(z.shape, dtype=bool)
        for k, level in enumerate(axes[2]):
            tissue = Polygon(shape.at(SKIN, level), [shape.at(b, level) for b in shape.bones])
            prepare(tissue)
            inside[k] = contains_xy(tissue, x[k], y[k])
        return _Grid(low, step, np.stack([x, y, z], axis=-1), inside)

    def cells(self, field: SizeField) -> float:
        """Return about how many tetrahedra fill the tissue."""
        sizes = field(self.points[self.inside])
        return float((1 / sizes**3).sum() * self.step.prod() / _FILL)

    def sizes(self, field: SizeField) -> Callable[..., float]:
        """Return the field interpolated, fast at single points."""
        values = field(self.points.reshape(-1, 3)).reshape(self.inside.shape)
        return trilinear(values, self.low, self.step)
