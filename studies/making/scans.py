"""Simulated scans: a leg's shape as a label volume, with the faults of a segmentation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import nibabel
import numpy as np
from scipy.ndimage import gaussian_filter1d

from legfem.common.errors import AboveZero, Checked, InputError, ZeroOrMore
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.motion import RigidTransform, rigidly_moved
from legfem.geometry.section import outward_normals
from legfem.imaging.label_volume import BONE, DEEP, SUPERFICIAL, LabelVolume


def coverage(
    contour: FloatArray, origin: FloatArray, spacing: FloatArray, shape: tuple[int, int], lines: int = 4
) -> FloatArray:
    """Return the covered share of every pixel, exact along x and sampled along y.

    A line at some y enters and leaves the contour at crossings; a pixel's share on the line is what
    lies to the right of the crossings, counted with their signs.

    Parameters
    ----------
    contour : (n, 2) array
        Closed, counter-clockwise, mm.
    origin, spacing : (2,) array
        Centre of the pixel [0, 0], and between centres (mm).
    shape : (n_x, n_y)
        Of the image.
    lines : int
        Lines a pixel.

    Returns
    -------
    ndarray
        (n_x, n_y), 0 to 1.
    """
    # In pixels; pixel i reaches from i to i + 1.
    xy = (contour - origin) / spacing + 0.5
    first = np.clip(np.floor(xy.min(axis=0)).astype(int), 0, shape)
    last = np.clip(np.ceil(xy.max(axis=0)).astype(int), first, shape)
    covered = np.zeros(shape)
    n_x, n_y = last - first
    if n_x == 0 or n_y == 0:
        return covered
    start = xy - first
    end = np.roll(start, -1, axis=0)
    at = (np.arange(n_y * lines) + 0.5) / lines
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    edge, line = np.nonzero((low[:, None] <= at) & (at < high[:, None]))
    rise = end[edge, 1] - start[edge, 1]
    x = start[edge, 0] + (at[line] - start[edge, 1]) / rise * (end[edge, 0] - start[edge, 0])
    sign = -np.sign(rise)  # a counter-clockwise contour is entered, from the left, going down
    x = np.clip(x, 0.0, n_x - 1e-9)
    pixel = x.astype(int)
    steps = np.zeros((n_x + 1, n_y * lines))
    share = pixel + 1 - x
    np.add.at(steps, (pixel, line), sign * share)
    np.add.at(steps, (pixel + 1, line), sign * (1 - share))
    shares = np.cumsum(steps, axis=0)[:n_x].reshape(n_x, n_y, lines).mean(axis=2)
    covered[first[0] : last[0], first[1] : last[1]] = shares
    return covered


PAPER_SPACING = (0.93, 0.93, 1.0)
"""mm; the second paper's scans."""


@dataclass(frozen=True)
class SegmentationNoise(Checked):
    """How a segmentation errs.

    Parameters
    ----------
    boundary_sd : float
        Of the displacement of the parts' surfaces (mm).
    correlation_length : float
        Of that displacement over the surface (mm).
    voxel_sd : float
        Of the covered share of a voxel.
    """

    boundary_sd: ZeroOrMore[float] = 0.3
    correlation_length: AboveZero[float] = 5.0
    voxel_sd: ZeroOrMore[float] = 0.15


@dataclass(frozen=True)
class ScanSettings:
    """The scanner's grid.

    Parameters
    ----------
    spacing : (float, float, float)
        Between voxels' centres (mm).
    margin : float
        Background round the leg (mm).
    subslices : int
        Levels within a slice over which what is covered is averaged.
    """

    spacing: tuple[float, float, float] = PAPER_SPACING
    margin: float = 6.0
    subslices: int = 3


def simulated_scan(
    shape: LegShape,
    seed: int,
    noise: SegmentationNoise | None = None,
    motion: RigidTransform | None = None,
    settings: ScanSettings | None = None,
) -> LabelVolume:
    """Return a simulated scan of a leg, undeformed or deformed.

    Parameters
    ----------
    shape : LegShape
        The leg; see `legfem.geometry.motion.displaced` for a deformed one.
    seed : int
        Of the noise and of where the leg lies in the grid, by a part of a voxel.
    noise : SegmentationNoise, optional
        None simulates a perfect segmentation.
    motion : RigidTransform, optional
        Of the leg in the scanner.
    settings : ScanSettings, optional
        The grid.

    Raises
    ------
    InputError
        If the leg leans so much that no slice holds all its parts.
    """
    settings = settings or ScanSettings()
    generator = np.random.default_rng(seed)
    spacing = np.array(settings.spacing)
    if motion is not None:
        shape = rigidly_moved(shape, motion.rotation, motion.translation)
    skin = shape.contours[SKIN]
    low = np.array([*skin.min(axis=(0, 1)), shape.levels[0] + 0.5 * spacing[2]])
    high = np.array([*skin.max(axis=(0, 1)), shape.levels[-1] - 0.5 * spacing[2]])
    low[:2] -= settings.margin + spacing[:2] * generator.uniform(size=2)
    high[:2] += settings.margin
    low[2] += spacing[2] * generator.uniform()
    counts = np.floor((high - low) / spacing).astype(int) + 1
    if counts.min() < 2:
        raise InputError("scan", "slices", "the leg is shorter than two slices", "give a longer segment")
    # Levels at which the leg is cut, some in every slice.
    share = (np.arange(settings.subslices) + 0.5) / settings.subslices - 0.5
    slices = low[2] + spacing[2] * np.arange(counts[2])
    fine = shape.at_levels((slices[:, None] + spacing[2] * share).ravel())
    labels = np.zeros(tuple(counts), dtype=np.uint8)
    for part in shape.parts:
        xy = fine.contours[part]
        if noise is not None:
            xy = _displaced(xy, fine.levels, noise, generator)
        label = {SKIN: SUPERFICIAL, HULL: DEEP}.get(part, BONE)
        inner = part != SKIN
        for k in range(counts[2]):
            cuts = xy[k * settings.subslices : (k + 1) * settings.subslices]
            grid = low[:2], spacing[:2], (int(counts[0]), int(counts[1]))
            covered = np.mean([coverage(cut, *grid) for cut in cuts], axis=0)
            if noise is not None and noise.voxel_sd:
                edge = (covered > 0) & (covered < 1)
                covered[edge] += noise.voxel_sd * generator.standard_normal(int(edge.sum()))
            inside = covered > 0.5
            if inner:  # a part never leaves the one around it
                inside &= labels[:, :, k] > 0
            labels[inside, k] = label
    return LabelVolume(labels, spacing, low, "simulated scan")


def _displaced(
    xy: FloatArray, levels: FloatArray, noise: SegmentationNoise, generator: np.random.Generator
) -> FloatArray:
    """Return contours displaced along their normals by a smooth random field."""
    tangent = np.roll(xy, -1, axis=1) - np.roll(xy, 1, axis=1)
    around = float(np.linalg.norm(tangent, axis=2).mean() / 2)
    along = float(np.diff(levels).mean())
    # Smoothing white noise with a Gaussian of this deviation correlates it over the length.
    deviation = noise.correlation_length / np.sqrt(2)
    extra = int(np.ceil(4 * deviation / along))
    field = generator.standard_normal((len(levels) + 2 * extra, xy.shape[1]))
    field = gaussian_filter1d(field, deviation / along, axis=0)[extra : extra + len(levels)]
    field = gaussian_filter1d(field, deviation / around, axis=1, mode="wrap")
    # White noise smoothed in two directions has this deviation.
    field *= np.sqrt(4 * np.pi * (deviation / along) * (deviation / around))
    return np.asarray(xy + noise.boundary_sd * field[..., None] * outward_normals(xy))


def write_volume(volume: LabelVolume, path: Path) -> None:
    """Write a label volume as NIfTI (``.nii`` or ``.nii.gz``), whose axes run to the right, the front and the head."""
    image = nibabel.Nifti1Image(volume.labels, np.diag([-1.0, -1.0, 1.0, 1.0]) @ volume.affine)
    image.header.set_xyzt_units("mm")
    nibabel.save(image, path)
