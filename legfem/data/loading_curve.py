"""Mean of the repeats of one press, as people are shown it, and how repeats tell of each other's first contact."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.data.contact import Contact
from legfem.data.noise import UNSTATED, Instrument
from legfem.data.phases import LOADING
from legfem.data.recording import Recording
from legfem.data.segmentation import Segmentation, segment
from legfem.data.smoothing import local_line, smooth_displacement

_STEP_MM = 0.25
"""Step of the grid."""
_SMOOTHED_FROM = 5
"""Samples of a stretch of loading, below which it isn't used."""


@dataclass(frozen=True, eq=False)
class LoadingCurve:
    """Mean of the trials' loading, on a grid of displacement after first contact."""

    displacement: FloatArray
    """(n,), mm; starts one step after first contact, where the force is zero by definition."""
    force: FloatArray
    """(n,), N."""
    force_sd: FloatArray
    """(n,), N: standard error of ``force``, by the readings' noise and the trials' differences."""
    trial_force: FloatArray
    """(R, n), N: each trial's own curve."""
    white_sd: float
    """Sample-to-sample noise of a force reading, N."""
    contacts: tuple[Contact, ...]

    @property
    def n_trials(self) -> int:
        """Number R of trials."""
        return len(self.trial_force)

    def down_to(self, depth: float) -> "LoadingCurve":
        """Return the curve as far as a depth, mm."""
        n = int((self.displacement <= depth + 1e-9).sum())
        names = ("displacement", "force", "force_sd", "trial_force")
        return replace(self, **{name: getattr(self, name)[..., :n] for name in names})


def mean_loading_curve(trials: Sequence[Segmentation]) -> LoadingCurve:
    """Bring repeated trials to one loading curve.

    Of each trial the samples count that lie after first contact, belong to loading and go deeper than any before.
    Displacement is smoothed over time (else its noise would flatten the curve) and counted from first contact; force
    is counted from its baseline in air where there was air (see `legfem.data.contact.first_contact`). A grid value is a
    straight-line fit within half a step either side: no interpolation of noisy samples. The grid ends where the
    shallowest trial does; trials less than half as deep as the deepest aren't in the mean. What readings err by when a
    model is fitted is another matter: `legfem.inverse.errors`.

    Parameters
    ----------
    trials : sequence of Segmentation
        At least one, all of one instrument.

    Raises
    ------
    InputError
        If there is no recording, or one has too little loading for the grid.
    """
    if not trials:
        raise InputError("recordings", "*.csv", "there are none", "give at least one trial")
    every = [_loaded(one) for one in trials]
    loaded = [one for one in every if one[0][-1] > 0.5 * max(depth[-1] for depth, _ in every)]
    deepest = min(float(depth[-1]) for depth, _ in loaded)
    # A trial to 20 mm ends at 19.99 or 20.01 by its sensor: a tenth of a step doesn't count.
    grid = _STEP_MM * np.arange(1, int(np.floor(deepest / _STEP_MM + 0.1)) + 1)
    if len(grid) < 4:
        shortest = trials[int(np.argmin([depth[-1] for depth, _ in every]))]
        problem = f"{deepest:.2f} mm of loading are too short to identify from"
        raise InputError(shortest.source, "displacement_mm", problem, "press deeper, or remove this trial")
    fits = [local_line(depth, force, grid, 0.5 * _STEP_MM) for depth, force in loaded]
    curves = np.vstack([fit.value for fit in fits])
    white = float(np.sqrt(np.mean([one.force_noise**2 for one in trials])))
    variance = white**2 * np.mean([fit.leverage for fit in fits], axis=0)
    if len(loaded) > 1:
        variance = np.maximum(variance, np.var(curves, axis=0, ddof=1))
    return LoadingCurve(
        displacement=frozen_array(grid),
        force=frozen_array(curves.mean(axis=0)),
        force_sd=frozen_array(np.sqrt(variance / len(loaded))),
        trial_force=frozen_array(curves),
        white_sd=white,
        contacts=tuple(one.contact for one in trials),
    )


def _loaded(trial: Segmentation) -> tuple[FloatArray, FloatArray]:
    """Return depths (mm after first contact, rising) and forces (N above the baseline) deeper than any before.

    Raises
    ------
    InputError
        If there is no loading after contact.
    """
    recording, loading = trial.recording, trial.labels == LOADING
    # Smoothing mustn't run over the motion's corners: each stretch by itself.
    edges = np.flatnonzero(np.diff(loading.astype(int), prepend=0, append=0))
    smooth, used = recording.displacement.copy(), loading.copy()
    for start, end in edges.reshape(-1, 2):
        if end - start < _SMOOTHED_FROM:
            used[start:end] = False
            continue
        part = slice(start, end)
        smooth[part], _ = smooth_displacement(recording.time[part], recording.displacement[part], trial.scales.way)
    depth = smooth - trial.contact.displacement
    reached = np.maximum.accumulate(np.where(used, depth, -np.inf))
    virgin = used & (depth >= reached - trial.displacement_noise) & (depth >= 0)
    if np.count_nonzero(virgin) < _SMOOTHED_FROM:
        problem = "there is no loading after contact"
        raise InputError(trial.source, "displacement_mm", problem, "press deeper, or remove this trial")
    order = np.argsort(depth[virgin], kind="stable")
    return depth[virgin][order], (recording.force - trial.contact.baseline)[virgin][order]


_LEVELS = np.linspace(0.1, 0.4, 7)
"""Shares of the least peak at which depths are compared, near contact and above the noise."""
_STIFFNESS_SD = 0.05
"""Standard deviation of a repeat's stiffness, relative."""
_DEPTH_SD_MM = 0.05
"""Standard deviation of the depth at a force."""
_FEWEST = 8
"""Samples of loading."""


def segment_all(
    recordings: Sequence[Recording], instrument: Instrument = UNSTATED, starts_at_contact: bool = False
) -> tuple[Segmentation, ...]:
    """Read the recordings of one leg and one instrument; see `segment`."""
    return among_repeats([segment(one, instrument, starts_at_contact) for one in recordings])


def among_repeats(trials: Sequence[Segmentation]) -> tuple[Segmentation, ...]:
    """Return repeats of one press, each's first contact known no better than the others' agree with it.

    Where contact is put too late by some way, a force is reached that much less deep after it than in the others.
    """
    if len(trials) < 2 or min(len(one.loading.force) for one in trials) < _FEWEST:
        return tuple(trials)
    peak = min(float(np.max(one.loading.force)) for one in trials)
    depths = np.array([_depths(one, peak * _LEVELS) for one in trials])
    found = []
    for k, one in enumerate(trials):
        others = np.delete(depths, k, axis=0).mean(axis=0)
        # A repeat that is stiffer differs in proportion to the depth, one whose contact is elsewhere by one way.
        design = np.column_stack([np.ones_like(others), _STIFFNESS_SD * others])
        sd = _DEPTH_SD_MM * one.scales.way
        design = np.vstack([design / sd, [0.0, 1.0]])
        left = np.append((depths[k] - others) / sd, 0.0)
        apart = abs(float(np.linalg.lstsq(design, left)[0][0]))
        known = one.contact.known or not apart > one.contact.displacement_error
        found.append(one if known else one.touching(replace(one.contact, displacement_error=apart)))
    return tuple(found)


def _depths(trial: Segmentation, forces: FloatArray) -> FloatArray:
    """Return the displacements after contact (m,), mm, at which forces (m,) are first exceeded for good."""
    loading, way = trial.loading, trial.scales.way
    order = np.argsort(loading.displacement, kind="stable")
    d, force = loading.displacement[order], loading.force[order]
    grid = np.linspace(d[0], d[-1], 200)
    return np.asarray(np.interp(forces, np.maximum.accumulate(local_line(d, force, grid, 0.25 * way).value), grid))
