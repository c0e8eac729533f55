"""How contact is enforced, in numbers without a dimension that suit any stiffness of the tissue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from legfem.common.errors import InputError
from legfem.mechanics.contact import ExponentialPressure, PressureLaw, StiffPressure
from legfem.mechanics.traction import Coulomb, Frictionless, Rough, TangentialLaw, Tape

TangentialName = Literal["rough", "frictionless", "coulomb", "tape"]
PENALTY_PARAMETERS = ("deep.C10", "deep.C20", "superficial.C10")
"""Stiffnesses of a leg whose sum the penalty is in proportion to."""


@dataclass(frozen=True)
class ContactSettings:
    r"""Laws of contact, their stiffness relative to the tissue's.

    Parameters
    ----------
    normal : {"stiff", "exponential"}
        Law of the pressure: a rounded linear penalty, or Abaqus' exponential law.
    tangential : {"rough", "frictionless", "coulomb", "tape"}
        Law along the surface; the paper's tape is ``"rough"``, and ``"tape"`` one that can fail.
    stiffness : float
        Dimensionless: the penalty is ``stiffness * mu / radius`` (MPa/mm) with the tissue's
        :math:`\mu = 2 (C_{10}^{deep} + C_{20}^{deep} + C_{10}^{superficial})`. The exponential law
        takes :math:`p_0` as the penalty times :math:`c_0`.
    onset : float
        Gap at which the pressure starts (mm).
    friction : float
        Coulomb's coefficient.
    weakness : float
        Inverse of the tape's shear strength (1/MPa).
    stiffnesses : tuple of str
        Full names of those whose sum the penalty is in proportion to; a leg's by default.
    """

    normal: Literal["stiff", "exponential"] = "stiff"
    tangential: TangentialName = "rough"
    stiffness: float = 1000.0
    onset: float = 0.005
    friction: float = 0.5
    weakness: float = 0.0
    stiffnesses: tuple[str, ...] = PENALTY_PARAMETERS

    def __post_init__(self) -> None:
        """Check the names of the laws."""
        for field, known in (("normal", ("stiff", "exponential")), ("tangential", get_args(TangentialName))):
            if getattr(self, field) not in known:
                raise InputError(
                    "contact", field, f"unknown law {getattr(self, field)!r}", f"choose one of {', '.join(known)}"
                )

    def penalty(self, parameters: Mapping[str, float], radius: float) -> float:
        """Return the penalty (MPa/mm) for a leg's parameters and the indenter's radius (mm)."""
        stiffness = sum(parameters.get(name, 0.0) for name in self.stiffnesses)
        return self.stiffness * 2 * stiffness / radius

    def penalty_slope(self, radius: float) -> float:
        """Return the penalty's derivative (1/mm) by each of the stiffnesses."""
        return self.stiffness * 2 / radius

    def pressure_law(self, penalty: float) -> PressureLaw:
        """Return the law of the pressure."""
        if self.normal == "stiff":
            return StiffPressure(penalty, self.onset)
        return ExponentialPressure(penalty * self.onset, self.onset)

    def tangential_law(self, penalty: float) -> TangentialLaw:
        """Return the law along the surface."""
        if self.tangential == "rough":
            return Rough(penalty)
        if self.tangential == "coulomb":
            return Coulomb(self.friction, penalty)
        if self.tangential == "tape":
            return Tape(self.weakness, penalty)
        return Frictionless()
