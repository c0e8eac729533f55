"""A thin sheet round the deep tissue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.errors import InputError, check_positive
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless

_ITERATIONS = 5
"""Of Newton's method for J, from 1: its error is below 3e-10 up to stretches of 0.7 and 1.3."""


@dataclass(frozen=True)
class Fascia(Memoryless):
    r"""A neo-Hookean membrane on the face between deep and superficial tissue.

    .. math:: \frac{k}{2} \left(J^{-2/3} \left(\operatorname{tr} C_s + J^2 / J_s^2\right) - 3
              + (J - 1)^2 / c\right)

    a reference area, with the deformation :math:`C_s` of the face in itself, the change
    :math:`J_s` of its area, and the volume ratio J at which nothing presses on the membrane across
    its thickness; k is the shear modulus times the thickness (2 C10 h) and c is D1 C10 of
    `legfem.mechanics.materials.NeoHookean`. It does nothing at ``stiffness = 0``.

    Parameters
    ----------
    stiffness : float
        k (N/mm).
    compressibility : float
        c, dimensionless; 0 is incompressible, J = 1.
    """

    stiffness: float = 0.0
    compressibility: float = 0.0
    domain: Literal["body"] = "body"

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "stiffness", "compressibility", zero_allowed=True)

    @property
    def name(self) -> str:
        """What parameters are named by."""
        return "fascia.membrane"

    @property
    def parameters(self) -> dict[str, float]:
        """The stiffness and the compressibility."""
        return {f"{self.name}.stiffness": self.stiffness, f"{self.name}.compressibility": self.compressibility}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the membrane's energy."""
        if body.hull is None:
            raise InputError(
                "mesh",
                self.name,
                "the mesh doesn't tell the face of the deep tissue",
                "mesh the leg with legfem.meshing.solid_leg",
            )
        k, c = (body.symbols.scalar(name, value) for name, value in self.parameters.items())
        trace, area2 = face_strain(body)
        J = free_volume_ratio(trace, area2, c)

        def varied(value: Expr) -> Expr:
            return ufl.derivative(value, body.unknown, body.test)

        # At J the energy is stationary: only the face's own strain varies.
        rate = varied(trace) - (J / area2) ** 2 * varied(area2)
        return 0.5 * k * J ** (-2 / 3) * rate * body.hull


def face_strain(body: Body) -> tuple[Expr, Expr]:
    """Return tr C of a face's deformation in itself, and its area's change squared."""
    F = body.deformation_gradient
    normal = ufl.FacetNormal(ufl.domain.extract_unique_domain(body.displacement))
    across = F * normal
    area = ufl.det(F) * ufl.inv(F).T * normal
    return ufl.inner(F, F) - ufl.dot(across, across), ufl.dot(area, area)


def free_volume_ratio(trace: Expr, area2: Expr, compressibility: Expr) -> Expr:
    r"""Return J of a sheet that nothing presses on, by Newton's method.

    .. math:: \tfrac{c}{3} \left(2 J^2 / J_s^2 - \operatorname{tr} C_s\right)
              + (J - 1) J^{5/3} = 0

    Parameters
    ----------
    trace, area2
        See `face_strain`; numbers serve, too.
    compressibility
        c.
    """
    third = compressibility / 3
    J: Expr = 1.0
    for _ in range(_ITERATIONS):
        power = J ** (2 / 3)
        off = third * (2 * J**2 / area2 - trace) + (J - 1) * J * power
        slope = 4 * third * J / area2 + (8 * J - 5) / 3 * power
        J = J - off / slope
    return J
