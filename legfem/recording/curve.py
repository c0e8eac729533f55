"""The mean loading curve of repeated trials, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.recording.branch import align_branches, loading_branch
from legfem.recording.contact import Contact, contact_at_start, find_first_contact
from legfem.recording.instrument import JITTER_LENGTH_MM, WANDER_LENGTH_MM, Instrument
from legfem.recording.noise import Expectation, NoiseEstimate, estimate_noise
from legfem.recording.smoothing import local_line, sample_noise
from legfem.recording.trial import Recording


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
    recordings: Sequence[Recording], instrument: Instrument, step: float = 0.25, starts_at_contact: bool = False
) -> LoadingCurve:
    """Bring repeated trials to one loading curve.

    Of each trial the samples count that lie after first contact, belong to loading and go
    deeper than any before. Displacement is smoothed over time (else its noise would flatten the
    curve) and counted from first contact; force is counted from its baseline in air where there
    was air (see `legfem.recording.find_first_contact`). Where there was, the trials are then
    aligned with each other and first contact is found in all of them together. A grid value is
    a straight-line fit within half a step either side: no interpolation of noisy samples. The
    grid ends where the shallowest trial does. The recordings aren't changed.

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
    starts_at_contact : bool
        Whether displacement is known to count from first touch; air isn't looked for then.

    Raises
    ------
    InputError
        If there is no recording, or one has too little loading for the grid.
    """
    if not recordings:
        raise InputError("recordings", "*.csv", "there are none", "give at least one trial")
    contacts = tuple(
        contact_at_start()
        if starts_at_contact
        else find_first_contact(r, instrument.force_sd, instrument.displacement_sd)
        for r in recordings
    )
    branches, common = align_branches(
        [loading_branch(r, c) for r, c in zip(recordings, contacts, strict=True)],
        contacts,
        instrument.displacement_sd,
        step,
    )
    deepest = min(float(b.depth[-1]) for b in branches)
    # A trial to 20 mm ends at 19.99 or 20.01 by its sensor: a tenth of a step doesn't count.
    grid = step * np.arange(1, int(np.floor(deepest / step + 0.1)) + 1)
    if len(grid) < 4:
        shallow = recordings[int(np.argmin([b.depth[-1] for b in branches]))]
        raise InputError(
            shallow.source or shallow.trial,
            "displacement_mm",
            f"{deepest:.2f} mm of loading are too short to identify from",
            "press deeper or take this trial out",
        )
    fits = [local_line(b.depth, b.force, grid, 0.5 * step) for b in branches]
    curves = np.vstack([fit.value for fit in fits])
    force = curves.mean(axis=0)
    # For the errors only; a noisy slope would make them look better known than they are.
    slope = Polynomial.fit(grid, force, min(5, len(grid) - 2)).deriv()(grid)
    white = float(np.sqrt(np.mean([sample_noise(r.force) ** 2 for r in recordings])))
    white_variance = white**2 * np.mean([fit.leverage for fit in fits], axis=0)
    readings = [sample_noise(r.displacement) ** 2 for r in recordings]
    jitter = np.mean(
        [np.interp(grid, b.depth, b.leverage) * variance for b, variance in zip(branches, readings, strict=True)],
        axis=0,
    )
    noise = estimate_noise(
        grid, curves, slope, white_variance + jitter * slope**2, _expected(contacts, instrument, white, common)
    )
    apart = np.abs(grid[:, None] - grid[None, :])
    drift = np.sqrt(jitter) * slope
    wander = instrument.wander_sd(float(np.sqrt(np.mean(readings)))) * slope
    covariance = (
        noise.trial_covariance(grid, force, slope)
        + np.diag(white_variance)
        + np.outer(drift, drift) * np.exp(-apart / JITTER_LENGTH_MM)
        + np.outer(wander, wander) * np.exp(-apart / WANDER_LENGTH_MM)
    ) / len(recordings) + noise.common_shift_sd**2 * np.outer(slope, slope)
    return LoadingCurve(
        displacement=frozen_array(grid),
        force=frozen_array(force),
        force_sd=frozen_array(np.sqrt(np.diag(covariance))),
        covariance=frozen_array(covariance),
        trial_force=frozen_array(curves),
        n_trials=len(recordings),
        n_samples=frozen_array(np.sum([fit.count for fit in fits], axis=0)),
        noise=noise,
        contacts=contacts,
    )


def _expected(contacts: Sequence[Contact], instrument: Instrument, white: float, common_shift: float) -> Expectation:
    aligned = any(c.in_air for c in contacts) and len(contacts) > 1
    offsets = [c.baseline_error if c.in_air else instrument.force_sd for c in contacts]
    return Expectation(
        offset_sd=float(np.sqrt(np.mean(np.square(offsets)))),
        # Aligned trials lie to each other far better than each one's contact is known.
        shift_sd=max(0.2 * common_shift, 0.2 * instrument.displacement_sd) if aligned else instrument.displacement_sd,
        common_shift_sd=common_shift,
        slow_sd=instrument.slow_force_sd(white),
        white_sd=white,
    )
