"""The loading branch of each trial, and bringing the branches of several onto each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.recording.contact import Contact, fit_onset
from legfem.recording.phases import AIR, LOADING, split_phases
from legfem.recording.smoothing import local_line, sample_noise, smooth_displacement
from legfem.recording.trial import Recording

_ALIGNED_WITHIN_MM = 2.0


@dataclass(frozen=True, eq=False)
class Branch:
    """Loading, and the approach through air before it; arrays are (n,)."""

    depth: FloatArray
    """mm after first contact, not decreasing; negative in air."""
    force: FloatArray
    """N above the baseline."""
    leverage: FloatArray
    """Variance of the smoothed displacement over that of a reading."""

    def moved(self, by: float, offset: float = 0.0) -> Branch:
        """Return the branch with ``by`` mm and ``offset`` N taken off."""
        return Branch(self.depth - by, self.force - offset, self.leverage)

    def loaded(self) -> Branch:
        """Return the part after first contact."""
        kept = self.depth >= 0.0
        return Branch(self.depth[kept], self.force[kept], self.leverage[kept])


def loading_branch(recording: Recording, contact: Contact) -> Branch:
    """Return the samples of approach and loading that go deeper than any before.

    Raises
    ------
    InputError
        If there is no loading after contact.
    """
    labels = split_phases(recording, contact)
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
            smooth[part], leverage[part] = smooth_displacement(recording.time[part], recording.displacement[part])
        else:
            approach[start:end] = False
    depth = smooth - contact.displacement
    reached = np.maximum.accumulate(np.where(approach, depth, -np.inf))
    virgin = approach & (depth >= reached - sample_noise(recording.displacement))
    if np.count_nonzero(virgin & (depth >= 0)) < 5:
        raise InputError(
            recording.source or recording.trial,
            "displacement_mm",
            "there is no loading after contact",
            "press deeper or remove this trial",
        )
    order = np.argsort(depth[virgin], kind="stable")
    force = recording.force - contact.baseline
    return Branch(depth[virgin][order], force[virgin][order], leverage[virgin][order])


def align_branches(
    branches: Sequence[Branch], contacts: Sequence[Contact], displacement_sd: float, step: float
) -> tuple[list[Branch], float]:
    """Bring branches onto each other and to first contact.

    Trials that all begin at first touch stay put. Where one begins in air, the whole curves tell
    how the trials lie to each other far better than each one's first contact does; contact is
    then found once, in all of them together.

    Parameters
    ----------
    branches : sequence of Branch
        The trials' branches.
    contacts : sequence of Contact
        Their first contacts.
    displacement_sd : float
        Of a reading, mm.
    step : float
        Grid on which branches are compared, mm.

    Returns
    -------
    list of Branch, float
        The loaded parts, and the standard error of their common contact, mm (0 without air).
    """
    in_air = [c.in_air for c in contacts]
    if not any(in_air):
        return [b.loaded() for b in branches], 0.0
    errors = [c.displacement_error for c in contacts if c.in_air]
    if len(branches) == 1:
        return [branches[0].loaded()], errors[0]
    placed = list(branches)
    # Those whose contact is known first; then each against the mean of the others.
    known = [b for b, air in zip(branches, in_air, strict=True) if air]
    for k, air in enumerate(in_air):
        if not air:
            placed[k] = _onto(branches[k], known, step, in_air=False)
    for _ in range(3):
        onto = [_onto(b, placed[:k] + placed[k + 1 :], step) for k, b in enumerate(placed)]
        # Half the way, lest two trials swap places.
        placed = [b.moved(0.5 * float(b.depth[0] - c.depth[0])) for b, c in zip(placed, onto, strict=True)]
    common = _common_contact(placed, displacement_sd)
    if common.in_air:
        by, offset, error = common.displacement, common.baseline, common.displacement_error
    else:
        # Together they show no air: then those that began at contact say where it is.
        at_contact = [
            float(b.depth[0] - a.depth[0]) for a, b, air in zip(branches, placed, in_air, strict=True) if not air
        ]
        by = float(np.mean(at_contact)) if at_contact else 0.0
        offset, error = 0.0, max(displacement_sd, float(np.mean(errors)))
    return [b.moved(by, offset).loaded() for b in placed], error


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


def _common_contact(branches: Sequence[Branch], displacement_sd: float) -> Contact:
    # Averaged rather than pooled: neighbours then keep the correlation that the error needs.
    start = max(float(b.depth[0]) for b in branches)
    end = min(float(b.depth[-1]) for b in branches)
    spacing = max(0.02, *(float(b.depth[-1] - b.depth[0]) / len(b.depth) for b in branches))
    grid = np.arange(start, end, spacing)
    mean = np.mean([local_line(b.depth, b.force, grid, 0.5 * spacing, 2).value for b in branches], axis=0)
    return fit_onset(grid, mean, 0.0, displacement_sd)
