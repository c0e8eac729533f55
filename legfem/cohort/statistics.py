"""Statistics of a cohort: those that its table permits, and why the others aren't there."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import chi2
from statsmodels.stats.power import TTestIndPower

from legfem.cohort.agreement import Agreement, Fitted, Limits, MixedModel, agreement, limits
from legfem.cohort.members import Member
from legfem.cohort.rows import Row, cohort_model, measured
from legfem.common.p_values import holm
from legfem.common.units import FloatArray

FACTORS = ("group", "side", "session", "rater", "rig", "sex")
COVARIATES = ("age", "bmi")
REPEATS = ("session", "rater", "method")
"""What tests are repeated by."""
_COLUMNS = ("value", "own", "alike", "person", "measure", "row", "date")
_LEAST_TARGETS = 5
_LEAST_PEOPLE = 4
"""Beyond the number of effects."""
_MOST_MISSING = 0.2
"""Share of members without a covariate from which it is left out, and not they."""
DIFFERENCES = (0.1, 0.2, 0.3)
"""Relative, for which the size of a next study is given."""
POWER, LEVEL = 0.8, 0.05


@dataclass(frozen=True, eq=False)
class Pair:
    """Two levels at which the same legs were tested."""

    levels: tuple[str, str]
    limits: Limits
    mean: FloatArray
    difference: FloatArray
    p_value: float = math.nan
    """Of differences at least so large by the readings' own errors alone (chi-square), where all have one."""


@dataclass(frozen=True)
class Repeated:
    """Agreement between sessions or raters."""

    by: str
    agreement: Agreement
    pairs: tuple[Pair, ...]
    own: float
    """Root mean square of the tests' own standard errors, without what a leg's tests have alike."""


@dataclass(frozen=True)
class Effect:
    """How a parameter differs between levels, or by a unit of a covariate."""

    name: str
    value: float
    low: float
    high: float
    p_value: float
    of_group: bool
    adjusted: float = math.nan
    """Holm's, over all groups and parameters."""


@dataclass(frozen=True)
class Analysed:
    """One parameter's statistics."""

    name: str
    unit: str
    logarithmic: bool
    """Whether all are of its logarithm: differences are then relative."""
    count: int
    people: int
    repeated: tuple[Repeated, ...] = ()
    effects: tuple[Effect, ...] = ()
    fitted: Fitted | None = None
    own: float = 0.0
    """Root mean square of the members' own standard errors."""
    needed: tuple[tuple[float, int], ...] = ()
    """People in each of two groups by relative difference to be found."""


@dataclass(frozen=True)
class Statistics:
    """All parameters, and what couldn't be done."""

    parameters: tuple[Analysed, ...]
    not_done: tuple[str, ...] = ()


def statistics(members: Sequence[Member], rows: Sequence[Row]) -> Statistics:
    """Return a cohort's statistics; members whose model doesn't fit are left out."""
    reasons: dict[str, None] = {}
    wrong = [row.name for row in rows if row.done and row.judged.tone == "wrong"]
    if wrong:
        reasons[f"{len(wrong)} members whose model does not fit are left out of statistics."] = None
    kept = [row for row in rows if row.judged.tone != "wrong"]
    names = dict.fromkeys(name for _, one in measured(kept, cohort_model(rows)) for name in one.measures)
    return _together([_analysed(*values_of(members, kept, name), name, reasons) for name in names], reasons)


def statistics_of_readings(table: pd.DataFrame, name: str, unit: str, notes: Sequence[str]) -> Statistics:
    """Return the statistics of a plain table, in the values' own unit: of each method's readings, and of all.

    Parameters
    ----------
    table
        A row a reading: value, own (its error, 0 where none is known), person, and any of `FACTORS`, `COVARIATES` and
        method.
    name, unit
        Of the values.
    notes
        What is to be known of the table.
    """
    reasons = dict.fromkeys(notes)
    table = table.reindex(columns=[*table, *(one for one in FACTORS if one not in table)]).assign(alike=0.0)
    if table.duplicated([one for one in ("person", "side", *REPEATS) if one in table]).any():
        reasons["Readings of one member that no column tells apart are averaged where agreement is computed."] = None
    parts = [(name, table)]
    if "method" in table:
        parts += [(f"{name} by {method}", part.drop(columns="method")) for method, part in table.groupby("method")]
    return _together([_analysed(part, unit, text, reasons, log=False) for text, part in parts], reasons)


def _together(found: Sequence[Analysed | None], reasons: Mapping[str, None]) -> Statistics:
    """Return parameters with their groups' p-values adjusted over all of them."""
    made = [one for one in found if one is not None]
    adjusted = iter(holm([effect.p_value for one in made for effect in one.effects if effect.of_group]))

    for place, one in enumerate(made):
        each = (replace(e, adjusted=float(next(adjusted))) if e.of_group else e for e in one.effects)
        made[place] = replace(one, effects=tuple(each))
    return Statistics(tuple(made), tuple(reasons))


def _analysed(table: pd.DataFrame, unit: str, name: str, reasons: dict[str, None], log: bool = True) -> Analysed | None:
    """Return a parameter's statistics: of its logarithm where that is asked for and all are positive."""
    people = table["person"].nunique()
    if people < 2:
        reasons["Statistics need several people: the table names one, or none has a result."] = None
        return None
    logarithmic = log and bool((table["value"] > 0).all())
    if logarithmic:
        table["own"] /= table["value"]
        table["alike"] /= table["value"]
        table["value"] = np.log(table["value"])
    own = float(np.sqrt(np.mean(table["own"] ** 2 + table["alike"] ** 2)))
    by = ("method",) if "method" in table else ("session", "rater")
    repeated = tuple(one for level in by if (one := _repeated(table, level, reasons)) is not None)
    effects, fitted = _effects(table, reasons)
    needed: tuple[tuple[float, int], ...] = ()
    if fitted is not None and logarithmic:
        legs = float(table.groupby("person").size().mean())
        spread = math.sqrt(fitted.sd[0] ** 2 + (fitted.sd[1] ** 2 + fitted.sd[2] ** 2 + own**2) / legs)
        needed = tuple((size, _people_needed(math.log1p(size) / spread)) for size in DIFFERENCES)
    return Analysed(name, unit, logarithmic, len(table), people, repeated, effects, fitted, own, needed)


def values_of(members: Sequence[Member], rows: Sequence[Row], name: str) -> tuple[pd.DataFrame, str]:
    """Return a parameter's values with what is known of each, a row a test, and the unit."""
    known = {one.name: one for one in members}
    entries, unit = [], ""
    for row, found in measured(rows, cohort_model(rows)):
        one, member = found.measures.get(name), known[row.member]
        if one is None:
            continue
        unit = one.unit
        sd = one.sd or 0.0
        entry: dict[str, Any] = {
            "value": one.value,
            "own": sd * math.sqrt(1 - one.alike),
            "alike": sd * math.sqrt(one.alike),
        }
        entry |= {key: member.given.get(key) for key in (*FACTORS, *COVARIATES, "date")}
        entries.append(entry | {"person": member.person, "measure": one, "row": row.name})
    return pd.DataFrame(entries, columns=[*_COLUMNS, *FACTORS, *COVARIATES]), unit


def _repeated(table: pd.DataFrame, by: str, reasons: dict[str, None]) -> Repeated | None:
    """Agreement between the levels of a column, of all legs that were tested at each."""
    levels = sorted(table[by].dropna().unique(), key=str)
    if len(levels) < 2:
        reasons[f"No agreement between {by}s: the table has {'no' if not levels else 'one'} {by}."] = None
        return None
    targets = [one for one in ("person", "side", "session", "rater") if one != by]
    there = table.fillna(dict.fromkeys(targets, "")).assign(squared=table["own"] ** 2)
    wide = there.pivot_table("value", targets, by, aggfunc="mean")
    # Of means, where several readings are at one level.
    squared = there.pivot_table("squared", targets, by, aggfunc=lambda own: own.mean() / len(own))
    whole = wide[levels].dropna()
    people = whole.index.get_level_values("person").nunique()
    if people < _LEAST_TARGETS:
        few = f"{people} people were tested at each, and {_LEAST_TARGETS} are needed"
        reasons[f"No agreement between {by}s: {few}."] = None
        return None
    if np.ptp(whole.to_numpy()) == 0:
        reasons[f"No agreement between {by}s: all values are alike."] = None
        return None
    pairs = []
    for one, other in combinations(levels, 2):
        both = wide[[one, other]].dropna()
        difference = (both[other] - both[one]).to_numpy()
        count = both.index.get_level_values("person").nunique()
        mean = both.mean(axis=1).to_numpy()
        known = squared.loc[both.index, [one, other]]
        expected = known.where(known > 0).to_numpy().sum(axis=1)
        p_value = float(chi2.sf(np.sum(difference**2 / expected), len(both)))
        pairs.append(Pair((str(one), str(other)), limits(difference, count), mean, difference, p_value))
    own = float(np.sqrt(np.mean(table.loc[table[by].notna(), "own"] ** 2)))
    return Repeated(by, agreement(whole.to_numpy(), people), tuple(pairs), own)


def _effects(table: pd.DataFrame, reasons: dict[str, None]) -> tuple[tuple[Effect, ...], Fitted | None]:
    """Differences by a mixed model that knows each member's own error."""
    kept, shown, design = design_of(table, [one for one in (*FACTORS, "method") if one in table], COVARIATES, reasons)
    _, person = np.unique(kept["person"], return_inverse=True)
    _, leg = np.unique(kept["person"].astype(str) + "\0" + kept["side"].fillna("").astype(str), return_inverse=True)
    people = int(person.max(initial=-1)) + 1
    count = design.shape[1]
    if people < count + _LEAST_PEOPLE:
        need = count + _LEAST_PEOPLE
        reasons[f"No mixed model: {people} people are too few for {count} effects ({need} are needed)."] = None
        return (), None
    own, alike = kept["own"].to_numpy(), kept["alike"].to_numpy()
    fitted = MixedModel(kept["value"].to_numpy(), design, own, alike, person, leg).fit()
    effects = (Effect(text, *fitted.effect(k + 1), of_group) for k, (text, of_group) in enumerate(shown))
    return tuple(effects), fitted


def design_of(
    table: pd.DataFrame, factors: Sequence[str], covariates: Sequence[str], reasons: dict[str, None]
) -> tuple[pd.DataFrame, list[tuple[str, bool]], FloatArray]:
    """Return the rows that have all, what each column but the first is and whether of a group, and the design."""
    used = []
    for name in (*factors, *covariates):
        there = table[name].notna()
        if table[name][there].nunique() < 2:
            if name == "group":
                reasons["No differences between groups: the table has no two groups."] = None
            continue
        if 1 - there.mean() > _MOST_MISSING:
            lacking = int((~there).sum())
            reasons[f"{name} is not in the mixed model: {lacking} of {len(table)} members have none."] = None
            continue
        used.append(name)
    kept = table.dropna(subset=used)
    columns: list[tuple[str, bool, FloatArray]] = []
    for name in used:
        if name in covariates:
            numbers = kept[name].to_numpy(dtype=np.float64)
            columns.append((f"{name}, by one more", False, numbers - numbers.mean()))
            continue
        first, *others = dict.fromkeys(kept[name])
        columns += [
            (f"{name} {level} against {first}", name == "group", (kept[name] == level).to_numpy(dtype=np.float64))
            for level in others
        ]
    design: list[FloatArray] = [np.ones(len(kept))]
    shown: list[tuple[str, bool]] = []
    for text, of_group, column in columns:
        if np.linalg.matrix_rank(np.column_stack([*design, column])) == len(design):
            reasons[f"{text} is not in the mixed model: what stands before it says the same."] = None
            continue
        design.append(column)
        shown.append((text, of_group))
    return kept, shown, np.column_stack(design)


def _people_needed(effect_size: float) -> int:
    found = TTestIndPower().solve_power(effect_size=effect_size, power=POWER, alpha=LEVEL)
    return max(math.ceil(float(found)), 2)
