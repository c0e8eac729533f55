"""A leg with and without its stocking, as a folder gives it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from legfem.common.doubts import Doubt
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.imaging.registration import Registration
from legfem.legs.elastography import ShearModulus
from legfem.mechanics.materials import NeoHookean
from legfem.stocking.accuracy import ContourAccuracy
from legfem.stocking.laplace import Stocking
from legfem.stocking.posture import Posture
from legfem.stocking.sensors import Sensor
from legfem.stocking.veins import Vein


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
