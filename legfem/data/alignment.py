r"""Repeats of one press, brought onto each other and to the first contact that they show together.

Trial k reads, at a depth :math:`x` that all have alike,

.. math:: F(x + \delta_k) + b_k + g_k F(x) + e_k,

with the same unknown force :math:`F`, a first contact that was put :math:`\delta_k` too early, a zero :math:`b_k`, a
gain and a slow error. Differences between trials don't contain :math:`F` but for its slope; weighed by their errors
they tell the :math:`\delta_k` and :math:`b_k` less their means. Where all rise from is then looked for in all at once
(`legfem.data.contact.common_onset`), whether or not one by itself shows air.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from scipy.linalg import cholesky, helmert, solve_triangular

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.contact import Contact, Onset, common_onset, enough_gain
from legfem.data.noise import WANDER_LENGTH_MM, Instrument, slow_correlation
from legfem.data.phases import AIR, LOADING
from legfem.data.segmentation import Segmentation
from legfem.data.smoothing import local_line, smooth_displacement

_GAIN = 0.02
"""Standard deviation of a repeat's stiffness, relative."""
_FARTHEST_MM = 2.0
"""Standard deviation of a first contact before the curves are compared."""
_WHITE = 0.1
"""Share of a reading's variance that is white on the grid."""
_STEP_MM = 0.25
"""Step of the grid."""
_ROUNDS = 12
"""Most rounds of the alignment."""
_SETTLED_MM = 1e-3
"""Shift below which the alignment has settled."""
_FEWEST = 8
"""Fewest points that show anything."""


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
    contact_sd: float
    """Standard error of their common contact, mm; 0 where it is known."""
    shift_sd: float
    """Standard error of one trial's place against the others', mm."""
    zero_sd: float
    """Standard error of one trial's zero, N."""
    from_air: bool = False
    """Whether air before it shows where zero is, and the curves' rise where contact is."""


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
        return Aligned(tuple(branches), 0.0, instrument.displacement_sd, instrument.force_sd)
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
        tuple(b.moved(onset.place, level) for b in placed.branches),
        onset.error,
        placed.shift_sd,
        placed.zero_sd,
        from_air=True,
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
    zeros = [c.baseline_error if c.in_air else instrument.force_sd for c in contacts]
    zero_sd, from_air = float(np.sqrt(np.mean(np.square(zeros)))), len(contacts) == 1 and contacts[0].in_air
    return Aligned(tuple(branches), float(np.mean(errors)), instrument.displacement_sd, zero_sd, from_air)


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
    came, seen = np.array([c.estimate - c.displacement for c in contacts]), [c.baseline for c in contacts if c.in_air]
    # Where no air shows a trial's zero, it may be as far off as the others'.
    unseen = float(np.hypot(instrument.force_sd, np.sqrt(np.mean(np.square(seen))) if seen else 0.0))
    zeros_sd = np.array([c.baseline_error if c.in_air else unseen for c in contacts])
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
        lower = cholesky(_trial_errors(grid, force, slope, instrument), lower=True)
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


def _trial_errors(grid: FloatArray, force: FloatArray, slope: FloatArray, instrument: Instrument) -> FloatArray:
    """Return the covariance (n, n), N^2, of what a trial errs by besides its place and its zero."""
    apart = np.abs(grid[:, None] - grid[None, :])
    correlation = slow_correlation(grid) + _WHITE * np.eye(len(grid))
    wander = instrument.displacement_sd * slope
    return np.asarray(
        max(instrument.force_sd, 1e-4 * float(np.ptp(force))) ** 2 * correlation
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
