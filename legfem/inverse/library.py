"""A leg's responses about its stiffness: solved once, used by every diagnosis on that leg.

Elastic curves stand at a lattice of stiffnesses about the leg's own, with their exact derivatives;
what a mechanism or another geometry adds, over the elastic force, at two stiffnesses there. A full
solution then confirms what is reported. The lattice's middle is a round number, so that recordings
of one leg share it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from legfem.common.units import FloatArray
from legfem.inverse.emulator import At, Emulator, Kriging
from legfem.inverse.mechanism import Mechanism, Stiffness, TissueMechanism, Values, null_of, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.responses import Acting, Columns

_REACH = 1.6
UNTRIED = "there was no time to solve it"
"""Why a library lacks a mechanism that no solution was begun of."""


@dataclass(frozen=True)
class Detail:
    """How much of a library is solved beyond what screens mechanisms: each at one stiffness and at a few strengths.

    Parameters
    ----------
    whole
        Names of mechanisms that are solved at both stiffnesses, at all strengths and far from their nulls, with what
        isn't known exactly beside them.
    pairs
        Names of mechanisms that are solved two at once.
    """

    whole: frozenset[str] = frozenset()
    pairs: frozenset[frozenset[str]] = frozenset()

    @classmethod
    def of_all(cls, mechanisms: Sequence[Mechanism], pairs: bool = True) -> "Detail":
        """Return that everything is solved."""
        names = [m.name for m in mechanisms]
        return cls(frozenset(names), frozenset(map(frozenset, combinations(names, 2))) if pairs else frozenset())

    def __or__(self, other: "Detail") -> "Detail":
        """Return what either has."""
        return Detail(self.whole | other.whole, self.pairs | other.pairs)


@dataclass(frozen=True, eq=False)
class Table:
    """Changes at some C10, in proportion to ln C10 between them."""

    logs: FloatArray
    """(k,)."""
    values: FloatArray
    """(k, ...)."""
    logarithmic: bool = False
    """Whether they are ln(1 + change)."""
    strengths: tuple[float, ...] = ()
    """Of the rows (k, strengths, ...) of a mechanism that is tabulated by them."""

    def __call__(self, c10: float) -> FloatArray:
        """Return the values (...) at a stiffness in MPa."""
        return self.between(c10, self.values)

    def between(self, c10: float, rows: Sequence[FloatArray] | FloatArray) -> FloatArray:
        """Return what lies at a stiffness in MPa between what is known at the table's."""
        if len(self.logs) == 1:
            return np.asarray(rows[0])
        low, high = self.logs[0], self.logs[-1]
        share = float(np.clip((np.log(c10) - low) / (high - low), -0.5, 1.5))
        return np.asarray((1 - share) * rows[0] + share * rows[-1])


def unchanged(mechanism: TissueMechanism, length: int) -> Table:
    """Return the table of a mechanism whose response changes nothing, in rows of some length."""
    values = np.zeros((1, len(mechanism.strengths or mechanism.derivatives), length))
    return Table(np.zeros(1), values, strengths=mechanism.strengths)


@dataclass(frozen=True, eq=False)
class NuisanceChanges:
    """Changes of the elastic courses by what isn't known exactly, of the force relative.

    Parameters
    ----------
    grid
        (m,), mm: of the force; that of other channels begins at zero.
    geometric
        By the name of an error of the geometry.
    material
        By a parameter's full name, per relative change of it.
    """

    grid: FloatArray
    geometric: Mapping[str, Columns]
    material: Mapping[str, Columns]

    def plus(self, times: float, more: "NuisanceChanges") -> "NuisanceChanges":
        """Return these changes with ``times`` others added, of what those know."""

        def added_to(own: Columns, other: Columns) -> Columns:
            return {one: row + times * other[one] if one in other else row for one, row in own.items()}

        def added(own: Mapping[str, Columns], others: Mapping[str, Columns]) -> dict[str, Columns]:
            return {name: added_to(columns, others.get(name, {})) for name, columns in own.items()}

        geometric, material = added(self.geometric, more.geometric), added(self.material, more.material)
        return NuisanceChanges(self.grid, geometric, material)


@dataclass(frozen=True, eq=False)
class ChannelTables:
    """Responses of the force at the grid, or of k channels beside it at zero and at the grid, (m + 1, k) as one row."""

    names: tuple[str, ...]
    elastic: Kriging | Emulator | None
    """Elastic courses over the stiffness, see `coordinates`; None without any."""
    changes: Mapping[tuple[str, str], Table]
    """Of the force relative, of channels absolute, by mechanism and protocol: (strengths or derivatives, ...). Along a
    path at stations, without zero."""
    _curves: dict[tuple[str, str], list[PchipInterpolator]] = field(default_factory=dict, init=False, repr=False)
    """Over the strength, at each of a table's stiffnesses."""

    def columns(self, row: FloatArray) -> FloatArray:
        """Return the channels of a row, as columns."""
        return row.reshape(-1, len(self.names))

    def of(self, names: Sequence[str]) -> "ChannelTables":
        """Return what is known of some of the channels."""
        if not isinstance(self.elastic, Kriging) or tuple(names) == self.names:
            return self
        own = [self.names.index(name) for name in names]

        def part(values: FloatArray) -> FloatArray:
            rows = values.reshape(*values.shape[:-1], -1, len(self.names))[..., own]
            return np.ascontiguousarray(rows.reshape(*values.shape[:-1], -1))

        places = np.arange(self.elastic.size).reshape(-1, len(self.names))[:, own].ravel()
        changes = {key: replace(table, values=part(table.values)) for key, table in self.changes.items()}
        return ChannelTables(tuple(names), self.elastic.part(places), changes)

    def change(self, mechanism: TissueMechanism, key: str, values: Values, c10: float) -> FloatArray:
        """Return a row of what a mechanism does, in a protocol of a key where it follows the path."""
        table = self.changes[mechanism.name, key]
        if mechanism.derivatives:
            rows = table(c10)
            return np.asarray(mechanism.shares(values)[: len(rows)] @ rows)
        found = self._at_strength(table, mechanism, key, values, c10)
        return np.asarray(mechanism.share(values) * (np.expm1(found) if table.logarithmic else found))

    def courses(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic courses at a stiffness (MPa), as columns."""
        assert self.elastic is not None
        return self.columns(self.elastic(coordinates(c10, c20)))

    def changes_at(
        self, mechanism: TissueMechanism, values: Values, c10: float, observed: Observations, at: At
    ) -> FloatArray:
        """Return what a mechanism does at the stations (n, k); ``at`` evaluates what doesn't follow the path."""

        def columns(key: str) -> FloatArray:
            return self.columns(self.change(mechanism, key, values, c10))

        if mechanism.along_path:
            return observed.spread([columns(stations.key) for stations in observed.protocols])
        return at(columns(""))

    def _at_strength(
        self, table: Table, mechanism: TissueMechanism, key: str, values: Values, c10: float
    ) -> FloatArray:
        """Return a table's row at a mechanism's strength; beyond the ends in proportion to their departure."""
        first = mechanism.parameters[0]
        prior = prior_of(first)
        place = mechanism.name, key
        if place not in self._curves:
            nodes = np.array([prior.departure(v) for v in (null_of(first), *table.strengths)])
            order = np.argsort(nodes)
            self._curves[place] = [
                PchipInterpolator(nodes[order], np.vstack([np.zeros(row.shape[1]), row])[order]) for row in table.values
            ]
        curves, at = self._curves[place], prior.departure(mechanism.tabulated(values))
        inside = float(np.clip(at, curves[0].x[0], curves[0].x[-1]))
        found = table.between(c10, [curve(inside) for curve in curves])
        return np.asarray(found * (at / inside) if inside not in (at, 0.0) else found)


NO_CHANNELS = ChannelTables((), None, {})


_USUAL, _MOST_OF_PAIR = 1.2, 2.0
"""Departure of a strength at which pairs are solved, about; and the most over it up to which they are in proportion."""


def pair_strength(mechanism: TissueMechanism) -> float | None:
    """Return the strength at which what it does beside another is solved; None where that isn't an elastic course."""
    if mechanism.along_path or mechanism.stands_for_C20:
        return None
    return min(mechanism.strengths, key=lambda one: abs(_departure(mechanism, one) - _USUAL), default=None)


def _share_of_pair(mechanism: TissueMechanism, values: Values) -> float:
    solved = pair_strength(mechanism)
    assert solved is not None
    share = _departure(mechanism, values[mechanism.parameters[0].name]) / _departure(mechanism, solved)
    return float(np.clip(share, -_MOST_OF_PAIR, _MOST_OF_PAIR))


def _departure(mechanism: TissueMechanism, strength: float) -> float:
    first = mechanism.parameters[0]
    return prior_of(first).departure(strength) - prior_of(first).departure(null_of(first))


@dataclass(frozen=True, eq=False)
class Library:
    """Responses from tables, asked for as those of `legfem.inverse.responses.SolvedResponses`."""

    grid: FloatArray
    force: ChannelTables
    nuisances: NuisanceChanges
    middle: float
    """C10, MPa."""
    missing: Mapping[str, str] = field(default_factory=dict)
    """Mechanisms that have no table, and why."""
    reach: float = _REACH
    """Largest departure of ln C10 from the middle at which it holds."""
    beside: ChannelTables = NO_CHANNELS
    """What is known of channels beside the force."""
    pairs: Mapping[frozenset[str], Columns] = field(default_factory=dict)
    """What two mechanisms at their `pair_strength` do at once beyond each by itself, by their names; see
    `Library.pair_change`."""
    altered: Mapping[str, NuisanceChanges] = field(default_factory=dict)
    """What ``nuisances`` are more beside a mechanism at its `pair_strength`, by its name."""
    detail: Detail = field(default_factory=Detail)
    """What of it is solved in full."""
    _seen: dict[tuple[str, ...], ChannelTables] = field(default_factory=dict, init=False, repr=False)
    """What is known of some of the channels, by their names."""
    _weights: list[tuple[Observations, FloatArray]] = field(default_factory=list, init=False, repr=False)
    """Of the recordings last asked for: see `_to_stations`."""

    def knows_no_more(self, before: "Library", names: Sequence[str]) -> bool:
        """Whether of mechanisms, and of two at once, no more is solved than was before."""
        more, pair = self.detail.whole - before.detail.whole, frozenset(names)
        return not more & pair and (pair in self.detail.pairs) == (pair in before.detail.pairs)

    @property
    def c10_bounds(self) -> tuple[float, float]:
        """Stiffness C10 that it holds for, MPa."""
        return self.middle * float(np.exp(-self.reach)), self.middle * float(np.exp(self.reach))

    @property
    def c20_bounds(self) -> tuple[float, float]:
        """Stiffness C20 that it holds for, MPa."""
        return 0.0, 12.0 * self.middle

    def curve(self, c10: ArrayLike, c20: ArrayLike) -> FloatArray:
        """Return the elastic force at the grid (..., m), N."""
        assert self.force.elastic is not None
        return self.force.elastic(coordinates(c10, c20))

    def elastic_courses(self, at: Stiffness) -> Columns:
        """Return the elastic force at the grid (m,), and channels at zero and there (m + 1,)."""
        courses = self.beside.courses(*at).T if self.beside.names else ()
        return {"force": self.curve(*at), **dict(zip(self.beside.names, courses, strict=True))}

    def relative_change(self, acting: Acting, at: Stiffness, observed: Observations) -> FloatArray:
        """Return what a mechanism adds to the elastic force, over that force; (n,)."""
        weights = self._to_stations(observed)
        return self.force.changes_at(*acting, at[0], observed, weights.__matmul__)[:, 0]

    def _of(self, names: Sequence[str]) -> ChannelTables:
        """Return what is known of some of the channels, which is quicker to ask."""
        key = tuple(names)
        if key not in self._seen:
            self._seen[key] = self.beside.of(key)
        return self._seen[key]

    def channel_curves(self, names: Sequence[str], c10: float, c20: float) -> FloatArray:
        """Return the elastic courses of channels at zero and at the grid (m + 1, k)."""
        return self._of(names).courses(c10, c20)

    def channel_changes(
        self, names: Sequence[str], acting: Acting, stiffness: Stiffness, observed: Observations, at: At
    ) -> FloatArray:
        """Return what a mechanism adds to channels (n, k); ``at`` evaluates courses where the tissue is pressed to."""
        return self._of(names).changes_at(*acting, stiffness[0], observed, at)

    def pair_change(self, pair: Sequence[Acting], stiffness: Stiffness) -> Columns:
        """Return what two do at once beyond each, in proportion to the departures of both; nothing where unknown.

        Of the force relative at the grid (m,), of channels absolute at zero and at the grid (m + 1,).
        """
        found = self.pairs.get(frozenset(mechanism.name for mechanism, _ in pair), {})
        share = math.prod(_share_of_pair(*one) for one in pair) if found else 0.0
        return {name: share * row for name, row in found.items()}

    def nuisances_beside(self, present: Sequence[tuple[Mechanism, Values]]) -> NuisanceChanges:
        """Return the changes by what isn't known exactly beside mechanisms, in proportion to what those do."""
        found = self.nuisances
        for mechanism, values in present:
            if isinstance(mechanism, TissueMechanism) and mechanism.name in self.altered:
                found = found.plus(self._done(mechanism, values), self.altered[mechanism.name])
        return found

    def _done(self, mechanism: TissueMechanism, values: Values) -> float:
        """Return what a mechanism does to the channels over what it does at its `pair_strength`, of the same form."""
        solved = pair_strength(mechanism)
        assert solved is not None
        here, there = (
            self.beside.change(mechanism, "", one, self.middle)
            for one in (values, {**values, mechanism.parameters[0].name: solved})
        )
        return float(np.clip(here @ there / (there @ there), -_MOST_OF_PAIR, _MOST_OF_PAIR))

    def _to_stations(self, observed: Observations) -> FloatArray:
        """Return what a spline through the grid's values takes of each for the stations, (n, m)."""
        if not self._weights or self._weights[0][0] is not observed:
            unit = CubicSpline(self.grid, np.eye(len(self.grid)))
            self._weights[:] = [(observed, unit(np.maximum(observed.displacement, self.grid[0])))]
        return self._weights[0][1]


def coordinates(c10: ArrayLike, c20: ArrayLike) -> FloatArray:
    """Return the emulator's coordinates (..., 2) of stiffnesses in MPa.

    ``ln C10`` and ``ln(1 + C20 / C10)``: the first carries the scale of all stiffnesses, the second
    is 0 for a neo-Hookean tissue and stays smooth where C20 rules.
    """
    return np.moveaxis(np.array([np.log(c10), np.log1p(np.divide(c20, c10))]), 0, -1)
