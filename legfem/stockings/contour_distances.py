r"""Distances of a simulated leg's contours from those of the scan in the stocking, and their errors.

The residuals are distances along the scanned contours' normals, of skin and hull, in a few slices
of the calf. The segmentation of an outline errs by :math:`\sigma`, alike over a length l:
:math:`\sigma^2 \exp(-s^2 / (2 l^2))` is the covariance of the errors of two points a distance s
apart. Smoothing the outlines (`legfem.imaging.outlines`) keeps
:math:`1/(1 + (\lambda_c/\lambda)^4)` of an undulation of wavelength :math:`\lambda`, of the errors'
too, which makes them smaller and alike over a longer way. Their covariance is written as a sum of
orthogonal modes; the distances are whitened by projecting them on these. The model's own error is
taken to have the same modes.

The bare outline's errors are not here but among the nuisances (`legfem.stockings.nuisances`), since
the stocking's pressure responds to them; so is the motion between the scans that registration on
the bones leaves: bones are nearly prisms, so that they hardly fix the scans along the leg.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from legfem.common.errors import AboveZero, Checked, ZeroOrMore
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import rigidly_moved
from legfem.geometry.section import closed_lengths
from legfem.geometry.slices import CONTOURS, SliceSet, slice_distances


@dataclass(frozen=True)
class ContourAccuracy(Checked):
    """Errors of the contours that are compared.

    Parameters
    ----------
    sd : float
        Standard deviation of a segmented outline's points in one scan, before smoothing (mm).
    correlation : float
        Length l over which these errors are alike (mm).
    around, along : float
        Wavelengths at which smoothing halved the outlines' undulations (mm); 0 for none.
    model_sd : float
        Standard deviation of the simulated contours, by mesh and interpolation (mm).
    pressure_sd : float
        Relative standard deviation of the stocking's pressure from Laplace's law over an eighth of
        the girth. A leg of soft tissue gives way by some 0.1 mm a per cent.
    tension_sd : float
        Relative standard deviation of the fabric's tension from what was given, one value for the
        whole leg; 0 takes the fabric as it was given.
    shift_sd : (float, float, float)
        Standard deviation of the registration's translation along x, y and z (mm).
    turn_sd : (float, float, float)
        Standard deviation of its rotation about x, y and z (rad).
    """

    sd: AboveZero[float] = 0.2
    correlation: AboveZero[float] = 8.0
    around: ZeroOrMore[float] = 0.0
    along: ZeroOrMore[float] = 0.0
    model_sd: AboveZero[float] = 0.03
    pressure_sd: AboveZero[float] = 0.01
    shift_sd: tuple[float, float, float] = (0.05, 0.05, 0.5)
    turn_sd: tuple[float, float, float] = (0.002, 0.002, 0.002)
    tension_sd: ZeroOrMore[float] = 0.0

    @property
    def smoothed_sd(self) -> float:
        """Standard deviation of one scan's outlines after smoothing (mm)."""
        left = self._kept(np.zeros(1), self.around) * self._kept(np.zeros(1), self.along)
        return float(self.sd * np.sqrt(left[0]))

    @property
    def expected_rms(self) -> float:
        """Root-mean-square distance (mm) that errors of the contours alone make."""
        return math.sqrt(2 * self.smoothed_sd**2 + self.model_sd**2)

    def covariance(self, around: FloatArray, along: FloatArray) -> FloatArray:
        """Return the covariance (mm2) of two points of one scan's outline.

        Parameters
        ----------
        around, along : array
            Distances between them around the contour and along the leg (mm), of shapes that
            broadcast.
        """
        return self.sd**2 * self._kept(around, self.around) * self._kept(along, self.along)

    def _kept(self, distance: FloatArray, wavelength: float) -> FloatArray:
        """Return the correlation after smoothing in one direction, times the share of variance it keeps."""
        if wavelength == 0:
            return np.exp(-0.5 * (distance / self.correlation) ** 2)
        number = np.linspace(0.0, 6.0 / self.correlation, 400)
        density = np.exp(-0.5 * (number * self.correlation) ** 2)
        smooth = density / (1 + (wavelength * number / (2 * np.pi)) ** 4) ** 2
        cosines = np.cos(np.multiply.outer(distance, number))
        return np.asarray(cosines @ smooth / density.sum())


HELD = 0.95
"""Share of the errors' variance that the modes hold; the rest is counted as white."""


def amplitudes(modes: FloatArray, distances: FloatArray) -> FloatArray:
    """Return the amplitudes (k, m) of orthogonal modes (n_levels, n_points, k) in distances (n_levels, n_points, m)."""
    sizes = np.sum(modes**2, axis=(0, 1))
    return np.tensordot(modes, distances, ((0, 1), (0, 1))) / sizes[:, None]


def error_modes(
    accuracy: ContourAccuracy, contours: FloatArray, levels: FloatArray, counts: FloatArray | float = 1.0
) -> FloatArray:
    """Return the principal modes of the errors of one part's outline in one scan, the largest first.

    They are those of `ContourAccuracy.covariance`, (n_levels, n_points, k): outward distances of the outline's points
    (mm) for one standard deviation of each mode; orthogonal.

    Parameters
    ----------
    accuracy
        Errors of the scan.
    contours : (n_levels, n_points, 2) array
        The part's outline, points evenly spaced around (mm).
    levels : (n_levels,) array
        Heights, mm.
    counts : (n_levels,) array or float
        Factor of the errors at every level, from 0 to 1.
    """
    count = contours.shape[1]
    step = np.arange(count)
    way = np.minimum(step, count - step) / count * float(closed_lengths(contours).mean())
    height = np.abs(np.subtract.outer(levels, levels))
    zero = np.zeros(1)
    # The covariance is a product of one around and one along the leg; around, waves are its modes.
    around = np.fft.rfft(accuracy.covariance(way, zero)).real / accuracy.covariance(zero, zero)
    weight = np.broadcast_to(counts, levels.shape)
    size, along = np.linalg.eigh(accuracy.covariance(zero, height) * np.outer(weight, weight))
    waves, strength = _waves(around, count)
    variances = np.outer(strength, np.maximum(size, 0.0))
    order = np.argsort(-variances.ravel())
    share = np.cumsum(variances.ravel()[order]) / variances.sum()
    chosen = order[: 1 + int(np.searchsorted(share, HELD))]
    wave, line = np.unravel_index(chosen, variances.shape)
    scale = np.sqrt(variances.ravel()[chosen])
    return along[:, None, line] * waves[None, :, wave] * scale


def _waves(around: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal waves on a closed contour, (count, m), and their variances, (m,)."""
    angle = 2 * np.pi * np.arange(count) / count
    columns, strength = [np.full(count, 1 / np.sqrt(count))], [around[0]]
    for number in range(1, (count + 1) // 2):
        for wave in (np.cos, np.sin):
            columns.append(np.sqrt(2 / count) * wave(number * angle))
            strength.append(around[number])
    return np.stack(columns, axis=1), np.maximum(np.array(strength), 0.0)


CONTOUR_NAMES = {"outer": "skin", "inner": "hull of the muscle"}
"""The contours that are compared, in words."""
SHIFT, TURN = 0.05, 0.001
"""Steps of finite differences by rigid motions: mm, rad."""


@dataclass(frozen=True, eq=False)
class ContourMisfit:
    """Distances of simulated shapes from the contours scanned in the stocking.

    Parameters
    ----------
    target : SliceSet
        Slices of the leg scanned in its stocking.
    accuracy : ContourAccuracy
        Errors of both scans.
    offset : (n,) array or float
        Distances (mm) of the meshed bare leg from the scanned bare leg, where parts had to be moved
        apart to be meshed; subtracted from simulated distances.
    """

    target: SliceSet
    accuracy: ContourAccuracy
    offset: FloatArray | float = 0.0

    @classmethod
    def between(
        cls, target: SliceSet, accuracy: ContourAccuracy, scanned: LegShape, meshed: LegShape
    ) -> "ContourMisfit":
        """Make the misfit with the offset between the scanned and the meshed bare leg."""
        plain = cls(target, accuracy)
        return cls(target, accuracy, plain.distances(meshed) - plain.distances(scanned))

    def distances(self, shape: LegShape) -> FloatArray:
        """Return signed distances of a simulated shape outside the target (mm), skin first, (n,)."""
        found = slice_distances(self.target, SliceSet.of(shape, self.target.levels))
        return np.concatenate([found[name].ravel() for name in CONTOURS]) - self.offset

    def rigid_slopes(self, shape: LegShape) -> FloatArray:
        """Differentiate the distances by rigid motions of a simulated shape as `moved` takes them, (n, 6)."""
        here, steps = self.distances(shape), np.repeat((SHIFT, TURN), 3)
        columns = [self.distances(self.moved(shape, motion)) - here for motion in np.diag(steps)]
        return np.stack(columns, axis=1) / steps

    def moved(self, shape: LegShape, motion: FloatArray) -> LegShape:
        """Move a shape by three translations (mm) and turns about x, y and z through the slices' middle (rad), (6,)."""
        middle = np.array([*self.target.outer.mean(axis=(0, 1)), self.target.levels.mean()])
        rotation = Rotation.from_rotvec(motion[3:]).as_matrix()
        return rigidly_moved(shape, rotation, middle - rotation @ middle + motion[:3])

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return distances (n,) or derivatives (n, k) as m residuals of unit variance, (m,) or (m, k).

        They are projected on the modes of the outlines' errors; finer undulations are left out,
        since the errors of the model itself are unknown there.
        """
        parts = np.split(values.reshape(len(values), -1), len(CONTOURS))
        shares = [
            amplitudes(modes, part.reshape(*modes.shape[:2], -1))
            for modes, part in zip(self._modes, parts, strict=True)
        ]
        white = np.concatenate(shares) / self._sd
        return white.reshape(-1, *values.shape[1:])

    @property
    def _sd(self) -> float:
        """Standard deviation of the errors that are no nuisances, over that of a mode of one scan."""
        accuracy = self.accuracy
        model = accuracy.model_sd / accuracy.smoothed_sd
        return float(np.sqrt(1.0 + (1.0 - HELD) + model**2))

    @cached_property
    def _modes(self) -> tuple[FloatArray, ...]:
        """Modes of the errors of the target's outer and inner contours."""
        target = self.target
        return tuple(error_modes(self.accuracy, target.contours(name), target.levels) for name in CONTOURS)
