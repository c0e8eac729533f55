"""A leg's shape from surfaces of its parts, closed but for their ends: what trimesh reads, and VTK's polydata."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import ArrayLike
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.geometry.contours import MUSCLE_HULL, check_girth
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.motion import CuttingPlane
from legfem.geometry.part_names import BONE, part_named
from legfem.geometry.section_from_outlines import Clearances, outline_of
from legfem.imaging.outlines import nested_shape
from legfem.imaging.polydata_reader import read_polydata

_LOOSE = "edges without two triangles"
_END = 1e-3  # mm; nearer than that to a surface's end a plane passes through it


def read_surfaces(paths: Mapping[str, Sequence[Path]]) -> dict[str, list[Any]]:
    """Read the closed surfaces of a leg's parts.

    Parameters
    ----------
    paths : mapping
        Parts (see `legfem.geometry.part_names.part_named`) to their files; coordinates in mm, z along the leg.
        The hull may be given muscle by muscle.

    Raises
    ------
    InputError
        If a file or a part is missing, or the coordinates are not mm.
    """
    files: dict[str, list[Path]] = {}
    for name, own in paths.items():
        files.setdefault(part_named(name, "surfaces"), []).extend(own)
    if SKIN not in files:
        raise InputError("surfaces", SKIN, "the part is missing", "give its file")
    if BONE in files or not files.keys() - {SKIN, MUSCLE_HULL}:
        raise InputError("surfaces", BONE, "no bone is named", "give each by its name: tibia, femur, radius, ...")
    surfaces = {part: [read_surface(file) for file in own] for part, own in files.items()}
    # Before anything else: levels in mm don't meet a leg in metres.
    skin = surfaces[SKIN][0]
    if pieces := _pieces(skin, CuttingPlane.at_level(float(skin.bounds[:, 2].mean()))):
        check_girth(max(piece.exterior.length for piece in pieces), files[SKIN][0])
    return surfaces


def read_surface(path: Path) -> Any:
    """Read a surface (`trimesh.Trimesh`, mm), which may be open where its scan ends.

    Raises
    ------
    InputError
        If the file can't be read, or is in pieces.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", "not found", "check the path")
    try:
        with path.open("rb") as file:
            legacy = re.search(rb"^DATASET\s+POLYDATA", file.read(1000), re.M | re.I)
        polydata = legacy or path.suffix.lower() == ".vtp"
        surface = trimesh.Trimesh(*read_polydata(path)) if polydata else trimesh.load(path, force="mesh")
    except ImportError as error:  # trimesh looks for the encoding of what it takes for text
        if error.name in ("meshio", "vtk"):
            raise
        raise InputError(path, "file", "is neither a whole binary STL nor text", "save it again") from None
    except Exception as error:  # the readers raise all kinds
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(path, "file", f"is not a surface that can be read ({said})", "save it as STL") from None
    if not isinstance(surface, trimesh.Trimesh):
        what = "points" if isinstance(surface, trimesh.PointCloud) else "a drawing"
        raise InputError(path, "file", f"contains {what}, not a surface", "save the leg's part as STL, PLY or OBJ")
    if len(surface.faces) == 0:
        raise InputError(path, "file", "contains no triangles", "save it as STL, PLY or OBJ")
    if not np.isfinite(surface.vertices).all():
        raise InputError(path, "surface", "has corners that are not finite numbers", "save it again")
    edges, count = np.unique(surface.edges_sorted, axis=0, return_counts=True)
    loose = edges[count != 2]
    if 2 * len(loose) >= len(edges):
        problem = f"is in pieces: at {len(loose)} of its {len(edges)} edges no two triangles meet"
        raise InputError(path, "surface", problem, "save the whole surface")
    surface.metadata[_LOOSE] = surface.vertices[loose]
    return surface


def outlines_of_surfaces(
    surfaces: Mapping[str, Sequence[Any]], plane: CuttingPlane, source: str | Path
) -> dict[str, Polygon]:
    """Return the outline of every part on a plane: its largest, the muscles' joined.

    Parameters
    ----------
    surfaces : mapping
        ``skin``, ``muscle_hull`` and the bones to their surfaces; the muscles may have several.
    plane : CuttingPlane
        Plane that cuts them.
    source : str or Path
        What errors name as the file.

    Raises
    ------
    InputError
        If the plane doesn't meet a part, goes through a hole of its surface, or passes the skin's end.
    """
    outlines = {}
    for part, every in surfaces.items():
        for surface in every:
            _check_closed(surface, plane, source, part)
        pieces = [piece for surface in every for piece in _pieces(surface, plane)]
        low, high = ends_of(every)
        if not pieces:
            remedy = f"choose levels between {low:.1f} and {high:.1f} mm"
            raise InputError(source, part, f"no closed outline at {plane}", remedy)
        outlines[part] = outline_of(part, pieces, source, str(plane))
        if part == SKIN:
            _check_ends(outlines[part], plane, low, high, source)
    return outlines


def shape_of_surfaces(
    surfaces: Mapping[str, Sequence[Any]], levels: ArrayLike, source: str | Path, clearances: Clearances | None = None
) -> LegShape:
    """Make a leg's shape of the closed surfaces of its parts.

    Parameters
    ----------
    surfaces : mapping
        As `read_surfaces` returns.
    levels : (n,) array
        Evenly spaced z, mm.
    source : str or Path
        What errors name as the file.
    clearances : Clearances, optional
        Room to keep between the parts; see `legfem.imaging.outlines.nested_shape`.

    Raises
    ------
    InputError
        If a level doesn't meet a surface, the coordinates are not mm, or the parts do not nest.
    """
    z = np.asarray(levels, dtype=np.float64)
    outlines = [outlines_of_surfaces(surfaces, CuttingPlane.at_level(at), source) for at in z]
    return nested_shape(z, outlines, source, clearances)


def ends_of(surfaces: Sequence[Any]) -> tuple[float, float]:
    """Return the levels between which the surfaces of a part lie, mm."""
    return min(one.bounds[0, 2] for one in surfaces), max(one.bounds[1, 2] for one in surfaces)


def _pieces(surface: Any, plane: CuttingPlane) -> list[Polygon]:
    """Return the outlines of a surface on a plane, without their holes; mm in the plane."""
    segments = trimesh.intersections.mesh_plane(surface, plane.normal, plane.point)
    # The two triangles at an edge find the same point but for rounding. Points of files with few digits lie half way
    # between two of the last one: off these.
    lines = shapely.linestrings(np.round(plane.flat(segments) + 0.27e-6, 6)) if len(segments) else []
    faces = shapely.union_all(shapely.polygonize(list(lines)))
    return [Polygon(face.exterior) for face in shapely.get_parts(faces) if isinstance(face, Polygon) and face.area > 0]


def _check_closed(surface: Any, plane: CuttingPlane, source: str | Path, part: str) -> None:
    """Check that two triangles meet at every edge that a plane goes through, so that what it cuts is closed."""
    loose = surface.metadata.get(_LOOSE, np.empty((0, 2, 3)))
    height = plane.height(loose)
    met = loose[(height.min(axis=1) <= 0) & (height.max(axis=1) >= 0)]
    if len(met):
        at = ", ".join(f"{c:.1f}" for c in met[0].mean(axis=0))
        problem = f"has a hole at {plane}, near ({at}): {len(loose)} of its edges are free"
        raise InputError(source, part, problem, "close it in the program that made it, or cut the leg elsewhere")


def _check_ends(skin: Polygon, plane: CuttingPlane, low: float, high: float, source: str | Path) -> None:
    """Check that a plane cuts the skin all around, and not its closed end."""
    corners = np.asarray(skin.exterior.coords)
    z = corners @ plane.axes[:, 2] + (plane.point @ plane.normal) * plane.normal[2]
    if z.min() < low + _END or z.max() > high - _END:
        remedy = f"the surface reaches from {low:.1f} to {high:.1f} mm: cut it elsewhere"
        raise InputError(source, SKIN, f"ends within the section at {plane}", remedy)
