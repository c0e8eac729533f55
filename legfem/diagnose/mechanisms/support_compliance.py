"""The leg's support gives way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.common.units import FloatArray
from legfem.diagnose.mechanisms.base import Mechanism, Values, strength
from legfem.diagnose.observations import Observations
from legfem.inference.parameter import Parameter


@dataclass(frozen=True)
class SupportCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`.

    Bones on springs that let the skeleton move along the travel are the same thing as a compliant
    rig: a rigid translation of leg and cylinder together.
    """

    name: ClassVar[str] = "support-compliance"
    statement: ClassVar[str] = (
        "the leg's support or the rig gave way: bones and frame moved with the force"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("compliance", "mm/N", "displacement per force", 0.2, (0.0, 2.0)),
    )
    next_experiment: ClassVar[str] = (
        "measure the shin's displacement during the test, or press a rigid block on the same rig"
    )

    def displacement_loss(
        self, values: Values, observed: Observations, force: FloatArray
    ) -> FloatArray:
        """Return what the springs take up."""
        return values["compliance"] * force
