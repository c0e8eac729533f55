"""From a label volume to a leg's shape: sub-voxel outlines of every part in every slice."""

from dataclasses import dataclass
from typing import Any

import contourpy
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from shapely import Polygon

from legfem.common.errors import InputError, check_positive
from legfem.common.units import FloatArray
from legfem.geometry.contours import MUSCLE_HULL, check_girth
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, check_shape, shape_of_contours
from legfem.geometry.leg_shape_from_outlines import smoothed
from legfem.geometry.section import area_and_centroid
from legfem.geometry.section_from_outlines import BRIDGE, Clearances, joined, nested_outlines
from legfem.imaging.label_volume import BACKGROUND, BONE, DEEP, LabelVolume

BONE_NAMES = ("tibia", "fibula")
_LEAST_BONE = 0.05  # a component of bone smaller than this share of the largest is a speck
_LEAST_MUSCLE = 0.02
_LEAST_LEG = 0.2  # likewise of skin: as large as that it is another leg


@dataclass(frozen=True)
class OutlineSettings:
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
        `legfem.geometry.leg_shape_from_outlines`).
    bone_around, bone_along : float
        The same of the bones.
    bridge : float
        Radius (mm) over which muscles that lie apart in a slice are joined.
    n_points : int
        Points a contour.
    """

    blur: float = 0.7
    around: float = 25.0
    along: float = 80.0
    bone_around: float = 12.0
    bone_along: float = 12.0
    bridge: float = BRIDGE
    n_points: int = 180

    def __post_init__(self) -> None:
        """Check the lengths."""
        check_positive(self, "blur", "n_points", "bridge")
        check_positive(self, "around", "along", "bone_around", "bone_along", zero_allowed=True)


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
    _check_one_leg(masks[SKIN], volume)
    _slices_with({**masks, "bone": volume.labels == BONE}, volume)
    masks |= _bones(volume)
    slices = _slices_with(masks, volume)
    found: dict[str, list[FloatArray]] = {part: [] for part in masks}
    for k in slices:
        here = {p: _outline(mask[:, :, k], volume, p, k, settings) for p, mask in masks.items()}
        check_girth(float(here[SKIN].length), volume.source)
        if clearances is not None:
            here[MUSCLE_HULL] = here.pop(HULL)
            here = nested_outlines(here, 0.0, f"{volume.source}, slice {k}", clearances)
            here[HULL] = here.pop(MUSCLE_HULL)
        for part, polygon in here.items():
            found[part].append(np.asarray(polygon.exterior.coords)[:-1])
    shape = shape_of_contours(volume.levels[slices], found, settings.n_points)
    shape = smoothed(shape, settings.around, settings.along, (SKIN, HULL))
    shape = smoothed(shape, settings.bone_around, settings.bone_along, shape.bones)
    if clearances is not None:
        check_shape(shape, volume.source, clearance=0.5)
    return shape


def _check_one_leg(skin: NDArray[np.bool_], volume: LabelVolume) -> None:
    k = skin.shape[2] // 2
    pieces, _ = ndimage.label(skin[:, :, k])
    sizes = np.sort(np.bincount(pieces.ravel())[1:])
    if len(sizes) > 1 and sizes[-2] > _LEAST_LEG * sizes[-1]:
        raise InputError(volume.source, f"slice {k}", "shows two legs", "remove the labels of the other leg")


def _bones(volume: LabelVolume) -> dict[str, NDArray[np.bool_]]:
    """Return the bones apart, the largest first."""
    pieces, _ = ndimage.label(volume.labels == BONE)
    sizes = np.bincount(pieces.ravel())[1:]
    order = [int(i) for i in np.argsort(-sizes) if sizes[i] > _LEAST_BONE * sizes.max()]
    if len(order) > len(BONE_NAMES):
        raise InputError(
            volume.source, "bone", f"is in {len(order)} pieces", "close the gaps in the tibia's and the fibula's labels"
        )
    return {name: pieces == i + 1 for name, i in zip(BONE_NAMES, order, strict=False)}


def _slices_with(masks: dict[str, NDArray[np.bool_]], volume: LabelVolume) -> NDArray[np.int64]:
    """Return the numbers of the slices that hold every part; they have to follow one another."""
    holds: dict[str, Any] = {part: mask.any(axis=(0, 1)) for part, mask in masks.items()}
    every = np.flatnonzero(np.all(list(holds.values()), axis=0))
    if len(every) < 2:
        raise InputError(
            volume.source, "slices", "none contains skin, deep tissue and bones together", "check the labels"
        )
    between = np.arange(every[0], every[-1] + 1)
    if len(between) > len(every):
        gap = int(np.setdiff1d(between, every)[0])
        part = next(part for part, has in holds.items() if not has[gap])
        what = "is empty" if part == SKIN else f"lacks the {part}"
        raise InputError(
            volume.source,
            f"slice {gap}",
            f"{what} (z = {volume.levels[gap]:.1f} mm)",
            "segment it, or cut the volume there",
        )
    return between


def _outline(mask: Any, volume: LabelVolume, part: str, k: int, settings: OutlineSettings) -> Polygon:
    """Return the outline of a part in a slice, without holes, mm; muscles apart are joined."""
    if mask[[0, -1]].any() or mask[:, [0, -1]].any():
        raise InputError(
            volume.source,
            f"slice {k}",
            f"the {part} is cut off by the volume's edge",
            "give the whole leg, with background around it",
        )
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
        raise InputError(
            volume.source,
            f"slice {k}",
            f"the {part} is too small to have an outline",
            "remove the specks, or use a finer volume",
        )
    index = max(closed, key=lambda line: abs(area_and_centroid(line)[0]))
    outline = Polygon(volume.origin[:2] + volume.spacing[:2] * (index + np.array(low) - 4))
    blurred = settings.blur**2 * float(volume.spacing[0] * volume.spacing[1])
    return outline.buffer(blurred * np.pi / outline.length)
