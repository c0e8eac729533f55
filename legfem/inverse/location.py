r"""Location of the misfit, and what it looks like: score tests of mechanisms and of windows of stations.

A mechanism's signature is the derivative of the prediction by its strength at the null. The base parameters hide what
lies in the span of their own derivatives, so signatures are projected off it, in the metric of the errors; priors count
as data, so that a parameter of a narrow one (a stated first contact) hides little. With whitened residual :math:`w` and
projected signature :math:`s`,

.. math:: T = \frac{\max(0, s^T w)^2}{s^T s}

(two-sided where the strength may have either sign), the largest over the mechanism's shapes. Draws of the errors
through the same arithmetic give p-values for each mechanism, for the largest of all (family-wise), and for windows of
stations, whose signatures are boxes.

Repeats of a programme do the same but for what is each trial's own: a gain, a zero, a first contact, noise. Where one
trial departs from the others by more, from some segment on or in a segment alone, nothing else need be wrong: the part
that something unknown touched is given an error without bounds, which is to leave it out, and all else is judged by the
rest (`touched_part`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, orth, solve_triangular

from legfem.common.units import FloatArray, runs_of
from legfem.inverse.errors import ErrorModel
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.mechanism import Mechanism, Values, null_of, value_at
from legfem.inverse.observations import Observations

_LENGTHS = (3, 5, 8, 12, 20)
SIGNIFICANT = 0.05
type _Member = tuple[str, NDArray[np.int_]]
"""A window: names of its trials, and readings that it holds."""


@dataclass(frozen=True)
class Window:
    """An interval that holds a misfit."""

    trial: str
    """Its name, or those of all trials that were driven alike."""
    phase: str
    displacement: tuple[float, float]
    """mm."""
    time: tuple[float, float]
    """s since first contact."""
    size: float
    """Mean residual there, in the channel's unit."""
    p_value: float
    """Family-wise over all windows."""
    stations: tuple[int, ...]
    """Readings that it holds."""
    channel: str
    """Whose readings these are."""


def significant(
    observed: Observations, members: Sequence[_Member], scores: FloatArray, largest: FloatArray, residual: FloatArray
) -> Iterator[Window]:
    """Yield non-overlapping significant windows, the strongest first.

    Parameters
    ----------
    observed
        All readings.
    members
        Trials' names and readings of each window, all of one channel.
    scores
        Of all windows.
    largest
        Sorted largest scores of draws without misfit.
    residual
        (n,), N.
    """
    taken: set[int] = set()
    for k in np.argsort(-scores):
        p = (len(largest) - np.searchsorted(largest, scores[k]) + 1) / (len(largest) + 1)
        if p > SIGNIFICANT:
            break
        name, where = members[k]
        if taken & set(where.tolist()):
            continue
        taken |= set(where.tolist())
        at = observed.nearest[where]
        d, t = observed.displacement[at], observed.time[at]
        channels = zip(observed.data.channels, observed.data.spans, strict=True)
        yield Window(
            name,
            str(observed.phase[at[0]]),
            (float(d.min()), float(d.max())),
            (float(t.min()), float(t.max())),
            float(residual[where].mean()),
            float(p),
            tuple(map(int, where)),
            next(one.name for one, span in channels if where[0] < span.stop),
        )


def _stretches(count: int) -> list[slice]:
    """Return stretches of several lengths among so many readings."""
    lengths = sorted({*(n for n in _LENGTHS if n < count), count} - {0})
    return [slice(k, k + length) for length in lengths for k in range(0, count - length + 1, max(1, length // 3))]


def windows_of(observed: Observations) -> tuple[list[_Member], FloatArray]:
    """Return all windows that are looked at, and their boxes (N, k)."""
    members: list[_Member] = []
    for number, stations in enumerate(observed.protocols):
        names, every = [observed.trials[k] for k in observed.trials_of(number)], observed.stations_of(number)
        groups = [(", ".join(names), every)]
        if len(names) > 1:
            groups += zip(names, every[:, None], strict=True)
        for segment in np.unique(stations.segment):
            here = np.flatnonzero(stations.segment == segment)
            for part in _stretches(len(here)):
                members += [(name, at[:, here[part]].ravel()) for name, at in groups]
    members += _channel_windows(observed)
    boxes = np.zeros((len(observed.values), len(members)))
    for k, (_, where) in enumerate(members):
        boxes[where, k] = 1.0
    return members, boxes


def _channel_windows(observed: Observations) -> Iterator[_Member]:
    """Yield the windows of channels beside the force: of all trials of a protocol together, in order along them."""
    for span in observed.data.spans[1:]:
        own = np.arange(span.start, span.stop)
        at = observed.nearest[own]
        for number in range(len(observed.protocols)):
            name = ", ".join(observed.trials[k] for k in observed.trials_of(number))
            for segment in np.unique(observed.segment[at]):
                here = np.flatnonzero((observed.protocol[at] == number) & (observed.segment[at] == segment))
                here = here[np.argsort(observed.time[at[here]], kind="stable")]
                yield from ((name, own[here[part]]) for part in _stretches(len(here)))


def runs_within(observed: Observations, marks: NDArray[np.int_]) -> Iterator[tuple[int, NDArray[np.int_]]]:
    """Yield trials with the stations of each run of like marks (n,) but zero within a segment."""
    for k in range(len(observed.trials)):
        for segment in np.unique(observed.segment[observed.trial == k]):
            here = np.flatnonzero((observed.trial == k) & (observed.segment == segment))
            yield from ((k, here[first:end]) for first, end in runs_of(marks[here]) if marks[here[first]])


DRAWS = 1000
_NO_MOVE, _SAME_DIRECTION = 1e-12, 1e-3


@dataclass(frozen=True, eq=False)
class Signature:
    """A mechanism's direction in the space of the data, for one shape of its parameters."""

    mechanism: Mechanism
    direction: FloatArray
    """(N + p,): whitened, projected off the base parameters; see `LinearisedFit.augmented_residual`."""
    one_sided: bool
    shape: Values
    """Values of the parameters beyond the first."""
    concealed: float
    """Share of its length that a refit of the base parameters hides."""


@dataclass(frozen=True)
class Score:
    """A mechanism's score test."""

    name: str
    statistic: float
    p_value: float
    concealed: float
    """Share of the signature's length that a refit of the base parameters hides."""


@dataclass(frozen=True, eq=False)
class MisfitAssessment:
    """What the residual of a fit says."""

    lack_of_fit: float
    """p-value of the trials' mean residuals' sum of squares."""
    scores: tuple[Score, ...]
    """Scores of the testable mechanisms, the strongest first."""
    windows: tuple[Window, ...]
    """Intervals that hold the misfit, family-wise significant ones only."""
    p_value: float
    """That the errors alone make as strong a sign as the strongest of the three tests."""
    signatures: tuple[Signature, ...]

    def score(self, name: str) -> Score | None:
        """Return a mechanism's."""
        return next((score for score in self.scores if score.name == name), None)


def signatures_of(fitted: LinearisedFit, mechanisms: Sequence[Mechanism]) -> Iterator[Signature]:
    """Yield the projected signatures at a fit."""
    problem, basis = fitted.problem, np.linalg.qr(fitted.augmented_jacobian)[0]
    observed = problem.predictor.observed
    for mechanism in mechanisms:
        first = mechanism.parameters[0]
        null = null_of(first)
        step = 0.05 * (value_at(first, 1.0) - null)
        shapes = {tuple(list(values.items())[1:]): values for values in mechanism.starts(observed)}
        for shape in shapes.values():
            values = {**fitted.values, **mechanism.by_full_name({**shape, first.name: null + step})}
            moved = problem.predictor(values, (*fitted.mechanisms, mechanism))
            white = _padded(problem.whitened((moved - fitted.prediction) / step), fitted)
            length = float(np.linalg.norm(white))
            direction = white - basis @ (basis.T @ white)
            direction -= basis @ (basis.T @ direction)
            rest = float(np.linalg.norm(direction))
            if length == 0 or rest < 1e-6 * length:
                continue
            yield Signature(mechanism, direction, first.bounds[0] >= null, shape, 1.0 - rest / length)


def score_tests(fitted: LinearisedFit, mechanisms: Sequence[Mechanism], seed: int = 0) -> MisfitAssessment:
    """Test a fit's residual against errors, mechanisms and windows; no solution is needed."""
    problem, found = fitted.problem, tuple(signatures_of(fitted, mechanisms))
    basis = np.linalg.qr(fitted.augmented_jacobian)[0]
    members, boxes = windows_of(problem.predictor.observed)
    white_boxes = _padded(problem.whitened(boxes), fitted)
    white_boxes -= basis @ (basis.T @ white_boxes)
    generator = np.random.default_rng(seed)
    errors = problem.errors.draw(DRAWS, generator)
    known = generator.normal(size=(DRAWS, len(fitted.free)))
    drawn = np.hstack([problem.whitened(errors.T).T, known])
    everything = np.vstack([fitted.augmented_residual, drawn])
    everything -= (everything @ basis) @ basis.T

    strength = _by_mechanism(found, everything)
    window_scores = _squares(everything, white_boxes.T, one_sided=np.zeros(len(boxes.T), bool))
    misfit = _rank(_lack_of_fit(fitted, np.vstack([fitted.residual, errors])))
    each = {name: _rank(row) for name, row in strength.items()}
    scan = _rank(window_scores.max(axis=1))
    family = _rank(-np.min([np.ones(DRAWS + 1), *each.values()], axis=0))
    joint = np.minimum(np.minimum(misfit, family), scan)
    scores = [
        Score(name, float(strength[name][0]), float(p[0]), min(s.concealed for s in found if s.mechanism.name == name))
        for name, p in each.items()
    ]
    threshold = np.sort(window_scores[1:].max(axis=1))
    return MisfitAssessment(
        float(misfit[0]),
        tuple(sorted(scores, key=lambda s: (s.p_value, -s.statistic))),
        tuple(significant(problem.predictor.observed, members, window_scores[0], threshold, fitted.residual)),
        float(_rank(-joint)[0]),
        found,
    )


def _padded(white: FloatArray, fitted: LinearisedFit) -> FloatArray:
    """Return vectors (n,) or (n, k) that say nothing of what was known of the parameters."""
    return np.concatenate([white, np.zeros((len(fitted.free), *white.shape[1:]))])


def _lack_of_fit(fitted: LinearisedFit, rows: FloatArray) -> FloatArray:
    """Return the sums of squares of the trials' mean residuals, whitened, off the parameters.

    Differences between repeats don't count: the errors' sizes were estimated from them.
    """
    errors, means = fitted.problem.errors, fitted.problem.predictor.observed.means
    lower = cholesky(means @ errors.covariance @ means.T, lower=True)
    moved = solve_triangular(lower, means @ errors.lower @ fitted.jacobian, lower=True)
    # First contacts of trials driven alike move their mean in one direction, not in one each.
    basis = orth(moved / np.maximum(np.linalg.norm(moved, axis=0), _NO_MOVE), rcond=_SAME_DIRECTION)
    white = solve_triangular(lower, means @ rows.T, lower=True).T
    return np.asarray(np.sum((white - (white @ basis) @ basis.T) ** 2, axis=1))


def _by_mechanism(found: Sequence[Signature], rows: FloatArray) -> dict[str, FloatArray]:
    result: dict[str, FloatArray] = {}
    for name in dict.fromkeys(s.mechanism.name for s in found):
        mine = [s for s in found if s.mechanism.name == name]
        directions = np.array([s.direction for s in mine])
        sided = np.array([s.one_sided for s in mine])
        result[name] = _squares(rows, directions, sided).max(axis=1)
    return result


def _squares(rows: FloatArray, directions: FloatArray, one_sided: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(directions, axis=1)
    along = (rows @ directions.T) / np.where(lengths > 0, lengths, 1.0)
    along = np.where(one_sided[None, :], np.maximum(along, 0.0), along)
    return np.asarray(along**2)


def _rank(statistics: FloatArray) -> FloatArray:
    """Return each one's p-value among the draws, which are all but the first."""
    drawn = np.sort(statistics[1:])
    above = len(drawn) - np.searchsorted(drawn, statistics - 1e-12, side="left")
    p = (above + 1.0) / (len(drawn) + 1.0)
    # A draw counts itself once; the recording is not among them.
    p[1:] = above[1:] / len(drawn)
    return np.asarray(p)


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
