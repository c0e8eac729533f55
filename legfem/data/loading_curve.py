r"""Repeats of one press, brought onto each other and to the first contact that they show together, and their mean.

Trial k reads, at a depth :math:`x` that all have alike,

.. math:: F(x + \delta_k) + b_k + g_k F(x) + e_k,

with the same unknown force :math:`F`, a first contact that was put :math:`\delta_k` too early, a zero :math:`b_k`, a
gain and a slow error. Differences between trials don't contain :math:`F` but for its slope; weighed by their errors
they tell the :math:`\delta_k` and :math:`b_k` less their means. Where all rise from is then looked for in all at once
(`legfem.data.contact.common_onset`), whether or not one by itself shows air.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial
from scipy.linalg import cholesky, helmert, solve_triangular

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.data.contact import Contact, Onset, common_onset, enough_gain
from legfem.data.noise import (
    JITTER_LENGTH_MM,
    UNSTATED,
    WANDER_LENGTH_MM,
    Expectation,
    Instrument,
    NoiseEstimate,
    estimate_components,
    slow_correlation,
)
from legfem.data.phases import AIR, LOADING
from legfem.data.recording import Recording
from legfem.data.segmentation import Segmentation, segment
from legfem.data.smoothing import local_line, smooth_displacement

_GAIN = 0.02
"""By which repeats differ in stiffness, as a standard deviation."""
_FARTHEST_MM = 2.0
"""By which a first contact may err, as a standard deviation, before the curves are compared."""
_WHITE = 0.1
"""Share of a reading's variance that is white on the grid."""
_STEP_MM = 0.25
_ROUNDS, _SETTLED_MM = 12, 1e-3
_FEWEST = 8
"""Points that show anything."""


@dataclass(frozen=True, eq=False)
class Branch:
    """Loading, and the approach through air before it; arrays are (n,)."""

    depth: FloatArray
    """mm after first contact, not decreasing; negative in air."""
    force: FloatArray
    """N above the baseline."""
    leverage: FloatArray
    """Variance of the smoothed displacement over that of a reading."""

    def moved(self, by: float, offset: float = 0.0) -> "Branch":
        """Return the branch with ``by`` mm and ``offset`` N taken off."""
        return Branch(self.depth - by, self.force - offset, self.leverage)

    def loaded(self) -> "Branch":
        """Return the part after first contact."""
        kept = self.depth >= 0.0
        return Branch(self.depth[kept], self.force[kept], self.leverage[kept])


def loading_branch(trial: Segmentation) -> Branch:
    """Return the samples of approach and loading that go deeper than any before.

    Raises
    ------
    InputError
        If there is no loading after contact.
    """
    recording, labels, contact = trial.recording, trial.labels, trial.contact
    loading = labels == LOADING
    index = np.arange(len(labels))
    approach = loading | ((labels == AIR) & (index < np.argmax(loading)))
    # Smoothing mustn't run over the motion's corners: each stretch by itself.
    edges = np.flatnonzero(np.diff(approach.astype(int), prepend=0, append=0))
    smooth = recording.displacement.copy()
    leverage = np.ones_like(smooth)
    for start, end in edges.reshape(-1, 2):
        if end - start >= 5:
            part = slice(start, end)
            smooth[part], leverage[part] = smooth_displacement(
                recording.time[part], recording.displacement[part], trial.scales.way
            )
        else:
            approach[start:end] = False
    depth = smooth - contact.displacement
    reached = np.maximum.accumulate(np.where(approach, depth, -np.inf))
    virgin = approach & (depth >= reached - trial.displacement_noise)
    if np.count_nonzero(virgin & (depth >= 0)) < 5:
        raise InputError(
            trial.source, "displacement_mm", "there is no loading after contact", "press deeper, or remove this trial"
        )
    order = np.argsort(depth[virgin], kind="stable")
    force = recording.force - contact.baseline
    return Branch(depth[virgin][order], force[virgin][order], leverage[virgin][order])


@dataclass(frozen=True, eq=False)
class Aligned:
    """Repeats that lie on each other."""

    branches: tuple[Branch, ...]
    """From first contact on."""
    contact_sd: float
    """Standard error of their common contact, mm; 0 where it is known."""
    shift_sd: float
    """Of one trial's place beside the others', mm."""
    zero_sd: float
    """Of one trial's zero, N."""


def align_branches(branches: Sequence[Branch], contacts: Sequence[Contact], instrument: Instrument) -> Aligned:
    """Bring branches onto each other and to first contact.

    Trials that are known to begin at first touch stay put, and so do those that all together show no air. Else the
    whole curves tell how the trials lie to each other far better than each one's first contact does, and contact is
    found once, in all of them together.

    Parameters
    ----------
    branches : sequence of Branch
        The trials' branches.
    contacts : sequence of Contact
        Their first contacts.
    instrument : Instrument
        Errors of a reading.
    """
    if all(c.known for c in contacts):
        return Aligned(tuple(b.loaded() for b in branches), 0.0, instrument.displacement_sd, instrument.force_sd)
    if len(branches) == 1:
        return _by_themselves(branches, contacts, instrument)
    placed = _placed(branches, contacts, instrument)
    onset = None
    if placed is not None:
        onset = common_onset([(b.depth, b.force) for b in placed.branches], placed.shift_sd, instrument)
    if placed is None or onset is None:
        return _by_themselves(branches, contacts, instrument)
    if not any(c.in_air for c in contacts) and not enough_gain(onset.gain + placed.gain, len(contacts)):
        return _by_themselves(branches, contacts, instrument)
    level = _level_in_air(placed.branches, onset)
    return Aligned(
        tuple(b.moved(onset.place, level).loaded() for b in placed.branches),
        onset.error,
        placed.shift_sd,
        placed.zero_sd,
    )


def _by_themselves(branches: Sequence[Branch], contacts: Sequence[Contact], instrument: Instrument) -> Aligned:
    """Return branches that aren't brought onto each other.

    Where a recording shows no air for certain its contact is taken at its start, as most recordings begin, and may
    be where it seems to be.
    """
    errors = [
        c.displacement_error if c.in_air else float(np.hypot(c.displacement_error, c.estimate - c.displacement))
        for c in contacts
    ]
    return Aligned(
        tuple(b.loaded() for b in branches),
        float(np.mean(errors)),
        instrument.displacement_sd,
        _zero(contacts, instrument),
    )


def _zero(contacts: Sequence[Contact], instrument: Instrument) -> float:
    """Return how well a trial's zero is known, N."""
    errors = [c.baseline_error if c.in_air else instrument.force_sd for c in contacts]
    return float(np.sqrt(np.mean(np.square(errors))))


@dataclass(frozen=True, eq=False)
class _Placed:
    branches: list[Branch]
    shift_sd: float
    zero_sd: float
    gain: float
    """By how many variances of the errors they lie better than as they came."""


def _placed(branches: Sequence[Branch], contacts: Sequence[Contact], instrument: Instrument) -> _Placed | None:
    """Return branches brought onto each other; None where they have too little in common."""
    count = len(branches)
    contrast, centring = helmert(count), np.eye(count) - 1 / count
    came, zeros_sd = np.array([c.estimate - c.displacement for c in contacts]), _zeros_sd(contacts, instrument)
    shifts, zeros = came.copy(), np.zeros(count)
    priors = np.diag(np.concatenate([np.full(count, 1 / _FARTHEST_MM), 1 / zeros_sd]))
    for _ in range(_ROUNDS):
        moved = [b.moved(s, z) for b, s, z in zip(branches, shifts, zeros, strict=True)]
        start, end = max(float(b.depth[0]) for b in moved), min(float(b.depth[-1]) for b in moved)
        grid = np.arange(start + _STEP_MM, end - 0.5 * _STEP_MM, _STEP_MM)
        if len(grid) < _FEWEST:
            return None
        curves = np.array([local_line(b.depth, b.force, grid, 0.5 * _STEP_MM).value for b in moved])
        force = curves.mean(axis=0)
        slope = Polynomial.fit(grid, force, 5).deriv()(grid)
        lower = cholesky(_own_errors(grid, force, slope, instrument), lower=True)
        # A trial whose contact lies further on reads less by the slope.
        effects = solve_triangular(lower, np.column_stack([-slope, np.ones(len(grid))]), lower=True)
        differences = solve_triangular(lower, (contrast @ curves).T, lower=True).T
        rows = np.vstack([np.hstack([np.kron(contrast, one[:, None]) for one in effects.T]), priors])
        left = np.concatenate([differences.ravel(), (came - shifts) / _FARTHEST_MM, -zeros / zeros_sd])
        found = np.linalg.lstsq(rows, left)[0]
        further = centring @ found[:count]
        shifts, zeros = shifts + np.clip(further, -_FARTHEST_MM, _FARTHEST_MM), zeros + found[count:]
        if np.abs(further).max() < _SETTLED_MM:
            break
    missed = left - rows @ found
    # What they differ by beyond these errors widens.
    spread = np.linalg.inv(rows.T @ rows) * max(1.0, float(missed @ missed) / (len(left) - 2 * count))
    apart, away = centring @ spread[:count, :count] @ centring, centring @ shifts
    return _Placed(
        [b.moved(s, z) for b, s, z in zip(branches, shifts, zeros, strict=True)],
        float(np.sqrt(np.mean(np.diag(apart)))),
        float(np.sqrt(np.mean(np.diag(spread)[count:]))),
        float(away @ np.linalg.pinv(apart) @ away),
    )


def _zeros_sd(contacts: Sequence[Contact], instrument: Instrument) -> FloatArray:
    """Return how well each trial's zero is known (R,), N: where no air shows it, it may be as far off as elsewhere."""
    seen = [c.baseline for c in contacts if c.in_air]
    unseen = float(np.hypot(instrument.force_sd, np.sqrt(np.mean(np.square(seen))) if seen else 0.0))
    return np.array([c.baseline_error if c.in_air else unseen for c in contacts])


def _own_errors(grid: FloatArray, force: FloatArray, slope: FloatArray, instrument: Instrument) -> FloatArray:
    """Return the covariance (n, n), N^2, of what a trial errs by besides its place and its zero."""
    apart = np.abs(grid[:, None] - grid[None, :])
    alike = slow_correlation(grid) + _WHITE * np.eye(len(grid))
    wander = instrument.displacement_sd * slope
    return np.asarray(
        max(instrument.force_sd, 1e-4 * float(np.ptp(force))) ** 2 * alike
        + _GAIN**2 * np.outer(force, force)
        + np.outer(wander, wander) * np.exp(-apart / WANDER_LENGTH_MM)
    )


def _level_in_air(branches: Sequence[Branch], onset: Onset) -> float:
    """Return the mean force before an onset, N; 0 where nothing was recorded there."""
    for before in (onset.place - 2 * onset.error, onset.place):
        force = np.concatenate([b.force[b.depth < before] for b in branches])
        if len(force) >= _FEWEST:
            return float(force.mean())
    return 0.0


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
    few_repeats: FloatArray
    """(n, n), N^2: the part of ``covariance`` that widens intervals, since a few repeats tell poorly by how much they
    differ. Errors of many curves have ``covariance`` less this."""
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


def mean_loading_curve(trials: Sequence[Segmentation], step: float = 0.25) -> LoadingCurve:
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
    displacement's (slope times its sd, smoothed) on top, over the number of trials. Repeats
    without air share no baseline, so their offsets stay in the covariance: weigh a misfit by its
    inverse rather than by ``force_sd`` alone.

    Parameters
    ----------
    trials : sequence of Segmentation
        At least one, all of one instrument.
    step : float
        Of the grid, mm.

    Raises
    ------
    InputError
        If there is no recording, or one has too little loading for the grid.
    """
    if not trials:
        raise InputError("recordings", "*.csv", "there are none", "give at least one trial")
    instrument, contacts = trials[0].instrument, tuple(one.contact for one in trials)
    aligned = align_branches([loading_branch(one) for one in trials], contacts, instrument)
    branches = aligned.branches
    deepest = min(float(b.depth[-1]) for b in branches)
    # A trial to 20 mm ends at 19.99 or 20.01 by its sensor: a tenth of a step doesn't count.
    grid = step * np.arange(1, int(np.floor(deepest / step + 0.1)) + 1)
    if len(grid) < 4:
        raise InputError(
            trials[int(np.argmin([b.depth[-1] for b in branches]))].source,
            "displacement_mm",
            f"{deepest:.2f} mm of loading are too short to identify from",
            "press deeper, or remove this trial",
        )
    fits = [local_line(b.depth, b.force, grid, 0.5 * step) for b in branches]
    curves = np.vstack([fit.value for fit in fits])
    force = curves.mean(axis=0)
    # For the errors only; a noisy slope would make them look better known than they are.
    slope = Polynomial.fit(grid, force, min(5, len(grid) - 2)).deriv()(grid)
    white = float(np.sqrt(np.mean([one.force_noise**2 for one in trials])))
    white_variance = white**2 * np.mean([fit.leverage for fit in fits], axis=0)
    readings = [one.displacement_noise**2 for one in trials]
    jitter = np.mean(
        [np.interp(grid, b.depth, b.leverage) * variance for b, variance in zip(branches, readings, strict=True)],
        axis=0,
    )
    noise = estimate_components(
        grid, curves, slope, white_variance + jitter * slope**2, _expected(aligned, instrument, white)
    )
    apart = np.abs(grid[:, None] - grid[None, :])
    drift = np.sqrt(jitter) * slope
    wander = instrument.wander_sd(float(np.sqrt(np.mean(readings)))) * slope
    of_trial = noise.trial_covariance(grid, force, slope)
    covariance = (
        of_trial
        + np.diag(white_variance)
        + np.outer(drift, drift) * np.exp(-apart / JITTER_LENGTH_MM)
        + np.outer(wander, wander) * np.exp(-apart / WANDER_LENGTH_MM)
    ) / len(trials) + noise.common_shift_sd**2 * np.outer(slope, slope)
    return LoadingCurve(
        displacement=frozen_array(grid),
        force=frozen_array(force),
        force_sd=frozen_array(np.sqrt(np.diag(covariance))),
        covariance=frozen_array(covariance),
        few_repeats=frozen_array(
            (of_trial - replace(noise, repeat_dof=0).trial_covariance(grid, force, slope)) / len(trials)
        ),
        trial_force=frozen_array(curves),
        n_trials=len(trials),
        n_samples=frozen_array(np.sum([fit.count for fit in fits], axis=0)),
        noise=noise,
        contacts=contacts,
    )


def _expected(aligned: Aligned, instrument: Instrument, white: float) -> Expectation:
    return Expectation(
        offset_sd=aligned.zero_sd,
        shift_sd=max(aligned.shift_sd, 0.2 * instrument.displacement_sd),
        common_shift_sd=aligned.contact_sd,
        slow_sd=instrument.slow_force_sd(white),
        white_sd=white,
    )


_LEVELS = np.linspace(0.1, 0.4, 7)
"""Of the least peak: where depths are compared, near contact and above the noise."""
_ALIKE = 0.05
"""Of the depth: what repeats differ by in stiffness, as a standard deviation."""
_READ = 0.05
"""mm: what a depth at a force errs by."""
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
        design = np.column_stack([np.ones_like(others), _ALIKE * others])
        design, left = np.vstack([design / _READ, [0.0, 1.0]]), np.append((depths[k] - others) / _READ, 0.0)
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
