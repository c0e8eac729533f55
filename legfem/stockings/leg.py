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
from legfem.stockings.misfit import ContourAccuracy
from legfem.stockings.sensors import Sensor

GAP = 7.0
"""Distance (mm) of a vein's axis from the bone beside it, by default."""


@dataclass(frozen=True, eq=False)
class Vein:
    """A vein in the level of interest; ``position`` (x, y, z) in mm, of the bare leg."""

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
"""Of height."""


@dataclass(frozen=True)
class Posture:
    """Where the heart is, and what a lying person's veins hold.

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
    """What is known of one leg; mm, MPa."""

    id: str
    title: str
    origin: Literal["measured", "simulated"]
    bare: LegShape
    """To be meshed: its parts keep clear of each other."""
    scanned_bare: LegShape
    """The same as the scan has it."""
    compressed: LegShape | None
    """In the stocking, in the bare leg's coordinates; None if it wasn't scanned."""
    registration: Registration | None
    stocking: Stocking
    accuracy: ContourAccuracy
    tissues: dict[str, NeoHookean]
    known: bool
    """Whether the tissues' stiffness is given; else C10 is a start."""
    ends: Literal["held", "free"]
    slices: FloatArray
    """Levels of the five slices (mm)."""
    veins: tuple[Vein, ...]
    sensors: tuple[Sensor, ...] = ()
    """Between stocking and skin."""
    posture: Posture | None = None
    elastography: tuple[ShearModulus, ...] = ()
    doubts: tuple[Doubt, ...] = ()
    """What is unlikely in what was given."""
