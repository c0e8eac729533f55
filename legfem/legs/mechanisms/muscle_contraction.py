"""The muscle tenses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.mechanisms.timing import moments, shortest_programme, smooth_switch


@dataclass(frozen=True)
class MuscleContraction(Mechanism):
    """The muscle tenses from a moment on, in every trial: a smooth switch of its stiffness.

    An elastic leg's force at a displacement follows from the stiffness then, so no history is
    needed; `legfem.mechanics.terms.muscle` is the same thing in the finite-element model.
    """

    name: ClassVar[str] = "muscle-contraction"
    statement: ClassVar[str] = "the muscle tensed during the test and became stiffer"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("stiffening", "-", "rise of the deep stiffness over itself", 0.2, (0.0, 3.0)),
        Parameter(
            "onset",
            "-",
            (0.0, 1.0),
            Prior(0.5, 0.3, "linear", "any time"),
            statement="when it begins, over the time of the shortest programme",
        ),
        Parameter(
            "rise",
            "-",
            (0.005, 0.5),
            Prior(0.06, 0.8, "log", "a second or some"),
            scale="log",
            statement="how long it takes to rise, likewise",
        ),
    )
    would_be: ClassVar[str] = "a muscle that tenses and becomes stiffer by a share of {}"
    next_experiment: ClassVar[str] = "repeat with electromyography of the calf, or ask for a relaxed leg and compare"
    measured_sd: ClassVar[float | None] = 0.03
    """An estimate."""

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return onsets through the programme."""
        rise = self.parameters[2]
        return tuple(
            {"stiffening": 0.1, "onset": onset, "rise": rise.inside(share * apart)}
            for onset, apart in moments(observed)
            for share in (0.4, 1.5)
        )

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the stiffness over that at rest."""
        since = observed.time / shortest_programme(observed) - values["onset"]
        return 1.0 + values["stiffening"] * smooth_switch(since / max(values["rise"], 1e-6))
