"""A thin sheet round the deep tissue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.checks import check_positive
from legfem.common.errors import InputError
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless


@dataclass(frozen=True)
class Fascia(Memoryless):
    r"""An incompressible neo-Hookean membrane on the face between deep and superficial tissue.

    .. math:: \frac{k}{2} \left(\operatorname{tr} C_s + 1 / J_s^2 - 3\right)

    a reference area, with the deformation :math:`C_s` of the face in itself and the change
    :math:`J_s` of its area; k is the shear modulus times the thickness (2 C10 h). It does nothing
    at ``stiffness = 0``.

    Parameters
    ----------
    stiffness : float
        k (N/mm).
    """

    stiffness: float = 0.0
    domain: Literal["body"] = "body"

    def __post_init__(self) -> None:
        """Check the stiffness."""
        check_positive(self, "stiffness", zero_allowed=True)

    @property
    def name(self) -> str:
        """What parameters are named by."""
        return "fascia.membrane"

    @property
    def parameters(self) -> dict[str, float]:
        """The stiffness."""
        return {f"{self.name}.stiffness": self.stiffness}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the membrane's energy."""
        if body.hull is None:
            raise InputError(
                "mesh", self.name, "the mesh doesn't tell the face of the deep tissue",
                "mesh the leg with legfem.meshing.solid_leg",
            )  # fmt: skip
        stiffness = body.symbols.scalar(f"{self.name}.stiffness", self.stiffness)
        energy = 0.5 * stiffness * membrane_invariant(body) * body.hull
        return ufl.derivative(energy, body.unknown, body.test)


def membrane_invariant(body: Body) -> Expr:
    """Return the first invariant, less 3, of an incompressible sheet that follows a face."""
    F = body.deformation_gradient
    normal = ufl.FacetNormal(ufl.domain.extract_unique_domain(body.displacement))
    across = F * normal
    area = ufl.det(F) * ufl.inv(F).T * normal
    return ufl.inner(F, F) - ufl.dot(across, across) + 1 / ufl.dot(area, area) - 3
