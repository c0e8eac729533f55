r"""The chance that a test would tell explanations apart.

Data that one explanation would give are predicted by another's parameters as they are known today.
With :math:`\Delta` the difference of both predictions, :math:`S` the errors of the new test and
:math:`J \Sigma J^T` what the other's parameters may still take up,

.. math:: m = \tfrac12 \Delta^T (S + J \Sigma J^T)^{-1} \Delta

is the logarithm of the Bayes factor that is expected; it scatters with variance :math:`2 m`, so
that both are told apart (a factor of :math:`e^3`) with probability
:math:`\Phi((m - 3) / \sqrt{2 m})`. Compare D. V. Lindley, Ann. Math. Statist. 27 (1956) 986-1005.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from legfem.common.units import FloatArray
from legfem.diagnose.fit import Fit, Problem
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.mechanisms.base import prior_of
from legfem.diagnose.mechanisms.end_effects import EndEffects
from legfem.diagnose.mechanisms.muscle_fibres import MuscleFibres
from legfem.diagnose.nuisances import Accuracy, Nuisances
from legfem.diagnose.observations import Observations, blank_observations
from legfem.diagnose.predict import Predictor
from legfem.inference.errors import error_model
from legfem.inference.trial_noise import Noise
from legfem.plan.designs import Design, Readings

TOLD_APART = 3.0
"""ln of the Bayes factor: twenty to one."""
_STEP = 1e-3
_SEEN_ONSET_SD_MM = 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """An explanation as it is known before the new test.

    Parameters
    ----------
    name
        For people.
    fit
        Its mechanisms and values; its parameters with their priors.
    mean, covariance
        (p,), (p, p): departures of its parameters from their priors.
    probability
        Today.
    """

    name: str
    fit: Fit
    mean: FloatArray
    covariance: FloatArray
    probability: float


@dataclass(frozen=True)
class Reckoned:
    """What a test is worth."""

    design: Design | Readings
    chances: Mapping[tuple[str, str], float]
    """That data of the first explanation tell it from the second."""
    chance: float
    """That whichever explanation holds is told from all others."""


def reckon(
    design: Design,
    candidates: Sequence[Candidate],
    predictor: Predictor,
    nuisances: Nuisances,
    accuracy: Accuracy,
    noise: Noise,
    gain_sd: float,
) -> Reckoned | None:
    """Return what a test is worth; None where a response to it isn't known.

    Parameters
    ----------
    design
        The test.
    candidates
        Explanations that are open.
    predictor
        Of the test that was made: its leg, law and ends.
    nuisances, accuracy
        What isn't known of the leg.
    noise, gain_sd
        Of the instruments and from trial to trial.
    """
    blank = blank_observations(design.protocols)
    new = replace(predictor, observed=blank, offset=0.0)
    accuracy = replace(accuracy, contour_sd=0.0) if design.outlines_known else accuracy
    forces = [_predicted(new, c, design) for c in candidates]
    if any(np.isnan(force).any() for force in forces):
        return None
    chances = {}
    for i, one in enumerate(candidates):
        effects = nuisances.effects(blank, forces[i], accuracy)
        errors = error_model(blank.with_force(forces[i]), noise, forces[i], effects)
        errors = replace(errors, gain_sd=gain_sd)
        for j, other in enumerate(candidates):
            if i == j:
                continue
            taken = _slopes(new, other, design, blank)
            spread = _known(other, design)
            total = errors.covariance + taken @ spread @ taken.T
            apart = forces[i] - forces[j]
            chances[one.name, other.name] = told_apart(apart, total)
    return reckoned(design, chances, candidates)


def told_apart(apart: FloatArray, total: FloatArray) -> float:
    """Return the chance that data tell two explanations apart.

    Parameters
    ----------
    apart
        (n,): difference of what both predict.
    total
        (n, n): covariance of all that the data and the second may be off by.
    """
    m = 0.5 * float(apart @ np.linalg.solve(total, apart))
    return float(norm.cdf((m - TOLD_APART) / np.sqrt(2 * m + 1e-9)))


def reckoned(
    design: Design | Readings,
    chances: Mapping[tuple[str, str], float],
    candidates: Sequence[Candidate],
) -> Reckoned:
    """Return what a test is worth, from the chances that it tells each from each."""
    weights = np.array([c.probability for c in candidates])
    each = [
        min((chances[c.name, o.name] for o in candidates if o is not c), default=1.0)
        for c in candidates
    ]
    return Reckoned(design, chances, float(weights @ each / weights.sum()))


def ranked(found: Sequence[Reckoned]) -> list[Reckoned]:
    """Return tests, the most telling first."""
    return sorted(found, key=lambda one: -one.chance)


def _predicted(new: Predictor, candidate: Candidate, design: Design) -> FloatArray:
    return _force(new, candidate.fit.mechanisms, candidate.fit.moved(candidate.mean), design)


def _force(
    new: Predictor, mechanisms: Sequence[Mechanism], values: Mapping[str, float], design: Design
) -> FloatArray:
    """Return the force (n,), N; a longer cylinder's ends count less, the rest more."""
    given = dict(values)
    for k in range(len(new.observed.trials)):
        given.setdefault(f"trial{k + 1}.onset", 0.0)
    # New trials are touched where they are touched: what was fitted before was the old ones'.
    given = {name: 0.0 if name.endswith(".onset") else value for name, value in given.items()}
    ends, fibres = f"{EndEffects.name}.scale", f"{MuscleFibres.name}.ratio"
    if ends in given:
        given[ends] /= design.length_factor
    if fibres in given:
        given[fibres] **= 1 / design.length_factor
    return design.length_factor * new(given, mechanisms)


def _slopes(
    new: Predictor, candidate: Candidate, design: Design, blank: Observations
) -> FloatArray:
    """Return what the other's parameters, and the new trials' first contacts, may change."""
    fitted = candidate.fit
    here = _force(new, fitted.mechanisms, fitted.moved(candidate.mean), design)
    columns = []
    for k, parameter in enumerate(fitted.parameters):
        if parameter.role == "nuisance":
            continue
        moved = candidate.mean.copy()
        moved[k] += _STEP
        there = _force(new, fitted.mechanisms, fitted.moved(moved), design)
        columns.append((there - here) / _STEP)
    slope = blank.with_force(here).stiffness
    onsets = [np.where(blank.trial == k, -slope, 0.0) for k in range(len(blank.trials))]
    return np.column_stack([*columns, *onsets])


def _known(candidate: Candidate, design: Design) -> FloatArray:
    kept = [k for k, p in enumerate(candidate.fit.parameters) if p.role != "nuisance"]
    sd = _SEEN_ONSET_SD_MM
    if not design.contact_known:
        nuisance = [p for p in candidate.fit.parameters if p.role == "nuisance"]
        sd = prior_of(nuisance[0]).sd if nuisance else sd
    trials = len(design.protocols)
    total = np.zeros((len(kept) + trials,) * 2)
    total[: len(kept), : len(kept)] = candidate.covariance[np.ix_(kept, kept)]
    total[len(kept) :, len(kept) :] = sd**2 * np.eye(trials)
    return total


def before_any_test(
    problem: Problem, base: Fit, mechanisms: Sequence[Mechanism]
) -> list[Candidate]:
    """Return nothing and every mechanism at a usual strength, all as probable.

    Parameters
    ----------
    problem
        Blank observations of the leg.
    base
        The base model at the stiffness that is expected.
    mechanisms
        Those that are to be told.
    """
    found = [Candidate("nothing", base, base.departure, np.eye(len(base.free)), 1.0)]
    for mechanism in mechanisms:
        parameters = problem.parameters([mechanism])
        departure = np.zeros(len(parameters))
        departure[: len(base.free)] = base.departure
        departure[len(base.free)] = 0.7
        fitted = replace(base, mechanisms=(mechanism,), parameters=parameters, departure=departure)
        found.append(Candidate(mechanism.name, fitted, departure, np.eye(len(parameters)), 1.0))
    return found
