"""Where a diagnosis found the base model wrong, as stretches that trials share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.inverse.location import runs
from legfem.inverse.verdict import Diagnosis


@dataclass(frozen=True, eq=False)
class Place:
    """A stretch of a protocol's segment in which the base model is wrong, to one side."""

    protocol: int
    trials: tuple[int, ...]
    segment: int
    phase: str
    stations: NDArray[np.int_]
    """Numbers of its stations in the protocol, consecutive."""
    displacement: tuple[float, float]
    """mm."""
    time: tuple[float, float]
    """s since first contact."""
    size: float
    """Mean of recorded less base model's force, N."""
    noise: float
    """N: standard deviation of one trial's value there."""
    p_value: float | None
    """Family-wise p-value of the strongest window in it; None if no window there is significant."""

    @property
    def weight(self) -> float:
        """How much misfit it holds: squares over the noise's."""
        return len(self.stations) * len(self.trials) * (self.size / self.noise) ** 2


def places_of(found: Diagnosis) -> list[Place]:
    """Return the located stretches in the order of protocols and time."""
    observed = found.observed
    signs = _signs(found)
    result = []
    for number, stations in enumerate(observed.protocols):
        groups: dict[tuple[int, int, int], list[int]] = {}
        for k in observed.trials_of(number):
            mine = signs[observed.trial == k]
            for segment in np.unique(stations.segment):
                here = np.flatnonzero(stations.segment == segment)
                for first, last in runs(mine[here]):
                    key = int(segment), int(here[first]), int(here[last - 1]) + 1
                    groups.setdefault(key, []).append(k)
        for (segment, first, end), trials in sorted(groups.items()):
            result.append(_place(found, number, segment, np.arange(first, end), tuple(trials)))
    return result


def _signs(found: Diagnosis) -> NDArray[np.int_]:
    """Return where the base model is wrong (n,): 1 where it is too soft, -1 where too stiff."""
    signs = np.zeros(len(found.located), dtype=int)
    if found.models:
        missed = found.models[0].fit.prediction - found.base.fit.prediction
        signs[found.located] = np.where(missed > 0, 1, -1)[found.located]
        return signs
    signs[found.located] = 1
    for window in found.assessment.windows:
        signs[list(window.stations)] = 1 if window.size > 0 else -1
    return np.where(found.located, signs, 0)


def _place(found: Diagnosis, protocol: int, segment: int, stations: NDArray[np.int_], trials: tuple[int, ...]) -> Place:
    observed, base = found.observed, found.base
    starts = [int(np.flatnonzero(observed.trial == k)[0]) for k in trials]
    where = np.concatenate([start + stations for start in starts])
    windows = found.assessment.windows
    touching = [w.p_value for w in windows if set(w.stations) & set(where.tolist())]
    d, t = observed.displacement[where], observed.time[where]
    return Place(
        protocol,
        trials,
        segment,
        str(observed.phase[where[0]]),
        stations,
        (float(d.min()), float(d.max())),
        (float(t.min()), float(t.max())),
        float(base.fit.residual[where].mean()),
        float(np.sqrt(np.mean(found.errors.trial_sd[where] ** 2))),
        min(touching, default=None),
    )
