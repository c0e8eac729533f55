"""Mesh of a segment of a leg in 3D: first-order tetrahedra in the fat and in the deep tissue.

The bones are holes whose surface is held. Elements are smaller where a layer of tissue is thin.

Triangulated surfaces bound the tissues: every part's tube, and the end faces. A tube is meshed where
it is flat, unrolled to (turns x mean perimeter, z), with its two edges in correspondence, and put
onto the part's smooth surface: no loft or boolean operation can fail. The end faces are meshed
between the tubes' ends.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gmsh
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, PartSurface, check_shape
from legfem.meshing import gmsh_mesh
from legfem.meshing.grid import Support
from legfem.meshing.leg_sizes import SizeField, SolidMeshSettings, TissueGrid, bilinear, size_field
from legfem.meshing.section import BONE, DEEP, SUPERFICIAL, muscle_tags, tagged_muscles
from legfem.meshing.section import HULL as HULL_TAG
from legfem.meshing.section import SKIN as SKIN_TAG
from legfem.meshing.structured import END, LegMesh

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
        pieces += [_end_face(rings[outer][end], [rings[p][end] for p in inner], sizes) for end in range(2)]
    offsets = np.cumsum([0, *(len(points) for points, _ in pieces)])
    every = np.vstack([points for points, _ in pieces])
    first, pairs = np.arange(len(every)), cKDTree(every).query_pairs(1e-6, output_type="ndarray")
    # Never more than three at one place, all paired with one another: the lowest number stands.
    np.minimum.at(first, pairs.max(axis=1), pairs.min(axis=1))
    kept, place = np.unique(first, return_inverse=True)
    points = every[kept]
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
    inside = (surface.nearest_at_level(middles.reshape(-1, 3)) - middles.reshape(-1, 3)).reshape(-1, 3, 3)
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
    with gmsh_mesh.gmsh_model("tube") as model:
        geometry = model.geo
        corners = [geometry.addPoint(x, z, 0) for x, z in ((0, low), (around, low), (around, high), (0, high))]
        lines = [geometry.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
        geometry.addPlaneSurface([geometry.addCurveLoop(lines)])
        geometry.synchronize()
        shift = [1, 0, 0, around, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
        model.mesh.setPeriodic(1, [lines[1]], [lines[3]], shift)
        flat, triangles = _triangulated(model, size)
    points = surface(np.minimum(flat[:, 0] / around, 1.0), flat[:, 1])
    rings = [
        order[np.argsort(flat[order, 0])][:-1]  # the last one is the first one
        for order in (np.flatnonzero(np.isclose(flat[:, 1], z, atol=1e-9)) for z in (low, high))
    ]
    return points, triangles, rings[0], rings[1]


def _end_face(outer: FloatArray, inner: list[FloatArray], sizes: SizeField) -> tuple[FloatArray, Triangles]:
    """Triangulate the plane between closed rings of nodes, which stay."""
    level = float(outer[0, 2])
    low, high = outer[:, :2].min(axis=0), outer[:, :2].max(axis=0)
    nodes = [np.linspace(low[k], high[k], max(8, round((high[k] - low[k]) / 3))) for k in range(2)]
    x, y = np.meshgrid(*nodes, indexing="ij")
    grid = sizes(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, level)])).reshape(x.shape)
    steps = float(nodes[0][1] - nodes[0][0]), float(nodes[1][1] - nodes[1][0])
    size = bilinear(grid, (float(low[0]), float(low[1])), steps)
    with gmsh_mesh.gmsh_model("end") as model:
        geometry, loops = model.geo, []
        for ring in (outer, *inner):
            _, lines = gmsh_mesh.drawn(geometry, ring)
            loops.append(geometry.addCurveLoop(lines))
        geometry.addPlaneSurface(loops)
        geometry.synchronize()
        return _triangulated(model, size)


def _triangulated(model: Any, size: Callable[[float, float], float]) -> tuple[FloatArray, Triangles]:
    """Mesh a plane model with triangles of sizes (mm) by place; return points (n, 3) and triangles (m, 3)."""
    model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y))
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh_mesh.generate(model, 2)
    tags, coordinates, _ = model.mesh.getNodes()
    points = np.asarray(coordinates, dtype=np.float64).reshape(-1, 3)
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    _, corners = model.mesh.getElementsByType(2)
    return points, number[corners].reshape(-1, 3)


SOLID_REGIONS = {"superficial": SUPERFICIAL, "deep": DEEP}
_REMEDY = "smooth the shape, leave more room between its parts, or ask for a finer mesh"


def mesh_solid_leg(
    shape: LegShape,
    settings: SolidMeshSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    muscles: Mapping[str, BaseGeometry] | None = None,
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
    muscles : mapping of str to Polygon or MultiPolygon, optional
        Regions of their own within the deep tissue, the same at all levels: the elements whose middle they hold.

    Returns
    -------
    LegMesh
        Facets `SKIN`, `HULL`, `BONE` (held) and `END`; regions superficial, deep, and muscles.

    Raises
    ------
    InputError
        If the parts do not nest, or no mesh of sound quality can be made.
    """
    settings = settings or SolidMeshSettings()

    def surfaces() -> tuple[SizeField, Shell]:
        check_shape(shape, "shape", settings.clearance, leg_sized=False)
        sizes = size_field(shape, settings, spacing=3.0)
        return sizes, mesh_shell(shape, sizes, settings.enclosing)

    sizes, shell = gmsh_mesh.on_first_rank(comm, surfaces)
    with gmsh_mesh.gmsh_model("leg") as model:

        def fill() -> gmsh_mesh.MeshQuality:
            _fill(model, shape, shell, sizes)
            return gmsh_mesh.sound(gmsh_mesh.element_quality(model, SOLID_REGIONS, dimension=3), "shape", _REMEDY)

        quality = gmsh_mesh.on_first_rank(comm, fill)
        mesh, cell_tags, facet_tags = gmsh_mesh.mesh_from_gmsh(model, comm, gdim=3)
    cell_tags = tagged_muscles(mesh, cell_tags, muscles or {})
    regions = {**SOLID_REGIONS, **muscle_tags(muscles or ())}
    return LegMesh(mesh, cell_tags, facet_tags, regions, (Support(BONE, (0, 1, 2)),), 1, quality)


def _fill(model: Any, shape: LegShape, shell: Shell, field: SizeField) -> None:
    """Fill the shell with tetrahedra."""
    model.mesh.addNodes(2, model.addDiscreteEntity(2), np.arange(1, len(shell.points) + 1), shell.points.ravel())
    tubes = {part: _add(model, triangles) for part, triangles in shell.tubes.items()}
    fat_ends, deep_ends = _add(model, shell.fat_ends), _add(model, shell.deep_ends)
    bones = [tubes[bone] for bone in shape.bones]
    geometry = model.geo
    fat = geometry.addVolume([geometry.addSurfaceLoop([tubes[SKIN], tubes[HULL], fat_ends])])
    deep = geometry.addVolume([geometry.addSurfaceLoop([tubes[HULL], *bones, deep_ends])])
    geometry.synchronize()
    sizes = TissueGrid.over(shape, spacing=3.0).sizes(field)
    model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: sizes(x, y, z))
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    try:
        gmsh_mesh.generate(model, 3)
    except InputError:
        raise
    except Exception as error:  # gmsh raises nothing more specific
        raise InputError("shape", "mesh", f"gmsh cannot fill the surfaces ({error})", _REMEDY) from None
    for volume, tag in ((fat, SUPERFICIAL), (deep, DEEP)):
        model.addPhysicalGroup(3, [volume], tag)
    for surfaces, tag in (
        ([tubes[SKIN]], SKIN_TAG),
        ([tubes[HULL]], HULL_TAG),
        (bones, BONE),
        ([fat_ends, deep_ends], END),
    ):
        model.addPhysicalGroup(2, surfaces, tag)


def _add(model: Any, triangles: Triangles) -> int:
    tag = int(model.addDiscreteEntity(2))
    model.mesh.addElementsByType(tag, 2, [], (triangles + 1).ravel())
    return tag
