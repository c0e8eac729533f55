"""A part of one trial that something unknown touched, found by the other trials and set aside.

Repeats of a programme do the same but for what is each trial's own: a gain, a zero, a first contact, noise. Where one
trial departs from the others by more, from some segment on or in a segment alone, nothing else need be wrong: the part
is given an error without bounds, which is to leave it out, and all else is judged by the rest.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.inverse.errors import ErrorModel
from legfem.inverse.observations import Observations

LEAST_TRIALS = 3
"""Of a programme: of two that differ nobody knows which one is sound, and the part is set aside in both."""
_STANDS_OUT = 4.0
"""Root mean square of a part's departure over the noise, from which something touched it."""
_REST = 2.0
"""The same of the rest of its trial, up to which that is sound."""
_FEWEST = 2
"""Readings of a part, at least."""


@dataclass(frozen=True, eq=False)
class SetAside:
    """A part of a trial that is left out of all that is said."""

    trial: str
    phases: tuple[str, ...]
    """Phases of the part, in their order."""
    whole: bool
    """Whether it is all of the trial."""
    readings: NDArray[np.bool_]
    """(N,): which of all readings it is."""
    size_N: float
    """Greatest departure from the other trials."""

    @property
    def described(self) -> str:
        """In words: ``trial2, hold and unloading``."""
        return self.trial if self.whole else f"{self.trial}, {' and '.join(self.phases)}"


def touched_part(observed: Observations, errors: ErrorModel) -> SetAside | None:
    """Return the smallest part of a trial beside which that agrees with the others, if one stands out.

    The trial is that which departs most: what touched it is in the others' mean, too. Of two trials both are touched
    in a part beside which they agree.

    Parameters
    ----------
    observed
        The recordings.
    errors
        Of the observations.
    """
    found: list[tuple[float, int, SetAside]] = []
    for members in observed.repeated:
        if len(members) < 2:
            continue
        both = len(members) < LEAST_TRIALS
        for trial in members[:1] if both else members:
            others = [k for k in members if k != trial]
            here = np.flatnonzero(observed.trial == trial)
            mean = np.mean([observed.force[observed.trial == k] for k in others], axis=0)
            noise = errors.trial_sd[: len(observed.force)][here] * np.sqrt(1 + 1 / len(others))
            for part, whole in _parts(observed.segment[here]):
                away = _departure(observed.force[here], mean, observed.stiffness[here], noise, part)
                inside, outside = _size(away[part] / noise[part]), _size(away[~part] / noise[~part])
                if part.sum() > _FEWEST and inside > _STANDS_OUT and outside < _REST and not (both and whole):
                    touched = members if both else [trial]
                    aside = _set_aside(observed, touched, observed.segment[here[part]], whole, away[part])
                    found.append((inside, int(part.sum()), aside))
    if not found:
        return None
    most = max(found, key=lambda one: one[0])[2].trial
    return min((one for one in found if one[2].trial == most), key=lambda one: one[1])[2]


def _parts(segment: NDArray[np.int_]) -> Iterator[tuple[NDArray[np.bool_], bool]]:
    """Yield parts of a trial: a segment, from a segment on, and all of it."""
    numbers = np.unique(segment)
    for number in numbers:
        if len(numbers) > 1:
            yield segment == number, False
        yield segment >= number, bool(number == numbers[0])


def _departure(
    force: FloatArray, mean: FloatArray, stiffness: FloatArray, noise: FloatArray, part: NDArray[np.bool_]
) -> FloatArray:
    """Return a trial less the others', its gain, zero and first contact taken from its rest, where there is one."""
    own = np.column_stack([mean, np.ones_like(mean), stiffness])
    rest = ~part if not part.all() else part
    weighed = own[rest] / noise[rest, None]
    change = np.linalg.lstsq(weighed, (force - mean)[rest] / noise[rest], rcond=1e-8)[0]
    return np.asarray(force - mean - own @ change)


def _size(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _set_aside(
    observed: Observations, trials: Sequence[int], segments: NDArray[np.int_], whole: bool, away: FloatArray
) -> SetAside:
    mine = np.isin(observed.trial, trials) & np.isin(observed.segment, segments)
    phases = tuple(dict.fromkeys(str(name) for name in observed.phase[mine]))
    names = " and ".join(observed.trials[trial] for trial in trials)
    return SetAside(names, phases, whole, mine[observed.nearest], float(away[np.argmax(np.abs(away))]))
