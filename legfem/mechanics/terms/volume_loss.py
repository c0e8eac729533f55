"""Volume that a tissue loses when it is squeezed: blood that drains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.errors import InputError
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless, RegionTerm


@dataclass(frozen=True)
class VolumeLoss(RegionTerm, Memoryless):
    r"""A share of a region's volume leaves it, evenly: its pressure is zero at :math:`J = 1 - s`.

    .. math:: p (J - 1) - D_1 p^2 / 4 \to p (J - 1 + s) - D_1 p^2 / 4.

    What has left is gone for good, whatever the pressure: blood drained from the veins, not the
    filtration of a poroelastic tissue. Nothing happens at ``share = 0``. Needs a form with a
    pressure.

    Parameters
    ----------
    region : str
        Region of the body; the parameter is named ``<region>.volume_loss.share``.
    share : float
        Share :math:`s` of the volume that is lost, dimensionless.
    """

    region: str
    share: float = 0.0
    domain: Literal["body"] = "body"
    effect = "volume_loss"
    numbers = ("share",)

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the pressure's work on the volume that is lost."""
        if self.region not in body.pressures:
            raise InputError(
                "formulation",
                self.name,
                "volume is lost against a pressure, and there is none",
                'choose the formulation "continuous" or "mixed"',
            )
        share = body.symbols.scalar(f"{self.name}.share", self.share)
        work = share * body.pressures[self.region] * body.regions[self.region]
        return ufl.derivative(work, body.unknown, body.test)

    def nominal_stress(self, body: Body) -> Expr:
        """Return zero: what is lost acts through the pressure, which is the tissue's."""
        return ufl.zero(3, 3)
