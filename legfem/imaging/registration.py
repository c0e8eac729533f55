r"""Rigid registration of a leg on its bones, in least squares.

Where the points correspond, R and t that minimise :math:`\sum_i |R x_i + t - y_i|^2` have a closed
form (the second paper's Eq. 1). Where they don't, as in two scans, they are found by iteration:
every patch of one surface is paired with the nearest of the other, and

.. math:: \sum_i \big(n_i \cdot (R x_i + t - c_i)\big)^2

is minimised over a small motion at a time; x and c are the patches' centres, n the normal of the
other's plane. Both surfaces are averaged over patches of one size: a centre lies inside a curved
surface, and on a bone that tapers a difference there would pass for a shift along it. Patches that
lie beyond the other surface's end, or far from it, are left out. Generalised ICP (small_gicp 1.0.1)
is ten times as fast and as good across the shafts; along them it is 0.4 mm off where this is 0.1,
on scans without noise.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import RigidTransform

LEAST_PATCH = 6
"""Fewest points of a patch."""
LEAST_SURFACE = 50
"""Fewest patches of a surface."""
_AT_A_TIME = 2000
"""Patches that are made at once."""
_RADIUS_MM = 4.0
"""Radius of the patches over which both surfaces are averaged; small against the bones'."""
_SPACING_MM = 0.5
"""Distance of points; denser ones are thinned out."""
_REACH_MM = 1.2
"""Distance along the surface beyond which a patch is no partner: at the surface's end."""
_OUTLIER = 4.0
"""Distance from the plane, in robust standard deviations, beyond which a patch is left out."""
_TOLERANCE_MM = 1e-5
"""Size of the last motion below which the iteration ends."""
_PAIRINGS = 40
"""Iterations in which partners are looked for anew; then they stay."""
_ITERATIONS = 60
"""Most iterations."""


@dataclass(frozen=True, eq=False)
class Registration:
    """What moves one set of bone points onto another, and how well."""

    transform: RigidTransform
    """Motion of the moving points onto the fixed ones."""
    residual: float
    """Root mean square of the remaining distances, mm: those of corresponding points,
    or of the patches' centres from the other surface."""
    pairs: int
    """Number of points or patches that were used."""
    left_out: int
    """Number of points or patches without a partner."""
    standard_error: FloatArray
    """Standard error of the moved bones' centre along x, y and z (mm), if errors of points, or of patches that do
    not overlap, are independent. Shafts of bones leave the motion along them least certain."""
    rotation_error: FloatArray
    """Standard error of the turns about x, y and z (degrees), likewise."""
    iterations: int
    converged: bool


def register_points(moving: FloatArray, fixed: FloatArray) -> Registration:
    """Register points on the same points seen elsewhere: landmarks of bones, or fiducials.

    Parameters
    ----------
    moving, fixed : (n, 3) array
        In correspondence, mm.

    Raises
    ------
    InputError
        If fewer than three are given, or all lie on a line.
    """
    moving, fixed = _points(moving, "moving"), _points(fixed, "fixed")
    here, there = moving.mean(axis=0), fixed.mean(axis=0)
    turn = Rotation.align_vectors(fixed - there, moving - here)[0].as_matrix()
    transform = RigidTransform(turn, there - turn @ here)
    left = transform(moving) - fixed
    rows = [_rows(moving @ turn.T - turn @ here, np.tile(e, (len(moving), 1))) for e in np.eye(3)]
    residual = float(np.sqrt((left**2).sum(axis=1).mean()))
    errors = _errors(left.T.ravel(), np.vstack(rows))
    return Registration(transform, residual, len(moving), 0, *errors, iterations=1, converged=True)


def register_surfaces(moving: FloatArray, fixed: FloatArray, start: RigidTransform | None = None) -> Registration:
    """Register points of a surface on points of the same surface that don't correspond.

    Parameters
    ----------
    moving, fixed : (n, 3), (m, 3) array
        Points of the bones' surfaces, mm.
    start : RigidTransform, optional
        Where to start; by default the shift between the points' centres.

    Raises
    ------
    InputError
        If too few points are given, or too few of them find a partner.
    """
    moving, fixed = _points(moving, "moving"), _points(fixed, "fixed")
    whole = moving
    moving, _, share = _patches(moving)
    centres, normals, _ = _patches(fixed)
    tree = cKDTree(centres)
    transform = start or RigidTransform(np.eye(3), fixed.mean(axis=0) - whole.mean(axis=0))
    converged = False
    for iteration in range(1, _ITERATIONS + 1):
        moved = transform(moving)
        if iteration <= _PAIRINGS:
            nearest = tree.query(moved)[1]
        normal, offset = normals[nearest], moved - centres[nearest]
        off = (normal * offset).sum(axis=1)
        if iteration <= _PAIRINGS:
            sideways = np.linalg.norm(offset - off[:, None] * normal, axis=1)
            used = sideways < _REACH_MM
            if used.sum() >= 6:
                spread = 1.4826 * float(np.median(np.abs(off[used]))) + 1e-9
                used &= np.abs(off) < _OUTLIER * spread
        if used.sum() < max(6, len(moving) // 10):
            problem = f"only {int(used.sum())} of {len(moving)} points find a partner"
            raise InputError("registration", "bones", problem, "give both scans in about the same posture, or a start")
        pivot = moved[used].mean(axis=0)
        rows = _rows(moved[used] - pivot, normal[used])
        step = np.linalg.lstsq(rows, -off[used], rcond=None)[0]
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        transform = RigidTransform(turn, pivot + step[3:] - turn @ pivot).after(transform)
        reach = float(np.linalg.norm(moved[used] - pivot, axis=1).max())
        if np.linalg.norm(step[:3]) * reach + np.linalg.norm(step[3:]) < _TOLERANCE_MM:
            converged = True
            break
    left = off[used] + rows @ step
    # Patches share points: as many as a patch has carry the information of one.
    residual = float(np.sqrt((left**2).mean()))
    errors, pairs = _errors(left, rows / np.sqrt(share)), int(used.sum())
    return Registration(transform, residual, pairs, len(used) - pairs, *errors, iteration, converged)


def register_shapes(moving: LegShape, fixed: LegShape) -> Registration:
    """Register a leg on another by the surfaces of all bones.

    The start makes the bones' axes and their order round the leg the same, and the middles of what
    is seen of them.

    Raises
    ------
    InputError
        If the two don't have the same bones, or see `register_surfaces`.
    """
    if set(moving.bones) != set(fixed.bones):
        problem = f"{', '.join(moving.bones)} and {', '.join(fixed.bones)} are not the same"
        raise InputError("registration", "bones", problem, "segment the same bones in both scans")
    there, here = _frame(fixed), _frame(moving)
    return register_surfaces(bone_points(moving), bone_points(fixed), there.after(here.inverse()))


def bone_points(shape: LegShape) -> FloatArray:
    """Return the points of all bones, (n, 3), mm."""
    return np.vstack([shape.points(bone).reshape(-1, 3) for bone in shape.bones])


def _frame(shape: LegShape) -> RigidTransform:
    """Return the motion of a frame at the origin to the bones' middle, axis and order."""
    middles = {bone: shape.contours[bone].mean(axis=1) for bone in shape.bones}
    first = middles[shape.bones[0]]
    slope = np.polyfit(shape.levels, first, 1)[0]
    axis = np.array([*slope, 1.0]) / np.sqrt(1 + slope @ slope)
    middle = np.array([*first.mean(axis=0), shape.levels.mean()])
    if len(shape.bones) > 1:
        towards = np.array([*(middles[shape.bones[1]] - first).mean(axis=0), 0.0])
    else:
        towards = np.array([1.0, 0.0, 0.0])
    across = np.cross(axis, towards)
    across /= np.linalg.norm(across)
    return RigidTransform(np.column_stack([np.cross(across, axis), across, axis]), middle)


def _patches(points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return centres and unit normals of the patches round all points, and points a patch."""
    cells = np.floor(points / _SPACING_MM).astype(np.int64)
    points = points[np.sort(np.unique(cells, axis=0, return_index=True)[1])]
    most = min(len(points), int(4 * (_RADIUS_MM / _SPACING_MM) ** 2) + 8)
    tree = cKDTree(points)
    # Some at a time: all patches of a leg's bones would take half a gigabyte.
    parts = np.array_split(points, 1 + len(points) // _AT_A_TIME)
    found = [_patches_round(part, points, tree, most) for part in parts]
    centres, normals, counts = (np.concatenate(each) for each in zip(*found, strict=True))
    kept = counts >= LEAST_PATCH
    if kept.sum() < LEAST_SURFACE:
        remedy = f"give the bones' surfaces, a point every {_SPACING_MM:g} mm or so"
        raise InputError("registration", "points", f"{len(points)} are too few or too far apart", remedy)
    return centres[kept], normals[kept], float(counts[kept].mean())


def _patches_round(
    some: FloatArray, points: FloatArray, tree: cKDTree, most: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return centres, unit normals and numbers of points of the patches round some points."""
    distance, index = tree.query(some, k=most, distance_upper_bound=_RADIUS_MM)
    near = np.isfinite(distance)
    counts = near.sum(axis=1)
    weight = near / counts[:, None]
    patch = points[np.where(near, index, 0)]
    centres = np.einsum("nk,nki->ni", weight, patch)
    apart = patch - centres[:, None]
    _, vectors = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weight, apart, apart, optimize=True))
    return centres, vectors[:, :, 0], counts


def _rows(arms: FloatArray, normals: FloatArray) -> FloatArray:
    """Return how distances along normals change with small turns and shifts, (n, 6)."""
    return np.hstack([np.cross(arms, normals), normals])


def _errors(left: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the standard errors of shifts (mm) and turns (degrees) that leave distances (n,), by their rows (n, 6)."""
    variance = float((left**2).sum()) / max(len(left) - 6, 1)
    error = np.sqrt(np.maximum(np.diag(variance * np.linalg.pinv(rows.T @ rows)), 0.0))
    return error[3:], np.degrees(error[:3])


def _points(points: FloatArray, name: str) -> FloatArray:
    xyz = np.asarray(points, dtype=np.float64)
    if xyz.ndim != 2 or xyz.shape[1] != 3 or not np.isfinite(xyz).all():
        raise InputError("registration", name, "is not (n, 3) finite coordinates", "check them")
    spread = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False) if len(xyz) > 2 else [0, 0]
    if len(xyz) < 3 or spread[1] <= 1e-6 * spread[0]:
        raise InputError("registration", name, "fewer than three points, or all on a line", "give more points")
    return xyz
