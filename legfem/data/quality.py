"""How good a recording is: rates, gaps, steps, saturation, drops, noise, and a grade."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, runs_of
from legfem.data.phases import LOADING
from legfem.data.plausibility import cut_off
from legfem.data.segmentation import Segmentation

_COARSE, _VERY_COARSE = 0.005, 0.02
"""Steps of the force over its range for grades B and C; a cell of 500 N with 16 bit reads a leg's 10 N in 0.15 %."""
_NOISY, _VERY_NOISY = 0.005, 0.02
"""Noise of the force over its range for grades B and C."""
_FEW_SAMPLES, _VERY_FEW_SAMPLES = 100, 40
"""Samples of loading for grades B and C."""
_MANY_DROPPED = 0.02
"""Share of dropped samples for grade C."""
_DROP_SHARE = 0.05
"""Share of the force's range by which a sudden drop falls."""
_SATURATED_SAMPLES = 10
"""Samples at the limit that show saturation."""
_NEIGHBOURS = 9
"""Steps of time whose median a step is compared with."""
MINIMAL_SAMPLES = 20
"""Fewest samples of a loading."""
GRADES = {"A": "good", "B": "usable", "C": "look at it first", "D": "not to be used"}
"""What grades mean."""
BEST_GRADE, WORST_GRADE = "A", "D"


@dataclass(frozen=True)
class Quality:
    """What a recording shows of its instrument."""

    trial: Segmentation
    sampling: float
    """Hz."""
    dropped: int
    """Samples missing between the others."""
    force_step: float
    """Smallest step of the force, N."""
    displacement_step: float
    """Smallest step of the displacement, mm."""
    saturated: int
    """Samples of the longest stretch at exactly the greatest or smallest force, or at the end of
    the loading with a force that is level within its noise."""
    drops: tuple[float, ...]
    """Times (s) of sudden falls of the force while loading."""
    grade: str
    """One of `GRADES`."""
    judged: tuple[tuple[str, str], ...]
    """What limits it: a grade each, and why."""

    @property
    def reasons(self) -> tuple[str, ...]:
        """Grades and why, as lines."""
        return tuple(f"{grade}: {why}" for grade, why in self.judged) or ("A: good",)


def quality_of(trial: Segmentation) -> Quality:
    """Return what a recording shows of its instrument, and a grade of it."""
    recording, in_loading, force_noise = trial.recording, trial.labels == LOADING, trial.force_noise
    steps = np.diff(recording.time)
    step = float(np.median(steps))
    # Beside their neighbours: an instrument may sample a hold more slowly than the loading.
    near = median_filter(steps, _NEIGHBOURS, mode="nearest")
    dropped = int(np.sum(np.maximum(np.round(steps / near) - 1, 0)))
    span = float(np.ptp(recording.force))
    d, force = trial.smooth[in_loading], recording.force[in_loading]
    cut = cut_off(d, force) if len(force) else 0.0
    level = int(np.count_nonzero(d >= d[-1] - cut)) if cut else 0
    saturated = max(_at_rail(recording.force, 1.0), _at_rail(recording.force, -1.0), level)
    found = (_smallest_step(recording.force), recording.step or _smallest_step(recording.displacement))
    sudden = np.diff(recording.force) < -max(_DROP_SHARE * span, 8.0 * force_noise)
    drops = tuple(recording.time[1:][sudden & in_loading[1:] & in_loading[:-1]].tolist())
    loading = int(np.count_nonzero(in_loading))
    judged: list[tuple[str, str]] = []

    def judge(value: float, little: float, much: float, reason: str) -> None:
        if value > little:
            judged.append(("C" if value > much else "B", reason))

    try:
        check_trial(trial)
    except InputError as error:
        judged.append((WORST_GRADE, f"{error.field}: {error.problem}"))
    if recording.torn:
        judged.append(("B", f"it tears, or slips, at {trial.smooth[-1]:.3g} mm: the part before is used"))
    if saturated >= _SATURATED_SAMPLES:
        judged.append((WORST_GRADE, f"the force stays at its limit for {saturated} samples: saturated"))
    if drops:
        judged.append(("C", f"the force drops suddenly at {drops[0]:.4g} s ({len(drops)} times)"))
    share = dropped / (len(recording) + dropped)
    judge(share, 0.0, _MANY_DROPPED, f"{dropped} samples dropped ({100 * share:.2g} %)")
    share, told = found[0] / span, f"steps of {found[0]:.2g} N"
    judge(share, _COARSE, _VERY_COARSE, f"the force comes in {told}, {100 * share:.2g} % of its range")
    share, told = recording.step / float(np.ptp(recording.displacement)), f"steps of {recording.step:.2g} mm"
    judge(share, _COARSE, _VERY_COARSE, f"the displacement comes in {told}, {100 * share:.2g} % of its range")
    share, told = force_noise / span, f"{force_noise:.2g} N"
    judge(share, _NOISY, _VERY_NOISY, f"the force's noise is {told}, {100 * share:.2g} % of its range")
    judge(-loading, -_FEW_SAMPLES, -_VERY_FEW_SAMPLES, f"only {loading} samples of loading")
    grade = max((grade for grade, _ in judged), default=BEST_GRADE)
    return Quality(trial, 1 / step, dropped, *found, saturated, drops, grade, tuple(judged))


def _smallest_step(values: FloatArray) -> float:
    """Return the step in which readings are taken: the small ones among distinct values."""
    levels = np.unique(values)
    if len(levels) < 2:
        return 0.0
    gaps = np.diff(levels)
    return float(np.percentile(gaps[gaps > 1e-9 * np.ptp(levels)], 5.0))


def _at_rail(force: FloatArray, sign: float) -> int:
    """Return the longest run of samples at exactly the greatest force (times a sign)."""
    values = sign * force
    top = values >= values.max()
    start, end = max((run for run in runs_of(top) if top[run[0]]), key=lambda run: run[1] - run[0])
    longest = end - start
    # At rest a noiseless cell reads one value too; a limit cuts off what rises.
    before = values[max(0, start - longest) : start]
    rises = len(before) > 2 and values[start] - before[0] > 0.02 * float(np.ptp(values))
    return longest if rises else 0


def check_trial(trial: Segmentation) -> None:
    """Check that a stiffness can be identified from a trial.

    Raises
    ------
    InputError
        If the trial has fewer than 20 samples of loading, or less of it after contact than its scales ask for,
        starts backwards, never touches, has tension for compression, or seems to be in other units.
    """
    source, recording, smooth = trial.source, trial.recording, trial.smooth
    if len(recording) < MINIMAL_SAMPLES:
        remedy = f"record at least {MINIMAL_SAMPLES} during loading"
        raise InputError(source, "rows", f"{len(recording)} samples are too few", remedy)
    _check_motion(trial)
    check_touch(trial)
    contact, way = trial.detected.displacement, trial.scales.way
    depth = float(smooth[trial.deepest]) - contact
    # Smoothing and contact are known to about the reading's noise: don't refuse for that.
    if depth < trial.scales.depth - 0.1 * way:
        problem = f"{depth:.1f} mm of loading after contact are too short to identify from"
        remedy = f"press at least {trial.scales.depth:g} mm beyond first touch"
        raise InputError(source, "displacement_mm", problem, remedy)
    samples = int(np.count_nonzero(smooth[: trial.deepest + 1] > contact))
    if samples < MINIMAL_SAMPLES:
        remedy = f"record at least {MINIMAL_SAMPLES}: sample faster or press more slowly"
        raise InputError(source, "rows", f"{samples} samples of loading after contact are too few", remedy)


def _check_motion(trial: Segmentation) -> None:
    away = trial.smooth - trial.smooth[0]
    travel, way = float(np.ptp(trial.smooth)), trial.scales.way
    if travel < 0.1 * way:
        remedy = "give displacement in mm (multiply metres by 1000), or record a deeper press"
        raise InputError(trial.source, "displacement_mm", f"changes by {travel:.3g} mm in all", remedy)
    first = np.flatnonzero(np.abs(away) > max(0.5 * way, 5.0 * trial.displacement_noise))
    if len(first) and away[first[0]] < 0:
        remedy = "let it grow towards the leg: change its sign or remove rows of moving away"
        raise InputError(trial.source, "displacement_mm", "falls at the start", remedy)


def check_touch(trial: Segmentation) -> None:
    """Check that a force rises as the displacement grows.

    Raises
    ------
    InputError
        If it falls, or stays as it is.
    """
    smooth, force, spread, least = trial.smooth, trial.recording.force, trial.force_noise, trial.scales.rise
    low, high = float(smooth.min()), float(smooth.max())
    before = max(3, int(np.argmax(smooth - smooth[0] > 0.05 * (high - low))))
    rise = float(np.median(force[smooth >= high - 0.05 * (high - low)])) - float(np.median(force[:before]))
    if rise < -5.0 * max(spread, 0.04 * least):
        remedy = "change its sign: force is positive as the test loads"
        raise InputError(trial.source, "force_N", f"falls by {-rise:.3g} N as the displacement grows", remedy)
    if rise <= max(5.0 * spread, least):
        hint = " or give force in N (multiply kN by 1000)" if 0 < rise < least else ""
        problem = f"never touches: the force changes by {rise:.2g} N, and its noise is {spread:.2g} N"
        raise InputError(trial.source, "force_N", problem, f"remove this recording, or press deeper{hint}")
