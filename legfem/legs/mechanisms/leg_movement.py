"""The leg moves under the cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Values, strength
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
