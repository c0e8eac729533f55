"""The second code's mesh of the round leg in 3D: quadratic hexahedra of a quarter, by felupe.

The planes x = 0 and z = 0 are mirrors; the cylinder stands at -y, its axis along z. Nodes between
corners lie on the leg's circles too, so that its skin is round.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.experiments.indentation_3d import Cylinder
from legfem.meshing.idealised_leg import IdealisedLeg

type Ints = NDArray[np.int_]

_FACE = (1, 2, 6, 5, 9, 18, 13, 17)
"""Nodes of a hexahedron's outer face, corners first."""
_GAUSS = np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6), np.array([5.0, 8.0, 5.0]) / 9.0
_SIZES = {"round": 2.5, "deep": 3.0, "end": 1.8}
"""Under the cylinder round the leg, along its rays, and along it at the cylinder's end, mm."""
_GROWTH, _FAR = 0.22, 9.0


@dataclass(frozen=True, eq=False)
class HexahedralMesh:
    """Quadratic hexahedra of a quarter of a round leg, mm."""

    points: FloatArray
    """(n, 3)."""
    cells: Mapping[str, Ints]
    """(m, 20) by tissue."""
    skin: Ints
    """(k, 8): corners and middles of every face's edges."""
    skin_weights: FloatArray
    """(k, 9): areas that the Gauss points of a face stand for, mm^2."""
    held: NDArray[np.bool_]
    """(n, 3): on the bone; across mirrors and end faces."""


def face_shapes() -> FloatArray:
    """Return the functions of a face's eight nodes at its nine Gauss points, (9, 8)."""
    import felupe as fem

    element = fem.QuadraticQuad()
    return np.array([element.function(point) for point in _gauss_points()])


def mesh_quarter(leg: IdealisedLeg, cylinder: Cylinder, finer: float = 1.0) -> HexahedralMesh:
    """Return a mesh, fine under a cylinder and at its end."""
    import felupe as fem

    reach, end = 1.2 * cylinder.radius, cylinder.length / 2 - cylinder.edge_radius / 2
    half = leg.length / 2
    size = {name: value / finer for name, value in _SIZES.items()}
    growth, far = _GROWTH / finer, _FAR / finer

    def turned(s: FloatArray) -> FloatArray:
        return np.minimum(size["round"] + growth * np.maximum(s - reach, 0.0), far)

    def along(z: FloatArray) -> FloatArray:
        return np.minimum(size["end"] + growth * np.abs(z - end), far)

    angles = _divided(np.pi * leg.radius, turned) / leg.radius
    levels = _divided(half, along)
    radii, regions = [leg.bone_radius], []
    for region, outer in leg.layers:
        below = leg.radius - outer

        def inward(t: FloatArray, below: float = below) -> FloatArray:
            return np.minimum(size["deep"] + growth * (below + t), far)

        nodes = outer - _divided(outer - radii[-1], inward)[::-1]
        radii.extend(nodes[1:])
        regions.extend([region] * (len(nodes) - 1))
    axes = np.array(radii), angles, levels
    counts = tuple(len(values) for values in axes)
    grid = fem.Cube(a=(0, 0, 0), b=tuple(n - 1 for n in counts), n=counts)
    grid = grid.convert(order=2, calc_points=True)
    radius, theta, z = (np.interp(grid.points[:, k], np.arange(len(values)), values) for k, values in enumerate(axes))
    points = np.column_stack([radius * np.sin(theta), -radius * np.cos(theta), z])
    ring = grid.points[grid.cells].mean(axis=1)[:, 0].astype(int)
    of = np.array(regions)[ring]
    held = np.repeat((radius < leg.bone_radius + 1e-9)[:, None], 3, axis=1)
    held[:, 0] |= (theta < 1e-9) | (theta > np.pi - 1e-9)
    held[:, 2] |= (z < 1e-9) | (z > half - 1e-9)
    skin = grid.cells[ring == counts[0] - 2][:, _FACE]
    cells = {name: grid.cells[of == name] for name, _ in leg.layers}
    return HexahedralMesh(points, cells, skin, _areas(points[skin]), held)


def _gauss_points() -> FloatArray:
    xi = _GAUSS[0]
    return np.array([(a, b) for a in xi for b in xi])


def _areas(faces: FloatArray) -> FloatArray:
    """Return what the Gauss points of faces (k, 8, 3) stand for, (k, 9)."""
    import felupe as fem

    element = fem.QuadraticQuad()
    slopes = np.array([element.gradient(point) for point in _gauss_points()])
    tangents = np.einsum("qna,knd->kqad", slopes, faces)
    weights = np.outer(_GAUSS[1], _GAUSS[1]).ravel()
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return np.asarray(np.linalg.norm(normal, axis=2) * weights)


def _divided(length: float, size: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return nodes from 0 to a length, between which elements have a size, or less."""
    s = np.linspace(0.0, length, 2001)
    density = 1 / size(s)
    number = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(s))])
    count = max(1, int(np.ceil(number[-1] - 1e-9)))
    return np.interp(np.linspace(0.0, number[-1], count + 1), number, s)
