"""What a lab can do next, as values: steps, and whether recordings show that one was taken."""

from collections.abc import Callable
from dataclasses import dataclass

from legfem.data.phases import HOLD
from legfem.data.ranges import REACHED_MM
from legfem.inverse.observations import Observations
from legfem.solve.protocol import ProtocolSegment

type Taken = Callable[[Observations], bool]
"""Whether recordings show that something was done."""
_NEARLY = 0.9
"""Share of a time, and of a depth, that counts as all of it."""
_MINUTE_S, _MINUTES_S = 60.0, 180.0


def recorded(*channels: str) -> Taken:
    """Return whether one of some channels was recorded."""
    return lambda observed: any(one.name in channels for one in observed.channels)


@dataclass(frozen=True)
class LabStep:
    """Something that a lab can do.

    Parameters
    ----------
    words
        What, as one who asks for it says it.
    taken
        Whether it was done.
    """

    words: str
    taken: Taken = lambda observed: False


def left(observed: Observations, *steps: LabStep) -> list[str]:
    """Return the steps that weren't taken, in words."""
    return [one.words for one in steps if not one.taken(observed)]


def either(*steps: LabStep) -> str:
    """Return steps of which each serves, in words."""
    return ", or ".join(one.words for one in steps)


def _holds(observed: Observations) -> list[ProtocolSegment]:
    return [part for one in observed.protocols for part in one.protocol.segments if part.phase == HOLD]


def _held(seconds: float) -> Taken:
    def is_long_enough(observed: Observations) -> bool:
        deep = _NEARLY * observed.depth
        return any(part.last >= deep and part.duration >= _NEARLY * seconds for part in _holds(observed))

    return is_long_enough


def _held_at_two_depths(observed: Observations) -> bool:
    depths = [part.last for part in _holds(observed)]
    return bool(depths) and min(depths) < _NEARLY * max(depths)


HOLD_A_MINUTE = LabStep("hold the deepest position for a minute", _held(_MINUTE_S))
HOLD_MINUTES = LabStep("hold for several minutes", _held(_MINUTES_S))
TWO_RATES = LabStep("press at two rates", lambda observed: len(observed.rates) > 1)
HALF_DEPTH = LabStep("hold at half the depth too: relaxation takes the same time at every depth", _held_at_two_depths)
DEEPER = LabStep("press deeper", lambda observed: observed.depth >= REACHED_MM)
