"""Mesh of a leg's cross-section: fat, fascia as a layer, deep tissue around the bones.

The mesh is graded: fine along the skin that the indenter will touch, coarser with the distance from
it. The fascia is one layer of elements across its thickness, with nodes of its two faces in pairs.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, compress
from typing import Any

import gmsh
import numpy as np
import shapely
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI
from scipy.integrate import cumulative_trapezoid
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from legfem.common.units import FloatArray
from legfem.geometry.indenter import first_touch
from legfem.geometry.section import LAYERS, MUSCLE, ClosedCurve, LegSection, across, smooth_closed_curve
from legfem.meshing import gmsh_mesh
from legfem.meshing.grid import ElementSizes, TaggedMesh

type Covered = dict[str, BaseGeometry]
"""Parts of the deep tissue that muscles cover, by name."""


@dataclass(frozen=True)
class MeshMotion:
    r"""Motion of an outline of a section, with which its mesh moves.

    Skin and fascia move along their normals by hat functions of the arc from first touch; what is
    between follows in proportion to the distances from both,

    .. math:: V(x) = n(x)\, h(s(x))\, w(x), \quad
              w = \frac{r_\text{other}}{r_\text{own} + r_\text{other}}.

    The elements stay what they are: a force's change by an outline is free of the noise that another
    mesh would bring.

    Parameters
    ----------
    outline : str
        Part whose outline moves; a bone as a whole.
    arc : float
        Position of the hat function's top from first touch, along the skin, counter-clockwise (mm).
    width : float
        Half of the hat's foot (mm).
    size : float
        Displacement at the top, outwards; that of a bone (mm).
    turned : float
        Angle of a bone's displacement from the travel, counter-clockwise (degrees).
    along : bool
        Whether the skin's nodes slide along it, to the left of the travel, and not outwards: the leg's shape stays.
    """

    outline: str
    arc: float = 0.0
    width: float = 20.0
    size: float = 0.5
    turned: float = 0.0
    along: bool = False

    def displacement(
        self, points: FloatArray, section: LegSection, touch: FloatArray, travel: FloatArray
    ) -> FloatArray:
        """Return how points (n, 2) of the section's mesh move (mm).

        Parameters
        ----------
        points
            Points of the mesh, mm.
        section
            The section before the motion.
        touch
            Centre of the indenter at first touch (mm).
        travel
            Unit vector of its travel.
        """
        at = shapely.points(points)
        skin, fascia = (section.polygon(part).exterior for part in ("skin", "fascia"))
        to_skin, to_fascia, to_bones = (shapely.distance(at, line) for line in (skin, fascia, section.held))
        inside = shapely.contains_properly(section.polygon("fascia"), at)
        if self.outline in section.bones:
            near, *others = (
                shapely.distance(at, section.polygon(part).exterior)
                for part in sorted(section.bones, key=lambda part: part != self.outline)
            )
            share = np.where(inside, _share(np.minimum.reduce([to_fascia, *others]), near), 0.0)
            angle = np.radians(self.turned)
            return share[:, None] * self.size * (np.cos(angle) * travel + np.sin(angle) * across(travel))
        if MUSCLE in section.lacks:
            share = _share(to_bones, to_skin)
        elif self.outline == "skin":
            share = np.where(inside, 0.0, _share(to_fascia, to_skin))
        else:
            # The layer moves as one.
            beyond = np.maximum(to_fascia - section.fascia_thickness, 0.0)
            share = np.where(inside, _share(to_bones, beyond), _share(to_skin, to_fascia))
        arc, normal = _arc_and_normal(skin, points, touch)
        hat = np.maximum(0.0, 1.0 - np.abs(arc - self.arc) / self.width)
        way = np.column_stack([normal[:, 1], -normal[:, 0]]) if self.along else normal
        return (self.size * share * hat)[:, None] * way


def _share(far: FloatArray, near: FloatArray) -> FloatArray:
    return np.asarray(far / np.maximum(near + far, 1e-12))


def _arc_and_normal(skin: shapely.LinearRing, points: FloatArray, touch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the arc from first touch of the skin's nearest points, and outward normals there."""
    length = skin.length
    at = shapely.line_locate_point(skin, shapely.points(points))
    first = shapely.line_locate_point(skin, shapely.Point(*touch))
    arc = (at - first + 0.5 * length) % length - 0.5 * length
    ahead, behind = (
        shapely.get_coordinates(shapely.line_interpolate_point(skin, (at + step) % length)) for step in (2.0, -2.0)
    )
    tangent = ahead - behind
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    # Contours are counter-clockwise.
    return arc, np.column_stack([tangent[:, 1], -tangent[:, 0]])


SUPERFICIAL, FASCIA, DEEP = 1, 2, 3
SKIN, BONE = 11, 12
HULL = 16
"""Facets between deep and superficial tissue, where they meet without a layer between."""
UNDER_FAT = 17
"""Facets of the fat on the fascia, where the mesh is split between them."""
OUTER_FASCIA = 18
"""Facets of the fascia under the fat, likewise."""
PLATE = 20
"""Facets of the skin that a plate holds."""
REGIONS = {"superficial": SUPERFICIAL, "fascia": FASCIA, "deep": DEEP}


_FIRST_MUSCLE = 21


def section_regions(section: LegSection) -> dict[str, int]:
    """Return the cell tags of a section's tissues by name: `REGIONS`, and its muscles; without muscle, all is deep."""
    layers = {"deep": DEEP} if MUSCLE in section.lacks else REGIONS
    return {**layers, **muscle_tags(section.muscles)}


def muscle_tags(muscles: Iterable[str]) -> dict[str, int]:
    """Return the cell tags of muscles by name, in their order."""
    return {muscle: tag for tag, muscle in enumerate(muscles, _FIRST_MUSCLE)}


def bone_regions(section: LegSection) -> dict[str, int]:
    """Return the cell tags of a section's bones by name, in meshes that have their inside, too."""
    return {bone: tag for tag, bone in enumerate(section.bones, DEEP + 1)}


@dataclass(frozen=True)
class SectionMeshSettings(ElementSizes):
    """How fine the mesh of a section is.

    Parameters
    ----------
    contact_size : float
        Length of an element's edge on the skin under the indenter (mm).
    growth : float
        Growth of the edge length per mm of distance from that skin.
    far_size : float
        Greatest edge length (mm).
    layer_size : float
        Greatest edge length along the fascia (mm): long straight edges would stiffen its bending.
    """

    contact_size: float = 1.2
    growth: float = 0.22
    far_size: float = 7.0
    layer_size: float = 3.0


@dataclass(frozen=True, eq=False)
class SectionMesh(TaggedMesh):
    """A meshed section and where the indenter first touches it.

    Its cells' tags are those of `section_regions` and `bone_regions`, its facets' `SKIN`, `BONE`, and where it is split
    `UNDER_FAT` and `OUTER_FASCIA`.
    """

    touch: FloatArray
    """Centre of the indenter at first touch, (2,), mm."""
    direction: FloatArray
    """Unit vector of travel, (2,)."""
    outline: FloatArray
    """Corners of the skin, (n, 2), mm."""
    quality: gmsh_mesh.MeshQuality


_REMEDY = "check the contours there for kinks or near contacts, or ask for a finer mesh"


def mesh_section(
    section: LegSection,
    radius: float,
    aim: FloatArray,
    direction: FloatArray,
    settings: SectionMeshSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    bones: bool = False,
    split: bool = False,
) -> SectionMesh:
    """Mesh a section for an indenter of given radius on a given line of travel.

    Parameters
    ----------
    section
        Contours and fascia thickness (mm).
    radius
        Radius of the indenter (mm).
    aim, direction
        A point on the line of travel (mm) and its unit vector.
    settings
        Sizes; the default is the one whose error the convergence study states.
    comm
        Communicator of the mesh; gmsh runs on its rank 0.
    bones
        Whether the bones' inside is meshed, too.
    split
        Whether fat and fascia have nodes of their own where they meet, in pairs.

    Raises
    ------
    InputError
        If the line of travel misses the leg, or no mesh of sound quality can be made in time.
    """
    settings = settings or SectionMeshSettings()
    skin = smooth_closed_curve(section.skin)
    reached = _skin_within_reach(skin, radius, aim, direction)
    with gmsh_mesh.gmsh_model("section") as model:

        def build() -> tuple[FloatArray, Covered, gmsh_mesh.MeshQuality]:
            outline, muscles = _build(model, section, skin, cKDTree(reached), settings, bones, split)
            quality = gmsh_mesh.element_quality(model, REGIONS if section.layers == LAYERS else {"deep": DEEP})
            return outline, muscles, gmsh_mesh.sound(quality, "contours", _REMEDY)

        outline, muscles, quality = gmsh_mesh.on_first_rank(comm, build)
        touch = first_touch(outline, radius, aim, direction)
        mesh, cell_tags, facet_tags = gmsh_mesh.mesh_from_gmsh(model, comm, gdim=2)
    if muscles:
        cell_tags = tagged_muscles(mesh, cell_tags, muscles)
    return SectionMesh(mesh, cell_tags, facet_tags, touch, direction, outline, quality)


def _skin_within_reach(skin: ClosedCurve, radius: float, aim: FloatArray, direction: FloatArray) -> FloatArray:
    """Return skin points that an indenter pressed by its own diameter will touch, (n, 2)."""
    turns = np.linspace(0, 1, 4000, endpoint=False)
    points = skin(turns)
    centre = first_touch(points, radius, aim, direction)
    first = int(np.argmin(np.linalg.norm(points - centre, axis=1)))
    distance = np.abs(turns - turns[first])
    arc = np.minimum(distance, 1 - distance) * skin.length
    return points[arc < 1.85 * radius]


def _place(curve: ClosedCurve, size: Any) -> tuple[FloatArray, FloatArray]:
    """Return nodes on a closed curve, spaced by ``size(points)``, and the unit tangents there."""
    turns = np.linspace(0, 1, 6001)
    points = curve(turns)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    sizes = size(points)
    count = np.concatenate([[0.0], np.cumsum(steps * 0.5 * (1 / sizes[1:] + 1 / sizes[:-1]))])
    number = max(8, math.ceil(count[-1]))
    at = np.interp(np.arange(number) / number * count[-1], count, turns)
    corners, tangents = curve(at), curve.tangent(at)
    # The polygon is to enclose what the curve does: a chord of length h on an arc of radius R lies h^2 / (12 R) inside
    # it on average.
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    turn = before / lengths[0][:, None] - after / lengths[1][:, None]
    return corners + turn * (0.5 * (lengths[0] + lengths[1]) / 12)[:, None], tangents


def _build(
    model: Any,
    section: LegSection,
    skin: ClosedCurve,
    reached: cKDTree,
    settings: SectionMeshSettings,
    bones: bool,
    split: bool,
) -> tuple[FloatArray, Covered]:
    """Draw and mesh the section in gmsh; return the skin's corners, and what its muscles cover."""
    contact, growth = settings.contact_size, settings.growth

    def size(points: FloatArray) -> FloatArray:
        return np.minimum(contact + growth * reached.query(points)[0], settings.far_size)

    def layer_size(points: FloatArray) -> FloatArray:
        return np.minimum(size(points), settings.layer_size)

    def bone_size(length: float) -> Any:
        return lambda points: np.minimum(size(points), max(contact, length / 30))

    corners, _ = _place(skin, size)
    loops, around, layered = {"skin": corners}, "skin", section.layers == LAYERS
    if layered:
        outer, tangent = _place(smooth_closed_curve(section.fascia), layer_size)
        loops |= {"outer": outer, "inner": outer + section.fascia_thickness * across(tangent)}
        around = "inner"
    if split:
        loops["under fat"] = outer
    for bone, outline in section.bones.items():
        curve = smooth_closed_curve(outline)
        loops[bone], _ = _place(curve, bone_size(curve.length))

    geometry = model.geo
    rings = {name: gmsh_mesh.drawn(geometry, xy) for name, xy in loops.items()}
    lines = {name: loop for name, (_, loop) in rings.items()}
    surfaces = {SUPERFICIAL: [], FASCIA: _fascia(geometry, rings["outer"], rings["inner"])} if layered else {}
    closed = {name: geometry.addCurveLoop(loop) for name, loop in lines.items()}
    if layered:
        surfaces[SUPERFICIAL] = [geometry.addPlaneSurface([closed["skin"], closed["under fat" if split else "outer"]])]
    deep = geometry.addPlaneSurface([closed[around], *(closed[bone] for bone in section.bones)])
    insides = {n: geometry.addPlaneSurface([closed[n]]) for n in section.bones} if bones else {}
    within = shapely.Polygon(loops[around], [loops[bone] for bone in section.bones])
    muscles = _covered(section, within)
    borders = [line for ring in _borders(within, muscles) for line in _border(model, ring, layer_size)]
    geometry.synchronize()
    if borders:
        model.mesh.embed(1, borders, 2, deep)

    for tag, drawn in {**surfaces, DEEP: [deep]}.items():
        model.addPhysicalGroup(2, drawn, tag)
    for bone, surface in insides.items():
        model.addPhysicalGroup(2, [surface], bone_regions(section)[bone])
    rests = section.rests(0.5 * (corners + np.roll(corners, -1, axis=0)))
    facets: dict[int, Iterable[int]] = {SKIN: compress(lines["skin"], ~rests), PLATE: compress(lines["skin"], rests)}
    facets[BONE] = chain.from_iterable(lines[bone] for bone in section.bones)
    if split:
        facets |= {UNDER_FAT: lines["under fat"], OUTER_FASCIA: lines["outer"]}
    for tag, own in ((tag, list(own)) for tag, own in facets.items()):
        if own:
            model.addPhysicalGroup(1, own, tag)

    near = [line for line, xy in zip(lines["skin"], corners, strict=True) if reached.query(xy)[0] < contact]
    field = model.mesh.field
    distance = field.add("Distance")
    field.setNumbers(distance, "CurvesList", near)
    graded = field.add("MathEval")
    field.setString(graded, "F", f"min({contact} + {growth}*F{distance}, {settings.far_size})")
    field.setAsBackgroundMesh(graded)
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh_mesh.generate(model, 2)
    return corners, muscles


def _fascia(geometry: Any, outer: tuple[list[int], list[int]], inner: tuple[list[int], list[int]]) -> list[int]:
    """Draw the fascia's layer, an element across, between points and lines of both faces; return its surfaces."""
    rungs = [geometry.addLine(a, b) for a, b in zip(outer[0], inner[0], strict=True)]
    for rung in rungs:
        geometry.mesh.setTransfiniteCurve(rung, 2)
    layer = []
    for k, (above, below) in enumerate(zip(outer[1], inner[1], strict=True)):
        loop = geometry.addCurveLoop([above, rungs[(k + 1) % len(rungs)], -below, -rungs[k]])
        layer.append(geometry.addPlaneSurface([loop]))
        geometry.mesh.setTransfiniteSurface(layer[-1], "AlternateLeft" if k % 2 else "Right")
    return layer


_SLIVER_MM = 0.8
"""Width below which what is between a muscle and its neighbour, the fascia or a bone belongs to the muscle."""


def _covered(section: LegSection, within: shapely.Polygon) -> Covered:
    """Return what each muscle covers of the deep tissue; a neighbour has what one named before it leaves."""
    named = {name: section.polygon(name) for name in section.muscles}
    left = within - shapely.union_all(list(named.values()))
    slivers = left - left.buffer(-0.5 * _SLIVER_MM).buffer(0.51 * _SLIVER_MM)
    found, left = dict[str, BaseGeometry](), within
    for name, own in named.items():
        found[name] = ((own | (slivers & own.buffer(_SLIVER_MM))) & left).buffer(0)  # of areas alone
        left = left - found[name]
    return found


def _borders(within: shapely.Polygon, muscles: Covered) -> Iterator[shapely.LineString]:
    """Yield the muscles' borders but where they run along what is drawn already, each once."""
    drawn = within.boundary
    for covered in muscles.values():
        new = shapely.line_merge(covered.boundary - drawn.buffer(_SLIVER_MM))
        yield from (line for line in shapely.get_parts(new) if line.length > 2 * _SLIVER_MM)
        drawn = drawn | covered.boundary


def _border(model: Any, line: shapely.LineString, size: Any) -> list[int]:
    """Draw a border as edges of elements, spaced by ``size(points)``."""
    along = np.linspace(0, line.length, 601)
    places = shapely.get_coordinates(shapely.line_interpolate_point(line, along))
    count = cumulative_trapezoid(1 / size(places), along, initial=0)
    at = np.interp(np.linspace(0, count[-1], 1 + max(3, math.ceil(count[-1]))), count, along)
    corners = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
    _, edges = gmsh_mesh.drawn(model.geo, corners[:-1] if line.is_ring else corners, line.is_ring)
    return edges


def tagged_muscles(mesh: Any, cell_tags: Any, muscles: Mapping[str, BaseGeometry]) -> Any:
    """Return cell tags with the muscles' in place of the deep tissue's where they cover it in section."""
    values = cell_tags.values.copy()
    middles = dolfinx_mesh.compute_midpoints(mesh, mesh.topology.dim, cell_tags.indices)[:, :2]
    for tag, covered in zip(muscle_tags(muscles).values(), muscles.values(), strict=True):
        values[(values == DEEP) & shapely.contains_xy(covered, middles)] = tag
    return dolfinx_mesh.meshtags(mesh, mesh.topology.dim, cell_tags.indices, values)
