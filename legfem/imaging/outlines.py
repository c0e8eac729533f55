"""A leg's shape from outlines: sub-voxel ones of every part of a label volume, or files ``level_mm,part,i,x_mm,y_mm``.

They are smoothed, and nested with clearances. Cross-sections of surfaces (see `legfem.geometry.contours`) are read
too: what they call ``muscle_hull`` is given room.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import contourpy
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.linalg import solveh_banded
from shapely import Polygon

from legfem.common.errors import AboveZero, Checked, InputError, ZeroOrMore
from legfem.common.units import FloatArray
from legfem.geometry.contours import MUSCLE_HULL, check_girth, read_loops
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, check_shape, corresponding_loops, shape_of_contours
from legfem.geometry.section import CALF, LIMBS, area_and_centroid, closed_lengths
from legfem.geometry.section_from_outlines import BRIDGE, Clearances, joined, nested_outlines, polygons_of
from legfem.imaging.label_volume import BACKGROUND, BONE, DEEP, LabelVolume


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
    contours = dict(shape.contours)
    for part in contours if parts is None else parts:
        smooth = contours[part]
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
        problem = "are not evenly spaced, so the leg can't be smoothed along them"
        raise InputError("shape", "levels", problem, "resample the shape first")
    n = len(levels)
    if n < 3:
        return xy
    cut = 2 - 2 * np.cos(min(2 * np.pi * steps.mean() / wavelength, np.pi))
    difference = np.diff(np.eye(n), 2, axis=0)
    matrix = np.eye(n) + difference.T @ difference / cut**2
    banded = np.stack([np.pad(np.diagonal(matrix, k), (k, 0)) for k in (2, 1, 0)])
    return np.asarray(solveh_banded(banded, xy.reshape(n, -1)).reshape(xy.shape))


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
        parts = list(chain(*found))
        outlines = [polygons_of(here, path, at, parts) for here, at in zip(found, names, strict=True)]
        try:
            return nested_shape(levels, outlines, path)
        except ValueError as error:
            raise not_closed(path, error) from None
    contours, points = {}, {}
    for part in dict.fromkeys(part for here in found for part in here):
        loops = [max(here.get(part, [np.empty((0, 2))]), key=len) for here in found]
        for level, loop in zip(levels, loops, strict=True):
            if len(loop) < 8:
                remedy = "give the contour of every part at every level, 8 points or more"
                raise InputError(path, f"{part}, level {level:g} mm", f"{len(loop)} points are too few", remedy)
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
    problem = f"a contour is not a closed outline: {error}"
    return InputError(path, "x_mm, y_mm", problem, "give its points in order around it, once")


_LEAST_BONE = 0.05  # a component of bone smaller than this share of the largest is a speck
_LEAST_MUSCLE = 0.02
_LEAST_LEG = 0.2  # likewise of skin: as large as that it is another leg


@dataclass(frozen=True)
class OutlineSettings(Checked):
    """How outlines are taken from a volume.

    Parameters
    ----------
    blur : float
        Standard deviation of the Gaussian that smooths the indicator of a part, in voxels of the
        slice. The outline that is left of a disk of radius R lies blur^2 / (2 R) inwards; that is
        put right for a part's mean curvature.
    around, along : float
        Wavelengths (mm) below which undulations of skin and hull are smoothed away, around the
        contours and along the leg, which hardly undulates (see
        `legfem.imaging.outlines`).
    bone_around, bone_along : float
        The same of the bones.
    bridge : float
        Radius (mm) over which muscles that lie apart in a slice are joined.
    n_points : int
        Points a contour.
    """

    blur: AboveZero[float] = 0.7
    around: ZeroOrMore[float] = 25.0
    along: ZeroOrMore[float] = 80.0
    bone_around: ZeroOrMore[float] = 12.0
    bone_along: ZeroOrMore[float] = 12.0
    bridge: AboveZero[float] = BRIDGE
    n_points: AboveZero[int] = 180


def shape_of_volume(
    volume: LabelVolume, settings: OutlineSettings | None = None, clearances: Clearances | None = None
) -> LegShape:
    """Return the shape of a leg in a label volume, at the levels of its slices.

    The hull is the outline of deep tissue and bones together. Slices at either end that lack a part
    are left out.

    Parameters
    ----------
    volume : LabelVolume
        One leg.
    settings : OutlineSettings, optional
        Smoothing.
    clearances : Clearances, optional
        Room to keep between the parts, for a shape that is to be meshed (see
        `legfem.geometry.section_from_outlines.nested_outlines`); without it the outlines stay where the
        labels have them, as a target of measurement.

    Raises
    ------
    InputError
        If the leg is not in mm, leaves the volume sideways, is broken by slices that lack a part,
        or its parts do not nest with the clearances.
    """
    settings = settings or OutlineSettings()
    masks = {SKIN: volume.labels != BACKGROUND, HULL: volume.labels >= DEEP}
    middle = masks[SKIN].shape[2] // 2
    sizes = np.sort(np.bincount(ndimage.label(masks[SKIN][:, :, middle])[0].ravel())[1:])
    if len(sizes) > 1 and sizes[-2] > _LEAST_LEG * sizes[-1]:
        raise InputError(volume.source, f"slice {middle}", "shows two legs", "remove the labels of the other leg")
    _slices_with({**masks, "bone": volume.labels >= BONE}, volume)
    masks |= _bones(volume)
    slices = _slices_with(masks, volume)
    outlines: list[dict[str, Polygon]] = []
    for k in slices:
        found = {p: _outline(mask[:, :, k], volume, p, k, settings) for p, mask in masks.items()}
        check_girth(float(found[SKIN].length), volume.source)
        here = {MUSCLE_HULL if p == HULL else p: outline for p, outline in found.items()}
        room = clearances and nested_outlines(here, 0.0, f"{volume.source}, slice {k}", clearances)
        outlines.append(room or here)
    shape = shape_of_outlines(volume.levels[slices], outlines, settings.n_points)
    shape = smoothed(shape, settings.around, settings.along, (SKIN, HULL))
    shape = smoothed(shape, settings.bone_around, settings.bone_along, shape.bones)
    if clearances is not None:
        check_shape(shape, volume.source, clearance=0.5)
    return shape


def _bones(volume: LabelVolume) -> dict[str, NDArray[np.bool_]]:
    """Return the bones apart: those with names; a calf's two, the largest first."""
    if volume.bones:
        return {bone: volume.labels == BONE + k for k, bone in enumerate(volume.bones)}
    pieces, _ = ndimage.label(volume.labels == BONE)
    sizes = np.bincount(pieces.ravel())[1:]
    order = [int(i) for i in np.argsort(-sizes) if sizes[i] > _LEAST_BONE * sizes.max()]
    if len(order) > len(LIMBS[CALF]):
        remedy = "close the gaps in the tibia's and the fibula's labels"
        raise InputError(volume.source, "bone", f"is in {len(order)} pieces", remedy)
    return {name: pieces == i + 1 for name, i in zip(LIMBS[CALF], order, strict=False)}


def _slices_with(masks: dict[str, NDArray[np.bool_]], volume: LabelVolume) -> NDArray[np.int64]:
    """Return the numbers of the slices that hold every part; they have to follow one another."""
    holds: dict[str, Any] = {part: mask.any(axis=(0, 1)) for part, mask in masks.items()}
    every = np.flatnonzero(np.all(list(holds.values()), axis=0))
    if len(every) < 2:
        problem = "none contains skin, deep tissue and bones together"
        raise InputError(volume.source, "slices", problem, "check the labels")
    between = np.arange(every[0], every[-1] + 1)
    if len(between) > len(every):
        gap = int(np.setdiff1d(between, every)[0])
        part = next(part for part, has in holds.items() if not has[gap])
        what = "is empty" if part == SKIN else f"lacks the {part}"
        problem = f"{what} (z = {volume.levels[gap]:.1f} mm)"
        raise InputError(volume.source, f"slice {gap}", problem, "segment it, or cut the volume there")
    return between


def _outline(mask: Any, volume: LabelVolume, part: str, k: int, settings: OutlineSettings) -> Polygon:
    """Return the outline of a part in a slice, without holes, mm; muscles apart are joined."""
    if mask[[0, -1]].any() or mask[:, [0, -1]].any():
        problem = f"the {part} is cut off by the volume's edge"
        raise InputError(volume.source, f"slice {k}", problem, "give the whole leg, with background around it")
    pieces, number = ndimage.label(mask)
    if number <= 1:
        return _outline_of_piece(mask, volume, part, k, settings)
    sizes = np.bincount(pieces.ravel())[1:]
    largest = [int(np.argmax(sizes))]
    kept = np.flatnonzero(sizes > _LEAST_MUSCLE * sizes.max()) if part == HULL else largest
    found = [_outline_of_piece(pieces == 1 + n, volume, part, k, settings) for n in kept]
    return joined(found, volume.source, f"slice {k}", settings.bridge)


def _outline_of_piece(mask: Any, volume: LabelVolume, part: str, k: int, settings: OutlineSettings) -> Polygon:
    window = ndimage.find_objects(mask.astype(np.int8))[0]
    low = [max(0, s.start - 4) for s in window]
    around = tuple(slice(a, s.stop + 4) for a, s in zip(low, window, strict=True))
    filled = ndimage.binary_fill_holes(np.pad(mask[around], 4))
    smooth = ndimage.gaussian_filter(filled.astype(np.float64), settings.blur)
    # contourpy's x runs along the columns of what it is given.
    lines = contourpy.contour_generator(z=smooth.T).lines(0.5)
    closed = [line for line in lines if len(line) > 4 and np.allclose(line[0], line[-1])]
    if not closed:
        problem = f"the {part} is too small to have an outline"
        raise InputError(volume.source, f"slice {k}", problem, "remove the specks, or use a finer volume")
    index = max(closed, key=lambda line: abs(area_and_centroid(line)[0]))
    outline = Polygon(volume.origin[:2] + volume.spacing[:2] * (index + np.array(low) - 4))
    blurred = settings.blur**2 * float(volume.spacing[0] * volume.spacing[1])
    return outline.buffer(blurred * np.pi / outline.length)
