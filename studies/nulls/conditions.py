"""What the null recordings err by: each cause alone at several levels, then all together."""

from __future__ import annotations

from dataclasses import dataclass

from studies.lab.recording import LabErrors
from studies.lab.stated import Misstated

_NONE, _EXACT = LabErrors(), Misstated()


@dataclass(frozen=True)
class Condition:
    """One kind of errors.

    Parameters
    ----------
    name
        What the page calls it.
    recording
        Errors of the recordings; None draws all of them.
    stated
        Errors of what is stated of the leg; None draws all of them.
    """

    name: str
    recording: LabErrors | None = _NONE
    stated: Misstated | None = _EXACT

    @property
    def exact(self) -> bool:
        """Whether the leg is stated as it is, so that one library serves all recordings."""
        return self.stated == _EXACT


CONDITIONS = (
    Condition("instruments alone"),
    *(Condition(f"scatter {100 * g:g} %", LabErrors(gain_sd=g)) for g in (0.003, 0.01, 0.03)),
    *(Condition(f"air to {a:g} mm", LabErrors(air=a)) for a in (1.0, 2.0, 4.0)),
    *(Condition(f"outlines {c:g} mm", stated=Misstated(contour=c)) for c in (0.3, 0.6, 1.0)),
    Condition("all", None, None),
)
ALL = CONDITIONS[-1]


@dataclass(frozen=True)
class NullTask:
    """One set of recordings."""

    condition: str
    curve: str
    """Name of the clean curve."""
    leg: int
    """Number of the misstated leg; 0 where the leg is stated as it is."""
    turn: int
    """Number of the set within its condition."""
    seed: int

    @property
    def key(self) -> str:
        """Of its condition, curve and leg, whose recordings share a library."""
        return f"{self.condition}/{self.curve}/{self.leg}"


def condition_named(name: str) -> Condition:
    """Return a condition."""
    return next(c for c in CONDITIONS if c.name == name)


def null_tasks(number: int, curves: tuple[str, ...], legs: int, seed: int) -> list[NullTask]:
    """Return so many sets of recordings, conditions and curves in turn.

    Parameters
    ----------
    number
        Of sets; those with all errors are three times as many as those of another condition.
    curves
        Names of the clean curves.
    legs
        Misstated legs of a condition (four times as many where all errors are drawn).
    seed
        Of all draws.
    """
    turns = (*CONDITIONS, ALL, ALL)
    tasks = []
    counts = dict.fromkeys((c.name for c in CONDITIONS), 0)
    for k in range(number):
        condition = turns[k % len(turns)]
        turn = counts[condition.name]
        counts[condition.name] += 1
        if condition.exact:
            tasks.append(NullTask(condition.name, curves[turn % len(curves)], 0, turn, seed))
            continue
        leg = turn % (4 * legs if condition == ALL else legs)
        # Levels of outline error begin with different curves.
        curve = curves[(leg + CONDITIONS.index(condition)) % len(curves)]
        tasks.append(NullTask(condition.name, curve, leg + 1, turn, seed))
    return tasks
