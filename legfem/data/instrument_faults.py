r"""What a rig adds to a press, and what each fault does to C10: one model of instruments for all commands.

A rig may read

.. math:: F_{read}(t) = (1 + g)\, F\big(d(t - \tau) - b\big) + z + r\,t + s\, H(t - t_s),

with a gain g of a trial, a lag :math:`\tau` of the force, play b of the drive, a zero z, its drift r, and a step s; a
dead band reads nothing below some force. Each is estimated from the recordings with its standard error (`Fault`).

**The effect on C10 without a solve.** Forces F of a loading follow :math:`\ln C_{10}` and :math:`\ln C_{20}` as

.. math:: \delta F = w F\,[(1 - s(x))\, \delta\ln C_{10} + s(x)\, \delta\ln C_{20}],

x being the displacement over the depth: w is the share of the force that the identified tissue bears, and s(x) the
share of that by stiffening, nothing at touch. Whatever the size of s, an error e(x) of the force is thus taken for
:math:`\delta\ln C_{10} = a / w` with the fit :math:`e \approx F\,(a + c\, x^p)`, weighted by the errors of a reading:
white and slow noise, first contact as far as a fit may move it, and a share of the force for the model. By the exact
derivatives of two shipped legs w is 0.65 to 0.78 from touch to 30 mm, and p 1.6 to 2.2. A fit takes up some of a zero,
as much as the instrument's accuracy lets it; what is said here is what C10 moves by where it doesn't. Subject 3 with
a force that is cut by 0.5 N is identified 20 % too soft, where 21 % are said.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from legfem.common.errors import Doubt
from legfem.common.units import FloatArray, runs_of
from legfem.data.contact import LEG, air_is_shown, way_felt
from legfem.data.noise import slow_correlation
from legfem.data.phases import HOLD, LOADING, UNLOADING
from legfem.data.segmentation import Segmentation
from legfem.data.smoothing import local_line

LEAST_EFFECT = 0.05
"""Of C10: half of a usual interval."""
_SURE = 4.0
"""Standard errors by which a fault differs from none."""
_STATIONS = 40
_FEWEST = 20
"""Samples of a loading."""
_SHARE_OF_LEG, _STIFFENING = 0.7, 1.7
"""w of a leg, whose fat and fascia are given, and p."""
_OF_MODEL = 0.02
"""Share of the force by which a model may err smoothly."""
_ZERO = 0.005
"""Standard deviation of a sound cell's zero over the greatest force, where that is more than is stated."""
_NEAR_START = 0.05
"""Share of the travel that counts as where a recording begins."""
_ALL = 0.8
"""Share of the force's rise that stands at the start of a press that was recorded from its end."""
_CONSTANT = 0.2
"""Of the noise that shows later, within which a force counts as constant."""
_CORNER, _GRID, _READINGS = 0.3, np.linspace(-0.4, 0.8, 61), 160
"""Share of the loading's time that is looked at on either side of a corner; shares of this at which a branch may end or
begin; means that are taken of the readings."""
_HOLD = 0.1
"""Share of the loading's time that a hold lasts at least which tells of a drift."""
_STEP = 0.025
"""Share of the way, or of the time, on either side of which a step is looked for."""
_GOES_ALONG = 0.5
"""Share of what a way that is really gone changes the force by, more of which shows that it was."""
_LEAST_SLOPE = 0.1
"""Of a force's slope at touch, over that of its chord."""
_ALIKE = 0.5
"""Share of the greatest size from which a trial has a fault, too."""
_SEARCHED, _AIR = 2.0, 0.9
"""By what errors grow where the worst of many places is taken; of a late touch, so that three trials show it by about
as much as shows one where nothing is stated."""
_REPEAT, _LIKE_SPEED, _OF_SPEED = 0.03, 2.0, 0.3
"""Standard deviation of a sound repeat's force, relative, of a living leg; ratio of speeds of repeats; the
same of other speeds."""


class Fault(NamedTuple):
    """What a trial shows of a fault."""

    size: float
    error: float
    """Standard error of ``size``, in its unit."""
    effect: float
    """Relative change of C10 by it."""
    text: str = ""
    """What is unlikely."""
    place: float = 0.0
    """Where a step is, mm after first contact."""

    @property
    def counts(self) -> bool:
        """Whether it differs from none, and C10 can't bear it."""
        return abs(self.size) > _SURE * self.error and abs(self.effect) > LEAST_EFFECT


_UNSEEN = Fault(0.0, np.inf, 0.0)


class Press:
    """A trial's loading, and n stations from first contact to its deepest point; arrays are (n,).

    Parameters
    ----------
    trial
        The recording.
    after_air
        Whether repeats begin in air, so that this one does so too.
    """

    def __init__(self, trial: Segmentation, after_air: bool = False) -> None:
        self.trial, contact, stated = trial, trial.contact, trial.instrument
        kept = np.flatnonzero(trial.labels[: trial.deepest + 1] == LOADING)
        kept = kept[np.argsort(trial.smooth[kept], kind="stable")]
        self.kept, self.way = kept, trial.smooth[kept] - (contact.estimate if after_air else contact.displacement)
        self.read = trial.recording.force[kept] - contact.baseline
        self.depth, self.lasts = float(self.way[-1]), float(np.ptp(trial.recording.time[kept]))
        self.at = self.depth * (np.arange(_STATIONS) + 0.5) / _STATIONS
        line = local_line(self.way, self.read, self.at, 0.5 * self.depth / _STATIONS)
        self.force, self.slope = line.value, np.gradient(line.value, self.at)
        self.time = np.interp(self.at, self.way, trial.recording.time[kept]) - trial.recording.time[0]
        self.white = max(trial.force_noise, 1e-4 * float(np.abs(self.force).max()))
        slow = stated.slow_force_sd(self.white) if stated.stated else self.white
        self.slow = max(slow, _ZERO * float(np.abs(self.force).max()))
        chord = float(np.abs(self.force).max()) / max(self.depth, 1e-9)  # nothing of a touch at the deepest point
        self.slope_at_touch = max(float(self.slope[:3].mean()), _LEAST_SLOPE * chord, 1e-9)
        felt = contact.touch_sd(trial.scales.way, way_felt(self.white, self.slope_at_touch))
        self.touch = contact.displacement_error if after_air else felt
        white = np.diag(self.white**2 * line.leverage)
        self.noise = white + self.slow**2 * slow_correlation(self.at / trial.scales.way)
        self.of_tissue = _SHARE_OF_LEG if trial.scales is LEG else 1.0
        self.at_start = (0.0, 0.0) if contact.in_air else self.level(np.arange(len(trial.smooth)) <= trial.deepest)

    def covariance(self, force: FloatArray) -> FloatArray:
        """Return the covariance (n, n), N^2, of readings about a force (n,), N, but for their zero."""
        contact, model = self.touch * np.gradient(force, self.at), _OF_MODEL * force
        alike = np.exp(-5.0 * (np.subtract.outer(self.at, self.at) / self.depth) ** 2)
        return np.asarray(self.noise + np.outer(contact, contact) + np.outer(model, model) * alike)

    def effect(self, error: FloatArray | float, here: FloatArray | None = None) -> float:
        """Return the relative change of C10 by an error (n,) of the force, N, where loading is off by ``here``."""
        force, error = self.force - (error if here is None else here), np.zeros(_STATIONS) + error
        like = np.column_stack([force, force * (self.at / self.depth) ** _STIFFENING])
        weighed = np.linalg.solve(self.covariance(force), like)
        return float(np.linalg.solve(like.T @ weighed, weighed.T @ error)[0] / self.of_tissue)

    def level(self, of: NDArray[np.bool_]) -> tuple[float, float]:
        """Return the force (N) that some samples show where the recording begins, and its error by white noise."""
        d, force = self.trial.smooth - self.trial.smooth[0], self.trial.recording.force - self.trial.contact.baseline
        near = of & (d <= _NEAR_START * float(d.max()))
        count = np.count_nonzero(near)
        if count < 3:
            return _UNSEEN[:2]
        mean = float(force[near].mean())
        # By the line through what lies near, above which a curve begins.
        line = float(np.polyfit(d[near], force[near], 1)[1]) if np.ptp(d[near]) > 0 else mean
        return float(np.sign(line)) * min(abs(line), abs(mean)), 2.0 * self.trial.force_noise / float(np.sqrt(count))


def presses_of(trials: Sequence[Segmentation]) -> list[Press]:
    """Return the loadings of those trials that have one."""
    contacts = [one.contact for one in trials]
    after_air = air_is_shown(contacts) and not any(one.known for one in contacts)
    presses = (Press(one, after_air) for one in trials if (one.labels[: one.deepest + 1] == LOADING).sum() >= _FEWEST)
    return [one for one in presses if one.depth > 0 and one.force.max() > 5.0 * one.white]


def standing_force(trial: Segmentation) -> float:
    """Return the force before anything is pressed, N; nothing where it stands out too little to move C10."""
    return sum(zero.size for press in presses_of([trial]) if (zero := _zero(press)).counts)


def _zero(press: Press) -> Fault:
    """Return the force (N) that stands before anything is pressed."""
    level, error = press.at_start
    # A force that stands may be of a press that had begun: contact then lies before by as much as it takes.
    late = max(level, 0.0) / press.slope_at_touch
    from_touch = np.interp(press.at - late, [-late, *press.at], [0.0, *press.force])
    effects = press.effect(level), press.effect(press.force - from_touch)
    why = "a preload, or a zero that wasn't taken" if level > 0 else "tissue doesn't pull, so the zero wasn't taken"
    if -level > _ALL * (press.force.max() - level):
        why = "the press was recorded from its end, as unloading alone, or its sign is wrong"
    text = f"reads {level:.2g} N before anything is pressed: {why}"
    return Fault(level, float(np.hypot(error, press.slow)), max(effects, key=abs), text)


def _drift(press: Press) -> Fault:
    """Return by how much more (N) a force is where it comes back than where it began; in a hold where it doesn't."""
    labels, time, force = press.trial.labels, press.trial.recording.time, press.trial.recording.force
    start, back = press.at_start, press.level(np.arange(len(time)) > press.trial.deepest)
    gained, error, lasts = back[0] - start[0], float(np.hypot(start[1], back[1])), float(np.ptp(time))
    where, course = "back where it began than at first", np.full(_STATIONS, 0.5)
    for (before, _), (a, b) in pairwise(runs_of(labels)):
        held, few = float(time[b - 1] - time[a]), (b - a) // 5
        long = held > _HOLD * press.lasts and few > 1 and labels[before] == LOADING and labels[a] == HOLD
        if np.isinf(error) and long:
            gained = max(float(np.median(force[b - few : b]) - np.median(force[a : a + few])), 0.0)
            error, lasts, course = 2.0 * press.white / float(np.sqrt(few)), 0.8 * held, press.time / (0.8 * held)
            where = "at the end of a hold, where tissue relaxes, than at its start"
    text = f"reads {gained:+.2g} N more {where} ({gained / lasts:+.2g} N/s): it drifts, which counts as stiffness"
    # What is read on the way back counts, too: in the mean with the way there it is off by half.
    effect = press.effect(gained * course, gained * press.time / lasts)
    return Fault(gained, float(np.hypot(error, np.sqrt(2) * press.slow)), effect, text)


def _dead_band(press: Press) -> Fault:
    """Return how far (mm) a press goes while its force doesn't even show its noise."""
    force, way = press.trial.recording.force, press.trial.smooth - press.trial.smooth[0]
    constant = np.abs(force - np.median(force[:8])) < _CONSTANT * press.white
    count = 0 if constant.all() else int(np.argmin(constant))
    if count < 8 or float(np.percentile(np.diff(np.unique(force)), 5.0)) > 0.5 * press.white:
        return Fault(0.0, 1.0, 0.0)
    # A contact that began with the recording would by then have come as far as the slope goes on to.
    band, since = float(way[count]), press.at - press.depth + way[press.trial.deepest]
    slope = float(press.slope[since > band][:3].mean())
    # Nor is contact then where it seems to be.
    press = copy(press)
    press.touch = 0.0
    effects = [press.effect(-slope * np.minimum(since, band))] * (not press.trial.contact.in_air)
    if not press.trial.contact.known:
        # The band may be taken for air, after which the force rises as deeper in the tissue.
        beyond = press.at + band
        further = press.slope[-1] * np.maximum(beyond - since[-1], 0.0)
        true = np.interp(press.at, since, press.force, 0.0) + slope * np.minimum(press.at, band)
        effects.append(press.effect(np.interp(beyond, since, press.force) + further - true, press.force - true))
    text = f"is constant over the first {band:.2g} mm, without its noise of {press.white:.2g} N: a dead band"
    return Fault(band, 0.1 * band, max(effects, key=abs), text)


def _late(press: Press) -> Fault:
    """Return by which way (mm) the force is behind the displacement where the drive stops or turns."""
    trial, time, found = press.trial, press.trial.recording.time, list[Fault]()
    for (a, b), (_, c) in pairwise(runs_of(trial.labels)):
        phases = str(trial.labels[a]), str(trial.labels[b])
        reach = min(time[b] - time[a], time[c - 1] - time[b], _CORNER * press.lasts)
        part = np.flatnonzero(np.abs(time - time[b]) <= reach)
        beside = int(np.bincount(part >= b, minlength=2).min())
        if phases not in _CORNERS or 2 * beside < _FEWEST or not trial.recording.timed:
            continue
        few, columns = min(_READINGS, len(part)), (time - time[b], trial.recording.displacement, trial.recording.force)
        since, way, force = (np.array([m.mean() for m in np.array_split(one[part], few)]) for one in columns)
        behind, error = _branch_begins(since, force, HOLD not in phases)
        drive, its_error = _branch_begins(since, way, False)
        moves = since < 0 if phases[0] == LOADING else since > 0
        speed = abs(float(np.polyfit(since[moves], way[moves], 1)[0]))
        late, error = speed * (behind - drive), 2.0 * np.hypot(speed * np.hypot(error, its_error), trial.recording.step)
        where = f"is {abs(late):.2g} mm ({abs(late) / speed:.2g} s) {'behind' if late > 0 else 'ahead of'}"
        text = f"{where} the displacement where the drive stops or turns: a filter, two clocks, or play in the drive"
        found.append(Fault(late, float(error), press.effect(-late * press.slope), text))
    # What lags is late in each; play shows only on the way back.
    return max(found, key=lambda one: one.size, default=_UNSEEN)


_CORNERS = ((LOADING, HOLD), (HOLD, UNLOADING), (LOADING, UNLOADING))


def _branch_begins(time: FloatArray, values: FloatArray, level: bool) -> tuple[float, float]:
    """Return when a course (n,) about a corner at 0 s begins its second branch, s, and the error.

    Both branches are parabolas, level between the two where that is asked for. Mean and standard deviation of
    exp(-cost / 2) over the times at which they may end and begin.
    """
    reach, left = float(-time[0]), values - values.mean()
    ends = np.array(np.meshgrid(_GRID, _GRID)).reshape(2, -1) if level else np.array([_GRID, _GRID])
    ends = ends[:, ends[0] <= ends[1]]
    before = np.minimum(time / reach - ends[0][:, None], 0.0)
    after = np.maximum(time / reach - ends[1][:, None], 0.0)
    design = np.stack([np.ones_like(before), before, before**2, after, after**2], axis=-1)
    across = np.swapaxes(design, 1, 2)
    terms = np.linalg.solve(across @ design + 1e-9 * np.eye(5), (across @ left)[..., None])
    squares = float(left @ left) - np.sum(terms[..., 0] * (across @ left), axis=1)
    # What the branches don't describe widens.
    least = max(float(squares.min()), 1e-12 * float(left @ left), 1e-300)
    weight = np.exp(-0.5 * len(time) * (squares - squares.min()) / least)
    mean = float(ends[1] @ weight / weight.sum())
    spread = float(np.sqrt((ends[1] - mean) ** 2 @ weight / weight.sum()))
    return reach * mean, reach * float(np.hypot(spread, 0.3 * (_GRID[1] - _GRID[0])))


def _touches_later(press: Press) -> Fault:
    """Return how much later (mm) than stated a press touches."""
    if not press.trial.contact.known:
        return _UNSEEN
    seen = press.trial.detected
    way, error = seen.estimate, _AIR * abs(seen.estimate) / max(seen.gain, 1e-9) ** 0.5
    text = f"begins {way:.2g} mm later than at first contact as it is stated: air, or play in the drive"
    return Fault(way, error, press.effect(-way * press.slope), text)


def _steps(
    x: FloatArray, values: FloatArray, at: FloatArray, half: float, white: float
) -> tuple[FloatArray, FloatArray]:
    """Return by how much values (n,) step at places (m,) of x (n,), by lines on either side, and the errors."""
    before, after = (local_line(x, values, at + side * half, half) for side in (-1, 1))
    steps = after.value - after.slope * half - before.value - before.slope * half
    # At an end of a straight line the variance is four times that in its middle.
    scatter = max(white, float(np.std(values - local_line(x, values, x, half).value)))
    return steps, 2.0 * scatter * np.sqrt(before.leverage + after.leverage)


def _step(press: Press) -> Fault:
    """Return by how much the force (N) steps within the loading, where it does most."""
    half = _STEP * press.depth / 2
    at = np.linspace(2 * half, 0.9 * press.depth, 200)
    steps, errors = _steps(press.way, press.read, at, half, press.white)
    k = int(np.argmax(np.abs(steps) / errors))
    size = float(steps[k])
    steps_by = f"{'jumps' if size > 0 else 'drops'} by {abs(size):.2g} N at {at[k]:.3g} mm"
    text = f"{steps_by}, while the displacement goes on as before"
    return Fault(size, _SEARCHED * float(errors[k]), _effect_beyond(press, float(at[k]), size), text, float(at[k]))


def _effect_beyond(press: Press, place: float, size: float) -> float:
    """Return the effect on C10 of a force that is off by a size (N) from a place (mm) on."""
    beyond = press.at > min(place, 0.9 * press.depth)
    # A zero that jumps, or a way that is lost: what is lost of the force then grows with its slope.
    slope = float(press.slope[beyond][:3].mean()) or np.inf
    effects = press.effect(size * beyond), press.effect(size * beyond * press.slope / slope)
    return max(effects, key=abs)


def _jump(press: Press) -> Fault:
    """Return by how much the displacement (mm) jumps within the loading while the force stays, where it does most."""
    kept, trial = np.sort(press.kept), press.trial
    time, d, half = trial.recording.time[kept], trial.recording.displacement[kept], _STEP * press.lasts / 2
    if not trial.recording.timed or half <= 0:
        return _UNSEEN
    at = np.linspace(time[0] + 2 * half, time[-1] - 2 * half, 200)
    steps, errors = _steps(time, d, at, half, trial.displacement_noise)
    k = int(np.argmax(np.abs(steps) / errors))
    size, place = float(steps[k]), float(np.interp(at[k], time, trial.smooth[kept]))
    # Slopes beside the jump, over which smoothing has spread it.
    beside = place + 2.0 * np.array([-1.0, 1.0]) * max(abs(size), half * press.depth / press.lasts)
    along = size * float(np.interp(beside, press.at, press.slope).mean())
    (felt,), (error,) = _steps(time, trial.recording.force[kept], at[k : k + 1], half, press.white)
    if np.sign(along) * felt + error > _GOES_ALONG * abs(along):
        size = 0.0
    effect = _effect_beyond(press, place, -along)
    text = f"goes on evenly at {at[k]:.3g} s, where displacement_mm jumps by {size:+.2g} mm: a counter that lost count"
    return Fault(size, _SEARCHED * float(errors[k]), effect, text)


_A_STEP = "a step"
_KINDS: dict[str, tuple[Callable[[Press], Fault], str]] = {
    "a dead band": (_dead_band, "switch off the amplifier's dead band or zero tracking"),
    "a lag or play": (_late, "record both by one clock without a filter, and measure at the indenter"),
    "a zero or preload": (_zero, "subtract what the cell reads without load, or record from before first touch"),
    "a jump": (_jump, "add the jump to what follows, or keep the part before it"),
    _A_STEP: (_step, "look for a slip, a loose cable or a changed sign, and keep the part without it"),
    "a drift": (_drift, "warm the load cell up, tare it, and take its drift off; legfem diagnose distinguishes drift"),
    "a late touch": (_touches_later, "subtract where it touches, or leave starts_at_contact out"),
}
_SIGNS = (_A_STEP, "a drift", "a late touch")
"""What may be a sign of those before, and is told only where there are none."""


def steps_of(trials: Sequence[Segmentation]) -> dict[str, tuple[float, float]]:
    """Return where (mm after contact) and by how much (N) the force steps, by the trials that have the step.

    There is none that C10 hardly feels. What shows one like the best, but not surely, has that.
    """
    found = {press.trial.name: _step(press) for press in presses_of(trials)}
    surely = {name: one for name, one in found.items() if abs(one.size) > _SURE * one.error}
    if not surely:
        return {}
    best = max(surely.values(), key=lambda one: abs(one.size) / one.error)
    seen = {name: best for name, one in found.items() if one.size / best.size > _ALIKE} | surely
    moved = sum(abs(one.effect) for one in seen.values()) / len(found)
    return {name: (one.place, one.size) for name, one in seen.items()} if moved > 0.5 * LEAST_EFFECT else {}


def instrument_doubts(trials: Sequence[Segmentation]) -> Iterator[Doubt]:
    """Yield the faults that C10 can't bear, the worst first; of a leg's trials in their mean, of specimens in each."""
    presses = presses_of(trials)
    for group in [presses] if all(one.trial.scales is LEG for one in presses) else [[one] for one in presses]:
        found = (*_of_each(group), *(_among(group) if len(group) > 1 else ()))
        yield from sorted(found, key=lambda one: -abs(one.effect_on_C10 or 0.0))


def repeat_doubts(trials: Sequence[Segmentation]) -> Iterator[Doubt]:
    """Yield what presses of one specimen say of those at like speed."""
    presses, like = presses_of(trials), (1.0 / _LIKE_SPEED, _LIKE_SPEED)
    for one in presses:
        group = [two for two in presses if like[0] <= two.trial.loading.speed / one.trial.loading.speed <= like[1]]
        if len(group) > 1 and group[0] is one:
            yield from _among(group)


def _doubt(press: Press, problem: str, effect: float, remedy: str, kind: str) -> Doubt:
    by = f"up to {100 * abs(effect):.0f} %" if abs(effect) < 1 else "a factor of two or more"
    moved = f"too {'high' if effect > 0 else 'low'} by {by}"
    allowed = kind == _A_STEP and press.trial.scales is LEG
    moved = f"C10 would be {moved} if nothing allowed for it" if allowed else f"C10 is {moved}"
    return Doubt(press.trial.source, "force_N", f"{problem}; {moved}", remedy, kind, effect)


def _of_each(presses: Sequence[Press]) -> Iterator[Doubt]:
    """Yield faults whose mean over the trials counts, or that of one trial by itself."""
    told = False
    for name, (look, remedy) in _KINDS.items():
        found = [(one, press) for press in presses if np.isfinite((one := look(press)).error)]
        if not found or (told and name in _SIGNS):
            continue
        sizes, errors, effects = np.array([one[:3] for one, _ in found]).T
        mean, count, effect = float(sizes.mean()), len(found), float(effects.mean())
        alone = [Fault(one.size, one.error, one.effect / count) for one, _ in found]
        if not (of_all := Fault(mean, float(np.linalg.norm(errors)) / count, effect)).counts:
            # What is in one trial, or of another sign in each, is none of their mean.
            of_all = max(alone, key=lambda one: abs(one.effect) * one.counts)
            mean, effect = of_all.size, of_all.effect
        if of_all.counts:
            told = True
            worst, press = found[int(np.argmax(sizes * np.sign(mean)))]
            have = np.count_nonzero(sizes / worst.size > _ALIKE)
            many = f" (so {'in all' if have == count else f'in {have} of'} {count} trials)" * (count > 1)
            yield _doubt(press, f"{worst.text}{many}", effect, remedy, name)


def _ratios(presses: Sequence[Press], repeat: float) -> Iterator[tuple[float, float]]:
    """Yield each trial's force over the mean of the others', and the standard error with that of a sound repeat."""
    depth, count = min(one.depth for one in presses), len(presses)
    for one in presses:
        near = one.at <= depth
        others = np.mean([np.interp(one.at[near], p.at, p.force) for p in presses if p is not one], axis=0)
        weighed = np.linalg.solve(one.covariance(one.force)[np.ix_(near, near)] + one.slow**2, others)
        known = float(weighed @ others) or np.finfo(float).tiny  # nothing beside a trial that is beyond all numbers
        yield float(weighed @ one.force[near]) / known, float(np.sqrt(repeat**2 + count / (count - 1) / known))


def _among(presses: Sequence[Press]) -> Iterator[Doubt]:
    """Yield that each trial is softer than the one before, or one higher or lower than the others."""
    speeds, count = [one.trial.loading.speed for one in presses], len(presses)
    repeat = _REPEAT if max(speeds) <= _LIKE_SPEED * min(speeds) else _OF_SPEED
    ratios, errors = np.array([*_ratios(presses, repeat)]).T
    of_mean, of_tissue = count * ratios / (count - 1 + ratios), presses[0].of_tissue
    if count > 2 and (np.diff(of_mean) < -repeat).all() and of_mean[0] > (1 + _SURE * repeat) * of_mean[-1]:
        each = ", ".join(f"{share:.2g}" for share in of_mean / of_mean[0])
        problem = f"each trial is softer than the one before ({each} of the first): preconditioning, slip or damage"
        remedy = "identify from the trials of one state, the first or the last, and say which"
        yield _doubt(presses[0], problem, float(of_mean[0] - 1) / of_tissue, remedy, "trials that soften")
        return
    k = int(np.argmax(np.abs(ratios - 1)))
    found = Fault(float(ratios[k] - 1), float(errors[k]), float(ratios[k] - 1) / count / of_tissue)
    if found.counts:
        problem = f"is {ratios[k]:.2g} times that of the other trials: so it is not a repeat"
        remedy = "keep one leg, posture, unit and gain in a folder, or remove the trial that is off"
        yield _doubt(presses[k], problem, found.effect, remedy, "trials that differ")
