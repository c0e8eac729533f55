"""A lying cylinder pressed, in plane strain, into a block on a rigid base."""

from legfem.experiments.axisymmetric import Arrangement, AxisymmetricTest
from legfem.experiments.bodies import CylinderOnBlock
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import RigidCylinder
from legfem.meshing.structured import MeridianMeshSettings, supports


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
