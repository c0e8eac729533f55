"""What readings can't have been: a clock that counts rows, a cell at its limit, a spike, an offset, a drift, a copy."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from legfem.common.errors import Doubt, InputError
from legfem.common.units import FloatArray, runs_of
from legfem.data.contact import LEG
from legfem.data.instrument_faults import instrument_doubts
from legfem.data.ranges import RANGES
from legfem.data.recording import Recording
from legfem.data.segmentation import Segmentation
from legfem.data.smoothing import sample_noise, without_outliers

_MANY_ROWS = 200
"""Rows of loading that would take minutes with one a second."""
_LEVEL_SHARES = np.geomspace(0.02, 0.7, 40)
"""Shares of a loading's way that may be level at its end."""
_LEVEL_EXACTLY = 0.1
"""Share of a loading's way over which one value to the last digit is no chance."""
# No level end is found so on 98 public recordings of beef and silicone.
_FEW = 8
"""Fewest samples of a level end."""
_LEVEL = 0.1
"""Largest rise of a level end over that before it."""
_OF_NOISE = 2.0
"""Largest scatter of a level end over the noise."""
_BEYOND_NOISE = 6.0
"""Least rise before a level end over the noise."""
_SPIKE = 0.15
"""Share of the force's range that a spike exceeds: corners of loadings sampled at 10 Hz have up to 0.07."""
_OFF_START = 0.05
"""Share of the travel at which a displacement that counts from first touch may start."""
_JUMP = 0.08
"""Share of the travel that no drive goes from one sample to the next."""
_LEVEL_FORCE = 0.03
"""Share of the force's range within which it stays as it is while the displacement jumps."""
_TIMES_STEP = 12.0
"""Times the median step that no drive goes, nor clock leaves out, from one sample to the next."""
_GAP = 0.1
"""Share of the travel of the loading that may go by unrecorded."""


def trial_doubts(trials: Sequence[Segmentation]) -> Iterator[Doubt]:
    """Yield what is unlikely in recordings of one instrument, whatever was pressed.

    Raises
    ------
    InputError
        For a displacement that jumps.
    """
    for trial in trials:
        _refuse_jump(trial)
        yield from _spike_doubts(trial)
        yield from _gap_doubts(trial)
        yield from _joined_doubts(trial)
        yield from start_doubts(trial)
    yield from instrument_doubts(trials)


GIVE_COLUMNS = "choose their columns under Columns in the app, or give [recordings], which `legfem data look` writes"
"""What to do with instruments' files that a described folder doesn't say how to read."""


def unread_doubts(folder: Path, unread: Sequence[Path], remedy: str) -> Iterator[Doubt]:
    """Yield a doubt about files in a folder of recordings that nothing reads, if there are any."""
    if unread:
        names = ", ".join(path.name for path in unread[:5])
        what = f"{names} {'is' if len(unread) == 1 else 'are'} not read"
        yield Doubt(str(folder), "recordings", what, f"{remedy}, or {GIVE_COLUMNS}")


def pull_doubts(trial: Segmentation) -> Iterator[Doubt]:
    """Yield a doubt about a recording of a leg, which is pressed, whose columns are called a pull's."""
    if trial.recording.pulled:
        remedy = 'of a specimen give direction = "tension" in specimen.toml; of a leg export the press'
        yield Doubt(trial.source, "recordings", "has a pull's column names, and is read as a press", remedy)


def magnitude_doubts(trial: Segmentation) -> Iterator[Doubt]:
    """Yield doubts about a travel, speed and force that no press or pull of soft tissue has: a unit that isn't true.

    Where no section and no specimen's size is known: a leg's test is compared with legs', any other with what labs do.
    """
    if not trial.recording.timed:
        return
    d, force, time = trial.smooth, trial.recording.force, trial.recording.time
    travel, rise = float(np.ptp(d)), float(np.ptp(without_outliers(force)))
    moving = np.abs(np.diff(d)) > 0.1 * np.abs(np.diff(d)).max()
    speed = float(np.median(np.abs(np.diff(d) / np.diff(time))[moving])) if moving.any() else 0.0
    if travel == 0 or speed == 0:
        return
    of_leg = trial.scales is LEG
    of = "leg" if of_leg else "specimen"
    if of_leg:
        yield from pull_doubts(trial)
    ways, speeds, stiffness = (RANGES[f"{what}_of_{of}"] for what in ("travel", "drive", "force"))
    yield from ways.likely(trial.source, "displacement_mm", travel)
    yield from speeds.likely(trial.source, "time_s", speed)
    other = "; of a specimen, run again with --specimens" if of_leg else ""
    size = rise / travel if of_leg else rise / travel**2
    yield from stiffness.likely(trial.source, "force_N", size, f"check its unit in the file{other}")


def loading_doubts(
    source: str, time: FloatArray, displacement: FloatArray, force: FloatArray, least_level: float = 0.0
) -> Iterator[Doubt]:
    """Yield what is unlikely in a loading (n,); ``least_level`` is the share of its way that may be level."""
    if len(time) > _MANY_ROWS and np.allclose(np.diff(time), 1.0, 0.0, 1e-6):
        remedy = "divide it by the sampling rate in Hz, or confirm that there was one a second"
        yield Doubt(source, "time_s", "goes up by exactly 1 from row to row, as a count of samples", remedy)
    way = cut_off(displacement, force)
    if way > least_level * float(displacement.max()):
        problem = f"stays at {force.max():.3g} N for the last {way:.2g} mm of loading"
        problem += ", as a load cell or an amplifier at its limit does"
        yield Doubt(source, "force_N", problem, "use a larger range, or remove what lies beyond")


def _refuse_jump(trial: Segmentation) -> None:
    d, force = without_outliers(trial.recording.displacement), trial.recording.force
    steps = np.diff(d)
    # A coarse encoder stands still between its steps.
    step = float(np.median(np.abs(steps[steps != 0]))) if steps.any() else 0.0
    far = max(_JUMP * float(np.ptp(d)), _TIMES_STEP * step, 8.0 * trial.displacement_noise)
    level = max(_LEVEL_FORCE * float(np.ptp(force)), 5.0 * trial.force_noise)
    # While nothing is pressed a drive may go back at any speed.
    pressed = np.minimum(force[1:], force[:-1]) - force.min() > 3.0 * level
    jumps = np.flatnonzero((np.abs(steps) > far) & (np.abs(np.diff(force)) < level) & pressed)
    if len(jumps):
        k = int(jumps[0])
        problem = f"jumps from {d[k]:.4g} to {d[k + 1]:.4g} mm at {trial.recording.time[k + 1]:.4g} s"
        problem += ", and the force stays as it is: a sensor or a counter that was reset"
        remedy = f"add {d[k] - d[k + 1]:.4g} mm to what follows, or keep the part before it"
        raise InputError(trial.source, f"displacement_mm, row {k + 2} of {len(d)}", problem, remedy)


_JOINED = 0.3
"""Share of the whole way and force by which both go back where a second press begins."""


def _gap_doubts(trial: Segmentation) -> Iterator[Doubt]:
    """Yield a doubt about a part of the loading that wasn't recorded."""
    time, d = trial.recording.time[: trial.deepest + 1], trial.smooth[: trial.deepest + 1]
    if not trial.recording.timed or len(time) < _FEW:
        return
    steps, way = np.diff(time), np.diff(d)
    gaps = np.flatnonzero((steps > _TIMES_STEP * float(np.median(steps))) & (way > _GAP * float(d[-1] - d[0])))
    if len(gaps):
        k = int(gaps[0])
        problem = f"nothing was recorded between {time[k]:.4g} and {time[k + 1]:.4g} s of the loading"
        problem += f", from {d[k]:.3g} to {d[k + 1]:.3g} mm"
        yield Doubt(trial.source, "time_s", problem, "export the whole test, or keep the part before the gap")


def _joined_doubts(trial: Segmentation) -> Iterator[Doubt]:
    """Yield a doubt about several presses that were put one behind the other in a file."""
    d, force = trial.recording.displacement, trial.recording.force
    back = (np.diff(d) < -_JOINED * np.ptp(d)) & (np.diff(force) < -_JOINED * np.ptp(force))
    deep = d[0] + 0.5 * float(np.ptp(d))
    joins = [int(k) for k in np.flatnonzero(back) if (d[k + 1 :] > deep).any()]
    if joins:
        k = joins[0]
        at = f"at {trial.recording.time[k]:.4g} s, and the force with it"
        problem = f"goes from {d[k]:.3g} to {d[k + 1]:.3g} mm from one reading to the next, {at}"
        problem += f": {len(joins) + 1} presses are in one file"
        yield Doubt(trial.source, "displacement_mm", problem, "save each press in a file of its own")


def start_doubts(trial: Segmentation) -> Iterator[Doubt]:
    """Yield a doubt about where displacement begins; raise InputError where it can't be from first touch."""
    d, contact = trial.smooth, trial.contact
    travel, start, deepest = float(d.max() - d[0]), float(d[0]), float(d.max())
    if contact.known and abs(start) > max(_OFF_START * travel, 5.0 * trial.instrument.displacement_sd):
        problem = f"starts at {start:.3g} mm, where starts_at_contact says that it counts from first touch: the press "
        problem += f"is taken to be {deepest:.3g} mm deep, and would be {travel:.3g} mm if it touches where it starts"
        remedy = "subtract where it touches, or leave starts_at_contact out"
        found = Doubt(trial.source, "displacement_mm", problem, remedy)
        yield from found.refused_if(abs(start) > (LEG.depth if trial.scales is LEG else travel))


def cut_off(displacement: FloatArray, force: FloatArray) -> float:
    """Return the way (mm) of a loading in which the force was cut off; 0 where it wasn't.

    Parameters
    ----------
    displacement, force
        (n,), mm and N, of a loading.
    """
    top = force >= force.max()
    exactly = max(float(displacement[end - 1] - displacement[start]) for start, end in runs_of(top) if top[start])
    few = _LEVEL_EXACTLY * float(np.ptp(displacement))
    return max(exactly if exactly > few else 0.0, _level_at_end(displacement, force))


def _level_at_end(displacement: FloatArray, force: FloatArray) -> float:
    """Return the way (mm) at the end of a loading in which the force rises no more.

    Soft tissue stiffens, so a force that is level within its noise, and rose before by far more
    than that in as long a way, was cut off.
    """
    noise = max(sample_noise(force), 1e-9 * float(np.ptp(force)))
    left, found = displacement[-1] - displacement, 0.0
    for way in float(np.ptp(displacement)) * _LEVEL_SHARES:
        end, before = left <= way, (left > way) & (left <= 2 * way)
        if min(np.count_nonzero(end), np.count_nonzero(before)) < _FEW:
            continue
        rise, rose = (way * _slope(displacement[part], force[part]) for part in (end, before))
        is_level = abs(rise) < _LEVEL * rose and np.std(force[end]) < _OF_NOISE * noise
        if is_level and rose > _BEYOND_NOISE * noise:
            found = way
    return found


def _slope(displacement: FloatArray, force: FloatArray) -> float:
    """Return the slope of the straight line through a part of a loading, N/mm."""
    away = displacement - displacement.mean()
    square = float(away @ away)
    return float(away @ force) / square if square > 0 else 0.0


def _spike_doubts(trial: Segmentation) -> Iterator[Doubt]:
    """Yield a doubt about a force that is far from two before it and two after it, which lie together."""
    force = trial.recording.force
    if len(force) < 5:
        return
    around = np.lib.stride_tricks.sliding_window_view(force, 5)
    middle = np.median(around, axis=1)
    off = np.abs(force[2:-2] - middle)
    together = np.ptp(np.delete(around, 2, axis=1), axis=1) < 0.5 * off
    off = np.where(together, off, 0.0)
    worst = int(np.argmax(off))
    if off[worst] > _SPIKE * np.ptp(middle):
        reading = f"{force[worst + 2]:.4g} N at {trial.recording.time[worst + 2]:.4g} s"
        problem = f"one reading, {reading}, differs from all around it"
        yield Doubt(trial.source, "force_N", problem, "remove the row if it is a disturbance")


_SAME_NOISE = 0.95
"""Least rank correlation of two copies' noise."""
_LEAST_NOISE_N = 5e-4
"""Below it noise may be no more than rounding, which copies and repeats share."""
_FEWEST = 20
"""Fewest samples that can be compared."""
_LIKE_SIGNS = 0.7
"""Least share of changes of slope with like signs in copies: a quick look before the ranks."""


def refuse_copies(other: Recording, recordings: Sequence[Recording]) -> None:
    """Check that a recording is no copy of others: moved in time, scaled, thinned or resampled.

    Raises
    ------
    InputError
        For two that share their noise, which no repeat does.
    """
    for one in recordings:
        n = min(len(one), len(other))
        pairs = [(one.force[:n], other.force[:n]), _at_times(one, other), _at_times(other, one)]
        if np.array_equal(one.force, other.force) or any(_share_noise(*pair) for pair in pairs):
            named = one.trial if one.trial != other.trial or one.source is None else "/".join(one.source.parts[-2:])
            problem = f"is a copy of {named}: the two have the same noise, which no repeat has"
            remedy = "remove one of them; with a copy the result looks more certain than it is"
            raise InputError(str(other.source or other.trial), "force_N", problem, remedy)


def _at_times(one: Recording, other: Recording) -> tuple[FloatArray, FloatArray]:
    """Return the force of one, and of another, at the other's times since its start."""
    since, asked = one.time - one.time[0], other.time - other.time[0]
    within = asked <= since[-1]
    return np.interp(asked[within], since, one.force), other.force[within]


def _share_noise(a: FloatArray, b: FloatArray) -> bool:
    a2, b2 = np.diff(a, 2), np.diff(b, 2)
    if len(a) < _FEWEST or np.mean(a2 * b2 > 0) < _LIKE_SIGNS:
        return False
    if min(sample_noise(a), sample_noise(b)) <= _LEAST_NOISE_N:
        return False
    from scipy.stats import spearmanr

    # By ranks: one jump that both trials share is no noise.
    return bool(spearmanr(a2, b2).statistic > _SAME_NOISE)
