"""The rig under a specimen gives way, which has no bones of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.common.units import FloatArray
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.legs.mechanisms import Mechanism, Values, mechanisms
from legfem.legs.mechanisms.support_compliance import SupportCompliance


@dataclass(frozen=True)
class RigCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`; a specimen has no bones."""

    name: ClassVar[str] = SupportCompliance.name
    statement: ClassVar[str] = "the rig or the base gave way with the force"
    parameters: ClassVar[tuple[Parameter, ...]] = SupportCompliance.parameters[:1]
    next_experiment: ClassVar[str] = "press a rigid block on the same rig, and subtract what that yields"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the rig takes up."""
        return values["compliance"] * force


def mechanisms_on_a_rig() -> tuple[Mechanism, ...]:
    """Return all mechanisms for a body that gives way with its rig, not with two bones."""
    return tuple(RigCompliance() if m.name == RigCompliance.name else m for m in mechanisms())
