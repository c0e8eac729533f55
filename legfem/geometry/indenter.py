"""A rigid cylinder, ball or punch, its line of travel, and the site of a leg where it presses."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from scipy.optimize import brentq

from legfem.common.errors import Argument, Command, InputError, Remedy
from legfem.common.units import FloatArray, freeze
from legfem.geometry.section import LegSection, across

IndenterShape = Literal["cylinder", "ball", "punch"]


@dataclass(frozen=True, eq=False)
class Indenter:
    """A rigid cylinder, ball or punch, and its line of travel."""

    radius: float
    """Radius, mm."""
    length: float
    """Length of a cylinder along its axis, diameter of a ball, mm."""
    aim: FloatArray
    """A point on the line of travel of the indenter's middle, (2,), mm."""
    direction_deg: float
    """Direction of travel, degrees counter-clockwise from +x."""
    shape: IndenterShape = "cylinder"
    """A punch is a cylinder that is pressed with its flat end."""
    axis_deg: float = 0.0
    """Turn of a cylinder about its travel, degrees: 0 lies along the leg, 90 across."""

    def __post_init__(self) -> None:
        """Keep a read-only copy of the aim."""
        freeze(self, "aim")

    @property
    def direction(self) -> FloatArray:
        """Unit vector of travel; (2,)."""
        angle = np.deg2rad(self.direction_deg)
        return np.array([np.cos(angle), np.sin(angle)])

    @property
    def lies_along(self) -> bool:
        """Whether it is a cylinder along the leg: a section in plane strain has no other."""
        return self.shape == "cylinder" and self.axis_deg % 180 == 0

    @property
    def extent(self) -> float:
        """Extent along the leg, mm."""
        if self.shape != "cylinder":
            return 2 * self.radius
        turn = np.deg2rad(self.axis_deg)
        return float(self.length * abs(np.cos(turn)) + 2 * self.radius * abs(np.sin(turn)))

    def __str__(self) -> str:
        """Say what it is, as reports have it."""
        across = f"{2 * self.radius:g} mm in diameter"
        if self.shape == "ball":
            return f"ball, {across}"
        if self.shape == "punch":
            return f"flat punch, {across}"
        turn = self.axis_deg % 180
        words = {0.0: "", 90.0: ", across the leg"}
        lies = words.get(turn, f", turned by {turn:g}° from the leg's axis")
        return f"cylinder, {across} and {self.length:g} mm long{lies}"

    def check_lies_along(self, source: str) -> None:
        """Check that a section in plane strain can have it.

        Raises
        ------
        InputError
            For a ball, a punch or a cylinder that doesn't lie along the leg.
        """
        if not self.lies_along:
            remedy = Remedy("solve the leg in 3D: ", Command("identify", (Argument("model", "3d"),)))
            raise InputError(source, "indenter", f"a section in plane strain cannot be pressed by a {self}", remedy)


def first_touch(outline: FloatArray, radius: float, aim: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the centre of a disk that, travelling along a line, just touches a closed polygon.

    Parameters
    ----------
    outline
        Corners of the polygon, (n, 2), mm.
    radius, aim, direction
        Radius of the disk (mm), a point on its line of travel (mm) and the travel's unit vector.

    Returns
    -------
    ndarray
        (2,), mm.
    """
    ring = shapely.LinearRing(outline)
    along = (outline - aim) @ direction
    near = np.abs((outline - aim) @ across(direction)) < 0.9 * radius
    if not near.any():
        remedy = "give a point inside the leg and check direction_deg"
        raise InputError("subject.toml", "indenter.aim_mm", "the indenter's line of travel misses the leg", remedy)

    def clearance(position: FloatArray | float) -> FloatArray:
        centres = aim + np.multiply.outer(position, direction)
        return np.asarray(shapely.distance(ring, shapely.points(centres)) - radius)

    inner = along[near].min()
    outer = along.min() - 2 * radius
    # The clearance falls with the approach, so the last sign change from outside is the touch.
    stations = np.linspace(outer, inner, 200)
    index = int(np.argmax(clearance(stations) <= 0))
    position = brentq(clearance, stations[index - 1], stations[index], xtol=1e-13)
    return aim + position * direction


@dataclass(frozen=True, eq=False)
class TravelLine:
    """A line of travel.

    Parameters
    ----------
    origin : (d,) array
        A point on it, mm.
    direction : (d,) array
        Its unit vector.
    """

    origin: FloatArray
    direction: FloatArray


@dataclass(frozen=True, eq=False)
class Site:
    """Where a leg is pressed: its section in the plane of the travel, and the indenter."""

    section: LegSection
    indenter: Indenter

    @property
    def touch(self) -> FloatArray:
        """The cylinder's axis at first touch (2,), mm."""
        return np.asarray(first_touch(self.section.skin, self.indenter.radius, self.indenter.aim, self.direction))

    @property
    def direction(self) -> FloatArray:
        """Unit vector of the travel (2,)."""
        return np.asarray(self.indenter.direction)

    @property
    def deepest(self) -> FloatArray:
        """Deepest point of the cylinder's face at first touch (2,), mm."""
        return np.asarray(self.touch + self.indenter.radius * self.direction)
