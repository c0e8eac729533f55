"""Where a misfit sits: windows of stations in a phase, of all trials of a protocol or of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.diagnose.observations import Observations

_LENGTHS = (3, 5, 8, 12, 20)
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Window:
    """An interval that holds a misfit."""

    trial: str
    """Its name, or those of all trials that were driven alike."""
    phase: str
    displacement: tuple[float, float]
    """mm."""
    time: tuple[float, float]
    """s since first contact."""
    size: float
    """Mean residual there, N."""
    p_value: float
    """Family-wise over all windows."""
    stations: tuple[int, ...]
    """Observations that it holds."""


@dataclass(frozen=True, eq=False)
class Windows:
    """All windows that are looked at."""

    observed: Observations
    members: Sequence[tuple[str, FloatArray]]
    """Trials' names and observations of each."""

    def significant(self, scores: FloatArray, largest: FloatArray, residual: FloatArray) -> tuple[Window, ...]:
        """Return non-overlapping significant windows, the strongest first.

        Parameters
        ----------
        scores
            Of all windows.
        largest
            Sorted largest scores of draws without misfit.
        residual
            (n,), N.
        """
        found: list[Window] = []
        taken: set[int] = set()
        for k in np.argsort(-scores):
            p = (len(largest) - np.searchsorted(largest, scores[k]) + 1) / (len(largest) + 1)
            if p > SIGNIFICANT:
                break
            name, where = self.members[k]
            if taken & set(where.tolist()):
                continue
            taken |= set(where.tolist())
            found.append(self._window(name, where, float(p), residual))
        return tuple(found)

    def _window(self, name: str, where: FloatArray, p: float, residual: FloatArray) -> Window:
        observed = self.observed
        d, t = observed.displacement[where], observed.time[where]
        return Window(
            name,
            str(observed.phase[where[0]]),
            (float(d.min()), float(d.max())),
            (float(t.min()), float(t.max())),
            float(residual[where].mean()),
            p,
            tuple(int(i) for i in where),
        )


def windows_of(observed: Observations) -> tuple[Windows, FloatArray]:
    """Return the windows and their boxes (n, k)."""
    members: list[tuple[str, FloatArray]] = []
    for number, stations in enumerate(observed.protocols):
        trials = observed.trials_of(number)
        starts = [int(np.flatnonzero(observed.trial == k)[0]) for k in trials]
        groups = [(", ".join(observed.trials[k] for k in trials), starts)]
        if len(trials) > 1:
            groups += [(observed.trials[k], [s]) for k, s in zip(trials, starts, strict=True)]
        for segment in np.unique(stations.segment):
            here = np.flatnonzero(stations.segment == segment)
            for length in sorted({*(n for n in _LENGTHS if n < len(here)), len(here)}):
                for first in range(0, len(here) - length + 1, max(1, length // 3)):
                    part = here[first : first + length]
                    members += [(name, np.concatenate([start + part for start in at])) for name, at in groups]
    boxes = np.zeros((len(observed.force), len(members)))
    for k, (_, where) in enumerate(members):
        boxes[where, k] = 1.0
    return Windows(observed, members), boxes


def runs(marks: NDArray[np.int_]) -> list[tuple[int, int]]:
    """Return the first number and the one after the last of each run of like marks but zero."""
    edges = [0, *(int(k) + 1 for k in np.flatnonzero(np.diff(marks))), len(marks)]
    return [(a, b) for a, b in pairwise(edges) if a < b and marks[a] != 0]
