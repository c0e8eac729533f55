"""The leg moves under the cylinder, or its support gives way."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from legfem.common.units import FloatArray
from legfem.geometry.section import BONES
from legfem.inverse.mechanism import IndentedLeg, Mechanism, Solution, TissueMechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.mechanisms.timing import moments, shortest_programme, smooth_switch


@dataclass(frozen=True)
class LegMovement(Mechanism):
    r"""The leg moves from a moment on, and back after a while, in every trial alike.

    .. math:: d_{tissue} = d - s \left(h(t - t_1) - h(t - t_1 - t_2)\right)

    with a smooth switch h. It moves as a whole, so that the tissue's force at what is left of the
    displacement is all that is asked for.
    """

    name: ClassVar[str] = "leg-movement"
    statement: ClassVar[str] = "the leg moved during the test: it gave way to the cylinder or came towards it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("shift", "mm", "how far it moved away from the cylinder", 0.7, (-5.0, 5.0)),
        Parameter(
            "onset",
            "-",
            (0.0, 1.0),
            Prior(0.5, 0.3, "linear", "any time"),
            statement="when it began, over the time of the shortest programme",
        ),
        Parameter(
            "rise",
            "-",
            (0.005, 0.3),
            Prior(0.05, 0.8, "log", "a second or some"),
            scale="log",
            statement="how long a movement took, likewise",
        ),
        Parameter(
            "away",
            "-",
            (0.01, 3.0),
            Prior(0.3, 1.2, "log", "nothing is known"),
            scale="log",
            statement="how long until it moved back, likewise; above one it stayed",
        ),
    )
    would_be: ClassVar[str] = "a leg that moves away by {}"
    next_experiment: ClassVar[str] = "film the shin against the frame during the test, strap the leg, and repeat"
    measured_sd: ClassVar[float | None] = 0.15
    """An estimate: a mark of 1 mm, seen to a fraction."""

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return moments through the programme, with a return and without."""
        _, _, rise, away = self.parameters
        return tuple(
            {"shift": 0.2, "onset": onset, "rise": rise.inside(0.5 * apart), "away": gone}
            for onset, apart in moments(observed)
            for gone in (away.inside(apart), 2.0)
        )

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return how far the leg is away from where it began."""
        since = observed.time / shortest_programme(observed) - values["onset"]
        rise = values["rise"]
        gone, returned = since / rise, (since - values["away"]) / rise
        return values["shift"] * (smooth_switch(gone) - smooth_switch(returned))


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
            statement="part of the displacement that is the bones', the rest being the frame's (0 to 1)",
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
