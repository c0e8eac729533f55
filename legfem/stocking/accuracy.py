r"""How far the outlines of a scan are off, and how alike the errors of neighbouring points are.

A segmentation errs by :math:`\sigma`, alike over a length l:
:math:`\sigma^2 \exp(-s^2 / (2 l^2))` is the covariance of points a distance s apart. Outlines taken
from it are smoothed (see `legfem.geometry.shape_smoothing`); of an undulation of wavelength
:math:`\lambda` they keep :math:`1/(1 + (\lambda_c/\lambda)^4)`, of its error too. That lessens the
errors, and makes them alike over a longer way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.checks import check_positive
from legfem.common.units import FloatArray


@dataclass(frozen=True)
class ContourAccuracy:
    """Errors of the contours that are compared.

    Parameters
    ----------
    sd : float
        Of the segmented outline's points off the true one, in one scan, before smoothing (mm).
    correlation : float
        Length l over which these errors are alike (mm).
    around, along : float
        Wavelengths at which smoothing halved the outlines' undulations (mm); 0 for none.
    model_sd : float
        Of the simulated contours, by mesh and interpolation (mm).
    pressure_sd : float
        By which the stocking's pressure may differ from Laplace's law over an eighth of the girth,
        relative. A leg of soft tissue gives way by some 0.1 mm a per cent.
    tension_sd : float
        By which the fabric's tension may differ from what was given, relative, all over the leg
        alike; 0 takes the fabric as it was given.
    shift_sd : (float, float, float)
        Of the registration's translation along x, y and z (mm).
    turn_sd : (float, float, float)
        Of its rotation about x, y and z (rad).
    """

    sd: float = 0.2
    correlation: float = 8.0
    around: float = 0.0
    along: float = 0.0
    model_sd: float = 0.03
    pressure_sd: float = 0.01
    shift_sd: tuple[float, float, float] = (0.05, 0.05, 0.5)
    turn_sd: tuple[float, float, float] = (0.002, 0.002, 0.002)
    tension_sd: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "sd", "correlation", "model_sd", "pressure_sd")
        check_positive(self, "around", "along", "tension_sd", zero_allowed=True)

    @property
    def smoothed_sd(self) -> float:
        """Of the outlines as they are compared, in one scan (mm)."""
        left = self._kept(np.zeros(1), self.around) * self._kept(np.zeros(1), self.along)
        return float(self.sd * np.sqrt(left[0]))

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
        """Return the correlation that smoothing in one direction leaves, times what it keeps."""
        if wavelength == 0:
            return np.exp(-0.5 * (distance / self.correlation) ** 2)
        number = np.linspace(0.0, 6.0 / self.correlation, 400)
        density = np.exp(-0.5 * (number * self.correlation) ** 2)
        smooth = density / (1 + (wavelength * number / (2 * np.pi)) ** 4) ** 2
        cosines = np.cos(np.multiply.outer(distance, number))
        return np.asarray(cosines @ smooth / density.sum())
