"""How fine the mesh of a leg's segment is: what is asked, and the sizes of elements that follow from it in the leg."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial import cKDTree
from shapely import Polygon, contains_xy, prepare

from legfem.common.errors import AboveZero, Argument, Checked, InputError
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, PartSurface, perimeter

_SAME_SIZE = 1.1
"""Ratio within which sizes count as the same."""


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
        group = np.floor(np.log(self.sizes) / np.log(_SAME_SIZE)).astype(int)
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


_FILL = 0.17
"""Mean volume of a tetrahedron over its size cubed, as gmsh makes them: measured."""


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
class SolidMeshSettings(Checked):
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
    strip : FineStrip, optional
        Strip of the skin with smaller elements.
    enclosing : bool
        Whether flat facets enclose the volume that the smooth surfaces do, instead of having their
        corners on them.
    """

    skin_size: AboveZero[float] = 5.0
    inside_size: AboveZero[float] = 7.0
    bone_size: AboveZero[float] = 4.0
    layer_elements: AboveZero[float] = 0.8
    turn_elements: AboveZero[float] = 12.0
    growth: AboveZero[float] = 0.25
    clearance: AboveZero[float] = 0.5
    strip: FineStrip | None = None
    enclosing: bool = False

    def refined(self, factor: float) -> "SolidMeshSettings":
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


def settings_for_cells(shape: LegShape, cells: int, share: float = 1.0) -> SolidMeshSettings:
    """Return settings, refined or coarsened, that give about a number of tetrahedra.

    Parameters
    ----------
    shape
        The leg.
    cells
        The number.
    share
        Of the leg, which may be all that is meshed in the end: the coarsest settings then stand for fewer cells.

    Raises
    ------
    InputError
        If the leg can't be meshed with so few.
    """
    settings = SolidMeshSettings()
    grid = TissueGrid.over(shape, spacing=5.0)

    def excess(log_factor: float) -> float:
        field = size_field(shape, settings.refined(math.exp(log_factor)), spacing=6.0)
        return math.log(grid.cells(field) / cells)

    low, high = math.log(0.2), math.log(12.0)
    least, most = (cells * math.exp(excess(end)) for end in (low, high))
    if not share * least <= cells <= most:
        remedy = f"choose from {1000 * math.ceil(least / 1000)} to {1000 * math.floor(most / 1000)}"
        raise InputError(Argument("cells"), f"{cells}", f"this leg cannot be meshed with {cells} tetrahedra", remedy)
    return settings.refined(math.exp(brentq(excess, low, high, xtol=0.01) if cells > least else high))


def size_field(shape: LegShape, settings: SolidMeshSettings, spacing: float) -> SizeField:
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
class TissueGrid:
    """A regular grid over the leg's tissue."""

    low: FloatArray
    step: FloatArray
    points: FloatArray
    """Positions, (n_z, n_x, n_y, 3), mm."""
    inside: NDArray[np.bool_]
    """Whether a point is in tissue, (n_z, n_x, n_y)."""

    @staticmethod
    def over(shape: LegShape, spacing: float) -> "TissueGrid":
        """Return the grid over a leg's skin, its points a distance (mm) apart."""
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
        return TissueGrid(low, step, np.stack([x, y, z], axis=-1), inside)

    def cells(self, field: SizeField) -> float:
        """Return about how many tetrahedra fill the tissue."""
        sizes = field(self.points[self.inside])
        return float((1 / sizes**3).sum() * self.step.prod() / _FILL)

    def sizes(self, field: SizeField) -> Callable[..., float]:
        """Return the field interpolated, fast at single points."""
        values = field(self.points.reshape(-1, 3)).reshape(self.inside.shape)
        return trilinear(values, self.low, self.step)
