"""Rigid motions, planes that cut a leg, with coordinates of their own, and the shape of a leg that moved, cut anew."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, freeze, frozen_array
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, corresponding_loops
from legfem.geometry.section import each_at, outward_normals

_ACROSS = np.cos(np.deg2rad(45.0))
_SQUARE = np.sin(np.deg2rad(10.0))
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class CuttingPlane:
    """A plane across a leg.

    Its coordinates are lengths along `axes`: across a leg along z they are x and y.

    Parameters
    ----------
    point : (3,) array
        On the plane, mm.
    normal : (3,) array
        Normal of any length, upwards (towards +z).
    """

    point: FloatArray
    normal: FloatArray

    def __post_init__(self) -> None:
        """Copy, and give the normal its length and direction."""
        normal = np.asarray(self.normal, dtype=np.float64)
        unit = normal / np.linalg.norm(normal)
        object.__setattr__(self, "normal", frozen_array(unit if unit[2] >= 0 else -unit))
        freeze(self, "point")

    @staticmethod
    def at_level(level: float) -> "CuttingPlane":
        """Return the plane z = level (mm)."""
        return CuttingPlane(level * _UP, _UP)

    @staticmethod
    def of_cylinder(
        position: FloatArray, direction: FloatArray, axis: FloatArray | None, source: str
    ) -> "CuttingPlane":
        """Return the plane in which a cylinder travels: through its position, across its axis.

        Parameters
        ----------
        position : (3,) array
            On the line of travel, mm.
        direction : (3,) array
            Direction of the indenter's travel.
        axis : (3,) array, optional
            Direction of the cylinder's axis; without it the plane holds the horizontal square to the travel.
        source : str
            What errors name as the file.

        Raises
        ------
        InputError
            If the plane doesn't lie across the leg.
        """
        travel = direction / np.linalg.norm(direction)
        along = _UP if axis is None else axis / np.linalg.norm(axis)
        normal = along - (along @ travel) * travel
        length = float(np.linalg.norm(normal))
        if length < 1e-6 or abs(normal[2]) / length < _ACROSS:
            remedy = "give the direction of travel, and the cylinder's axis along the leg"
            raise InputError(source, "indenter.direction", "the plane of travel doesn't lie across the leg (z)", remedy)
        return CuttingPlane(position, normal)

    @property
    def axes(self) -> FloatArray:
        """Two unit vectors in the plane, (2, 3): the first is x laid into it."""
        first = np.array([1.0, 0.0, 0.0]) - self.normal[0] * self.normal
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])

    @property
    def is_level(self) -> bool:
        """Whether it lies square to z."""
        return bool(self.normal[2] > 1 - 1e-12)

    def height(self, points: FloatArray) -> FloatArray:
        """Return the distances of points (..., 3) above the plane, mm."""
        return np.asarray((points - self.point) @ self.normal)

    def flat(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (..., 2) of points (..., 3) in the plane, mm."""
        return np.asarray(points @ self.axes.T)

    def levels(self, low: FloatArray, high: FloatArray) -> tuple[float, float]:
        """Return the lowest and highest z of the plane over a rectangle of x and y, mm."""
        corners = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
        z = -self.height(corners) / self.normal[2]
        return float(z.min()), float(z.max())

    def __str__(self) -> str:
        """Say where it lies."""
        x, y, z = self.point
        if self.is_level:
            return f"level {z:g} mm"
        tilt = float(np.degrees(np.arccos(self.normal[2])))
        return f"plane through ({x:.1f}, {y:.1f}, {z:.1f}) mm, tilted by {tilt:.1f} degrees"


def turn_about_travel(direction: FloatArray, axis: FloatArray, source: str) -> float:
    """Return by how much a cylinder is turned about its travel, from standing as upright as it can.

    Parameters
    ----------
    direction : (3,) array
        Direction of the indenter's travel.
    axis : (3,) array
        Direction of the cylinder's axis.
    source : str
        What errors name as the file.

    Returns
    -------
    float
        Degrees, right-handed, from -90 to 90.

    Raises
    ------
    InputError
        If the axis isn't square to the travel.
    """
    travel, along = direction / np.linalg.norm(direction), axis / np.linalg.norm(axis)
    if abs(along @ travel) > _SQUARE:
        angle = np.degrees(np.arccos(np.clip(along @ travel, -1, 1)))
        remedy = "a cylinder travels square to its axis: correct axis or direction"
        raise InputError(source, "indenter.axis", f"stands at {angle:.0f} degrees to the direction", remedy)
    upright = _UP - (_UP @ travel) * travel
    turn = float(np.degrees(np.arctan2(along @ np.cross(travel, upright), along @ upright)))
    return (turn + 90.0) % 180.0 - 90.0


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """x -> R x + t.

    Parameters
    ----------
    rotation : (3, 3) array
        R, a rotation.
    translation : (3,) array
        t, mm.

    Raises
    ------
    InputError
        If R is no rotation.
    """

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Copy and check."""
        freeze(self, "rotation", "translation")
        R, t = self.rotation, self.translation
        if R.shape != (3, 3) or t.shape != (3,) or not np.isfinite(t).all():
            problem = "is not a 3 x 3 rotation and a translation of 3 lengths (mm)"
            raise InputError("transform", "shape", problem, "give R and t of x -> R x + t")
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
            raise InputError("transform", "rotation", "is not a rotation", "give an orthogonal matrix, det 1")

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return moved points, (..., 3), mm."""
        return np.asarray(points @ self.rotation.T + self.translation)

    def inverse(self) -> "RigidTransform":
        """Return the inverse motion."""
        return RigidTransform(self.rotation.T, -self.rotation.T @ self.translation)

    def after(self, first: "RigidTransform") -> "RigidTransform":
        """Return the motion that does ``first`` and then this one."""
        return RigidTransform(self.rotation @ first.rotation, self.rotation @ first.translation + self.translation)


_STEPS = 12
"""Iterations of Newton's method for where a line crosses a level."""
_CLOSE = 1e-12
"""Step over the segment's length at which it ends."""


def displaced(shape: LegShape, displacement: Mapping[str, FloatArray]) -> LegShape:
    """Return a deformed shape.

    It has as many levels as there were, between the highest of the lowest points and the lowest of the highest.

    Parameters
    ----------
    shape : LegShape
        Undeformed.
    displacement : mapping of str to (n_levels, n_points, 3) array
        Displacement of the points of `LegShape.points`, mm, by part; parts not named stay.
    """
    points = {part: shape.points(part) + displacement.get(part, 0.0) for part in shape.contours}
    z = _levels_to_cut(points)
    return LegShape(
        z, {part: _cut(xyz, z, part) if part in displacement else shape.at(part, z) for part, xyz in points.items()}
    )


def rigidly_moved(shape: LegShape, rotation: ArrayLike, translation: ArrayLike) -> LegShape:
    """Return the shape after x -> R x + t, R (3, 3) and t (3,) in mm; levels as for `displaced`.

    Every line of corresponding points along the leg is cut by the levels' planes.

    Raises
    ------
    InputError
        If the points of a line do not ascend.
    """
    turn, shift = np.asarray(rotation, dtype=np.float64), np.asarray(translation, dtype=np.float64)
    points = {part: shape.points(part) @ turn.T + shift for part in shape.contours}
    z = _levels_to_cut(points)
    return LegShape(z, {part: _cut(xyz, z, part) for part, xyz in points.items()})


def without_layer(shape: LegShape, thickness: float) -> LegShape:
    """Return a shape without the outermost layer of its deep tissue.

    Skin and hull move inwards in their planes; the fat keeps its thickness.

    Parameters
    ----------
    shape : LegShape
        Its hull is the layer's outer face.
    thickness : float
        mm.
    """
    moved = {part: shape.contours[part] - thickness * outward_normals(shape.contours[part]) for part in (SKIN, HULL)}
    return LegShape(shape.levels, {**shape.contours, **moved})


def _levels_to_cut(points: Mapping[str, FloatArray]) -> FloatArray:
    """Return levels that all parts reach, as many as there were."""
    for part, xyz in points.items():
        if not (np.diff(xyz[..., 2], axis=0) > 0).all():
            raise _folds_back(part)
    lowest = max(float(xyz[0, :, 2].max()) for xyz in points.values())
    highest = min(float(xyz[-1, :, 2].min()) for xyz in points.values())
    return np.linspace(lowest, highest, next(iter(points.values())).shape[0])


def _cut(points: FloatArray, levels: FloatArray, part: str) -> FloatArray:
    """Return the contours (m, n_points, 2) of a part's points (n_levels, n_points, 3) at levels."""
    middles = points[..., 2].mean(axis=1)
    lines = CubicSpline(middles, points)
    slopes = lines.derivative()
    at = np.repeat(levels[:, None], points.shape[1], axis=1)
    for _ in range(_STEPS):
        above = each_at(lines, at)[..., 2] - levels[:, None]
        if np.abs(above).max() < _CLOSE * (middles[-1] - middles[0]):
            break
        at = at - above / each_at(slopes, at)[..., 2]
    else:
        raise _folds_back(part)
    return corresponding_loops(each_at(lines, at)[..., :2])


def _folds_back(part: str) -> InputError:
    return InputError("shape", part, "its lines along the leg fold back", "check the motion given")


def inward(bare: LegShape, moved: FloatArray) -> FloatArray:
    """Return how far the skin moved inwards (mm), (n_levels, n_points)."""
    return -np.einsum("lpd,lpd->lp", outward_normals(bare.contours[SKIN]), moved[..., :2])


def stretch_round(bare: LegShape, moved: FloatArray) -> FloatArray:
    """Return the skin's elongation round the leg (%), of the ways to both neighbours."""
    points = bare.points(SKIN)

    def ways(at: FloatArray) -> FloatArray:
        ahead = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2)
        return np.asarray(ahead + np.roll(ahead, 1, axis=1))

    return 100 * (ways(points + moved) / ways(points) - 1)
