"""When work has to end that could go on: nothing more is begun then, and what was done is told."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass


class TimeIsUpError(Exception):
    """A deadline came before all was there that something can't do without."""


@dataclass(frozen=True)
class Deadline:
    """A moment after which no more work is begun; never without it.

    Parameters
    ----------
    at
        By the clock, s.
    clock
        This machine's; or the time that a processor spent, as `time.process_time` has it.
    """

    at: float = math.inf
    clock: Callable[[], float] = time.monotonic

    @classmethod
    def after(cls, seconds: float | None, clock: Callable[[], float] = time.monotonic) -> "Deadline":
        """Return the moment in so many seconds; never without them."""
        return cls() if seconds is None else cls(clock() + seconds, clock)

    @property
    def passed(self) -> bool:
        """Whether it is over."""
        return self.clock() >= self.at

    def check(self) -> None:
        """Raise TimeIsUpError if it is over."""
        if self.passed:
            raise TimeIsUpError


NEVER = Deadline()
