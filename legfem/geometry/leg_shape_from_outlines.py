"""A leg's shape from outlines: smoothing, nesting with clearances, and files ``level_mm,part,i,x_mm,y_mm``.

Cross-sections of surfaces (see `legfem.geometry.contours`) are read too: what they call
``muscle_hull`` is given room.
"""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solveh_banded
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import MUSCLE_HULL, read_loops
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, check_shape, corresponding_loops, shape_of_contours
from legfem.geometry.section import closed_lengths
from legfem.geometry.section_from_outlines import Clearances, nested_outlines, polygons_of


def smoothed(
    shape: LegShape, around: float = 0.0, along: float = 0.0, parts: Collection[str] | None = None
) -> LegShape:
    r"""Return the shape without its short undulations, around its contours and along the leg.

    Both ways penalise second differences (Whittaker's smoother): an undulation of wavelength
    :math:`\lambda` keeps :math:`1/(1 + (\lambda_c/\lambda)^4)` of its amplitude, and what is straight
    along the leg stays as it is, at the ends too. A contour's size is kept.

    Parameters
    ----------
    shape : LegShape
        With evenly spaced levels where it is smoothed along.
    around : float
        Wavelength around the contours of which half is left (mm); 0 smooths nothing.
    along : float
        The same along the leg (mm).
    parts : collection of str, optional
        Which to smooth; all by default.

    Raises
    ------
    InputError
        If the levels are not evenly spaced and ``along`` is not 0.
    """
    contours = {}
    for part, xy in shape.contours.items():
        smooth = np.array(xy)
        if parts is not None and part not in parts:
            contours[part] = smooth
            continue
        if around > 0:
            smooth = _around(smooth, around)
        if along > 0:
            smooth = _along(smooth, shape.levels, along)
        contours[part] = corresponding_loops(smooth)
    return LegShape(shape.levels, contours)


def _around(xy: FloatArray, wavelength: float) -> FloatArray:
    n = xy.shape[1]
    spacing = (closed_lengths(xy) / n)[:, None]
    # Of the second difference, squared; relative to that at the cut-off wavelength.
    stiffness = 2 - 2 * np.cos(2 * np.pi * np.fft.rfftfreq(n))[None, :]
    cut = 2 - 2 * np.cos(np.minimum(2 * np.pi * spacing / wavelength, np.pi))
    # Once around the contour is its size, not an undulation.
    stiffness = np.maximum(stiffness - stiffness[:, 1:2], 0.0)
    kept = 1 / (1 + (stiffness / cut) ** 2)
    return np.fft.irfft(np.fft.rfft(xy, axis=1) * kept[..., None], n, axis=1)


def _along(xy: FloatArray, levels: FloatArray, wavelength: float) -> FloatArray:
    steps = np.diff(levels)
    if np.ptp(steps) > 1e-6 * steps.mean():
        raise InputError(
            "shape",
            "levels",
            "are not evenly spaced, so the leg can't be smoothed along them",
            "resample the shape first",
        )
    n = len(levels)
    if n < 3:
        return xy
    cut = 2 - 2 * np.cos(min(2 * np.pi * steps.mean() / wavelength, np.pi))
    difference = np.diff(np.eye(n), 2, axis=0)
    matrix = np.eye(n) + difference.T @ difference / cut**2
    banded = np.stack([np.pad(np.diagonal(matrix, k), (k, 0)) for k in (2, 1, 0)])
    solved: FloatArray = solveh_banded(banded, xy.reshape(n, -1)).reshape(xy.shape)
    return solved


_MESHED_CLEARANCE = 0.5
_AROUND, _ALONG = 10.0, 12.0
"""Wavelengths (mm) below which undulations are smoothed away."""


def shape_of_outlines(levels: ArrayLike, outlines: Sequence[Mapping[str, Polygon]], n_points: int = 180) -> LegShape:
    """Return the shape of outlines as they are; ``muscle_hull`` becomes the hull."""
    contours: dict[str, list[FloatArray]] = {}
    for here in outlines:
        for part, polygon in here.items():
            name = HULL if part == MUSCLE_HULL else part
            contours.setdefault(name, []).append(np.asarray(polygon.exterior.coords)[:-1])
    return shape_of_contours(levels, contours, n_points)


def nested_shape(
    levels: ArrayLike,
    outlines: Sequence[Mapping[str, Polygon]],
    source: str | Path,
    clearances: Clearances | None = None,
) -> LegShape:
    """Make a shape whose parts nest with clearances.

    The hull of the muscles is joined with the bones and their clearance, its furrows bridged, kept
    off the skin; a bone that stands too close to the skin is cut back there
    (see `legfem.geometry.section_from_outlines.nested_outlines`).

    Parameters
    ----------
    levels : (n,) array
        Evenly spaced z, mm.
    outlines : sequence of mapping
        At each level ``skin``, ``muscle_hull`` and the bones, mm.
    source : str or Path
        What errors name as the file.
    clearances : Clearances, optional
        Room to keep between the parts.

    Raises
    ------
    InputError
        If the parts do not nest, or the coordinates are not mm.
    """
    room, z = clearances or Clearances(), np.asarray(levels, dtype=np.float64)
    nested = [
        nested_outlines(here, 0.0, f"{source}, level {level:g} mm", room)
        for level, here in zip(z, outlines, strict=True)
    ]
    shape = smoothed(shape_of_outlines(z, nested), _AROUND, _ALONG)
    check_shape(shape, source, _MESHED_CLEARANCE)
    return shape


def read_shape(path: Path, between: tuple[float, float] = (-np.inf, np.inf)) -> LegShape:
    """Read a shape and check that its parts nest.

    The contours may have different numbers of points from level to level, and start anywhere.

    Parameters
    ----------
    path : Path
        The file.
    between : tuple of float
        Levels (mm) beyond which rows are passed over.

    Raises
    ------
    InputError
        If the table can't be read, a part is missing or missing at a level, or the contours are
        not those of a leg (see `legfem.geometry.leg_shape.check_shape`).
    """
    path = Path(path)
    levels, found = read_loops(path, between)
    if any(MUSCLE_HULL in here for here in found):
        names = [f"level {level:g} mm" for level in levels]
        outlines = [polygons_of(here, path, at) for here, at in zip(found, names, strict=True)]
        try:
            return nested_shape(levels, outlines, path)
        except ValueError as error:
            raise not_closed(path, error) from None
    contours, points = {}, {}
    for part in dict.fromkeys(part for here in found for part in here):
        loops = [max(here.get(part, [np.empty((0, 2))]), key=len) for here in found]
        for level, loop in zip(levels, loops, strict=True):
            if len(loop) < 8:
                raise InputError(
                    path,
                    f"{part}, level {level:g} mm",
                    f"{len(loop)} points are too few",
                    "give the contour of every part at every level, 8 points or more",
                )
        contours[part] = loops
        points[part] = max(len(loop) for loop in loops)
    for part in (SKIN, HULL):
        if part not in contours:
            raise InputError(path, part, "the part is missing", f"add rows 'level,{part},i,x,y'")
    try:
        shape = shape_of_contours(levels, contours, points)
    except ValueError as error:
        raise not_closed(path, error) from None
    check_shape(shape, path)
    return shape


def not_closed(path: Path, error: ValueError) -> InputError:
    """Return the error of a file with a contour that no closed curve goes through."""
    return InputError(
        path, "x_mm, y_mm", f"a contour is not a closed outline: {error}", "give its points in order around it, once"
    )
