"""How good a recording is: rates, gaps, steps, saturation, drops, noise, and a grade."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.contact import Contact, find_first_contact
from legfem.data.plausibility import cut_off
from legfem.data.reader import MINIMAL_DEPTH_MM, check_recording
from legfem.data.recording import Recording
from legfem.data.segmentation import LOADING, split_phases
from legfem.data.smoothing import sample_noise, smooth_displacement

# Of the force's range; a load cell of 500 N with 16 bit reads a leg's 10 N in steps of 0.15 %.
_COARSE, _VERY_COARSE = 0.005, 0.02
_NOISY, _VERY_NOISY = 0.005, 0.02
_FEW_SAMPLES, _VERY_FEW_SAMPLES = 100, 40
_MANY_DROPPED = 0.02
_DROP_SHARE = 0.05
_SATURATED_SAMPLES = 10
_NEIGHBOURS = 9
ANY_DEPTH = 0.0
"""mm, of which specimens ask no more."""
GRADES = {"A": "nothing to say", "B": "usable", "C": "look at it first", "D": "not to be used"}
"""What grades mean."""
BEST_GRADE = "A"


@dataclass(frozen=True)
class Part:
    """A phase of a recording."""

    phase: str
    start: float
    """s."""
    end: float
    """s."""
    first: float
    """mm."""
    last: float
    """mm."""

    @property
    def rate(self) -> float:
        """Speed, mm/s."""
        return (self.last - self.first) / max(self.end - self.start, 1e-12)


@dataclass(frozen=True)
class Quality:
    """What a recording shows of its instrument."""

    parts: tuple[Part, ...]
    contact: Contact
    sampling: float
    """Hz."""
    dropped: int
    """Samples missing between the others."""
    force_step: float
    """Smallest step of the force, N."""
    displacement_step: float
    """Smallest step of the displacement, mm."""
    force_noise: float
    """N, from sample to sample."""
    displacement_noise: float
    """mm, from sample to sample."""
    saturated: int
    """Samples of the longest stretch at exactly the greatest or smallest force, or at the end of
    the loading with a force that is level within its noise."""
    drops: tuple[float, ...]
    """Times (s) of sudden falls of the force while loading."""
    grade: str
    """One of `GRADES`."""
    reasons: tuple[str, ...]


def quality_of(recording: Recording, minimal_depth: float = MINIMAL_DEPTH_MM) -> Quality:
    """Return what a recording shows of its instrument, and a grade of it.

    Parameters
    ----------
    recording
        Of one trial.
    minimal_depth
        mm, less of which after contact shows no stiffness: of a leg; `ANY_DEPTH` for a specimen.
    """
    contact = find_first_contact(recording)
    labels = split_phases(recording, contact)
    smooth, _ = smooth_displacement(recording.time, recording.displacement)
    edges = [0, *(int(k) + 1 for k in np.flatnonzero(labels[1:] != labels[:-1])), len(labels)]
    parts = tuple(
        Part(
            str(labels[a]),
            float(recording.time[a]),
            float(recording.time[b - 1]),
            float(smooth[a]),
            float(smooth[b - 1]),
        )
        for a, b in pairwise(edges)
    )
    steps = np.diff(recording.time)
    step = float(np.median(steps))
    # Beside their neighbours: an instrument may sample a hold more slowly than the loading.
    near = median_filter(steps, _NEIGHBOURS, mode="nearest")
    dropped = int(np.sum(np.maximum(np.round(steps / near) - 1, 0)))
    span = float(np.ptp(recording.force))
    force_noise = sample_noise(recording.force)
    in_loading = labels == LOADING
    saturated = max(
        _at_rail(recording.force, 1.0),
        _at_rail(recording.force, -1.0),
        _level_at_end(smooth[in_loading], recording.force[in_loading]),
    )
    found = (_smallest_step(recording.force), _smallest_step(recording.displacement))
    drops = _drops(recording, in_loading, force_noise)
    loading = int(np.count_nonzero(in_loading))
    judged: list[tuple[str, str]] = []

    def judge(value: float, little: float, much: float, reason: str) -> None:
        if value > little:
            judged.append(("C" if value > much else "B", reason))

    try:
        check_recording(recording, minimal_depth)
    except InputError as error:
        judged.append(("D", f"{error.field}: {error.problem}"))
    if saturated >= _SATURATED_SAMPLES:
        judged.append(("D", f"the force stays at its limit for {saturated} samples: saturated"))
    if drops:
        judged.append(("C", f"the force drops suddenly at {drops[0]:.4g} s ({len(drops)} times)"))
    share = dropped / (len(recording) + dropped)
    judge(share, 0.0, _MANY_DROPPED, f"{dropped} samples dropped ({100 * share:.2g} %)")
    judge(
        found[0] / span,
        _COARSE,
        _VERY_COARSE,
        f"the force comes in steps of {found[0]:.2g} N, {100 * found[0] / span:.2g} % of its range",
    )
    judge(
        force_noise / span,
        _NOISY,
        _VERY_NOISY,
        f"the force's noise is {force_noise:.2g} N, {100 * force_noise / span:.2g} % of its range",
    )
    judge(-loading, -_FEW_SAMPLES, -_VERY_FEW_SAMPLES, f"only {loading} samples of loading")
    return Quality(
        parts,
        contact,
        1 / step,
        dropped,
        *found,
        force_noise,
        sample_noise(recording.displacement),
        saturated,
        drops,
        max((grade for grade, _ in judged), default=BEST_GRADE),
        tuple(f"{grade}: {reason}" for grade, reason in judged) or ("A: nothing to say",),
    )


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
    edges = np.flatnonzero(np.diff(top.astype(int), prepend=0, append=0)).reshape(-1, 2)
    longest = int(max(b - a for a, b in edges))
    # At rest a noiseless cell reads one value too; a limit cuts off what rises.
    start = int(edges[np.argmax(edges[:, 1] - edges[:, 0])][0])
    before = values[max(0, start - longest) : start]
    rises = len(before) > 2 and values[start] - before[0] > 0.02 * float(np.ptp(values))
    return longest if rises else 0


def _level_at_end(displacement: FloatArray, force: FloatArray) -> int:
    """Return the samples at the end of a loading in which the force rises no more."""
    way = cut_off(displacement, force) if len(force) else 0.0
    return int(np.count_nonzero(displacement >= displacement[-1] - way)) if way else 0


def _drops(recording: Recording, loading: NDArray[np.bool_], noise: float) -> tuple[float, ...]:
    change = np.diff(recording.force)
    least = max(_DROP_SHARE * float(np.ptp(recording.force)), 8.0 * noise)
    sudden = np.flatnonzero((change < -least) & loading[1:] & loading[:-1])
    return tuple(float(t) for t in recording.time[sudden + 1])
