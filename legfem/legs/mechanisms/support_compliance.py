"""The leg's support gives way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from legfem.common.units import FloatArray
from legfem.geometry.section import BONES
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior

_LEAST = 1e-5
"""mm/N: as good as none."""


@dataclass(frozen=True)
class SupportCompliance(TissueMechanism):
    r"""Springs in series with the whole leg, or tibia and fibula each on springs of their own.

    In series :math:`d_{tissue} = d - c F`: a rig that gives way is the same as a rigid translation
    of leg and skeleton together. On springs of :math:`1 / (2 c)` each, in two directions, the bones
    would move by :math:`c F` together if both bore the same, and they don't. The force is taken in
    proportion between the two, by a share at the bones.
    """

    name: ClassVar[str] = "support-compliance"
    statement: ClassVar[str] = "the leg's support or the rig gave way: bones and frame moved with the force"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("compliance", "mm/N", "displacement per force", 0.2, (0.0, 2.0)),
        Parameter(
            "at_bones",
            "-",
            (0.0, 1.0),
            Prior(0.5, 0.5, "linear", "nothing is known"),
            statement="share of the way from a frame that gives way to bones that do",
        ),
    )
    would_be: ClassVar[str] = "a support that gives way by {}"
    next_experiment: ClassVar[str] = (
        "measure the shin's displacement during the test, or press a rigid block on the same rig"
    )
    measured_sd: ClassVar[float | None] = 0.02
    """An estimate: the skin over the shin yields 0.1 to 0.2 mm at 10 N."""
    variant: ClassVar[str] = "bones on springs"
    null_variant: ClassVar[str] = variant
    strengths: ClassVar[tuple[float, ...]] = (0.1, 0.4, 1.2)
    does_without: ClassVar[bool] = True

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return a usual compliance at the bones and in the frame, and a great one."""
        return (
            {"compliance": 0.1, "at_bones": 1.0},
            {"compliance": 0.1, "at_bones": 0.0},
            {"compliance": 0.6, "at_bones": 0.5},
        )

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the springs take up, were they in series."""
        return values["compliance"] * force

    def share(self, values: Values) -> float:
        """Return how much of what bones do otherwise than a frame there is."""
        return values["at_bones"]

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the bones' springs."""
        from legfem.mechanics.terms import BoneSprings

        section, length = leg.section, leg.indenter.length
        return [BoneSprings(bone, section.polygon(bone).area, length) for bone in BONES]

    def solution(self, values: Values) -> Solution:
        """Return the model with its bones on springs, beside the leg in series with such springs.

        Without compliance the two are one.
        """
        compliance = values["compliance"]
        if compliance <= _LEAST:
            return Solution(self.variant, null=self.null_variant)
        names = [f"{bone}.springs.{axis}" for bone in BONES for axis in "xy"]
        springs = dict.fromkeys(names, 0.5 / compliance)
        return Solution(self.variant, springs, null=self.null_variant, null_in_series=compliance)
