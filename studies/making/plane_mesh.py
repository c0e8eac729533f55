"""Triangles of a leg's section for the other code, fine where the cylinder presses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.geometry.section import MUSCLE, LegSection

type Ints = NDArray[np.int_]

GAUSS = (np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6), np.array([5.0, 8.0, 5.0]) / 9.0)
"""Points and weights on an edge from -1 to 1."""


_SIZES = {"contact": 1.2, "far": 4.0}


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Quadratic triangles of a leg."""

    points: FloatArray
    cells: Mapping[str, Ints]
    """(m, 6) by tissue."""
    skin: Ints
    """(k, 3): end points and middle of every edge."""
    bones: Mapping[str, Ints]
    """Points of every bone, and of the skin on a plate."""

    @cached_property
    def skin_weights(self) -> FloatArray:
        """Lengths (k, 3) that the Gauss points of an edge stand for, mm."""
        ends = self.points[self.skin[:, :2]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        return np.asarray(0.5 * length[:, None] * GAUSS[1][None, :])


def mesh_leg(section: LegSection, touch: FloatArray, finer: float = 1.0) -> TriangleMesh:
    """Return a mesh, fine about the point of first touch."""
    import gmsh

    inner = shapely.Polygon(section.fascia).buffer(-section.fascia_thickness)
    loops = {"skin": section.skin, "fascia": section.fascia, "inner": np.array(inner.exterior.coords)[:-1]}
    nested = {"superficial": ("skin", "fascia"), "fascia": ("fascia", "inner"), "deep": ("inner", *section.bones)}
    if MUSCLE in section.lacks:
        loops, nested = {"skin": section.skin}, {"deep": ("skin", *section.bones)}
    loops |= section.bones
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("leg")
        lines = {name: _loop(gmsh, _resampled(points, 1.0)) for name, points in loops.items()}
        surfaces = {
            name: gmsh.model.occ.addPlaneSurface([lines[part] for part in parts]) for name, parts in nested.items()
        }
        gmsh.model.occ.synchronize()
        _sizes(gmsh, touch, section, finer)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        tags, flat, _ = gmsh.model.mesh.getNodes()
        cells = {
            name: gmsh.model.mesh.getElements(2, surface)[2][0].astype(int).reshape(-1, 6)
            for name, surface in surfaces.items()
        }
    finally:
        gmsh.finalize()
    # Points that only define a spline belong to no triangle.
    used = np.unique(np.vstack(list(cells.values())))
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[used] = np.arange(len(used))
    places = np.zeros((int(tags.max()) + 1, 2))
    places[tags] = flat.reshape(-1, 3)[:, :2]
    return _tidied(places[used], {name: number[own] for name, own in cells.items()}, section)


def in_muscles(mesh: TriangleMesh, section: LegSection, c10: Mapping[str, float], rest: float) -> FloatArray:
    """Return the factor on the deep tissue's C10 of each of its triangles, by muscles; the first named counts."""
    middle = mesh.points[mesh.cells["deep"][:, :3]].mean(axis=1)
    inside = [shapely.contains_xy(section.polygon(muscle), middle) for muscle in c10]
    return np.asarray(np.select(inside, [own / rest for own in c10.values()], 1.0)) if c10 else np.ones(len(middle))


def _resampled(points: FloatArray, step: float) -> FloatArray:
    ring = shapely.LinearRing(points)
    count = max(24, round(ring.length / step))
    return np.array([ring.interpolate(s).coords[0] for s in np.arange(count) * ring.length / count])


def _loop(gmsh: Any, points: FloatArray) -> int:
    tags = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in points]
    return int(gmsh.model.occ.addCurveLoop([gmsh.model.occ.addSpline([*tags, tags[0]])]))


def _sizes(gmsh: Any, touch: FloatArray, section: LegSection, finer: float) -> None:
    fields = gmsh.model.mesh.field
    ball = fields.add("MathEval")
    x, y = touch
    near, far = _SIZES["contact"] / finer, _SIZES["far"] / finer
    distance = f"Sqrt((x-({x}))^2+(y-({y}))^2)"
    fields.setString(ball, "F", f"Min({far}, {near}+0.12*Max(0,{distance}-16))")
    fields.setAsBackgroundMesh(ball)
    for name in ("MeshSizeFromPoints", "MeshSizeFromCurvature", "MeshSizeExtendFromBoundary"):
        gmsh.option.setNumber(f"Mesh.{name}", 0)


def _tidied(points: FloatArray, cells: Mapping[str, Ints], section: LegSection) -> TriangleMesh:
    """Return the mesh, triangles counter-clockwise; edges of one triangle lie on an outline."""
    turned = {}
    for name, own in cells.items():
        a, b, c = (points[own[:, k]] for k in range(3))
        cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        flipped = own.copy()
        flipped[cross < 0] = own[cross < 0][:, [0, 2, 1, 5, 4, 3]]
        turned[name] = flipped
    every = np.vstack(list(turned.values()))
    edges = np.vstack([every[:, [0, 1, 3]], every[:, [1, 2, 4]], every[:, [2, 0, 5]]])
    _, index, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True, return_counts=True)
    outer = edges[index[count == 1]]
    middle = shapely.points(points[outer[:, 2]])
    apart = {name: shapely.distance(middle, section.polygon(name).exterior) for name in ("skin", *section.bones)}
    nearest = np.argmin(np.array(list(apart.values())), axis=0)
    bones = {bone: np.unique(outer[nearest == k + 1]) for k, bone in enumerate(section.bones)}
    rests = section.rests(points[outer[:, 2]]) & (nearest == 0)
    plate = {"plate": np.unique(outer[rests])} if rests.any() else {}
    return TriangleMesh(points, turned, outer[(nearest == 0) & ~rests], {**bones, **plate})


def distances_from_edges(at: FloatArray, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distances of points (k, 2) from curved edges (k, 3, 2), outwards, and their derivatives (k, 8) by both."""
    first, last, middle = nodes[:, 0], nodes[:, 1], nodes[:, 2]
    half, bent = (last - first) / 2, (first + last) / 2 - middle
    chord = np.sum(half**2, axis=1)
    xi = np.sum((at - middle) * half, axis=1) / chord
    for _ in range(6):
        on, slope = middle + xi[:, None] * half + xi[:, None] ** 2 * bent, half + 2 * xi[:, None] * bent
        away = on - at
        xi = xi - np.sum(away * slope, axis=1) / (np.sum(slope**2, axis=1) + 2 * np.sum(away * bent, axis=1))
    on, slope = middle + xi[:, None] * half + xi[:, None] ** 2 * bent, half + 2 * xi[:, None] * bent
    normal = np.column_stack([slope[:, 1], -slope[:, 0]]) / np.linalg.norm(slope, axis=1)[:, None]
    gap = np.sum((at - on) * normal, axis=1)
    shape = np.column_stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2])
    return gap, np.hstack([normal, -(shape[:, :, None] * normal[:, None, :]).reshape(-1, 6)])
