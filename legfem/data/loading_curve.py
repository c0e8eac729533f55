"""The mean loading curve of repeated trials, with its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.data.contact import SLOW_WAYS, Contact, air_is_shown, fit_onset
from legfem.data.noise import (
    JITTER_LENGTH_MM,
    UNSTATED,
    WANDER_LENGTH_MM,
    Expectation,
    Instrument,
    NoiseEstimate,
    estimate_components,
)
from legfem.data.recording import Recording
from legfem.data.segmentation import AIR, LOADING, Segmentation, segment
from legfem.data.smoothing import local_line, smooth_displacement

_ALIGNED_WITHIN_MM = 2.0
_LEAST_GAIN = 14.0
"""Fall of a sum of squares, in units of the errors, from which trials are said to lie apart."""
_GAIN = 0.02
"""By which repeats differ in stiffness, as a standard deviation."""


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
            trial.source, "displacement_mm", "there is no loading after contact", "press deeper or remove this trial"
        )
    order = np.argsort(depth[virgin], kind="stable")
    force = recording.force - contact.baseline
    return Branch(depth[virgin][order], force[virgin][order], leverage[virgin][order])


def align_branches(
    branches: Sequence[Branch], contacts: Sequence[Contact], instrument: Instrument, step: float
) -> tuple[list[Branch], float]:
    """Bring branches onto each other and to first contact.

    Trials that are known to begin at first touch stay put. Else the whole curves tell how the trials lie to each
    other far better than each one's first contact does, and contact is found once, in all of them together. Trials
    in none of which air is seen for certain aren't brought onto each other, unless their curves lie apart: they can't
    all begin at first touch then.

    Parameters
    ----------
    branches : sequence of Branch
        The trials' branches.
    contacts : sequence of Contact
        Their first contacts.
    instrument : Instrument
        Errors of a reading.
    step : float
        Grid on which branches are compared, mm.

    Returns
    -------
    list of Branch, float
        The loaded parts, and the standard error of their common contact, mm (0 where it is known).
    """
    in_air = [c.in_air for c in contacts]
    if all(c.known for c in contacts):
        return [b.loaded() for b in branches], 0.0
    if len(branches) == 1:
        return _by_themselves(branches, contacts)
    placed = list(branches)
    if any(in_air):
        # Those whose contact is known first; then each against the mean of the others.
        known = [b for b, air in zip(branches, in_air, strict=True) if air]
        for k, air in enumerate(in_air):
            if not air:
                placed[k] = _onto(branches[k], known, step, in_air=False)
        for _ in range(3):
            onto = [_onto(b, placed[:k] + placed[k + 1 :], step) for k, b in enumerate(placed)]
            # Half the way, lest two trials swap places.
            placed = [b.moved(0.5 * float(b.depth[0] - c.depth[0])) for b, c in zip(placed, onto, strict=True)]
    else:
        shifts = [_shift(b, branches[0], instrument, step) for b in branches[1:]]
        if not (any(shifts) or air_is_shown(contacts)):
            return _by_themselves(branches, contacts)
        placed[1:] = [b.moved(shift) for b, shift in zip(branches[1:], shifts, strict=True)]
    begin = np.array([float(a.depth[0] - b.depth[0]) for b, a in zip(branches, placed, strict=True)])
    # Those that begin in air show most of it.
    common = _common_contact([b for b, air in zip(placed, in_air, strict=True) if air or not any(in_air)], instrument)
    if common.in_air:
        by, offset, error = common.displacement, common.baseline, common.displacement_error
    else:
        # Together they show no air: the one that begins last may begin at contact, if any does.
        last = float(begin[~np.array(in_air)].max()) if not all(in_air) else 0.0
        half = 0.5 * max(common.estimate - last, 0.0) if not any(in_air) else 0.0
        errors = [c.displacement_error for c in contacts if c.in_air] or [common.displacement_error]
        by, offset = last + half, 0.0
        error = float(np.hypot(max(instrument.displacement_sd, float(np.mean(errors))), half))
    # Where each trial by itself has its contact, once they lie on each other.
    own = begin[in_air]
    apart = float(np.linalg.norm(own - by)) / len(own) if len(own) else 0.0
    return [b.moved(by, offset).loaded() for b in placed], max(error, apart)


def _by_themselves(branches: Sequence[Branch], contacts: Sequence[Contact]) -> tuple[list[Branch], float]:
    """Return the loaded parts of branches that aren't brought onto each other.

    Where a recording shows no air for certain its contact is taken at its start, as most recordings begin, and may
    be where it seems to be.
    """
    errors = [
        c.displacement_error if c.in_air else float(np.hypot(c.displacement_error, c.estimate - c.displacement))
        for c in contacts
        if not c.known
    ]
    return [b.loaded() for b in branches], float(np.mean(errors))


def _shift(branch: Branch, other: Branch, instrument: Instrument, step: float) -> float:
    """Return how much later (mm) a branch's force rises than another's; 0 where zeros, gains and noise may do it."""
    deepest = min(float(branch.depth[-1]), float(other.depth[-1]))
    grid = np.arange(2 * step, deepest - _ALIGNED_WITHIN_MM, step)
    if len(grid) < 8:
        return 0.0
    force = local_line(other.depth, other.force, grid, step).value
    # Both have each of these errors: a zero, a slow and a white one, each as large as all that is stated; a gain.
    between = np.abs(grid[:, None] - grid[None, :])
    alike = 1.0 + np.mean([np.exp(-between / ways) for ways in SLOW_WAYS], axis=0) + 0.1 * np.eye(len(grid))
    errors = 2.0 * (instrument.force_sd**2 * alike + _GAIN**2 * np.outer(force, force))
    farthest = max(_ALIGNED_WITHIN_MM, 0.5 * deepest)
    shifts = np.arange(-farthest, farthest + 0.01, 0.05)
    still = local_line(branch.depth, branch.force, grid, step).value - force
    gained = np.full(len(shifts), -np.inf)
    for i, shift in enumerate(shifts):
        inside = (grid + shift >= branch.depth[0]) & (grid + shift <= branch.depth[-1])
        if inside.sum() > 0.5 * len(grid):
            apart = local_line(branch.depth, branch.force, grid[inside] + shift, step).value - force[inside]
            both = np.column_stack([still[inside], apart])
            without, left = np.einsum("nk,nk->k", both, np.linalg.solve(errors[np.ix_(inside, inside)], both))
            gained[i] = without - left
    i = int(np.argmax(gained))
    return _lowest(shifts, -gained, i) if gained[i] > _LEAST_GAIN else 0.0


def _onto(branch: Branch, others: Sequence[Branch], step: float, in_air: bool = True) -> Branch:
    """Move a branch by the shift that brings it nearest to the others' mean.

    One without air may lie further off and its force be offset by a constant.
    """
    deepest = min(float(b.depth[-1]) for b in [branch, *others])
    grid = np.arange(2 * step, deepest - _ALIGNED_WITHIN_MM, step)
    if len(grid) < 8:
        return branch
    mean = np.mean([local_line(b.depth, b.force, grid, step).value for b in others], axis=0)
    furthest = _ALIGNED_WITHIN_MM if in_air else max(_ALIGNED_WITHIN_MM, 0.5 * deepest)
    shifts = np.arange(-_ALIGNED_WITHIN_MM, furthest + 0.01, 0.05)
    cost, offset = np.empty(len(shifts)), np.empty(len(shifts))
    for i, shift in enumerate(shifts):
        inside = (grid + shift >= branch.depth[0]) & (grid + shift <= branch.depth[-1])
        if inside.sum() < 8:
            cost[i], offset[i] = np.inf, 0.0
            continue
        apart = local_line(branch.depth, branch.force, grid[inside] + shift, step).value
        apart -= mean[inside]
        offset[i] = 0.0 if in_air else apart.mean()
        cost[i] = np.mean((apart - offset[i]) ** 2)
    i = int(np.argmin(cost))
    return branch.moved(_lowest(shifts, cost, i), float(offset[i]))


def _lowest(x: FloatArray, y: FloatArray, i: int) -> float:
    """Return where the parabola through the lowest value and its neighbours is lowest."""
    if i in (0, len(x) - 1) or not np.isfinite(y[i - 1 : i + 2]).all():
        return float(x[i])
    bend = y[i - 1] - 2 * y[i] + y[i + 1]
    lean = 0.5 * (y[i - 1] - y[i + 1]) / bend if bend > 0 else 0.0
    return float(x[i] + lean * (x[1] - x[0]))


def _common_contact(branches: Sequence[Branch], instrument: Instrument) -> Contact:
    # Averaged rather than pooled: neighbours then keep the correlation that the error needs.
    start = max(float(b.depth[0]) for b in branches)
    end = min(float(b.depth[-1]) for b in branches)
    spacing = max(0.02, *(float(b.depth[-1] - b.depth[0]) / len(b.depth) for b in branches))
    grid = np.arange(start, end, spacing)
    mean = np.mean([local_line(b.depth, b.force, grid, 0.5 * spacing, 2).value for b in branches], axis=0)
    return fit_onset(grid, mean, replace(instrument, force_sd=instrument.force_sd / np.sqrt(len(branches))))


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


def mean_loading_curve(trials: Sequence[Segmentation], step: float = 0.25) -> LoadingCurve:
    """Bring repeated trials to one loading curve.

    Of each trial the samples count that lie after first contact, belong to loading and go
    deeper than any before. Displacement is smoothed over time (else its noise would flatten the
    curve) and counted from first contact; force is counted from its baseline in air where there
    was air (see `legfem.data.contact.first_contact`). Where there was, the trials are then
    aligned with each other and first contact is found in all of them together. A grid value is
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
    branches, common = align_branches([loading_branch(one) for one in trials], contacts, instrument, step)
    deepest = min(float(b.depth[-1]) for b in branches)
    # A trial to 20 mm ends at 19.99 or 20.01 by its sensor: a tenth of a step doesn't count.
    grid = step * np.arange(1, int(np.floor(deepest / step + 0.1)) + 1)
    if len(grid) < 4:
        raise InputError(
            trials[int(np.argmin([b.depth[-1] for b in branches]))].source,
            "displacement_mm",
            f"{deepest:.2f} mm of loading are too short to identify from",
            "press deeper or take this trial out",
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
    ) / len(trials) + noise.common_shift_sd**2 * np.outer(slope, slope)
    return LoadingCurve(
        displacement=frozen_array(grid),
        force=frozen_array(force),
        force_sd=frozen_array(np.sqrt(np.diag(covariance))),
        covariance=frozen_array(covariance),
        trial_force=frozen_array(curves),
        n_trials=len(trials),
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
