r"""A leg with and without its stocking: scans, fabric, tissues, veins, posture, and sensors' pressures.

Contours alone tell the ratio of pressure and stiffness: a fabric 10 % stiffer than was given makes
both tissues 10 % stiffer. A sensor measures the pressure itself:

.. math:: p_i = (1 + t) \sum_j w_{ij}\, p_j + e_i,

with the stocking's pressure :math:`p_j` at the skin's points, weights :math:`w_{ij}` over the
sensor's face, the relative error :math:`t` of the fabric's tension, the same everywhere, and the
sensor's own error :math:`e_i`.

A sensor lifts the fabric, and so bears what the fabric presses with beside it, too. A fabric of tension :math:`T`
without friction that leaves a round firm leg of radius :math:`r` for a pliable sensor of width :math:`w` and thickness
:math:`t` turns over it by :math:`2 (\theta + \varphi)` in place of :math:`2 \theta`, so that the sensor reads more by

.. math:: u = \frac{\sin(\theta + \varphi)}{\sin\theta} - 1, \quad
    \theta = \frac{w}{2 r}, \quad \cos\varphi = \frac{r}{r + t}

(Laplace's law, :math:`p = T / r`, for the fabric beside and over it: a balance of forces). A leg that yields lets it
sink in by :math:`\pi w u p / (32\, C_{10})`, as a rigid disc into an incompressible half-space (Sneddon 1965), until
:math:`t` less that is what still stands out. Which share of :math:`t` is left isn't known well: the reading is
corrected for that, with an even chance of anything from none to a firm leg's :math:`u` as its further error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
import shapely

from legfem.common.drawing import Pictured
from legfem.common.errors import Doubt
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.imaging.registration import Registration
from legfem.inverse.elastography import ShearModulus
from legfem.mechanics.materials import NeoHookean
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.fabric import Stocking, stocking_load
from legfem.stockings.levels import NOTHING_STATED, MakersLevels

KINDS = {"PicoPress": (0.028, 50.0), "Kikuhime": (0.042, 34.0)}
"""Of instruments the relative standard deviation of a reading, as the issue that asked for sensors states it, and the
diameter (mm) of the face, or of a round one of the same area: 50 mm, and 30 by 38 mm."""


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
    thickness : float, optional
        As it lies under the fabric (mm), for which the reading isn't corrected yet; None where nobody states it.
    """

    name: str
    position: FloatArray
    pressure: float
    sd: float
    diameter: float
    thickness: float | None = None

    def rises(self, radius: float, C10: float, thickness: float) -> tuple[float, float]:
        """Return by which shares it reads more than what presses beside it: on this leg, and on a firm one.

        Parameters
        ----------
        radius
            Of the leg at its place, mm.
        C10
            Of what it lies on, MPa.
        thickness
            mm.
        """
        half = self.diameter / (2 * radius)
        # It sinks in by `slack` times the root of what stands out (mm), as u is 2 / w times the root of 2 r that.
        slack = np.pi * self.pressure * np.sqrt(2 * radius) / (16 * C10)
        outside = (np.sqrt(slack**2 / 4 + thickness) - slack / 2) ** 2
        turns = half + np.arccos(radius / (radius + np.array([outside, thickness])))
        yielding, firm = np.sin(np.minimum(turns, np.pi / 2)) / np.sin(min(half, np.pi / 2)) - 1
        return float(yielding), float(firm)

    def corrected(self, radius: float, C10: float) -> "Sensor":
        """Return it with what presses beside it as its pressure; as it is where its thickness isn't stated."""
        yielding, firm = self.rises(radius, C10, self.thickness or 0.0)
        pressure = self.pressure / (1 + yielding)
        return replace(self, pressure=pressure, sd=float(np.hypot(self.sd, pressure * firm / np.sqrt(12))))


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
    def on(cls, shape: LegShape, sensors: Sequence[Sensor]) -> "SensorArray":
        """Place sensors on the skin of a bare leg."""
        weights = np.array([_weights(shape, sensor) for sensor in sensors])
        return cls(sensors, weights.reshape(len(sensors), *shape.contours[SKIN].shape[:2]))

    def __len__(self) -> int:
        """Return the number of sensors."""
        return len(self.sensors)

    def averages(self, pressure: FloatArray) -> FloatArray:
        """Average pressures at the skin's points (n_levels, n_points) over the faces, (s,)."""
        return np.tensordot(self.weights, pressure, axes=2)

    def compared(self, pressure: FloatArray) -> tuple["ComparedSensor", ...]:
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


GAP = 7.0
"""Distance (mm) of a vein's axis from the bone beside it, by default."""


@dataclass(frozen=True, eq=False)
class Vein:
    """A point of a vein; ``position`` (3,) in the bare leg, mm."""

    name: str
    position: FloatArray


def default_veins(shape: LegShape, level: float) -> tuple[Vein, ...]:
    """Place the main deep veins beside the bones they run along.

    The posterior tibial veins stand behind the tibia, the fibular ones behind the fibula towards
    the tibia, the anterior tibial ones before the membrane between the bones. Behind is where most
    of the muscle is. In a leg that has no tibia and fibula there are none.
    """
    if not {"tibia", "fibula"} <= set(shape.bones):
        return ()
    bones = {name: shapely.Polygon(shape.at(name, level)) for name in ("tibia", "fibula")}
    tibia, fibula = (np.array(bones[name].centroid.coords[0]) for name in ("tibia", "fibula"))
    across = (fibula - tibia) / np.linalg.norm(fibula - tibia)
    muscle = np.array(shapely.Polygon(shape.at(HULL, level)).centroid.coords[0])
    behind = muscle - 0.5 * (tibia + fibula)
    behind -= (behind @ across) * across
    behind /= np.linalg.norm(behind)
    between = 0.5 * (_edge(bones["tibia"], across) + _edge(bones["fibula"], -across))
    places = {
        "posterior tibial": _beside(bones["tibia"], behind),
        "fibular": _beside(bones["fibula"], (behind - across) / np.sqrt(2)),
        "anterior tibial": between - GAP * behind,
    }
    return tuple(Vein(name, np.array([*place, level])) for name, place in places.items())


def _beside(bone: shapely.Polygon, direction: FloatArray) -> FloatArray:
    return _edge(bone, direction) + GAP * direction


def _edge(bone: shapely.Polygon, direction: FloatArray) -> FloatArray:
    """Return where the ray from a bone's centroid leaves it, (2,)."""
    centre = np.array(bone.centroid.coords[0])
    ray = shapely.LineString([centre, centre + 1e3 * direction])
    inside = shapely.intersection(ray, bone)
    return np.array(inside.coords[-1])


BLOOD_KG_PER_M3 = 1060.0
GRAVITY_M_PER_S2 = 9.80665
_MPA_PER_MM = BLOOD_KG_PER_M3 * GRAVITY_M_PER_S2 * 1e-9
"""Pressure of a column of blood by its height, MPa/mm."""


@dataclass(frozen=True)
class Posture:
    """What the pressure inside the veins depends on.

    Parameters
    ----------
    heart : float
        Height of the heart above the scan's z = 0 when standing (mm).
    lying : float, optional
        Pressure in the leg's veins when lying (MPa).
    """

    heart: float
    lying: float | None = None

    def inside(self, height: float) -> dict[str, float]:
        """Return the pressure in a vein at a height z (mm) by posture, MPa."""
        standing = {"standing": _MPA_PER_MM * (self.heart - height)}
        return standing if self.lying is None else {**standing, "lying": self.lying}


@dataclass(frozen=True, eq=False, repr=False)
class StockingLeg(Pictured):
    """What is given of one leg; mm, MPa.

    Parameters
    ----------
    id, title, origin : str
        As in ``leg.toml``.
    bare : LegShape
        Bare leg as it is meshed, its parts kept apart.
    scanned_bare : LegShape
        Bare leg as it was scanned.
    compressed : LegShape, optional
        Leg scanned in its stocking, in the bare leg's coordinates.
    registration : Registration, optional
        How that was laid on the bare leg; None if there was nothing to register.
    stocking : Stocking
        Fabric that is worn.
    accuracy : ContourAccuracy
        Errors of the scans.
    tissues : dict of str to NeoHookean
        Laws of muscle (``deep``) and fat (``superficial``).
    known : bool
        Whether both C10 are given; else those of ``tissues`` are a start.
    ends : {"held", "free"}
        Condition at the segment's end faces.
    slices : (5,) array
        Heights of the slices that are compared.
    veins : tuple of Vein
        Where pressures are asked for.
    sensors : tuple of Sensor
        Pressures measured between stocking and skin.
    posture : Posture, optional
        Pressure inside the veins.
    elastography : tuple of ShearModulus
        Priors of the stiffnesses.
    doubts : tuple of Doubt
        What is unlikely in all this.
    makers : MakersLevels
        Where makers give its pressure, and the limits of its class.
    directory : Path, optional
        Folder that it was read from.
    girth_sd : float, optional
        Relative standard deviation of the girths of a leg by tape, whose ``bare`` are round rings; None of a scan.
    """

    id: str
    title: str
    origin: Literal["measured", "simulated"]
    bare: LegShape
    scanned_bare: LegShape
    compressed: LegShape | None
    registration: Registration | None
    stocking: Stocking
    accuracy: ContourAccuracy
    tissues: dict[str, NeoHookean]
    known: bool
    ends: Literal["held", "free"]
    slices: FloatArray
    veins: tuple[Vein, ...]
    sensors: tuple[Sensor, ...] = ()
    posture: Posture | None = None
    elastography: tuple[ShearModulus, ...] = ()
    doubts: tuple[Doubt, ...] = ()
    makers: MakersLevels = NOTHING_STATED
    directory: Path | None = None
    girth_sd: float | None = None

    @cached_property
    def sensors_there(self) -> tuple[tuple[Sensor, float, float], ...]:
        """Sensors with the leg's radius there, mm, at most a round one's of its girth, and C10 of fat, MPa."""
        if not self.sensors:
            return ()
        load = stocking_load(self.bare, self.stocking)
        flattest = 2 * np.pi / load.perimeter.max()
        under = SensorArray.on(self.bare, self.sensors).averages(load.curvature)
        c10 = float(self.tissues["superficial"].C10)
        return tuple((one, float(1 / max(at, flattest)), c10) for one, at in zip(self.sensors, under, strict=True))
