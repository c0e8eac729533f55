r"""A cylinder between two plates that stick to its ends, one of which turns while they keep their distance.

With the twist :math:`\psi` per height, :math:`\bar I_1 = 3 + \psi^2 r^2` at a radius r, and nothing changes its volume,
so that compressibility does nothing to first order. With the law's :math:`w = \partial U / \partial \bar I_1` the
torque is

.. math:: M = 4 \pi \psi \int_0^R w\, r^3\, \mathrm{d}r

(R. S. Rivlin, Phil. Trans. R. Soc. A 242 (1949) 173-195), of a neo-Hookean cylinder :math:`\pi C_{10} \psi R^4`. The
plates are pushed apart by :math:`\psi M / 2` whatever the law.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from legfem.channels.kinds.normal_force import NORMAL_FORCE
from legfem.common.units import FloatArray
from legfem.experiments.bodies import TwistedCylinder
from legfem.experiments.homogeneous import ClosedFormTest
from legfem.solve.path import FORCE

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_RADII = 0.5 * (1 + _NODES)
"""Shares of the radius at which the integral is evaluated."""


class TorsionTest(ClosedFormTest[TwistedCylinder]):
    """The cylinder's test, at a lever of 1 mm: displacements are angles (rad), forces torques (N mm)."""

    def read(self, parameters: Mapping[str, Any], at: FloatArray) -> dict[str, Any]:
        """Return the torque, and the force that pushes the plates apart."""
        body, twist = self.test, at / self.test.height
        sheared = (twist[:, None] * body.radius * _RADII) ** 2
        slope = self.law_at(parameters).distortion_slope(sheared)
        torque = 4 * np.pi * twist * body.radius**4 * (slope * _RADII**3 @ (0.5 * _WEIGHTS))
        return {FORCE: torque, NORMAL_FORCE.name: 0.5 * twist * torque}
