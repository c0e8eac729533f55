"""The mean loading curve of repeated trials, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.errors import InputError
from legfem.recording.contact import Contact, find_first_contact
from legfem.recording.instrument import Instrument
from legfem.recording.noise import Expectation, NoiseEstimate, estimate_noise
from legfem.recording.phases import LOADING, split_phases
from legfem.recording.smoothing import LocalLine, local_line, sample_noise, smooth_displacement
from legfem.recording.trial import Recording
from legfem.units import FloatArray, frozen_array

_ALIGNMENTS = 6

# Depth after contact (increasing), force, and the depth's leverage; each (n,).
type Branch = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LoadingCurve:
    """Mean of the trials' loading, on a grid of displacement after first contact."""

    displacement: FloatArray
    """(n,), mm; starts one step after first contact, where the force is zero by definition."""
    force: FloatArray
    """(n,), N."""
    force_sd: FloatArray
    """(n,), N: standard error of ``force``."""
    covariance: FloatArray
    """(n, n), N^2, of ``force``: its diagonal is ``force_sd``**2. Neighbours are correlated."""
    trial_force: FloatArray
    """(R, n), N: each trial's own curve."""
    n_trials: int
    n_samples: FloatArray
    """(n,): readings behind each value."""
    noise: NoiseEstimate
    contacts: tuple[Contact, ...]

    @property
    def lag1_correlation(self) -> float:
        """Mean correlation between the errors of neighbouring values."""
        sd = self.force_sd
        return float(np.mean(np.diag(self.covariance, 1) / (sd[1:] * sd[:-1])))

    @property
    def effective_samples(self) -> float:
        """How many independent values would carry as much about the curve's level."""
        correlation = self.covariance / np.outer(self.force_sd, self.force_sd)
        return float(len(self.force) ** 2 / correlation.sum())

    @property
    def spread(self) -> FloatArray:
        """(n,), N: standard deviation between trials; NaN for a single one."""
        if self.n_trials < 2:
            return np.full(len(self.force), np.nan)
        return np.asarray(np.std(self.trial_force, axis=0, ddof=1))


def mean_loading_curve(
    recordings: Sequence[Recording], instrument: Instrument, step: float = 0.25
) -> LoadingCurve:
    """Bring repeated trials to one loading curve.

    Of each trial the samples count that lie after first contact, belong to loading and go
    deeper than any before. Displacement is smoothed over time (else its noise would flatten the
    curve), shifted to first contact; force is set to its baseline in air where there was air
    (see `legfem.recording.find_first_contact`). Trials with air are then aligned with each other
    over their whole curves, keeping their contacts' mean. A grid value is a straight-line fit within half
    a step either side: no interpolation of noisy samples. The grid ends where the shallowest
    trial does. The recordings aren't changed.

    The covariance is the trials' error model (`NoiseEstimate`), with white force noise and the
    displacement's (slope times its sd, smoothed) on top, over the number of trials. Repeats
    without air share no baseline, so their offsets stay in the covariance: weigh a misfit by its
    inverse rather than by ``force_sd`` alone.

    Parameters
    ----------
    recordings : sequence of Recording
        The trials, at least one.
    instrument : Instrument
        Standard deviations of a reading.
    step : float
        Of the grid, mm.

    Raises
    ------
    InputError
        If there is no recording, or one has too little loading for the grid.
    """
    if not recordings:
        raise InputError("recordings", "*.csv", "there are none", "give at least one trial")
    contacts = tuple(
        find_first_contact(r, instrument.force_sd, instrument.displacement_sd) for r in recordings
    )
    branches = [_loading(r, c) for r, c in zip(recordings, contacts, strict=True)]
    deepest = min(float(d[-1]) for d, _, _ in branches)
    # A trial to 20 mm ends at 19.99 or 20.01 by its sensor: a tenth of a step doesn't count.
    grid = step * np.arange(1, int(np.floor(deepest / step + 0.1)) + 1)
    if len(grid) < 4:
        shallow = recordings[int(np.argmin([d[-1] for d, _, _ in branches]))]
        raise InputError(shallow.source or shallow.trial, "displacement_mm",
                         f"{deepest:.2f} mm of loading are too short to identify from",
                         "press deeper or take this trial out")
    aligned = _aligned(recordings, contacts, branches, grid, instrument)
    noise, fits, slope = aligned.noise, aligned.fits, aligned.slope
    curves = np.vstack([fit.value for fit in fits])
    force = curves.mean(axis=0)
    # Smoothed displacement errs alike over about half the 1 mm it is smoothed over.
    apart = np.abs(grid[:, None] - grid[None, :])
    drift = np.sqrt(aligned.jitter) * slope
    covariance = (
        noise.trial_covariance(grid, force, slope) + np.diag(aligned.white_variance)
        + np.outer(drift, drift) * np.exp(-apart / 0.5)
    ) / len(recordings) + noise.common_shift_sd**2 * np.outer(slope, slope)
    return LoadingCurve(
        displacement=frozen_array(grid), force=frozen_array(force),
        force_sd=frozen_array(np.sqrt(np.diag(covariance))), covariance=frozen_array(covariance),
        trial_force=frozen_array(curves), n_trials=len(recordings),
        n_samples=frozen_array(np.sum([fit.count for fit in fits], axis=0)), noise=noise,
        contacts=contacts,
    )


def _loading(recording: Recording, contact: Contact) -> Branch:
    """Return the loading after contact."""
    labels = split_phases(recording, contact)
    loading = labels == LOADING
    # Smoothing mustn't run over the corners: each stretch of motion by itself, air included.
    approach = loading | ((labels == "air") & (np.arange(len(labels)) < np.argmax(loading)))
    edges = np.flatnonzero(np.diff(approach.astype(int), prepend=0, append=0))
    smooth = recording.displacement.copy()
    leverage = np.ones_like(smooth)
    for start, end in edges.reshape(-1, 2):
        if end - start >= 5:
            part = slice(start, end)
            smooth[part], leverage[part] = smooth_displacement(
                recording.time[part], recording.displacement[part]
            )
        else:
            loading[start:end] = False
    depth = smooth - contact.displacement
    reached = np.maximum.accumulate(np.where(approach, depth, -np.inf))
    tolerance = sample_noise(recording.displacement)
    virgin = loading & (depth >= reached - tolerance) & (depth >= 0.0)
    if np.count_nonzero(virgin) < 5:
        raise InputError(recording.source or recording.trial, "displacement_mm",
                         "there is no loading after contact", "press deeper or remove this trial")
    order = np.argsort(depth[virgin], kind="stable")
    force = recording.force - contact.baseline
    return depth[virgin][order], force[virgin][order], leverage[virgin][order]


@dataclass(frozen=True, eq=False)
class _Aligned:
    fits: list[LocalLine]
    slope: FloatArray
    white_variance: FloatArray
    jitter: FloatArray
    """(n,), mm^2: variance of the smoothed displacement."""
    noise: NoiseEstimate


def _aligned(
    recordings: Sequence[Recording], contacts: Sequence[Contact], branches: Sequence[Branch],
    grid: FloatArray, instrument: Instrument,
) -> _Aligned:
    """Fit the trials on the grid and, after air, shift them onto each other.

    The whole curves tell how trials lie to each other far better than their first contacts do;
    the contacts' mean then places all of them. Trials that begin at first touch stay put.
    """
    step = float(grid[0])
    white = float(np.sqrt(np.mean([sample_noise(r.force) ** 2 for r in recordings])))
    jitter = np.mean([
        np.interp(grid, d, leverage) * sample_noise(r.displacement) ** 2
        for (d, _, leverage), r in zip(branches, recordings, strict=True)
    ], axis=0)
    movable = len(recordings) > 1 and all(c.in_air for c in contacts)
    shifts = np.zeros(len(recordings))
    for _ in range(_ALIGNMENTS if movable else 1):
        fits = [local_line(d - s, f, grid, 0.5 * step)
                for (d, f, _), s in zip(branches, shifts, strict=True)]
        curves = np.vstack([fit.value for fit in fits])
        force = curves.mean(axis=0)
        slope = local_line(grid, force, grid, 2 * step, 3).slope
        white_variance = white**2 * np.mean([fit.leverage for fit in fits], axis=0)
        known = white_variance + jitter * slope**2
        expected = _expected(contacts, instrument, white, shifts)
        noise = estimate_noise(grid, curves, slope, known, expected)
        if not movable:
            break
        moved = -noise.shift_estimate(grid, curves - force, slope, known, force)
        shifts = shifts + moved
        if np.max(np.abs(moved)) < 0.01:
            break
    return _Aligned(fits, slope, white_variance, jitter, noise)


def _expected(
    contacts: Sequence[Contact], instrument: Instrument, white: float, shifts: FloatArray
) -> Expectation:
    offsets = [c.baseline_error if c.in_air else instrument.force_sd for c in contacts]
    between = _rms([
        c.displacement_error if c.in_air else instrument.displacement_sd for c in contacts
    ])
    common = 0.0
    if all(c.in_air for c in contacts):
        # What alignment moved the trials by is what their contacts were wrong by: pooled with
        # the stated errors, which count as two trials.
        n = len(contacts)
        moved = float(np.sum(shifts**2))
        pooled = (2 * between**2 + moved) / (1 + n)
        common = float(np.sqrt(pooled / n)) if n > 1 else between
        between = between if not moved else max(0.2 * between, instrument.displacement_sd / 5)
    return Expectation(
        offset_sd=_rms(offsets), shift_sd=between, common_shift_sd=common,
        slow_sd=float(np.sqrt(max(instrument.force_sd**2 - white**2,
                                  0.09 * instrument.force_sd**2))),
        white_sd=white,
    )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
