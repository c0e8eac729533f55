"""A rigid cylinder that lies on a block on a rigid base and is pressed into it, in plane strain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from legfem.common.errors import InputError, check_positive
from legfem.experiments.axisymmetric import Arrangement, AxisymmetricTest, Faces
from legfem.mechanics.contact import ContactSettings, RigidCylinder
from legfem.meshing.meridian import MeridianMeshSettings, supports


@dataclass(frozen=True)
class CylinderOnBlock:
    """A rigid cylinder across a block on a rigid base.

    Parameters
    ----------
    thickness, width : float
        Sizes of the block along the travel and across the cylinder, mm.
    cylinder_radius : float
        mm.
    length : float
        Length over which cylinder and block touch, along the cylinder (mm); ends don't count.
    cylinder : {"rough", "frictionless"}
        Whether what touches the cylinder sticks.
    base : {"bonded", "sliding"}
        Whether the block sticks to its base; it doesn't lift off in either case.
    """

    thickness: float
    width: float
    length: float
    cylinder_radius: float = 15.0
    cylinder: Faces = "rough"
    base: Literal["bonded", "sliding"] = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "thickness", "width", "length", "cylinder_radius")
        if self.width < self.cylinder_radius:
            raise InputError(
                "block", "width", f"{self.width:g} mm end under the cylinder", "give more than the cylinder's radius"
            )


class LateralCylinder(AxisymmetricTest[CylinderOnBlock]):
    """The cylinder's test; half of the block is meshed, and the plane through the axis is a mirror."""

    @property
    def arrangement(self) -> Arrangement:
        """A cylinder above half of the block."""
        test = self.test
        radius = test.cylinder_radius
        return Arrangement(
            RigidCylinder(radius),
            test.thickness + radius,
            self.settings.contact or ContactSettings(tangential=test.cylinder, stiffness=4000.0),
            radius,
            supports(test.base),
            test.width / 2,
            test.thickness,
            (0.0, min(1.2 * radius, 0.5 * test.width)),
            self.settings.mesh or MeridianMeshSettings(radius / 16),
            symmetry="plane",
            whole=2 * test.length,
        )
