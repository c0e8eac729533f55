"""Mesh of a segment of a leg in 3D: first-order tetrahedra in the fat and in the deep tissue.

The bones are holes whose surface is held. Elements are smaller where a layer of tissue is thin.

Triangulated surfaces bound the tissues: every part's tube, and the end faces. A tube is meshed where
it is flat, unrolled to (turns x mean perimeter, z), with its two edges in correspondence, and put
onto the part's smooth surface: no loft or boolean operation can fail. The end faces are meshed
between the tubes' ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
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
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, check_shape, perimeter
from legfem.geometry.leg_surface import PartSurface
from legfem.meshing.gmsh_mesh import (
    MeshQuality,
    element_quality,
    generate,
    gmsh_model,
    mesh_from_gmsh,
    raise_everywhere,
)
from legfem.meshing.grid import Support
from legfem.meshing.idealised_leg import END, LegMesh
from legfem.meshing.section import BONE, DEEP, SUPERFICIAL
from legfem.meshing.section import HULL as HULL_TAG
from legfem.meshing.section import SKIN as SKIN_TAG

_ALIKE = 1.1  # sizes within this ratio count as the same


@dataclass(frozen=True, eq=False)
class SizeField:
    r"""Sizes of elements that grow with the distance from where they are given.

    .. math:: h(x) = \min\Big(h_\infty,\; \min_b\,(h_b + g\,|x - x_b|)\Big)

    Parameters
    ----------
    points : (n, 3) array
        Where sizes are given, mm.
    sizes : (n,) array
        mm.
    growth : float
        Growth of the size per mm of distance.
    far_size : float
        Greatest size, mm.
    """

    points: FloatArray
    sizes: FloatArray
    growth: float
    far_size: float

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the sizes at some points (m, 3); (m,), mm."""
        found = np.full(len(points), self.far_size)
        for size, tree in self._trees:
            if size < self.far_size:
                reach = (self.far_size - size) / self.growth
                distance, _ = tree.query(points, distance_upper_bound=reach)
                found = np.minimum(found, size + self.growth * distance)
        return found

    @cached_property
    def _trees(self) -> list[tuple[float, cKDTree]]:
        """Trees of the points with about the same size."""
        group = np.floor(np.log(self.sizes) / np.log(_ALIKE)).astype(int)
        return [(float(self.sizes[group == g].mean()), cKDTree(self.points[group == g])) for g in np.unique(group)]


def bilinear(grid: FloatArray, low: tuple[float, float], step: tuple[float, float]) -> Callable[..., float]:
    """Return a fast function of (x, y) that interpolates values on a regular grid."""
    values: Any = grid.tolist()
    (x0, y0), (dx, dy) = low, step
    last_x, last_y = grid.shape[0] - 2, grid.shape[1] - 2

    def interpolated(x: float, y: float) -> float:
        a, b = (x - x0) / dx, (y - y0) / dy
        i, j = min(max(int(a), 0), last_x), min(max(int(b), 0), last_y)
        a, b = min(max(a - i, 0.0), 1.0), min(max(b - j, 0.0), 1.0)
        here, following = values[i], values[i + 1]
        return (1 - a) * ((1 - b) * here[j] + b * here[j + 1]) + a * ((1 - b) * following[j] + b * following[j + 1])

    return interpolated


def trilinear(grid: FloatArray, low: FloatArray, step: FloatArray) -> Callable[..., float]:
    """Return a fast function of (x, y, z) that interpolates values on a regular grid."""
    layers = [bilinear(layer, (low[0], low[1]), (step[0], step[1])) for layer in grid]
    z0, dz, last = float(low[2]), float(step[2]), len(layers) - 2

    def interpolated(x: float, y: float, z: float) -> float:
        c = (z - z0) / dz
        k = min(max(int(c), 0), last)
        c = min(max(c - k, 0.0), 1.0)
        return (1 - c) * layers[k](x, y) + c * layers[k + 1](x, y)

    return interpolated


type Triangles = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Shell:
    """Closed surfaces of the tissues, welded."""

    points: FloatArray
    """Corners of the triangles, (n, 3), mm."""
    tubes: Mapping[str, Triangles]
    """Part to its triangles, (m, 3)."""
    fat_ends: Triangles
    """Both end faces between skin and hull."""
    deep_ends: Triangles
    """Both end faces between hull and bones."""


def mesh_shell(shape: LegShape, sizes: SizeField, enclosing: bool = False) -> Shell:
    """Triangulate the surfaces of a leg with elements of given sizes.

    The flat triangles' corners lie on the surfaces, or beside them where they are to enclose what
    the surfaces do: `_enclosing`.
    """
    pieces: list[tuple[FloatArray, Triangles]] = []
    rings: dict[str, tuple[FloatArray, FloatArray]] = {}
    surfaces = {part: PartSurface(shape, part) for part in shape.parts}
    for part, surface in surfaces.items():
        points, triangles, bottom, top = _tube(surface, shape, sizes)
        pieces.append((points, triangles))
        rings[part] = points[bottom], points[top]
    for outer, inner in ((SKIN, (HULL,)), (HULL, shape.bones)):
        for end in range(2):
            pieces.append(_end_face(rings[outer][end], [rings[p][end] for p in inner], sizes))
    offsets = np.cumsum([0, *(len(points) for points, _ in pieces)])
    every = np.vstack([points for points, _ in pieces])
    points, place = _welded(every)
    faces = [place[t + offset] for (_, t), offset in zip(pieces, offsets[:-1], strict=True)]
    n = len(shape.parts)
    tubes = dict(zip(shape.parts, faces[:n], strict=True))
    if enclosing:
        for part, tube in tubes.items():
            points += _enclosing(surfaces[part], points, tube)
    return Shell(points, tubes, np.vstack(faces[n : n + 2]), np.vstack(faces[n + 2 :]))


def _enclosing(surface: PartSurface, points: FloatArray, tube: Triangles) -> FloatArray:
    """Return by how much to move points (n, 3), mm, across the leg to keep a tube's volume.

    Chords of length h about a radius R lie h^2 / (12 R) inside the circle in the mean; a corner
    moves by the mean of the triangles that meet there, and what is left is of fourth order.
    """
    corners = points[tube]
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    # Edge midpoints integrate what is quadratic exactly.
    inside = (surface.beside(middles.reshape(-1, 3)) - middles.reshape(-1, 3)).reshape(-1, 3, 3)
    inside[..., 2] = 0.0
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    moved, weight = np.zeros_like(points), np.zeros(len(points))
    for k in range(3):
        np.add.at(moved, tube[:, k], area[:, None] * inside.mean(axis=1))
        np.add.at(weight, tube[:, k], area)
    return moved / np.where(weight > 0, weight, 1.0)[:, None]


def _tube(
    surface: PartSurface, shape: LegShape, sizes: SizeField
) -> tuple[FloatArray, Triangles, NDArray[np.int64], NDArray[np.int64]]:
    """Return a tube's points and triangles, and the numbers of its lowest and highest ring."""
    around, low, high = surface.perimeter, float(shape.levels[0]), float(shape.levels[-1])
    turns = np.linspace(0.0, 1.0, max(24, round(around / 4)) + 1)
    levels = np.linspace(low, high, max(6, round((high - low) / 4)) + 1)
    on_tube = surface(turns[:, None], levels[None, :])
    grid = sizes(on_tube.reshape(-1, 3)).reshape(on_tube.shape[:2])
    size = bilinear(grid, (0.0, low), (around * turns[1], float(levels[1] - levels[0])))
    with gmsh_model("tube") as model:
        flat, triangles = _unrolled(model, around, low, high, size)
    points = surface(np.minimum(flat[:, 0] / around, 1.0), flat[:, 1])
    rings = [
        order[np.argsort(flat[order, 0])][:-1]  # the last one is the first one
        for order in (np.flatnonzero(np.isclose(flat[:, 1], z, atol=1e-9)) for z in (low, high))
    ]
    return points, triangles, rings[0], rings[1]


def _unrolled(
    model: Any, width: float, low: float, high: float, size: Callable[[float, float], float]
) -> tuple[FloatArray, Triangles]:
    geometry = model.geo
    corners = [geometry.addPoint(x, z, 0) for x, z in ((0, low), (width, low), (width, high), (0, high))]
    lines = [geometry.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    sides = lines[3], lines[1]
    geometry.addPlaneSurface([geometry.addCurveLoop(lines)])
    geometry.synchronize()
    shift = [1, 0, 0, width, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    model.mesh.setPeriodic(1, [sides[1]], [sides[0]], shift)
    model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y))
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    generate(model, 2)
    points, triangles = _triangles(model)
    return points[:, :2], triangles


def _end_face(outer: FloatArray, inner: list[FloatArray], sizes: SizeField) -> tuple[FloatArray, Triangles]:
    """Triangulate the plane between closed rings of nodes, which stay."""
    level = float(outer[0, 2])
    low, high = outer[:, :2].min(axis=0), outer[:, :2].max(axis=0)
    nodes = [np.linspace(low[k], high[k], max(8, round((high[k] - low[k]) / 3))) for k in range(2)]
    x, y = np.meshgrid(*nodes, indexing="ij")
    grid = sizes(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, level)])).reshape(x.shape)
    steps = float(nodes[0][1] - nodes[0][0]), float(nodes[1][1] - nodes[1][0])
    size = bilinear(grid, (float(low[0]), float(low[1])), steps)
    with gmsh_model("end") as model:
        geometry, loops = model.geo, []
        for ring in (outer, *inner):
            points = [geometry.addPoint(*xyz) for xyz in ring]
            lines = [geometry.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
            for line in lines:
                geometry.mesh.setTransfiniteCurve(line, 2)
            loops.append(geometry.addCurveLoop(lines))
        geometry.addPlaneSurface(loops)
        geometry.synchronize()
        model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y))
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        generate(model, 2)
        return _triangles(model)


def _triangles(model: Any) -> tuple[FloatArray, Triangles]:
    tags, coordinates, _ = model.mesh.getNodes()
    points = np.asarray(coordinates, dtype=np.float64).reshape(-1, 3)
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    _, corners = model.mesh.getElementsByType(2)
    return points, number[corners].reshape(-1, 3)


def _welded(points: FloatArray, tolerance: float = 1e-6) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the distinct points, and the number of each point among them."""
    first = np.arange(len(points))
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    # Never more than three at one place, all paired with one another: the lowest number stands.
    np.minimum.at(first, pairs.max(axis=1), pairs.min(axis=1))
    kept, place = np.unique(first, return_inverse=True)
    return points[kept], place


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
        Ends of the line on the skin that the strip lies about (mm); they may be one point.
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
        Strip of the skin with smaller elements.
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
        Ranks of the mesh; gmsh runs on rank 0.

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
    """Positions, (n_z, n_x, n_y, 3), mm."""
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
