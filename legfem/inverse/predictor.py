"""The predicted readings for any stiffness and any mechanisms, in milliseconds: forces, then further channels.

The tissue's response comes from `Responses`, solved once for a section; everything else is exact
arithmetic on it. How far the tissue is pressed follows from the force; further channels are read there. What acts by
a factor on the force acts so on other forces and pressures on the cylinder (`ChannelKind.follows_force`), and on
nothing else.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.data.contact import way_felt
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName, deep_stiffness
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.emulator import At, GridSpline
from legfem.inverse.library import Library
from legfem.inverse.mechanism import Mechanism, TissueMechanism, null_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.responses import Acting, SolvedResponses
from legfem.inverse.stations import since_touch

_FACTOR_NODES = 4
_CURVES_KEPT = 400


type Responses = Library | SolvedResponses
"""What the finite-element model said beforehand, or says when it is asked."""


IN_AIR_SD_MM = 1.0
"""Of first contact where some trials begin in air: all may, by any way. The detection is where the fit begins, and no
second reading beside it: it looked at the same forces."""
LEAST_SD_IN_AIR_MM, _DOUBT = 0.15, 2.0
"""Where they only seem to: at least, and over that of a touch."""
LATEST_ALIKE_MM = 3.0
"""Way by which all trials may have been begun too late at most, by one habit."""
_ONSETS_MM = (-4.0, 4.0)


@dataclass(frozen=True, eq=False)
class Predictor:
    """Predicts observations; parameters are ``deep.C10``, ``deep.C20`` (MPa) and ``mechanism.parameter``.

    Parameters
    ----------
    observed
        The recordings.
    responses
        Of the leg.
    law
        Of the deep tissue.
    ends
        Of the cylinder, where the recordings have them.
    measured
        C10 (MPa) by other means, where it was.
    offset
        (N,): what a full solution was above the emulated one, where one was made.
    """

    observed: Observations
    responses: Responses
    law: LawName
    ends: TabulatedCorrection | None = None
    measured: Prior | None = None
    offset: FloatArray | float = 0.0
    _kept: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)
    """Curves of the stiffnesses last asked for."""

    @property
    def library(self) -> Library:
        """The tables that it predicts by."""
        assert not isinstance(self.responses, SolvedResponses)
        return self.responses

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the base model: stiffness, and first contact of every trial."""
        low, high = self.responses.c10_bounds
        middle = float(np.sqrt(low * high))
        known = self.measured or Prior(middle, 1.5, "log", "nothing is known")
        found = [Parameter(DEEP_C10, "MPa", (low, high), known, scale="log", statement="of the deep tissue")]
        if self.law == "reduced-polynomial":
            prior = Prior(0.0, 4.0 * middle, "linear", "nothing is known")
            found.append(Parameter(DEEP_C20, "MPa", self.responses.c20_bounds, prior, statement="likewise"))
        for trial in range(len(self.observed.trials)):
            prior, known_of = onset_prior(self.observed, trial), "first contact, after that found in the recording"
            contact = self.observed.contacts[trial]
            low, high = (self.observed.way * end for end in _ONSETS_MM)
            bounds = low, min(high, max(contact.latest - contact.displacement, 0.0))
            onset = Parameter(onset_name(trial), "mm", bounds, prior, role="nuisance", statement=known_of)
            found.append(onset)
        return tuple(found)

    def __call__(self, values: Mapping[str, float], mechanisms: Sequence[Mechanism] = ()) -> FloatArray:
        """Return all readings (N,); NaN where a full solution stopped, and of channels that it hasn't."""
        force, factors, courses_of = self._predicted(values, mechanisms)
        if not self.observed.channels:
            return force + self.offset
        if np.isnan(force).any():
            return np.full(len(self.observed.values), np.nan)
        courses = courses_of(self.observed.courses)
        if self._follows.any():
            courses[:, self._follows] *= factors[:, None]
        places, weights = self._read
        return np.concatenate([force, np.einsum("rw,rw->r", weights, courses.ravel()[places])]) + self.offset

    def images_elsewhere(
        self, values: Mapping[str, float], mechanisms: Sequence[Mechanism] = ()
    ) -> dict[str, dict[str, FloatArray]]:
        """Return what images do that lie elsewhere, by channel and by way: one standard deviation, (k,) readings."""
        seen_in = [one for one in self.observed.channels if one.laid_courses]
        if not seen_in:
            return {}
        courses_of = self._predicted(values, mechanisms)[2]

        def moved(one: StationChannel, way: str) -> FloatArray:
            by_name = dict(zip(one.courses, courses_of(one.laid_courses[way]).T, strict=True))
            return one.accuracy.laid[way] * one.read(by_name.__getitem__)

        return {one.name: {way: moved(one, way) for way in one.accuracy.laid} for one in seen_in}

    def _predicted(
        self, values: Mapping[str, float], mechanisms: Sequence[Mechanism]
    ) -> tuple[FloatArray, FloatArray, Callable[[tuple[str, ...]], FloatArray]]:
        """Return forces (n,), what acts on them by a factor (n,), and what gives courses (n, k) by their names."""
        observed = self.observed
        own = {m.name: values_of(values, m) for m in mechanisms}
        c10, c20 = deep_stiffness(values)
        onset = np.array([values.get(onset_name(k), 0.0) for k in range(len(observed.trials))])
        for mechanism in mechanisms:
            if mechanism.stands_for_C20 and self.law == "neo-hookean":
                c20 = kpa_to_mpa(own[mechanism.name][mechanism.parameters[0].name])
        factor: FloatArray = np.ones(len(observed.force))
        for mechanism in mechanisms:
            factor = factor * mechanism.deep_factor(own[mechanism.name], observed)
        elastic = self._elastic(c10, c20, factor)

        def loss(force: FloatArray) -> FloatArray:
            return sum((m.displacement_loss(own[m.name], observed, force) for m in mechanisms), onset[observed.trial])

        force = _pressed(elastic, observed.displacement, loss)
        pressing, pressed = force, observed.displacement
        if self.ends is not None or observed.channels:
            pressed = pressed - loss(force)
        factors: FloatArray = np.ones(len(force))
        if self.ends is not None:
            of_ends = self.ends.factor(np.maximum(pressed, 0.0), np.asarray(c10), np.asarray(c20))
            force, factors = force * of_ends, of_ends
        tissue: list[Acting] = []
        for mechanism in mechanisms:
            mine = own[mechanism.name]
            if not (mechanism.stands_for_C20 and self.law == "neo-hookean"):
                if isinstance(mechanism, TissueMechanism):
                    force = force * (1 + self.responses.relative_change((mechanism, mine), (c10, c20), observed))
                    tissue.append((mechanism, mine))
                elif (change := mechanism.relative_change(mine, (c10, c20), observed)) is not None:
                    force, factors = force * (1 + change), factors * (1 + change)
            own_factor = mechanism.force_factor(mine, observed)
            force, factors = force * own_factor, factors * own_factor
        acting = [(m, its) for m, its in tissue if not m.along_path]
        beyond = self.responses.pair_change(acting, (c10, c20)) if len(acting) == 2 else {}
        if beyond:
            force = force * (1 + np.interp(observed.displacement, self.responses.grid, beyond["force"]))
        for mechanism in mechanisms:
            force = force + mechanism.added_force(own[mechanism.name], observed)

        def courses_of(names: tuple[str, ...]) -> FloatArray:
            changed: FloatArray = np.zeros((len(self.responses.grid) + 1, len(names)))
            along: FloatArray = np.zeros((len(force), len(names)))
            taken: FloatArray = np.zeros(len(force))
            for mechanism, its in tissue:
                # What is known at the grid is evaluated once, all together, but for what takes up a part of the way
                # by itself: its solution knows of that.
                own_loss = mechanism.displacement_loss(its, observed, pressing)
                apart = mechanism.along_path or bool(np.any(own_loss))
                read = self._grid.at(pressed + own_loss) if apart else np.asarray
                change = self.responses.channel_changes(names, (mechanism, its), (c10, c20), observed, read)
                along, changed = (along + change, changed) if apart else (along, changed + change)
                taken = taken + own_loss
            if beyond:
                without = np.zeros(len(self.responses.grid) + 1)
                rows = np.column_stack([beyond.get(name, without) for name in names])
                along = along + self._grid.at(pressed + taken)(rows)
            return self._courses(names, c10, c20, factor, changed, self._grid.at(pressed)) + along

        return force, factors, courses_of

    @cached_property
    def _follows(self) -> NDArray[np.bool_]:
        """Which courses are multiplied by what acts by a factor on the force."""
        return np.array([one.kind.follows_force for one in self.observed.channels for _ in one.courses])

    @cached_property
    def _read(self) -> tuple[NDArray[np.int_], FloatArray]:
        """Where in the courses (n, k) every reading beside the force stands, and what it takes of it; (r, w) each."""
        channels = self.observed.channels
        every = np.concatenate([one.weights for one in channels])
        starts = np.cumsum([0, *(len(one.courses) for one in channels)])
        own = [np.zeros(len(one.values), dtype=int) if one.course is None else one.course for one in channels]
        course = np.repeat(starts[:-1], list(map(len, own))) + np.concatenate(own)
        width = int((every != 0).sum(axis=1).max())
        at = np.argsort(every == 0, axis=1, kind="stable")[:, :width]
        places = at * int(starts[-1]) + course[:, None]
        return places, np.take_along_axis(every, at, axis=1)

    def _elastic(self, c10: float, c20: float, factor: FloatArray) -> "_Elastic":
        """Return the force at factors on the deep stiffness."""
        nodes, weights = _nodes_of(factor)
        return _Elastic(self._spline(c10 * nodes, c20 * nodes), weights, self.observed.half_width)

    def _courses(
        self, names: tuple[str, ...], c10: float, c20: float, factor: FloatArray, changed: FloatArray, at: At
    ) -> FloatArray:
        """Return elastic channels (n, k) at factors on the deep stiffness, with changes (m + 1, k) at the grid."""
        nodes, weights = _nodes_of(factor)
        each = [at(self._beside(names, c10 * n, c20 * n) + changed) for n in nodes]
        return each[0] if weights is None else np.einsum("ij,ijk->jk", weights, np.array(each))

    @cached_property
    def _grid(self) -> GridSpline:
        return GridSpline(self.responses.grid)

    def _spline(self, c10: FloatArray, c20: FloatArray) -> PPoly:
        """Return the elastic forces of stiffnesses (k,), MPa, kept for the next time; NaN where there is none."""

        def made() -> PPoly:
            return self._grid.through(np.vstack([np.zeros(len(c10)), self.responses.curve(c10, c20).T]))

        return self._recalled((tuple(c10), tuple(c20)), made)

    def _beside(self, names: tuple[str, ...], c10: float, c20: float) -> FloatArray:
        """Return channels' courses (m + 1, k) of a stiffness (MPa), kept likewise."""
        return self._recalled((names, float(c10), float(c20)), lambda: self.responses.channel_curves(names, c10, c20))

    def _recalled[V](self, key: tuple[Any, ...], make: Callable[[], V]) -> V:
        if key not in self._kept:
            if len(self._kept) > _CURVES_KEPT:
                self._kept.clear()
            self._kept[key] = make()
        found: V = self._kept[key]
        return found


@dataclass(frozen=True, eq=False)
class _Elastic:
    """Curves at several factors on the deep stiffness, interpolated to every station's; nothing before first touch.

    See `legfem.inverse.stations.since_touch`.
    """

    splines: Callable[[FloatArray, int], FloatArray]
    """Of the k curves together, (n, k)."""
    weights: FloatArray | None
    """(k, n)."""
    half_width: FloatArray

    def __call__(self, displacement: FloatArray) -> FloatArray:
        since, share = since_touch(displacement, self.half_width)
        return share * self._of(since, 0)

    def slope(self, displacement: FloatArray) -> FloatArray:
        """Return the derivative of the force (n,) by the displacement, N/mm."""
        since, share = since_touch(displacement, self.half_width)
        inside = share < 1.0
        by_share = np.divide(0.5, self.half_width, out=np.zeros_like(since), where=inside & (self.half_width > 0))
        slope = share * np.where(inside, 0.5, 1.0) * self._of(since, 1) + by_share * self._of(since, 0)
        return np.where(share > 0.0, slope, 0.0)

    def _of(self, at: FloatArray, derivative: int) -> FloatArray:
        values = self.splines(at, derivative)
        return values[:, 0] if self.weights is None else np.einsum("kn,nk->n", self.weights, values)


def _nodes_of(factor: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """Return factors at which curves are looked up, and what stations' take of each; None where all are one."""
    low, high = float(factor.min()), float(factor.max())
    if high - low < 1e-12:
        return factor[:1], None
    nodes = np.linspace(low, high, _FACTOR_NODES)
    # Lagrange's polynomials.
    each = [[(factor - other) / (node - other) for other in nodes if other != node] for node in nodes]
    return nodes, np.prod(each, axis=1)


def _pressed(elastic: _Elastic, displacement: FloatArray, loss) -> FloatArray:  # type: ignore[no-untyped-def]
    """Solve F = elastic(d - loss(F)) by Newton's method."""
    unpressed = loss(np.zeros_like(displacement))
    force = elastic(displacement - unpressed)
    if np.array_equal(loss(np.ones_like(force)), unpressed):
        return force
    for _ in range(12):
        lost = loss(force)
        by_force = loss(force + 1.0) - lost
        at = displacement - lost
        step = (force - elastic(at)) / (1.0 + elastic.slope(at) * by_force)
        force = force - step
        if np.abs(step).max() < 1e-9:
            break
    return force


def values_of(values: Mapping[str, float], mechanism: Mechanism) -> dict[str, float]:
    """Return a mechanism's own values by their short names."""
    return {p.name: values.get(f"{mechanism.name}.{p.name}", null_of(p)) for p in mechanism.parameters}


def onset_prior(observed: Observations, trial: int) -> Prior:
    """Return what is known of a trial's first contact beforehand, after that counted from (mm).

    It lies at the recording's start, or after some air where it seems to be, each as likely as the trials together say.
    """
    contact, way = observed.contacts[trial], observed.way
    apart, chance = contact.estimate - contact.displacement, observed.chance_of_air
    if observed.shows_air:
        return Prior(apart, IN_AIR_SD_MM * way, "linear", "detection in the recording")
    touching = contact.touch_sd(way, _felt(observed, trial))
    in_air = float(np.clip(_DOUBT * touching, way * LEAST_SD_IN_AIR_MM, way * IN_AIR_SD_MM))
    variance = chance * (in_air**2 + (1.0 - chance) * apart**2) + (1.0 - chance) * touching**2
    return Prior(chance * apart, math.sqrt(variance), "linear", "the recording's start, or detection in it")


def _felt(observed: Observations, trial: int) -> float:
    return way_felt(observed.white_sd, max(float(observed.stiffness[observed.trial == trial][0]), 1e-9))


def contact_sd_alike(observed: Observations) -> float:
    """Return the standard deviation (mm) of first contact that all trials have alike, where it is stated to be at zero.

    Who states it has put it anywhere on the way on which the load cell comes to feel it.
    """
    felt = float(np.mean([_felt(observed, trial) for trial in range(len(observed.trials))]))
    return min(felt, LATEST_ALIKE_MM * observed.way) / float(np.sqrt(12.0))


def onset_name(trial: int) -> str:
    """Return the full name of a trial's first contact."""
    return f"trial{trial + 1}.onset"
