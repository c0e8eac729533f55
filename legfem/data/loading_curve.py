r"""Mean of the repeats of one press, and what it errs by.

Where air shows a trial's zero :math:`b_k`, its readings there, :math:`b_k + e_k`, and in contact, :math:`F + b_k +
e_k`, err slowly together. :math:`F` is their best linear unbiased estimate with every :math:`b_k` left open, by the
covariance of :math:`e_k` along the whole way. First contact was placed by the very readings that a model is compared
with: where these are weighed by their errors, contact is left open too (`LoadingCurve.open_contact`), and the model's
own rise finds it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.data.alignment import Aligned, Branch, align_branches, loading_branch
from legfem.data.contact import Contact
from legfem.data.noise import (
    ANY_LEVEL,
    ANY_PLACE_MM,
    JITTER_LENGTH_MM,
    UNSTATED,
    WANDER_LENGTH_MM,
    Expectation,
    Instrument,
    NoiseEstimate,
    estimate_components,
)
from legfem.data.recording import Recording
from legfem.data.segmentation import Segmentation, segment
from legfem.data.smoothing import LocalLine, local_line

_STEP_MM = 0.25
"""Step of the grid."""
_AIR_MM = 10.0
"""Way in air before first contact that counts."""


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
    """(n, n), N^2, of ``force``: its diagonal is the square of ``force_sd``. Neighbours are correlated."""
    few_repeats: FloatArray
    """(n, n), N^2: the part of ``covariance`` that widens intervals, since a few repeats tell poorly by how much they
    differ. Errors of many curves have ``covariance`` less this."""
    trial_force: FloatArray
    """(R, n), N: each trial's own curve."""
    smooth: FloatArray
    """(n,), N: ``force`` without its noise. Shares of noisy forces would draw a fit to one side (Peelle's puzzle)."""
    slope: FloatArray
    """(n,), N/mm, of ``smooth``."""
    from_air: bool
    """Whether first contact was found from how the curve rises from air."""
    n_trials: int
    n_samples: FloatArray
    """(n,): readings behind each value."""
    noise: NoiseEstimate
    contacts: tuple[Contact, ...]

    @property
    def open_contact(self) -> FloatArray:
        """(n, n), N^2: what leaves first contact open, beside ``covariance``; 0 where it is known otherwise."""
        return self.from_air * ANY_PLACE_MM**2 * np.outer(self.slope, self.slope)

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


def mean_loading_curve(trials: Sequence[Segmentation]) -> LoadingCurve:
    """Bring repeated trials to one loading curve.

    Of each trial the samples count that lie after first contact, belong to loading and go
    deeper than any before. Displacement is smoothed over time (else its noise would flatten the
    curve) and counted from first contact; force is counted from its baseline in air where there
    was air (see `legfem.data.contact.first_contact`). Where there was, in one trial by itself or in
    all together, they are then brought onto each other and first contact is found in all of them
    together (`align_branches`). A grid value is
    a straight-line fit within half a step either side: no interpolation of noisy samples. The
    grid ends where the shallowest trial does. The recordings aren't changed.

    The covariance is the trials' error model (`NoiseEstimate`), with white force noise and the
    displacement's (slope times its sd, smoothed) on top, over the number of trials; slow errors and zeros count as
    air leaves them. Repeats
    without air share no baseline, so their offsets stay in the covariance: weigh a misfit by its
    inverse rather than by ``force_sd`` alone.

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
    instrument, contacts = trials[0].instrument, tuple(one.contact for one in trials)
    aligned = align_branches([loading_branch(one) for one in trials], contacts, instrument)
    branches = [one.loaded() for one in aligned.branches]
    deepest = min(float(b.depth[-1]) for b in branches)
    # A trial to 20 mm ends at 19.99 or 20.01 by its sensor: a tenth of a step doesn't count.
    grid = _STEP_MM * np.arange(1, int(np.floor(deepest / _STEP_MM + 0.1)) + 1)
    if len(grid) < 4:
        raise InputError(
            trials[int(np.argmin([b.depth[-1] for b in branches]))].source,
            "displacement_mm",
            f"{deepest:.2f} mm of loading are too short to identify from",
            "press deeper, or remove this trial",
        )
    fits = [local_line(b.depth, b.force, grid, 0.5 * _STEP_MM) for b in branches]
    curves = np.vstack([fit.value for fit in fits])
    smooth, slope = _smooth(grid, curves.mean(axis=0), aligned.from_air)
    white = float(np.sqrt(np.mean([one.force_noise**2 for one in trials])))
    white_variance = white**2 * np.mean([fit.leverage for fit in fits], axis=0)
    readings = [one.displacement_noise**2 for one in trials]
    jitter = np.mean(
        [np.interp(grid, b.depth, b.leverage) * variance for b, variance in zip(branches, readings, strict=True)],
        axis=0,
    )
    expected = Expectation(
        offset_sd=aligned.zero_sd,
        shift_sd=max(aligned.shift_sd, 0.2 * instrument.displacement_sd),
        common_shift_sd=aligned.contact_sd,
        slow_sd=instrument.slow_force_sd(white),
        white_sd=white,
        placed=aligned.from_air,
    )
    noise = estimate_components(grid, curves, smooth, slope, white_variance + jitter * slope**2, expected)
    force, covariance = _above_air(aligned, noise, grid, curves, white_variance)
    rest = replace(noise, slow_sd=0.0)
    if aligned.from_air:
        rest = replace(rest, offset_sd=0.0, shift_sd=0.0)
    of_trial = rest.trial_covariance(grid, smooth, slope)
    few_repeats = of_trial - replace(rest, repeat_dof=0).trial_covariance(grid, smooth, slope)
    apart = np.abs(grid[:, None] - grid[None, :])
    drift = np.sqrt(jitter) * slope
    wander = instrument.wander_sd(float(np.sqrt(np.mean(readings)))) * slope
    covariance += (
        replace(rest, offset_sd=0.0).trial_covariance(grid, smooth, slope)
        + np.outer(drift, drift) * np.exp(-apart / JITTER_LENGTH_MM)
        + np.outer(wander, wander) * np.exp(-apart / WANDER_LENGTH_MM)
    ) / len(trials) + noise.common_shift_sd**2 * np.outer(slope, slope)
    return LoadingCurve(
        displacement=frozen_array(grid),
        force=frozen_array(force),
        force_sd=frozen_array(np.sqrt(np.diag(covariance))),
        covariance=frozen_array(covariance),
        few_repeats=frozen_array(few_repeats / len(trials)),
        trial_force=frozen_array(curves),
        smooth=frozen_array(smooth),
        slope=frozen_array(slope),
        from_air=aligned.from_air,
        n_trials=len(trials),
        n_samples=frozen_array(np.sum([fit.count for fit in fits], axis=0)),
        noise=noise,
        contacts=contacts,
    )


def _smooth(grid: FloatArray, force: FloatArray, from_zero: bool) -> tuple[FloatArray, FloatArray]:
    """Return a cubic through forces (n,), N, and its slope, N/mm: for the errors only."""
    powers = np.arange(1 if from_zero else 0, 4)
    share = (grid / grid[-1])[:, None]
    found = np.linalg.lstsq(share**powers, force)[0]
    return share**powers @ found, (powers * share ** np.maximum(powers - 1, 0)) @ found / grid[-1]


def _above_air(
    aligned: Aligned, noise: NoiseEstimate, grid: FloatArray, curves: FloatArray, white_variance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return forces (n,), N, above the trials' levels, and what zeros, slow and white errors make of their covariance.

    Without air that is the mean of the trials' curves (R, n), N.
    """
    step, level = grid[1] - grid[0], replace(noise, gain_sd=0.0, shift_sd=0.0)
    ends = -2.0 * noise.common_shift_sd
    air = -step * np.arange(1, int(_AIR_MM / step) + 1)[::-1] if aligned.from_air else grid[:0]
    seen = [_in_air(one, air[air <= ends], step) for one in aligned.branches]
    if any(len(places) for places, _ in seen):
        level = replace(level, offset_sd=ANY_LEVEL * level.slow_sd, repeat_dof=0)
    least = 1e-12 * float(np.max(curves**2))
    precision, weighed = np.zeros((len(grid), len(grid))), np.zeros(len(grid))
    for (places, fit), curve in zip(seen, curves, strict=True):
        every, nothing = np.concatenate([places, grid]), np.zeros(len(places) + len(grid))
        white = np.concatenate([noise.white_sd**2 * fit.leverage, white_variance]) + least
        inverse = np.linalg.inv(level.trial_covariance(every, nothing, nothing) + np.diag(white))[len(places) :]
        precision += inverse[:, len(places) :]
        weighed += inverse @ np.concatenate([fit.value, curve])
    covariance = np.linalg.inv(precision)
    return covariance @ weighed, covariance


def _in_air(branch: Branch, places: FloatArray, step: float) -> tuple[FloatArray, LocalLine]:
    """Return the places of a grid (m,), mm, at which a branch was in air, and its force there."""
    places = places[places >= branch.depth[0] + 0.5 * step]
    if np.count_nonzero(branch.depth < 0) < _FEWEST:
        places = places[:0]
    return places, local_line(branch.depth, branch.force, places, 0.5 * step)


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
        design = np.vstack([design / _DEPTH_SD_MM, [0.0, 1.0]])
        left = np.append((depths[k] - others) / _DEPTH_SD_MM, 0.0)
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
    rising = np.maximum.accumulate(local_line(d, force, grid, 0.25 * way).value)
    return np.asarray(np.interp(forces, rising, grid))
