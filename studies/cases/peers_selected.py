"""Sparse selection among legfem's mechanisms: the fewest linearised responses that describe the recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
import statsmodels.api as sm
from scipy.stats import norm

from legfem.common.progress import Silent
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10, deep_stiffness
from legfem.inverse.diagnose import starts
from legfem.inverse.errors import error_model
from legfem.inverse.library import Detail
from legfem.inverse.library_tasks import STIFFENING, cross, rounded, tasks_for
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import fit, ordinary_fit
from legfem.inverse.mechanism import Mechanism, TissueMechanism, shown_mechanisms
from legfem.inverse.predictor import Predictor
from legfem.inverse.trial_noise import estimate_noise
from legfem.legs.diagnosis import Diagnoser, ruled_out_of
from legfem.legs.subject import Subject
from studies.cases.outcomes import Interval
from studies.cases.peers_fitted import Answer

type Chosen = tuple[int, ...]
"""Columns."""
PENALTIES = np.geomspace(1.0, 1e-2, 20)
"""Of LASSO's path, over the one from which all is nought."""


def bic_of(chosen: Chosen, left: FloatArray, base: FloatArray, responses: FloatArray) -> float:
    """Return Schwarz' criterion (up to a constant) of responses beside the base model's parameters, all whitened."""
    design = np.hstack([base, responses[:, chosen]])
    rest = left - design @ np.linalg.lstsq(design, left)[0]
    return float(rest @ rest + len(chosen) * np.log(len(left)))


def least_bic(left: FloatArray, base: FloatArray, responses: FloatArray, names: Sequence[str]) -> Chosen:
    """Return what of nothing, single responses and pairs has the least of it.

    Parameters
    ----------
    left
        (n,): what the base model leaves.
    base
        (n, p): by its parameters.
    responses
        (n, k): by strengths.
    names
        Of the k mechanisms; no pair is of one.
    """
    alone = [(k,) for k in range(len(names))]
    pairs = [pair for pair in combinations(range(len(names)), 2) if names[pair[0]] != names[pair[1]]]
    return min([(), *alone, *pairs], key=lambda one: bic_of(one, left, base, responses))


def lasso(left: FloatArray, base: FloatArray, responses: FloatArray, names: Sequence[str]) -> Chosen:
    """Return what of LASSO's path has the least of it; the base model's parameters aren't penalised.

    B. Efron et al., Ann. Stat. 32 (2004) 407-499: what is found is fitted anew without a penalty.
    """
    basis = np.linalg.qr(base)[0]
    free, seen = (one - basis @ (basis.T @ one) for one in (left, responses))
    size = np.linalg.norm(seen, axis=0)
    columns = np.divide(seen, size, out=np.zeros_like(seen), where=size > 1e-9 * np.linalg.norm(responses, axis=0))
    most = np.abs(columns.T @ free).max() / len(free)
    model, found = sm.OLS(free, columns), set[Chosen]([()])
    for penalty in PENALTIES:
        weights = model.fit_regularized(alpha=penalty * most, L1_wt=1.0).params
        order = np.argsort(-np.abs(weights))
        found.add(tuple(int(k) for k in order if weights[k] != 0))
    return min(sorted(found), key=lambda one: bic_of(one, left, base, responses))


def after(chosen: Chosen, base: LinearisedFit, responses: FloatArray) -> Interval:
    """Return C10 with its 95 % interval, as if what was chosen had been known."""
    design = np.hstack([base.jacobian, responses[:, chosen]])
    spread = np.linalg.pinv(design.T @ design)
    moved = spread @ design.T @ base.whitened
    half = np.eye(len(moved))[base.free.index(DEEP_C10)] * norm.ppf(0.975) * np.sqrt(np.diag(spread))
    ends = [(base.prior_z + (moved + side * half)[: len(base.free)]) for side in (0.0, -1.0, 1.0)]
    return Interval(*(mpa_to_kpa(base.moved(one)[DEEP_C10]) for one in ends))


def screened(leg: Subject, diagnoser: Diagnoser) -> tuple[LinearisedFit, list[Mechanism], int]:
    """Return the base model's fit, the mechanisms that were screened, and the solves that these took.

    By a diagnosis' own errors and screening responses; those are recalled where it is kept.
    """
    observed = diagnoser.observations(leg)
    first = diagnoser.by_base_model(leg, observed)
    middle = rounded(deep_stiffness(first.base_model.fit.values)[0])
    able, _ = shown_mechanisms(diagnoser.mechanisms_of(leg), observed, ruled_out_of(leg, None))
    complete, solved = diagnoser.tabulating(leg, observed, middle, Silent(), able)
    library = complete(Detail())
    stiffening, tissue = STIFFENING[leg.tissues["deep"].law], [m for m in able if isinstance(m, TissueMechanism)]
    tasks = tasks_for(observed, tissue, middle, stiffening, solved.variants, cross(stiffening), Detail())
    predictor = Predictor(observed, library, leg.tissues["deep"].law)
    noise = estimate_noise(observed, leg.instrument)
    problem = LinearisedProblem(predictor, error_model(observed, noise, observed.values))
    plain = ordinary_fit(problem, starts(predictor.law, middle))
    noise = estimate_noise(observed, leg.instrument, plain.residual)
    problem = LinearisedProblem(predictor, error_model(observed, noise, plain.prediction))
    return fit(problem, (), plain.values), [m for m in able if m.name not in library.missing], len(tasks)


def linearised(base: LinearisedFit, mechanisms: Sequence[Mechanism]) -> tuple[list[str], FloatArray]:
    """Return mechanisms' names and their whitened responses (n, k) about the base model's fit."""
    problem, names, columns = base.problem, [], []
    for mechanism in mechanisms:
        for values in mechanism.starts(problem.predictor.observed):
            moved = problem.predictor({**base.values, **mechanism.by_full_name(values)}, [mechanism]) - base.prediction
            if np.isfinite(moved).all() and np.any(moved):
                names.append(mechanism.name)
                columns.append(problem.whitened(moved))
    return names, np.column_stack(columns)


def selected(choose: Callable[..., Chosen], leg: Subject, folder: Path) -> Answer:
    """Choose among the responses that a diagnosis keeps in a folder; ``solves`` are those that a first one takes."""
    base, mechanisms, solves = screened(leg, Diagnoser(folder, None))
    names, responses = linearised(base, mechanisms)
    chosen = choose(base.whitened, base.jacobian, responses, names)
    return Answer(after(chosen, base, responses), solves, list(dict.fromkeys(names[k] for k in chosen)))


by_bic, by_lasso = partial(selected, least_bic), partial(selected, lasso)
