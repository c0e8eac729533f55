"""Which mechanisms to believe: refits of candidates, Schwarz' criterion, held-out data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.diagnose.fit import Fit, Problem, fit
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.observations import Observations
from legfem.diagnose.score import Assessment, assess

ADEQUATE = 0.004
"""p-value below which a model's residual is called misfit."""
BIC_MARGIN = 6.0
"""Difference of the criterion below which models aren't told apart (Raftery's strong evidence)."""
CONFIRMED = 3
"""So many of the best refits at most are confirmed by full solutions."""
PAIRS_FROM = 3
"""So many of the best single mechanisms are tried in pairs."""
MISMATCH = 0.02
"""p-value of the base model below which there is a mismatch."""

type Confirm = Callable[[Problem, Fit, float], tuple[Problem, Fit, bool]]
"""Refits about a full solution, up to a criterion from which it isn't worth it: the problem shifted
to it, the refit, and whether it was made."""
_HOPELESS = 30.0
"""Difference of the criterion beyond which more full solutions don't help."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with mechanisms, refitted and assessed."""

    problem: Problem
    fit: Fit
    assessment: Assessment
    confirmed: bool
    """Whether a full solution stands behind the refit."""

    @property
    def adequate(self) -> bool:
        """Whether its residual is noise."""
        return self.assessment.p_value >= ADEQUATE


@dataclass(frozen=True, eq=False)
class Choice:
    """What was chosen, and what could have been as well."""

    base: Candidate
    best: Candidate
    alternatives: tuple[Candidate, ...]
    """Other adequate models that the data can't tell from the best, the nearest first."""
    tried: tuple[Fit, ...]
    """All refits, by their criterion."""

    @property
    def mismatch(self) -> bool:
        """Whether the base model is contradicted."""
        return self.base.assessment.p_value < MISMATCH


def unconfirmed(problem: Problem, fitted: Fit, limit: float) -> tuple[Problem, Fit, bool]:
    """Return a refit as it is, where there is no full model."""
    return problem, fitted, False


def choose(
    problem: Problem,
    base: Fit,
    mechanisms: Sequence[Mechanism],
    seed: int = 0,
    confirm: Confirm = unconfirmed,
) -> Choice:
    """Choose the mechanisms that the data ask for, one, then two at a time.

    Parameters
    ----------
    problem
        The observations.
    base
        The base model's fit.
    mechanisms
        Those that the data can show.
    seed
        Of the draws behind p-values.
    confirm
        Refits about a full solution, before a model is judged: an emulated response is not exact
        where the effect is strong.
    """
    first = Candidate(problem, base, assess(problem, base, mechanisms, seed), True)
    if first.assessment.p_value >= MISMATCH:
        return Choice(first, first, (), (base,))

    def judged(candidates: Sequence[tuple[Problem, Fit]]) -> list[Candidate]:
        found: list[Candidate] = []
        for own, fitted in candidates:
            known = [c.fit.bic for c in found if c.adequate]
            limit = min(known, default=np.inf) + _HOPELESS
            shifted, refit, made = confirm(own, fitted, limit)
            others = [m for m in mechanisms if m.name not in refit.names]
            found.append(Candidate(shifted, refit, assess(shifted, refit, others, seed), made))
        return sorted(found, key=lambda c: (not c.adequate, c.fit.bic))

    singles = sorted((fit(problem, [m], base.values) for m in mechanisms), key=lambda f: f.bic)
    near = judged([(problem, single) for single in _leading(base, singles)])
    tried = [*(c.fit for c in near), *singles[len(near) :]]
    if not near[0].adequate:
        pairs = _pairs(near[:PAIRS_FROM], singles)
        tried += [found for _, found in pairs]
        best_pairs = _leading(base, [found for _, found in pairs])
        pairs_near = judged([(own, f) for own, f in pairs if f in best_pairs])
        if pairs_near and pairs_near[0].fit.bic < near[0].fit.bic - BIC_MARGIN:
            near = pairs_near
    best = near[0]
    alternatives = tuple(
        c
        for c in near[1:]
        if best.adequate and c.adequate and c.fit.bic < best.fit.bic + BIC_MARGIN
    )
    return Choice(first, best, alternatives, tuple(sorted(tried, key=lambda f: f.bic)))


def _leading(base: Fit, found: Sequence[Fit]) -> list[Fit]:
    """Return the refits that a full solution might put first, of those sorted by criterion."""
    gained = max(base.bic - found[0].bic, 0.0)
    margin = max(BIC_MARGIN, 0.1 * gained)
    return [f for f in found if f.bic < found[0].bic + margin][:CONFIRMED]


def _pairs(leading: Sequence[Candidate], singles: Sequence[Fit]) -> list[tuple[Problem, Fit]]:
    """Return fits of leading single mechanisms with each other one, started from both."""
    pairs: dict[frozenset[str], tuple[Problem, Fit]] = {}
    for one in leading:
        for other in singles:
            names = frozenset([*one.fit.names, *other.names])
            if len(names) < 2 or names in pairs:
                continue
            shapes = {key: value for key, value in other.values.items() if "." in key}
            start = {**one.fit.values, **_halved(shapes, other)}
            both = [*one.fit.mechanisms, *other.mechanisms]
            pairs[names] = (one.problem, fit(one.problem, both, start))
    return sorted(pairs.values(), key=lambda pair: pair[1].bic)


def _halved(values: Mapping[str, float], single: Fit) -> dict[str, float]:
    """Return the values with strengths halved: two share what each explained alone."""
    strengths = {f"{m.name}.{m.parameters[0].name}" for m in single.mechanisms}
    return {key: value / 2 if key in strengths else value for key, value in values.items()}


@dataclass(frozen=True)
class HeldOut:
    """Errors of predicting what a fit didn't see."""

    how: str
    rmse: float
    """N."""
    noise: float
    """N: what the errors alone would make."""


def folds_of(observed: Observations) -> tuple[str, list[NDArray[np.bool_]]]:
    """Return what is held out in turn: protocols, else trials, else later phases, else depth.

    Of repeats the first trial is always seen: it alone tells how the leg was before it was pressed,
    which can't be predicted from later trials.
    """
    if observed.repeats > 1:
        later = observed.trial > 0
        if len(observed.protocols) > 1:
            how = "each protocol in turn, but for the first trial"
            each = (later & (observed.protocol == p) for p in range(len(observed.protocols)))
            folds = [fold for fold in each if fold.any()]
        else:
            how = "each trial in turn, but for the first"
            folds = [observed.trial == k for k in range(1, len(observed.trials))]
    elif len(observed.protocols) > 1:
        how, folds = "each protocol in turn", [
            observed.protocol == p for p in range(len(observed.protocols))
        ]  # fmt: skip
    elif len(observed.phases) > 1:
        how, folds = "hold and unloading", [observed.phase != "loading"]
    else:
        how, folds = "the deepest third", [observed.displacement > 2 / 3 * observed.depth]
    return how, folds


def held_out(problem: Problem, fitted: Fit) -> HeldOut:
    """Return the error of predicting each fold from the others."""
    observed = problem.predictor.observed
    how, folds = folds_of(observed)
    squares, noise, count = 0.0, 0.0, 0
    for fold in folds:
        refit = fit(problem.without(fold), fitted.mechanisms, fitted.values, free_shapes=False)
        squares += float(np.sum(refit.residual[fold] ** 2))
        noise += float(np.sum(np.diag(problem.errors.covariance)[fold]))
        count += int(fold.sum())
    return HeldOut(how, float(np.sqrt(squares / count)), float(np.sqrt(noise / count)))
