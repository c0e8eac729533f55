"""The models of a body and what is asked of them; responses by finite elements, each made once and kept on disk.

A solution that doesn't follow its protocol to the end, now or before, has NaN for its values, and
so has all that is computed from them.
"""

import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.inverse.emulator import At, GridSpline
from legfem.inverse.mechanism import Solution, Stiffness, TissueMechanism, Values, null_of
from legfem.inverse.observations import Observations
from legfem.inverse.stations import Stations
from legfem.jobs.store import Store, key_of
from legfem.solve.protocol import Protocol as Motion

if TYPE_CHECKING:
    from legfem.experiments.experiment import Solved


class BodyModels(Protocol):
    """The models of one body that show mechanisms, one for every variant."""

    @property
    def assumed(self) -> tuple[str, ...]:
        """Full names of the numbers that are assumed, and may be somewhat off."""

    @property
    def geometric(self) -> tuple[str, ...]:
        """Names of errors of the stated geometry, by which solutions are differentiated, too."""

    def follow(
        self, protocol: Motion, deep: Mapping[str, float], solution: Solution, sensitivities: Sequence[str] = ()
    ) -> "Solved":
        """Solve a protocol for a stiffness; see `legfem.legs.finite_element_models.LegVariants.follow`."""

    def parameters(self, variant: str) -> Mapping[str, float]:
        """Return a variant's parameters by full name (MPa, 1/MPa)."""

    def described(self, variant: str) -> str:
        """Return what tells a variant from others."""


type Acting = tuple[TissueMechanism, Values]
"""A mechanism of the tissue with its own values, by their short names."""
type Columns = dict[str, FloatArray]
"""Arrays by channel: ``force`` along (m,) points, and every further channel at zero time and there, (m + 1,). Of
derivatives by a parameter (`derivative_of`) likewise. Changes are relative of the force, and absolute of channels."""


def derivative_of(channel: str, parameter: str) -> str:
    """Return the name of a channel's derivative by a parameter; the parameter's own of the force."""
    return parameter if channel == "force" else f"{channel} by {parameter}"


def channels_of(columns: Mapping[str, FloatArray]) -> tuple[str, ...]:
    """Return the names of the channels that a solution has beside the force."""
    return tuple(name for name in columns if " by " not in name and name.partition(":")[0] in CHANNELS)


@dataclass(frozen=True, eq=False)
class PathRequest:
    """A solution, and where on its path it is asked for.

    Parameters
    ----------
    protocol
        Of the indenter.
    at
        Times of it, s.
    stiffness
        Of the deep tissue.
    solution
        Which model, and its parameters.
    derivatives
        Full names of parameters by which the force is differentiated.
    """

    protocol: Motion
    at: FloatArray
    stiffness: Stiffness
    solution: Solution
    derivatives: tuple[str, ...] = ()

    def entry(self, terms: str) -> dict[str, Any]:
        """Return what its outcome is kept under; ``terms`` are those of its model."""
        return {
            "protocol": [list(self.protocol.time), list(self.protocol.displacement)],
            "at": np.round(self.at, 9).tolist(),
            "deep_MPa": [float(value) for value in self.stiffness],
            "variant": self.solution.variant,
            "terms": terms,
            "parameters": {k: float(v) for k, v in self.solution.parameters.items()},
            "scaled": {k: float(v) for k, v in self.solution.scaled.items()},
            "tilt_deg": float(self.solution.tilt_deg),
            "derivatives": list(self.derivatives),
        }


GRID_STEP_MM = 0.5
ELASTIC_DERIVATIVES = ("deep.C10", "deep.C20")
_SMALLEST_FORCE_N = 1e-6
PLAIN = Solution("plain")
"""The base model with no term of any mechanism."""


class NotKeptError(LookupError):
    """A solution would have to be made."""


@dataclass(eq=False)
class SolvedResponses:
    """Responses of one leg, by solutions made when asked for.

    Parameters
    ----------
    variants
        The body's models.
    depth
        Of the elastic curves, mm.
    folder
        Where solutions are kept; none is without it.
    fingerprint
        Of all that a solution depends on beside its arguments.
    step
        Of the grid, mm.
    """

    variants: BodyModels
    depth: float
    folder: pathlib.Path | None
    fingerprint: Mapping[str, Any]
    step: float = GRID_STEP_MM
    c10_bounds: tuple[float, float] = (1e-5, 0.1)
    c20_bounds: tuple[float, float] = (0.0, 0.1)
    only_kept: bool = False
    """Whether `NotKeptError` is raised where a solution would have to be made."""
    elastic_courses: Callable[[Stiffness], Columns] | None = None
    """What elastic courses at the grid are taken from where no solution of them is asked for."""
    _made: list[PathRequest] = field(default_factory=list, repr=False)
    _known: dict[str, Columns] = field(default_factory=dict, repr=False)

    @property
    def solutions(self) -> int:
        """How many were made, not recalled."""
        return len(self._made)

    @property
    def grid(self) -> FloatArray:
        """Displacements of the elastic curves, mm."""
        return self.step * np.arange(1, round(self.depth / self.step) + 1)

    def curve(self, c10: ArrayLike, c20: ArrayLike) -> FloatArray:
        """Return the elastic force at the grid (..., m), N."""
        every = [self.ramp((float(one), float(other)), Solution()) for one, other in np.broadcast(c10, c20)]
        return np.array(every).reshape(*np.shape(c10), -1)

    def ramp(self, stiffness: Stiffness, solution: Solution) -> FloatArray:
        """Return a solution's force at the grid, N."""
        return self._on_grid(stiffness, solution)["force"]

    def elastic(self, stiffness: Stiffness) -> Columns:
        """Return the elastic force and its derivatives (N per MPa or 1/MPa) at the grid."""
        return self._solve(replace(self._at_grid(stiffness, Solution()), derivatives=ELASTIC_DERIVATIVES))

    def _at_grid(self, stiffness: Stiffness, solution: Solution) -> PathRequest:
        return PathRequest(Motion.ramp(self.depth, 1.0), self.grid, stiffness, solution)

    def _on_grid(self, stiffness: Stiffness, solution: Solution) -> Columns:
        if self.elastic_courses is not None and solution == Solution():
            return self.elastic_courses(stiffness)
        return self._solve(self._at_grid(stiffness, solution))

    def _sprung(self, stiffness: Stiffness, solution: Solution, compliance: float) -> Columns:
        """Return force and channels at the grid of a model that is in series with springs (mm/N)."""
        found = self._on_grid(stiffness, solution)
        read = _in_series(self.grid, found["force"], compliance)
        return {"force": read(found["force"])[1:], **{name: read(found[name]) for name in channels_of(found)}}

    def relative_change(self, acting: Acting, at: Stiffness, observed: Observations) -> FloatArray:
        """Return what a mechanism adds to the elastic force, over that force; (n,)."""
        mechanism, values = acting
        solution = mechanism.solution(values)
        if not mechanism.along_path:
            change = mechanism.share(values) * self.elastic_change(solution, at)["force"]
            return at_displacement(self.grid, change, observed.displacement, level=True)
        return observed.spread([self.path_change(solution, s, at)["force"] for s in observed.protocols])

    def channel_curves(self, names: Sequence[str], c10: float, c20: float) -> FloatArray:
        """Return the elastic courses of channels at zero and at the grid (m + 1, k)."""
        return _columns_of(self._on_grid((c10, c20), Solution()), names, len(self.grid) + 1)

    def channel_changes(
        self, names: Sequence[str], acting: Acting, stiffness: Stiffness, observed: Observations, at: At
    ) -> FloatArray:
        """Return what a mechanism adds to channels (n, k); ``at`` evaluates courses where the tissue is pressed to."""
        mechanism, values = acting
        solution = mechanism.solution(values)
        if not mechanism.along_path:
            found = _columns_of(self.elastic_change(solution, stiffness), names, len(self.grid) + 1)
            return mechanism.share(values) * at(found)
        changes = [(self.path_change(solution, s, stiffness), len(s.time)) for s in observed.protocols]
        return observed.spread([_columns_of(change, names, length) for change, length in changes])

    def elastic_change(self, solution: Solution, stiffness: Stiffness) -> Columns:
        """Return the changes of the elastic courses at the grid: of the force relative, of channels absolute."""
        before = self._sprung(stiffness, Solution(solution.null), solution.null_in_series)
        return _changes(before, self._on_grid(stiffness, solution))

    def pair_change(self, pair: Sequence[Acting], stiffness: Stiffness) -> Columns:
        """Return what two mechanisms do at once beyond each; nothing where no model shows both.

        Of one that has a share of its whole response, what both do is that share of the way from what its null model
        does with the other's changes.
        """
        one, other = (mechanism.solution(values) for mechanism, values in pair)
        joint = one.joined(other)
        if joint is None:
            return {}
        shares = [mechanism.share(values) for mechanism, values in pair]
        both, first, second = (self.elastic_change(solution, stiffness) for solution in (joint, one, other))
        share = shares[0] * shares[1]
        if share != 1.0:
            # What the model that it is compared with is changed by what both change of any model.
            models = Solution(joint.null), Solution(joint.null, scaled=joint.scaled, tilt_deg=joint.tilt_deg)
            without = _changes(*(self._sprung(stiffness, model, joint.null_in_series) for model in models))
            both = {name: share * both[name] + (1.0 - share) * without[name] for name in both if name in without}
        force_alone = [1 + own * alone["force"] for own, alone in zip(shares, (first, second), strict=True)]
        found: Columns = {"force": (1 + both["force"]) / (force_alone[0] * force_alone[1]) - 1}
        # Springs in series take up a part of the way, and the other's changes are those of the rest.
        null = self._on_grid(stiffness, Solution(joint.null))["force"]
        rest = _in_series(self.grid, null, joint.null_in_series)
        each = zip(shares, (one, other), (first, second), strict=True)
        alone = [(own, changes, bool(solution.null_in_series)) for own, solution, changes in each]
        for name in channels_of(both):
            if name in first and name in second:
                found[name] = both[name] - sum(
                    own * (changes[name] if knows else rest(changes[name])) for own, changes, knows in alone
                )
        return found

    def path_change(self, solution: Solution, stations: Stations, stiffness: Stiffness) -> Columns:
        """Return the changes at a protocol's stations (m,): of the force relative, of channels absolute."""
        # A porous leg has another formulation: compared with itself, its own error cancels.
        porous = solution.variant == "porous"
        null = Solution("porous", dict.fromkeys(solution.parameters, 0.0)) if porous else Solution()
        elastic = self._on_grid(stiffness, null)
        before = at_displacement(self.grid, elastic["force"], stations.displacement)
        changed = self._solve(PathRequest(stations.protocol, stations.time, stiffness, solution))
        found = {"force": changed["force"] / np.maximum(before, _SMALLEST_FORCE_N) - 1.0}
        at = GridSpline(self.grid).at(stations.displacement)
        for name in channels_of(changed):
            if name in elastic:
                found[name] = changed[name][1:] - at(elastic[name][:, None])[:, 0]
        return found

    def by_derivatives(self, mechanism: TissueMechanism, stations: Stations | None, stiffness: Stiffness) -> Columns:
        """Return the changes by each of a mechanism's derivatives at its null, of the force relative.

        (k, stations); (k, grid) of a mechanism that doesn't follow a path, of channels with zero before it.
        """
        solution = mechanism.solution({p.name: null_of(p) for p in mechanism.parameters})
        asked = self._at_grid(stiffness, solution)
        if stations is not None:
            asked = PathRequest(stations.protocol, stations.time, stiffness, solution)
        columns = self._solve(replace(asked, derivatives=mechanism.derived_together))
        force = np.maximum(columns["force"], _SMALLEST_FORCE_N)
        found = {"force": np.array([columns[name] / force for name in mechanism.derivatives])}
        for channel in channels_of(columns):
            rows = np.array([columns[derivative_of(channel, name)] for name in mechanism.derivatives])
            found[channel] = rows if stations is None else rows[:, 1:]
        return found

    def sensitivities(
        self, names: Sequence[str], stiffness: Stiffness, solution: Solution = PLAIN
    ) -> Mapping[str, Columns]:
        """Return the changes at the grid by relative ones of a solution's parameters, or one of geometric errors."""
        columns = self._solve(replace(self._at_grid(stiffness, solution), derivatives=tuple(names)))
        force = np.maximum(columns["force"], _SMALLEST_FORCE_N)
        nominal = self.variants.parameters(solution.variant)
        deep = dict(zip(ELASTIC_DERIVATIVES, stiffness, strict=True))
        own = {**nominal, **solution.values(deep, nominal)}
        return {
            name: {
                "force": own.get(name, 1.0) * columns[name] / force,
                **{one: own.get(name, 1.0) * columns[derivative_of(one, name)] for one in channels_of(columns)},
            }
            for name in names
        }

    def _solve(self, asked: PathRequest) -> Columns:
        """Return force, channels and their derivatives at times of a protocol."""
        entry = asked.entry(self.variants.described(asked.solution.variant))
        key = key_of(entry)
        if key not in self._known:
            make, store = partial(self._solved, asked), self._store
            self._known[key] = make() if store is None else store.get_or_make(entry, make)
        columns = self._known[key]
        if "force" not in columns:
            return {name: np.full(len(asked.at), np.nan) for name in ("force", *asked.derivatives)}
        return columns

    @cached_property
    def _store(self) -> Store[Columns] | None:
        return None if self.folder is None else Store(self.folder, dict[str, FloatArray], self.fingerprint)

    def _solved(self, asked: PathRequest) -> Columns:
        if self.only_kept:
            raise NotKeptError
        self._made.append(asked)
        deep = dict(zip(ELASTIC_DERIVATIVES, asked.stiffness, strict=True))
        solved = self.variants.follow(asked.protocol, deep, asked.solution, asked.derivatives)
        if not solved.report.complete:
            return {"stopped": np.zeros(0)}
        path = solved.path
        slopes = {name: path.sensitivity_at(name, asked.at) for name in asked.derivatives}
        of_channels = {
            derivative_of(channel, name): by[name]
            for channel, by in path.channel_sensitivities.items()
            for name in asked.derivatives
        }
        beside = path.each_at(np.concatenate([[0.0], asked.at]), {**path.channels, **of_channels})
        return {"force": path.force_at(asked.at), **slopes, **beside}


def _columns_of(columns: Columns, names: Sequence[str], length: int) -> FloatArray:
    """Return channels as columns (length, k); NaN where a solution hasn't one."""
    return np.column_stack([columns.get(name, np.full(length, np.nan)) for name in names])


def _changes(before: Columns, after: Columns) -> Columns:
    """Return what changed: of the force relative, of the channels that both have absolute."""
    found = {"force": after["force"] / np.maximum(before["force"], _SMALLEST_FORCE_N) - 1.0}
    return found | {name: after[name] - before[name] for name in channels_of(after) if name in before}


def _in_series(grid: FloatArray, force: FloatArray, compliance: float) -> Callable[[FloatArray], FloatArray]:
    """Return how a course at zero and at the grid is changed by springs in series (mm/N) that a force (m,) pushes.

    A course of (m,) is of the force, which is nothing at zero.
    """
    at, pressing = (np.concatenate([[0.0], one]) for one in (grid, force))
    pushed = at + max(compliance, 0.0) * pressing

    def changed(course: FloatArray) -> FloatArray:
        whole = course if len(course) == len(at) else np.concatenate([[0.0], course])
        if np.array_equal(pushed, at) or np.isnan(pushed).any():
            return whole
        return np.asarray(CubicSpline(pushed, whole)(at))

    return changed


def at_displacement(grid: FloatArray, values: FloatArray, at: FloatArray, level: bool = False) -> FloatArray:
    """Interpolate from the grid; towards zero to nothing, or level from the first point on.

    NaN where the course stops.
    """
    if np.isnan(values).any():
        return np.full(len(at), np.nan)
    if level:
        return np.asarray(CubicSpline(grid, values)(np.maximum(at, grid[0])))
    spline = CubicSpline(np.concatenate([[0.0], grid]), np.concatenate([[0.0], values]))
    return np.asarray(spline(np.maximum(at, 0.0)))
