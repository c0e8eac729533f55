"""What no single leg shows: copied recordings, exchanged sides, a rig that drifts, outliers, and what is missing."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime

import numpy as np
import pandas as pd

from legfem.cohort.agreement import sums_by
from legfem.cohort.members import Member
from legfem.cohort.rows import Row, cohort_model, measured
from legfem.cohort.statistics import values_of
from legfem.common.numbers import fit_probability
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import called

_LEAST_DATED = 10
"""People's days from which a step is looked for."""
_DRAWS = 999
_DRIFTS = 0.05
"""Probability by chance, in any rig of a cohort, up to which a step is said."""


def drifts(members: Sequence[Member], rows: Sequence[Row]) -> Iterator[str]:
    """Say which rigs' C10 steps at a date, in the same people where they came several times."""
    for rig, step in rig_steps(members, rows):
        size, low, high = (100 * np.expm1(step.size + k * step.sd) for k in (0, -2, 2))
        where = f"rig {rig}: " if rig else ""
        whose = "in the same people" if step.within else "from one set of people to another"
        days = f"{date.fromordinal(step.before)} and {date.fromordinal(step.after)}"
        yield (
            f"{where}C10 changes by {size:+.1f} % ({low:+.1f} to {high:+.1f} %) {whose} between {days} "
            f"({fit_probability(step.p_value)}). Was the rig's force, displacement or zero calibrated anew, or changed?"
        )


def rig_steps(members: Sequence[Member], rows: Sequence[Row]) -> Iterator[tuple[str, "DriftStep"]]:
    """Yield the rigs whose C10 steps at a date, and how."""
    table, _ = values_of(members, rows, "c10_deep")
    tests = table[["person", "side", "rig", "group"]].fillna("").astype(str)
    tests = tests.assign(day=table["date"].map(day), value=table["value"].astype(np.float64))
    tests = tests[tests["day"].notna() & (tests["value"] > 0)]
    seen = []
    for rig, own in tests.assign(value=np.log(tests["value"])).groupby("rig", sort=False):
        visits = _visits(own)
        step = largest_step(*(visits[name].to_numpy() for name in ("day", "person", "group", "value")))
        seen += [] if step is None else [(str(rig), step)]
    for rig, step in seen:
        if step.p_value * len(seen) <= _DRIFTS:
            yield rig, step


def day(text: str | None) -> float:
    """Return the ordinal of a test's day; not a number where none is stated."""
    return float(datetime.fromisoformat(text).toordinal()) if text else math.nan


def _visits(tests: pd.DataFrame) -> pd.DataFrame:
    """One value a person and day: both legs of a day err together."""
    sides = tests.groupby(["person", "side"], sort=False)
    middle = sides["value"].transform("mean").where(sides["day"].transform("nunique") > 1, 0.0)
    by_side = tests.assign(value=tests["value"] - middle).iloc[np.argsort(sides.ngroup(), kind="stable")]
    return by_side.groupby(["person", "day"], sort=False).agg({"group": "first", "value": "mean"}).reset_index()


@dataclass(frozen=True)
class DriftStep:
    """The step in time that explains most."""

    size: float
    """Change of the logarithm."""
    sd: float
    p_value: float
    before: int
    """Last day (ordinal) before it."""
    after: int
    within: bool
    """Whether it is seen in people who came before and after."""


def largest_step(days: FloatArray, person: np.ndarray, group: np.ndarray, values: FloatArray) -> DriftStep | None:
    """Return the step that explains most, with the probability of one as large by chance.

    Where people came on several days, each is compared with himself alone; else with his group. The probability is a
    permutation's: days are shuffled within whom they are compared, and the largest step of all dates counts.
    """
    came: dict[str, set[float]] = defaultdict(set)
    for who, when in zip(person, days, strict=True):
        came[str(who)].add(float(when))
    kept = np.array([len(came[str(who)]) > 1 for who in person])
    within = int(kept.sum()) >= _LEAST_DATED
    blocks = group
    if within:
        days, blocks, values = days[kept], person[kept], values[kept]
    starts = np.unique(days)[1:]
    if len(values) < _LEAST_DATED or not len(starts):
        return None
    _, block = np.unique(blocks, return_inverse=True)
    freedom = len(values) - block.max() - 2
    if freedom < 3:
        return None

    def centred(table: FloatArray) -> FloatArray:
        counts = np.bincount(block).reshape(-1, *[1] * (table.ndim - 1))
        return table - (sums_by(block, table) / counts)[block]

    late = centred((days[:, None] >= starts).astype(np.float64))
    spread = (late**2).sum(axis=0)
    usable = spread > 1e-9 + 0.05 * spread.max(initial=0.0)  # a step that a few alone have seen is anybody's outlier
    late, spread, starts = late[:, usable], spread[usable], starts[usable]
    residual = centred(values)

    def gains(y: FloatArray) -> FloatArray:
        return np.asarray((late.T @ y) ** 2 / spread[:, None])

    generator = np.random.default_rng(0)
    order = np.lexsort((generator.random((_DRAWS, len(values))), np.broadcast_to(block, (_DRAWS, len(values)))), axis=1)
    home = np.argsort(block, kind="stable")
    shuffled = np.empty((_DRAWS, len(values)))
    shuffled[:, home] = residual[order]
    best = gains(residual[:, None])[:, 0]
    k = int(np.argmax(best))
    chance = float((1 + np.sum(gains(shuffled.T).max(axis=0) >= best[k] * (1 - 1e-12))) / (_DRAWS + 1))
    size = float(late[:, k] @ residual / spread[k])
    variance = float(np.sum((residual - size * late[:, k]) ** 2)) / freedom
    before = int(days[days < starts[k]].max())
    return DriftStep(size, float(np.sqrt(variance / spread[k])), chance, before, int(starts[k]), within)


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
    drifting = [Suspicion(sentence, ()) for sentence in drifts(members, rows)]
    return [*_copies(rows), *_exchanged(known, rows), *drifting, *_outliers(known, rows)]


def _copies(rows: Sequence[Row]) -> Iterator[Suspicion]:
    holders: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        for digest in row.recordings.values():
            holders[digest].add(row.name)
    shared = Counter(tuple(sorted(names)) for names in holders.values() if len(names) > 1)
    for names, count in shared.items():
        what = "a recording" if count == 1 else f"{count} recordings"
        yield Suspicion(
            f"{listed(names)} contain {what} with the same numbers: was a folder copied or named twice?", names
        )


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
                values[name, known[row.member].group].append((row.name, np.log(one.value)))
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
                    f"{who}: {called(name)} lies {abs(score):.1f} robust standard deviations {side} the median{among}.",
                    (who,),
                )


def missing(members: Sequence[Member], rows: Sequence[Row]) -> list[str]:
    """Return what a cohort lacks: results, cells of the table, and sides or sessions that others have."""
    lines = []
    if failed := [row.name for row in rows if not row.done]:
        lines.append(f"No result: {listed(failed)}.")
    for name in dict.fromkeys(name for one in members for name in one.given):
        if lacking := [one.name for one in members if name not in one.given]:
            lines.append(f"The table says no {name} of {listed(lacking)}.")
    for name in ("side", "session"):
        levels = sorted({str(one.given[name]) for one in members if name in one.given})
        people: dict[str, set[str]] = defaultdict(set)
        for one in members:
            people[one.person].add(str(one.given.get(name, "")))
        for level in levels if len(levels) > 1 else ():
            if without := [person for person, there in people.items() if level not in there]:
                lines.append(f"{name} {level} is missing of {listed(without)}.")
    return lines


_MOST_LISTED = 8


def listed(names: Sequence[str]) -> str:
    """Return names as people list them, no more than a few."""
    if len(names) > _MOST_LISTED:
        return f"{', '.join(names[:_MOST_LISTED])} and {len(names) - _MOST_LISTED} more"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
