"""Adding physics to a specimen's elastic model one mechanism at a time, while the data ask for it.

`legfem.diagnose.choose` tries singles and pairs; a relaxing piece of meat needs a Prony branch or
two, and where it was first touched, at once. Here mechanisms are added greedily, by Schwarz'
criterion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from legfem.diagnose.choose import BIC_MARGIN
from legfem.diagnose.fit import Fit, Problem, fit
from legfem.diagnose.mechanisms import Mechanism
from legfem.study.recordings.responses import Relaxation, SpecimenResponses

_MOST = 4
_CONFIRMATIONS = 2


@dataclass(frozen=True, eq=False)
class Repair:
    """The elastic model and the one with what it left out; both fitted to the same data."""

    base: Fit
    best: Fit
    gains: tuple[tuple[str, float], ...]
    """Mechanisms in the order that they came in, and what each took off the criterion."""
    linear_error: float
    """Greatest difference of the full solution from the sum of branches, over the peak force."""

    @property
    def names(self) -> tuple[str, ...]:
        """Mechanisms of the repaired model."""
        return self.best.names


def repair(
    problem: Problem,
    mechanisms: Sequence[Mechanism],
    left_out: NDArray[np.bool_],
    start: Mapping[str, float],
) -> Repair:
    """Fit the elastic model, and add mechanisms while the criterion falls by more than its margin.

    Parameters
    ----------
    problem
        The observations, with `SpecimenResponses`.
    mechanisms
        Candidates; of several with one name, a later one may take an earlier one's place.
    left_out
        (n,): observations that no fit sees.
    start
        Stiffness to start from (kPa).
    """
    seen = problem.without(left_out)
    base = best = fit(seen, (), start)
    gains: list[tuple[str, float]] = []
    while len(best.mechanisms) < _MOST:
        trials = [_with(seen, best, m) for m in mechanisms if m not in best.mechanisms]
        ahead = min(trials, key=lambda f: f.bic, default=best)
        if ahead.bic > best.bic - BIC_MARGIN:
            break
        new = next(m for m in ahead.mechanisms if m not in best.mechanisms)
        gains.append((_label(new), best.bic - ahead.bic))
        best = ahead
    best, error = _confirmed(seen, best)
    return Repair(base, best, tuple(gains), error)


def _label(mechanism: Mechanism) -> str:
    if isinstance(mechanism, Relaxation) and mechanism.branches > 1:
        return f"{mechanism.name} ({mechanism.branches} branches)"
    return mechanism.name


def _with(problem: Problem, fitted: Fit, mechanism: Mechanism) -> Fit:
    """Add a mechanism, in place of one of its name."""
    kept = [m for m in fitted.mechanisms if m.name != mechanism.name]
    start = {k: v for k, v in fitted.values.items() if not k.startswith(f"{mechanism.name}.")}
    return fit(problem, [*kept, mechanism], start)


def _confirmed(problem: Problem, fitted: Fit) -> tuple[Fit, float]:
    """Refit about full solutions with all branches at once; return their distance before."""
    plain = problem.predictor
    responses = plain.responses
    assert isinstance(responses, SpecimenResponses)
    if "viscoelasticity" not in fitted.names:
        return fitted, 0.0
    full = replace(plain, responses=replace(responses, whole=True))
    error = 0.0
    for k in range(_CONFIRMATIONS):
        difference = full(fitted.values, fitted.mechanisms) - plain(
            fitted.values, fitted.mechanisms
        )
        if k == 0:
            error = float(np.abs(difference).max() / np.abs(fitted.prediction).max())
        fitted = fit(problem.corrected(difference), fitted.mechanisms, fitted.values)
    return fitted, error
