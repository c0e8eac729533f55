r"""Pressures measured by sensors between stocking and skin, as data of the identification.

Contours alone tell the ratio of pressure and stiffness: a fabric 10 % stiffer than was given makes
both tissues 10 % stiffer. A sensor measures the pressure itself:

.. math:: p_i = (1 + t) \sum_j w_{ij}\, p_j + e_i,

with the stocking's pressure :math:`p_j` at the skin's points, weights :math:`w_{ij}` over the
sensor's face, the relative error :math:`t` of the fabric's tension, the same everywhere, and the
sensor's own error :math:`e_i`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import SKIN, LegShape


@dataclass(frozen=True)
class SensorKind:
    """An instrument for the pressure under a stocking.

    Parameters
    ----------
    relative_sd : float
        Relative standard deviation of a reading.
    diameter : float
        Diameter of the face (mm), or of a round one of the same area.
    """

    relative_sd: float
    diameter: float


KINDS = {"PicoPress": SensorKind(0.028, 50.0), "Kikuhime": SensorKind(0.042, 34.0)}
"""Relative errors as the issue that asked for sensors states them; faces of 50 mm, and of 30 by
38 mm."""


USUAL_DIAMETER = 30.0
"""Diameter of a face that isn't stated, mm."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """One sensor and its reading.

    Parameters
    ----------
    name : str
        Place of the sensor, in the user's words.
    position : (3,) array
        Place on the bare leg's skin, mm.
    pressure, sd : float
        Reading and its standard deviation (MPa).
    diameter : float
        Diameter of the face (mm).
    """

    name: str
    position: FloatArray
    pressure: float
    sd: float
    diameter: float


@dataclass(frozen=True, eq=False)
class SensorArray:
    """The sensors of one leg, which average the pressure over their faces.

    Parameters
    ----------
    sensors : sequence of Sensor
        s sensors.
    weights : (s, n_levels, n_points) array
        Weights of the skin's points under each face, of sum 1.
    """

    sensors: Sequence[Sensor]
    weights: FloatArray

    @classmethod
    def on(cls, shape: LegShape, sensors: Sequence[Sensor]) -> SensorArray:
        """Place sensors on the skin of a bare leg."""
        weights = np.array([_weights(shape, sensor) for sensor in sensors])
        return cls(sensors, weights.reshape(len(sensors), *shape.contours[SKIN].shape[:2]))

    def __len__(self) -> int:
        """Return the number of sensors."""
        return len(self.sensors)

    def averages(self, pressure: FloatArray) -> FloatArray:
        """Average pressures at the skin's points (n_levels, n_points) over the faces, (s,)."""
        return np.tensordot(self.weights, pressure, axes=2)

    def compared(self, pressure: FloatArray) -> tuple[ComparedSensor, ...]:
        """Pair each sensor with the model's pressure, given at the skin's points."""
        modelled = map(float, self.averages(pressure))
        return tuple(ComparedSensor(*pair) for pair in zip(self.sensors, modelled, strict=True))

    @property
    def measured(self) -> FloatArray:
        """Readings (s,), MPa."""
        return np.array([sensor.pressure for sensor in self.sensors])

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of the readings (s,), MPa."""
        return np.array([sensor.sd for sensor in self.sensors])


@dataclass(frozen=True)
class ComparedSensor:
    """A sensor and the model's pressure at its place."""

    sensor: Sensor
    pressure: float
    """The model's, averaged over the face, MPa."""

    @property
    def standardised_residual(self) -> float:
        """Model less reading, over the reading's standard deviation."""
        return (self.pressure - self.sensor.pressure) / self.sensor.sd


def off_skin(shape: LegShape, position: FloatArray) -> float:
    """Return the distance of a point from the nearest of the skin's points, mm."""
    return float(_distances(shape, position).min())


def _weights(shape: LegShape, sensor: Sensor) -> FloatArray:
    """Weight the skin's points under a sensor's face by their area."""
    skin = shape.contours[SKIN]
    around = 0.5 * np.linalg.norm(np.roll(skin, -1, axis=1) - np.roll(skin, 1, axis=1), axis=2)
    # From the nearest point of the skin: a place that is read off a scan lies beside it.
    away = _distances(shape, sensor.position)
    level, point = np.unravel_index(int(np.argmin(away)), away.shape)
    middle = np.array([*skin[level, point], shape.levels[level]])
    under = _distances(shape, middle) <= 0.5 * sensor.diameter
    area = around * np.gradient(shape.levels)[:, None] * under
    return np.asarray(area / area.sum())


def _distances(shape: LegShape, position: FloatArray) -> FloatArray:
    """Return the skin's points' distances (n_levels, n_points) from a position (3,), mm."""
    across = shape.contours[SKIN] - position[:2]
    up = (shape.levels - position[2])[:, None]
    return np.sqrt(np.sum(across**2, axis=2) + up**2)
