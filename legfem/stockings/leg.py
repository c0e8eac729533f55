"""A leg with and without its stocking: scans, fabric, tissues, veins and posture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from legfem.common.doubts import Doubt
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, LegShape
from legfem.imaging.registration import Registration
from legfem.legs.elastography import ShearModulus
from legfem.mechanics.materials import NeoHookean
from legfem.stockings.fabric import Stocking
from legfem.stockings.levels import NOTHING_STATED, MakersLevels
from legfem.stockings.misfit import ContourAccuracy
from legfem.stockings.sensors import Sensor

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
    of the muscle is.

    Raises
    ------
    InputError
        If the leg has no tibia and fibula: positions have to be given then.
    """
    if not {"tibia", "fibula"} <= set(shape.bones):
        raise InputError(
            "veins",
            "positions",
            f"no default places beside {', '.join(shape.bones)}",
            "give positions, or name the bones tibia and fibula",
        )
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


@dataclass(frozen=True, eq=False)
class StockingLeg:
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
