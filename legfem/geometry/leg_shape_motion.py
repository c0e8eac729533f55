"""Moving a leg's shape: its points leave their levels, and are cut by levels anew."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.curve import at_own_places, outward_normals
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, corresponding_loops

_STEPS, _CLOSE = 12, 1e-12
"""Of Newton's method for where a line crosses a level; its end, over the segment's length."""


def resliced(points: Mapping[str, FloatArray], levels: ArrayLike | None = None) -> LegShape:
    """Make a shape of points that moved out of their levels.

    Every line of corresponding points along the leg is cut by the levels' planes.

    Parameters
    ----------
    points : mapping of str to (n_levels, n_points, 3) array
        Part to its points now, mm; see `LegShape.points`.
    levels : (m,) array, optional
        Where to cut; by default as many as there were, between the highest of the lowest points and
        the lowest of the highest.

    Raises
    ------
    InputError
        If the points of a line do not ascend, or a level is not reached by all of them.
    """
    z = _levels_to_cut(points, levels)
    return LegShape(z, {part: _cut(xyz, z, part) for part, xyz in points.items()})


def displaced(shape: LegShape, displacement: Mapping[str, FloatArray], levels: ArrayLike | None = None) -> LegShape:
    """Return a deformed shape.

    Parameters
    ----------
    shape : LegShape
        Undeformed.
    displacement : mapping of str to (n_levels, n_points, 3) array
        Displacement of the points of `LegShape.points`, mm, by part; parts not named stay.
    levels : (m,) array, optional
        Levels of the result, mm; see `resliced`.
    """
    points = {part: shape.points(part) + displacement.get(part, 0.0) for part in shape.contours}
    z = _levels_to_cut(points, levels)
    return LegShape(
        z, {part: _cut(xyz, z, part) if part in displacement else shape.at(part, z) for part, xyz in points.items()}
    )


def rigidly_moved(
    shape: LegShape, rotation: ArrayLike, translation: ArrayLike, levels: ArrayLike | None = None
) -> LegShape:
    """Return the shape after x -> R x + t, R (3, 3) and t (3,) in mm; levels as for `resliced`."""
    turn, shift = np.asarray(rotation, dtype=np.float64), np.asarray(translation, dtype=np.float64)
    return resliced({part: shape.points(part) @ turn.T + shift for part in shape.contours}, levels)


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


def _levels_to_cut(points: Mapping[str, FloatArray], levels: ArrayLike | None) -> FloatArray:
    """Return the levels given, or those of `resliced`; all parts reach them."""
    for part, xyz in points.items():
        if not (np.diff(xyz[..., 2], axis=0) > 0).all():
            raise _folds_back(part)
    lowest = max(float(xyz[0, :, 2].max()) for xyz in points.values())
    highest = min(float(xyz[-1, :, 2].min()) for xyz in points.values())
    if levels is None:
        count = next(iter(points.values())).shape[0]
        return np.linspace(lowest, highest, count)
    z = np.asarray(levels, dtype=np.float64)
    slack = 1e-9 * (abs(highest) + abs(lowest))
    if z.min() < lowest - slack or z.max() > highest + slack:
        raise InputError(
            "shape",
            "level",
            f"{z.min():g} to {z.max():g} mm is not within what moved, {lowest:.4g} to {highest:.4g} mm",
            "choose levels farther from the ends",
        )
    return z


def _cut(points: FloatArray, levels: FloatArray, part: str) -> FloatArray:
    """Return the contours (m, n_points, 2) of a part's points (n_levels, n_points, 3) at levels."""
    middles = points[..., 2].mean(axis=1)
    lines = CubicSpline(middles, points)
    slopes = lines.derivative()
    at = np.repeat(levels[:, None], points.shape[1], axis=1)
    for _ in range(_STEPS):
        above = at_own_places(lines, at)[..., 2] - levels[:, None]
        if np.abs(above).max() < _CLOSE * (middles[-1] - middles[0]):
            break
        at = at - above / at_own_places(slopes, at)[..., 2]
    else:
        raise _folds_back(part)
    return corresponding_loops(at_own_places(lines, at)[..., :2])


def _folds_back(part: str) -> InputError:
    return InputError("shape", part, "its lines along the leg fold back", "check the motion given")


def inward(bare: LegShape, moved: FloatArray) -> FloatArray:
    """Return how far the skin moved inwards (mm), (n_levels, n_points)."""
    normals = outward_normals(bare.contours[SKIN])
    return -np.einsum("lpd,lpd->lp", normals, moved[..., :2])


def stretch_round(bare: LegShape, moved: FloatArray) -> FloatArray:
    """Return the skin's elongation round the leg (%), of the ways to both neighbours."""
    points = bare.points(SKIN)

    def ways(at: FloatArray) -> FloatArray:
        ahead = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2)
        return np.asarray(ahead + np.roll(ahead, 1, axis=1))

    return 100 * (ways(points + moved) / ways(points) - 1)
