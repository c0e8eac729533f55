"""All that was recorded of a leg as one vector: forces at the stations, then the readings of every further channel.

`StationReading` says what they take of a model's courses on a grid of displacements, for given first contacts.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from legfem.common.units import FloatArray
from legfem.data.contact import Contact, air_is_shown, chance_of_air, contact_at_start
from legfem.data.instrument_faults import steps_of
from legfem.data.noise import slowest_error
from legfem.data.phases import HOLD, LOADING, UNLOADING
from legfem.data.segmentation import Segmentation
from legfem.inverse.answer import FitNotice, Notice
from legfem.inverse.channel_readings import PlannedChannel, StationChannel, channel_readings, planned_readings
from legfem.inverse.readings import Channel, Data, unit_spline
from legfem.inverse.stations import Stations, group_trials, read_at, since_touch, stations_along, stations_of
from legfem.solve.path import ForceCurve
from legfem.solve.protocol import Protocol


@dataclass(frozen=True, eq=False)
class Observations:
    """Forces at the n stations of all trials, trial after trial, and readings of further channels; arrays are (n,)."""

    trials: tuple[str, ...]
    protocols: tuple[Stations, ...]
    protocol_of: tuple[int, ...]
    """A trial's protocol."""
    force: FloatArray
    """N."""
    white_variance: FloatArray
    """N^2."""
    jitter_variance: FloatArray
    """mm^2, of the smoothed displacement."""
    white_sd: float
    """Standard deviation of one force reading, N."""
    jitter_sd: float
    """Standard deviation of one displacement reading, mm."""
    contacts: tuple[Contact, ...]
    notices: tuple[Notice, ...]
    """What was noticed in the recordings, in sentences."""
    depths: tuple[float, ...] = ()
    """Greatest displacement of each trial, mm, where it isn't its protocol's: with more air before
    the skin the same travel goes less deep."""
    starts_at_contact: bool = False
    """Whether displacement is stated to count from first touch."""
    channels: tuple[StationChannel, ...] = ()
    """What was recorded beside the force."""
    way: float = 1.0
    """mm in which errors change as they do in a mm of a leg's press; see `legfem.data.contact.Scales`."""
    steps: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Places (mm after first contact) and sizes (N) of steps of the force, by the trials that surely have one."""

    def stepped(self, trial: str) -> FloatArray:
        """Return what a trial's step adds to the readings, and to those beside it, which may have a part; (3, N)."""
        found, (place, size) = np.zeros((3, len(self.values))), self.steps[trial]
        here = np.flatnonzero(self.trial == self.trials.index(trial))
        beyond = here[np.maximum.accumulate(self.displacement[here]) > place]
        found[0, beyond] = size
        # Beyond the depth that all trials have nothing is read.
        for first in beyond[:1]:
            found[[1, 2], [max(first - 1, here[0]), first]] = size
        return found

    @cached_property
    def data(self) -> Data:
        """All N readings: the force's, then every further channel's."""
        force_sd = np.sqrt(self.white_variance)
        force = Channel("force", "N", self.displacement, "displacement_mm", self.force, force_sd)
        return Data((force, *(one.channel for one in self.channels)))

    @cached_property
    def courses(self) -> tuple[str, ...]:
        """Names of the courses beside the force."""
        return tuple(course for one in self.channels for course in one.courses)

    @property
    def values(self) -> FloatArray:
        """All readings, (N,), each in its channel's unit."""
        return self.data.values

    @cached_property
    def nearest(self) -> NDArray[np.int_]:
        """Station nearest to each reading, (N,)."""
        return np.concatenate([np.arange(len(self.force)), *(one.nearest for one in self.channels)])

    def beside(self, course: FloatArray) -> FloatArray:
        """Return a course (n,) at the stations as all readings (N,) have it."""
        return np.concatenate([course, *(one.weights @ course for one in self.channels)])

    def following_force(self, relative: FloatArray) -> FloatArray:
        """Return what changes the force relatively (n,) as relative changes of all readings (N,) that follow it."""
        further = (one.weights @ (one.kind.follows_force * relative) for one in self.channels)
        return np.concatenate([relative, *further])

    def spread(self, by_protocol: Sequence[FloatArray]) -> NDArray[np.float64]:
        """Return values at every protocol's stations as one vector over all trials."""
        return np.concatenate([by_protocol[number] for number in self.protocol_of])

    @cached_property
    def trial(self) -> NDArray[np.int_]:
        """Number of the trial."""
        sizes = [len(self.protocols[p].time) for p in self.protocol_of]
        return np.repeat(np.arange(len(sizes)), sizes)

    @cached_property
    def protocol(self) -> NDArray[np.int_]:
        """Number of the protocol."""
        return np.array(self.protocol_of)[self.trial]

    @cached_property
    def displacement(self) -> FloatArray:
        """Displacement, mm; in a hold at the deepest point that of the trial itself."""
        stated = self.spread([stations.displacement for stations in self.protocols])
        if not self.depths:
            return stated
        deepest = np.array([self.protocols[p].depth for p in self.protocol_of])
        further = (np.array(self.depths) - deepest)[self.trial]
        held = (self.phase == HOLD) & (np.abs(stated - deepest[self.trial]) < 0.5 * self.way)
        return np.where(held, stated + further, stated)

    @cached_property
    def time(self) -> FloatArray:
        """Time since first contact, s."""
        return self.spread([stations.time for stations in self.protocols])

    @cached_property
    def phase(self) -> NDArray[np.str_]:
        """Name of the phase."""
        return np.concatenate([self.protocols[number].phase for number in self.protocol_of])

    @cached_property
    def segment(self) -> NDArray[np.int_]:
        """Number of the protocol's segment."""
        return np.concatenate([self.protocols[number].segment for number in self.protocol_of])

    @cached_property
    def half_width(self) -> FloatArray:
        """Way to either side of a station within which its force was read, mm; see `Stations.half_width`."""
        return self.spread([stations.half_width for stations in self.protocols])

    @cached_property
    def stiffness(self) -> FloatArray:
        """Slope dF/dd of the recordings, smoothed, N/mm; in a hold that at its depth."""
        slopes = []
        for number, stations in enumerate(self.protocols):
            mean = self.force[self.stations_of(number)].mean(axis=0)
            slope = np.zeros(len(mean))
            last = 0.0
            for segment in np.unique(stations.segment):
                here = stations.segment == segment
                if stations.phase[here][0] == HOLD:
                    slope[here] = last
                    continue
                d = stations.displacement[here]
                fit = Polynomial.fit(d, mean[here], min(5, len(d) - 2))
                slope[here] = fit.deriv()(d)
                last = float(slope[here][-1])
            slopes.append(slope)
        return self.spread(slopes)

    @cached_property
    def by_displacement(self) -> FloatArray:
        """Derivative of all N readings by the displacement, per mm, smoothed."""
        return np.concatenate([self.stiffness, *(one.slope(one.values) for one in self.channels)])

    @cached_property
    def means(self) -> FloatArray:
        """Matrix (m, N) that takes the mean over a protocol's trials at each of its stations, and the rest as it is."""
        every, count = map(self.stations_of, range(len(self.protocols))), len(self.force)
        rows = [np.bincount(at, minlength=count) / len(at) for stations in every for at in stations.T]
        return np.asarray(block_diag(np.array(rows), np.eye(len(self.values) - count)))

    def trials_of(self, protocol: int) -> list[int]:
        """Return the numbers of a protocol's trials."""
        return [k for k, p in enumerate(self.protocol_of) if p == protocol]

    def stations_of(self, protocol: int) -> NDArray[np.int_]:
        """Return the numbers (trials, m) of the stations of a protocol's trials, and so of their forces' readings."""
        return np.array([np.flatnonzero(self.trial == k) for k in self.trials_of(protocol)])

    @property
    def repeats(self) -> int:
        """Number of trials of the most repeated protocol."""
        return max(len(self.trials_of(p)) for p in range(len(self.protocols)))

    @property
    def shows_air(self) -> bool:
        """Whether trials begin above the skin, though none is stated to begin at it."""
        return not self.starts_at_contact and air_is_shown(self.contacts)

    @property
    def chance_of_air(self) -> float:
        """How likely it is that trials begin above the skin."""
        return 0.0 if self.starts_at_contact else chance_of_air(self.contacts)

    @property
    def repeated(self) -> list[list[int]]:
        """Numbers of the trials by protocol."""
        return [self.trials_of(p) for p in range(len(self.protocols))]

    @property
    def depth(self) -> float:
        """Greatest displacement of all, mm."""
        return max([*self.depths, *(stations.depth for stations in self.protocols)])

    @property
    def phases(self) -> frozenset[str]:
        """Phases that were recorded."""
        return frozenset(str(name) for name in self.phase)

    @property
    def rates(self) -> list[float]:
        """Loading rates, mm/s, rising; those within 20 % count as one."""
        found: list[float] = []
        parts = [part for s in self.protocols for part in s.protocol.segments]
        for part in (p for p in parts if p.phase == LOADING):
            if all(abs(part.rate / other - 1) > 0.2 for other in found):
                found.append(part.rate)
        return sorted(found)

    @property
    def slowest(self) -> float:
        """Time over which a load cell's slow error is expected to be correlated, s."""
        return slowest_error(max(self.rates) / self.way, max(float(s.protocol.time[-1]) for s in self.protocols))

    def with_force(self, force: FloatArray) -> "Observations":
        """Return the same stations with other forces (N)."""
        return replace(self, force=force)

    def with_channels(self, names: Collection[str]) -> "Observations":
        """Return the observations without channels whose courses a model doesn't know, with a notice of each."""
        known = set(names)
        told = tuple(
            Notice.of(FitNotice.CHANNEL_NOT_SOLVED, channel=one.kind.words)
            for one in self.channels
            if not known.issuperset(one.needed)
        )
        kept = tuple(one for one in self.channels if known.issuperset(one.needed))
        return replace(self, channels=kept, notices=(*self.notices, *told)) if told else self

    def with_values(self, values: FloatArray) -> "Observations":
        """Return the same stations with other readings (N,)."""
        force, *others = (values[span] for span in self.data.spans)
        channels = tuple(replace(one, values=own) for one, own in zip(self.channels, others, strict=True))
        return replace(self, force=force, channels=channels)


def blank_observations(protocols: Sequence[Protocol], planned: Sequence[PlannedChannel] = ()) -> Observations:
    """Return observations of nothing at a programme's stations, one trial a protocol.

    Parameters
    ----------
    protocols
        Of the trials.
    planned
        Channels beside the force.
    """
    distinct = list(dict.fromkeys(protocols))
    stations = tuple(stations_along(protocol) for protocol in distinct)
    numbers = tuple(distinct.index(protocol) for protocol in protocols)
    nothing = np.zeros(sum(len(stations[k].time) for k in numbers))
    return Observations(
        tuple(f"trial{k + 1}" for k in range(len(protocols))),
        stations,
        numbers,
        nothing,
        nothing,
        nothing,
        0.0,
        0.0,
        tuple(contact_at_start() for _ in protocols),
        (),
        channels=tuple(planned_readings(planned, [stations[k] for k in numbers])),
    )


def _about(trial: Segmentation) -> Iterator[Notice]:
    """Yield what a reader should know of how a trial was driven."""
    told = partial(Notice.of, trial=trial.name)
    if trial.contact.in_air:
        yield told(FitNotice.BEGUN_IN_AIR, air=trial.contact.displacement)
    yield from (told(FitNotice.SPEED_CHANGES, phase=part.phase) for part in trial.segments if part.changes_speed)
    if trial.pressed_again:
        yield told(FitNotice.PRESSED_AGAIN)
    again = sum(p == LOADING and UNLOADING in trial.phases[:k] for k, p in enumerate(trial.phases))
    if again:
        yield told(FitNotice.SEVERAL_LOADINGS, loadings=again + 1)


def observe(trials: Sequence[Segmentation]) -> Observations:
    """Bring recordings to stations.

    Raises
    ------
    InputError
        If a recording has no loading.
    """
    groups = group_trials(trials)
    protocols = tuple(stations_of([trials[k] for k in group]) for group in groups)
    protocol_of = tuple(next(g for g, group in enumerate(groups) if k in group) for k in range(len(trials)))
    stations = [protocols[p] for p in protocol_of]
    readings = [read_at(t, own) for t, own in zip(trials, stations, strict=True)]
    white = [t.force_noise**2 * r.white_leverage for t, r in zip(trials, readings, strict=True)]
    jitter = [t.displacement_noise**2 * r.jitter_leverage for t, r in zip(trials, readings, strict=True)]
    return Observations(
        tuple(t.name for t in trials),
        protocols,
        protocol_of,
        np.concatenate([r.force for r in readings]),
        np.concatenate(white),
        np.concatenate(jitter),
        float(np.sqrt(np.mean([t.force_noise**2 for t in trials]))),
        float(np.sqrt(np.mean([t.displacement_noise**2 for t in trials]))),
        tuple(t.contact for t in trials),
        tuple(notice for trial in trials for notice in _about(trial)),
        tuple(t.depth for t in trials),
        all(t.contact.known for t in trials),
        tuple(channel_readings(trials, stations)),
        min(t.scales.way for t in trials),
        steps_of(trials),
    )


type Derivatives = dict[str, FloatArray]
type Corrected = Callable[[FloatArray, Derivatives], tuple[FloatArray, Derivatives]]


@dataclass(frozen=True, eq=False)
class StationReading:
    """Readings of all trials, whose first contacts are given, from courses on a grid.

    Parameters
    ----------
    observed : Observations
        K trials at n stations, N readings in all.
    contacts : (K,) array
        First contacts (mm), after those counted from.
    grid : (g,) array
        Displacements (mm), rising from above 0: of forces, which vanish at 0, and of each further course's changes
        since touch, which follow its value there. Together these are a model's m values.
    """

    observed: Observations
    contacts: FloatArray
    grid: FloatArray

    def unseen_in(self, curve: ForceCurve) -> list[str]:
        """Names of the channels whose courses a solve doesn't have."""
        return [one.name for one in self.observed.channels if not curve.channels.keys() >= set(one.courses)]

    @cached_property
    def pressed(self) -> FloatArray:
        """Displacement after touch (n,), mm; negative before it."""
        return np.asarray(self.observed.displacement - self.contacts[self.observed.trial])

    @cached_property
    def _spline(self) -> CubicSpline:
        return unit_spline(self.grid)

    def _at(self, ways: FloatArray, derivative: int = 0) -> FloatArray:
        """Return what values on the grid make at ways after touch, or their derivatives; (k, g)."""
        return np.asarray(self._spline(np.maximum(ways, 0.0), derivative))

    def matrix(self, derivative: int = 0, offset: float = 0.0) -> FloatArray:
        """Return what all readings take of the model's values, or their derivatives by the displacement; (N, m).

        ``offset`` (mm) is how much later all trials touch.
        """
        ways, share = since_touch(self.pressed - offset, self.observed.half_width)
        force = share[:, None] * self._at(ways, derivative)
        if derivative:
            # Within a station's half-width of touch the share itself changes.
            half = self.observed.half_width
            inside = (share > 0) & (share < 1.0) & (half > 0)
            rise = np.divide(0.5, half, out=np.zeros_like(half), where=inside)
            force = np.where(inside, 0.5, 1.0)[:, None] * force + rise[:, None] * self._at(ways)
        if not self.observed.courses:
            return force
        after = self.pressed - offset
        change = np.where(after > 0, 1.0, 0.0)[:, None] * self._at(after, derivative)
        level = np.full((len(after), 1), 0.0 if derivative else 1.0)
        course, blocks, width = np.hstack([level, change]), [], 1 + len(self.grid)
        for one in self.observed.channels:
            block = np.zeros((len(one.values), len(one.courses) * width))
            for k, rows in enumerate(one.rows):
                block[rows, k * width : (k + 1) * width] = one.weights[rows] @ course
            blocks.append(block)
        return np.asarray(block_diag(force, *blocks))

    @cached_property
    def plain(self) -> FloatArray:
        """What all readings take of the model's values, (N, m)."""
        return self.matrix()

    @cached_property
    def linear_scale(self) -> FloatArray:
        """Sizes (m,) of what isn't a force along the travel, which is 0."""
        channels = self.observed.channels
        sizes = [max(float(np.ptp(one.values)), 3 * one.kind.usual.reading) for one in channels for _ in one.courses]
        return np.concatenate([np.zeros(len(self.grid)), np.repeat(sizes, 1 + len(self.grid))])

    def model_values(
        self, curve: ForceCurve, corrected: Corrected = lambda change, by: (change, by)
    ) -> tuple[FloatArray, Derivatives]:
        """Return what the model gives on the grid (m,), and its derivatives.

        Parameters
        ----------
        curve
            The solve.
        corrected
            What acts on the force, on changes (g,) of channels that follow it, and on their derivatives.
        """
        names, knots = tuple(curve.sensitivities), np.concatenate([[0.0], self.grid])
        force, by_force = corrected(curve(self.grid), {name: curve.sensitivity(name, self.grid) for name in names})
        parts, by = [force], {name: [rates] for name, rates in by_force.items()}
        for one in self.observed.channels:
            for course in one.courses:
                known = curve.channel_sensitivities.get(course, {})
                every = np.stack([curve.channels[course], *(known[name] for name in names)], axis=-1)
                level, *rest = curve.interpolated(every, knots).T
                rates = dict(zip(names, rest, strict=True))
                change, by_change = level[1:] - level[0], {name: rate[1:] - rate[0] for name, rate in rates.items()}
                if one.kind.follows_force:
                    change, by_change = corrected(change, by_change)
                parts += [level[:1], change]
                for name in names:
                    by[name] += [rates[name][:1], by_change[name]]
        return np.concatenate(parts), {name: np.concatenate(rows) for name, rows in by.items()}

    def images_elsewhere(self, curve: ForceCurve) -> dict[str, dict[str, FloatArray]]:
        """Return what images do that lie elsewhere, by channel and by way: one standard deviation, (k,) readings."""
        pressed, found = np.maximum(self.pressed, 0.0), dict[str, dict[str, FloatArray]]()
        for one in self.observed.channels:
            for way, names in one.laid_courses.items():
                by_name = {own: curve.channel(name, pressed) for own, name in zip(one.courses, names, strict=True)}
                found.setdefault(one.name, {})[way] = one.accuracy.laid[way] * one.read(by_name.__getitem__)
        return found
