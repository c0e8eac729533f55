"""What no single leg shows: copied recordings, exchanged sides, a rig that drifts, outliers, and what is missing."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from legfem.cohort.drift import drifts
from legfem.cohort.members import Member
from legfem.cohort.rows import Row, cohort_model, measured

_LEAST_SIDES = 5
"""Legs with a side and outlines from which it can be seen how sides are drawn."""
_AS_DRAWN = 0.75
"""Share of them that has to follow one rule, before others are called exchanged."""
_OUTLYING = 3.5
"""Modified z-scores beyond which Iglewicz and Hoaglin (1993) call a value an outlier."""
_LEAST_SPREAD = 8
"""Values from which a spread is taken."""


@dataclass(frozen=True)
class Suspicion:
    """Something to look into, in a sentence, and whom it is about."""

    sentence: str
    members: tuple[str, ...]


def suspicions(members: Sequence[Member], rows: Sequence[Row]) -> list[Suspicion]:
    """Return what is odd across members, the gravest first."""
    known = {one.name: one for one in members}
    drifting = [Suspicion(sentence, ()) for sentence in drifts(known, rows)]
    return [*_copies(rows), *_exchanged(known, rows), *drifting, *_outliers(known, rows)]


def _copies(rows: Sequence[Row]) -> Iterator[Suspicion]:
    holders: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        for digest in row.recordings.values():
            holders[digest].add(row.name)
    shared = Counter(tuple(sorted(names)) for names in holders.values() if len(names) > 1)
    for names, count in shared.items():
        what = "a recording" if count == 1 else f"{count} recordings"
        yield Suspicion(f"{listed(names)} hold {what} of the same numbers: was a folder copied or named twice?", names)


def _exchanged(known: Mapping[str, Member], rows: Sequence[Row]) -> Iterator[Suspicion]:
    """Legs whose fibula lies where the other side's does in all others."""
    drawn = [
        (row, known[row.member].given["side"] == "left", row.shape.fibula > 0)
        for row in rows
        if row.shape.fibula is not None and known[row.member].given.get("side") in ("left", "right")
    ]
    alike = [left == right_of_tibia for _, left, right_of_tibia in drawn]
    both = len({left for _, left, _ in drawn}) == 2 and len({beside for *_, beside in drawn}) == 2
    if len(drawn) < _LEAST_SIDES or not both:
        return
    rule = sum(alike) >= len(alike) / 2
    odd = [row.name for (row, *_), one in zip(drawn, alike, strict=True) if one is not rule]
    if odd and 1 - len(odd) / len(drawn) >= _AS_DRAWN:
        count = len(drawn) - len(odd)
        yield Suspicion(
            f"{listed(odd)}: the fibula lies on the side where {count} of {len(drawn)} legs have it on the other leg. "
            "Were left and right exchanged, or outlines mirrored?",
            tuple(odd),
        )


def _outliers(known: Mapping[str, Member], rows: Sequence[Row]) -> Iterator[Suspicion]:
    values: dict[tuple[str, str], list[tuple[str, float]]] = defaultdict(list)
    for row, found in measured(rows, cohort_model(rows)):
        for name, one in found.measures.items():
            if one.value > 0:
                values[name, str(known[row.member].given.get("group", ""))].append((row.name, np.log(one.value)))
    for (name, group), given in values.items():
        every = np.array([value for _, value in given])
        middle = np.median(every)
        spread = np.median(np.abs(every - middle))
        if len(every) < _LEAST_SPREAD or spread == 0:
            continue
        scores = 0.6745 * (every - middle) / spread
        for (who, _), score in zip(given, scores, strict=True):
            if abs(score) > _OUTLYING:
                among = f" of group {group}" if group else ""
                side = "above" if score > 0 else "below"
                yield Suspicion(
                    f"{who}: {name} lies {abs(score):.1f} robust standard deviations {side} the median{among}.", (who,)
                )


def missing(members: Sequence[Member], rows: Sequence[Row]) -> list[str]:
    """Return what a cohort lacks: results, cells of the table, and sides or sessions that others have."""
    lines = []
    failed = [row.name for row in rows if not row.done]
    if failed:
        lines.append(f"No result: {listed(failed)}.")
    columns = dict.fromkeys(name for one in members for name in one.given)
    for name in columns:
        lacking = [one.name for one in members if name not in one.given]
        if lacking:
            lines.append(f"The table says no {name} of {listed(lacking)}.")
    for name in ("side", "session"):
        levels = sorted({str(one.given[name]) for one in members if name in one.given})
        people: dict[str, set[str]] = defaultdict(set)
        for one in members:
            people[one.person].add(str(one.given.get(name, "")))
        for level in levels if len(levels) > 1 else ():
            without = [person for person, there in people.items() if level not in there]
            if without:
                lines.append(f"{name} {level} is missing of {listed(without)}.")
    return lines


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return names as people list them, no more than a few."""
    if len(names) > most:
        return f"{', '.join(names[:most])} and {len(names) - most} more"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
