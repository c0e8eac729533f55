"""States of solutions in memory, from which pictures are made without solving again."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.base import Solved

if TYPE_CHECKING:
    from legfem.experiments.pressing import PressingTest

_STATES = 16
"""About how many states of a solution are kept, between which a page interpolates."""
_SOLUTIONS = 4
"""The last ones, of some MB each."""


def is_due(at: float, last: float, depth: float) -> bool:
    """Tell whether to keep the state at a displacement: about evenly to a depth, and there (mm)."""
    return at - last >= depth / _STATES or bool(np.isclose(at, depth))


@dataclass(eq=False)
class Replay:
    """A solution and states on its way.

    Parameters
    ----------
    test
        That is solved.
    values
        That differ from the model's own.
    depth
        To which it is pressed (mm).
    """

    test: PressingTest
    values: Mapping[str, float]
    depth: float
    solved: Solved | None = None
    _states: list[tuple[float, dict[str, FloatArray]]] = field(default_factory=list)

    def take(self, at: float) -> None:
        """Keep the state at a displacement (mm), unless the last one is near."""
        if self._states and at < self._states[-1][0]:
            self._states.clear()  # the solution began anew
        if is_due(at, self._states[-1][0] if self._states else 0.0, self.depth):
            self._states.append((at, self.test.system.state()))

    def show(self) -> Iterator[float]:
        """Bring the test's system into one kept state after the other; yield displacements (mm)."""
        assert self.solved is not None
        self.test.system.set_parameters(dict(self.solved.parameters))
        for at, state in self._states:
            self.test.system.restore(state, at)
            yield at


@dataclass(eq=False)
class Replays:
    """The last solutions of a test in this process."""

    _kept: deque[Replay] = field(default_factory=lambda: deque(maxlen=_SOLUTIONS))

    def add(self, one: Replay) -> None:
        """Keep a solution."""
        self._kept.append(one)

    def find(self, values: Mapping[str, float], depth: float) -> Replay | None:
        """Return what was solved for values to a depth (mm), None where that isn't kept."""
        same = (one for one in self._kept if one.values == dict(values) and one.depth == depth)
        return next(same, None)
