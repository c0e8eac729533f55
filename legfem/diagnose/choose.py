"""Which mechanisms to believe: refits of candidates, Schwarz' criterion, held-out data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from legfem.diagnose.fit import Fit, Problem, fit
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.observations import Observations
from legfem.diagnose.score import Assessment, assess

ADEQUATE = 0.01
"""p-value below which a model's residual is called misfit."""
BIC_MARGIN = 6.0
"""Difference of the criterion below which models aren't told apart (Raftery's strong evidence)."""
PAIRS_FROM = 6
"""So many of the best single mechanisms are tried in pairs."""
MISMATCH = 0.02
"""p-value of the base model below which there is a mismatch."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with mechanisms, refitted and assessed."""

    fit: Fit
    assessment: Assessment

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


def choose(
    problem: Problem,
    base: Fit,
    mechanisms: Sequence[Mechanism],
    seed: int = 0,
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
    """
    first = Candidate(base, assess(problem, base, mechanisms, seed))
    if first.assessment.p_value >= MISMATCH:
        return Choice(first, first, (), (base,))
    singles = sorted((fit(problem, [m], base.values) for m in mechanisms), key=lambda f: f.bic)
    tried = [*singles]
    best = _assessed(problem, singles[0], mechanisms, seed)
    pool = singles
    if not best.adequate or _more_asked(best):
        pairs = _pairs(problem, singles)
        tried += pairs
        if pairs and pairs[0].bic < best.fit.bic - BIC_MARGIN:
            best, pool = _assessed(problem, pairs[0], mechanisms, seed), pairs
    near = [
        _assessed(problem, other, mechanisms, seed)
        for other in pool
        if other.names != best.fit.names and other.bic < best.fit.bic + BIC_MARGIN
    ]
    alternatives = tuple(c for c in near if c.adequate) if best.adequate else ()
    return Choice(first, best, alternatives, tuple(sorted(tried, key=lambda f: f.bic)))


def _more_asked(candidate: Candidate) -> bool:
    return candidate.assessment.p_value < 0.1


def _assessed(
    problem: Problem, found: Fit, mechanisms: Sequence[Mechanism], seed: int
) -> Candidate:
    others = [m for m in mechanisms if m.name not in found.names]
    return Candidate(found, assess(problem, found, others, seed))


def _pairs(problem: Problem, singles: Sequence[Fit]) -> list[Fit]:
    """Return fits of the best singles with each other mechanism, started from both."""
    by_name = {single.names[0]: single for single in singles}
    wanted = {
        tuple(sorted((a.names[0], b.names[0])))
        for a in singles[:PAIRS_FROM]
        for b in singles
        if a is not b
    }
    order = [single.names[0] for single in singles]
    pairs = []
    for one, two in combinations(order, 2):
        if tuple(sorted((one, two))) not in wanted:
            continue
        a, b = by_name[one], by_name[two]
        shapes = {key: value for part in (a, b) for key, value in part.values.items() if "." in key}
        start = {**a.values, **_halved(shapes, (a, b))}
        pairs.append(fit(problem, [*a.mechanisms, *b.mechanisms], start))
    return sorted(pairs, key=lambda f: f.bic)


def _halved(values: dict[str, float], parts: Sequence[Fit]) -> dict[str, float]:
    """Return the values with strengths halved: two share what each explained alone."""
    strengths = {f"{m.name}.{m.parameters[0].name}" for part in parts for m in part.mechanisms}
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
    """Return what is held out in turn: protocols, else trials, else later phases, else depth."""
    if len(observed.protocols) > 1:
        how, folds = "each protocol in turn", [
            observed.protocol == p for p in range(len(observed.protocols))
        ]  # fmt: skip
    elif observed.repeats > 1:
        how, folds = "each trial in turn", [
            observed.trial == k for k in range(len(observed.trials))
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
