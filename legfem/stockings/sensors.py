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
    """An instrument.

    Parameters
    ----------
    relative_sd : float
        Of a reading.
    diameter : float
        Of the face (mm), of a round one as large.
    """

    relative_sd: float
    diameter: float


KINDS = {"PicoPress": SensorKind(0.028, 50.0), "Kikuhime": SensorKind(0.042, 34.0)}
"""Relative errors as the issue that asked for sensors states them; faces of 50 mm, and of 30 by
38 mm."""


USUAL_DIAMETER = 30.0
"""Of a face that isn't stated, mm."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """One sensor.

    Parameters
    ----------
    name : str
        Of its place.
    position : (3,) array
        On the bare leg's skin, mm.
    pressure, sd : float
        That it showed, and its standard deviation (MPa).
    diameter : float
        Of its face (mm).
    """

    name: str
    position: FloatArray
    pressure: float
    sd: float
    diameter: float


@dataclass(frozen=True, eq=False)
class Sensing:
    """What sensors on a leg feel of the pressure at the skin's points.

    Parameters
    ----------
    sensors : sequence of Sensor
        s of them.
    weights : (s, n_levels, n_points) array
        Over the skin's points, each sensor's of sum 1.
    """

    sensors: Sequence[Sensor]
    weights: FloatArray

    @classmethod
    def on(cls, shape: LegShape, sensors: Sequence[Sensor]) -> Sensing:
        """Lay sensors on the skin of a bare leg."""
        weights = np.array([_weights(shape, sensor) for sensor in sensors])
        return cls(sensors, weights.reshape(len(sensors), *shape.contours[SKIN].shape[:2]))

    def __len__(self) -> int:
        """Return s."""
        return len(self.sensors)

    def felt(self, pressure: FloatArray) -> FloatArray:
        """Return what sensors feel (s,) of pressures at the skin's points (n_levels, n_points)."""
        return np.tensordot(self.weights, pressure, axes=2)

    def compared(self, pressure: FloatArray) -> tuple[ComparedSensor, ...]:
        """Return the sensors beside pressures at the skin's points."""
        felt = map(float, self.felt(pressure))
        return tuple(ComparedSensor(*pair) for pair in zip(self.sensors, felt, strict=True))

    @property
    def measured(self) -> FloatArray:
        """Pressures that they showed, (s,), MPa."""
        return np.array([sensor.pressure for sensor in self.sensors])

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of these, (s,), MPa."""
        return np.array([sensor.sd for sensor in self.sensors])


@dataclass(frozen=True)
class ComparedSensor:
    """A sensor beside the model."""

    sensor: Sensor
    pressure: float
    """That the model has there, MPa."""

    @property
    def departure(self) -> float:
        """Of the model from the reading, over the reading's standard deviation."""
        return (self.pressure - self.sensor.pressure) / self.sensor.sd


def off_skin(shape: LegShape, position: FloatArray) -> float:
    """Return how far a point is from the nearest of the skin's points, mm."""
    return float(_distances(shape, position).min())


def _weights(shape: LegShape, sensor: Sensor) -> FloatArray:
    """Return a sensor's weights over the skin's points: by area under its face."""
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
