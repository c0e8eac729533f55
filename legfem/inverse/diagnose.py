"""From recordings to a verdict: noise, fit of the base model, location of its misfit, explanations, limits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from legfem.common.progress import NEVER, Deadline, Progress
from legfem.data import Instrument
from legfem.inverse.accuracy import Accuracy, measured_strengths
from legfem.inverse.averaging import unseen_of
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName, deep_stiffness
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.errors import NuisanceEffect, error_model
from legfem.inverse.explain import explain, tolerantly
from legfem.inverse.explanation import Explained, Explanation
from legfem.inverse.fit import LEAST_CHANCE, Fit, Identity
from legfem.inverse.hidden import Limit
from legfem.inverse.least_squares import sandwich
from legfem.inverse.library import UNTRIED, Library
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem, nuisance_effects, variance_degrees
from legfem.inverse.location import SetAside, score_tests, touched_part
from legfem.inverse.map_fit import base_about_solution, equally_weighted, fit, ordinary_fit, refitted_about_solutions
from legfem.inverse.mechanism import Mechanism, Occurrence, shown_mechanisms
from legfem.inverse.observations import Observations
from legfem.inverse.predictive import held_out, misfit_of
from legfem.inverse.predictor import Predictor, onset_name, values_of
from legfem.inverse.responses import SolvedResponses
from legfem.inverse.screening import Complete
from legfem.inverse.station_test import FittedStations
from legfem.inverse.trial_noise import estimate_noise
from legfem.inverse.verdict import ADEQUATE, SHOWN_MOST, Diagnosis, Verdict, limits_of


class Identified(NamedTuple):
    """A fit of the base model, and its recordings at their stations."""

    fit: Fit[Any]
    stations: FittedStations


@dataclass(frozen=True, eq=False)
class DiagnosisInput:
    """What a diagnosis is given: recordings of a body whose responses are tabulated, and what is known of it.

    Parameters
    ----------
    observed
        The recordings at their stations.
    instrument
        Stated errors.
    law
        Of the deep tissue in the base model.
    library
        Of the body's responses.
    mechanisms
        That the body may have.
    subject, kind
        Whose recordings they are, and of what: ``leg`` or ``specimens``.
    identified
        The base model's fit to all that was recorded, about which explanations are sought; the diagnosis makes its own
        without it.
    accuracy
        How well the body is known.
    ends
        The correction for the cylinder's ends, where the recordings have them.
    ruled_out
        Mechanisms by name that can't be what was left out of the base model, and why.
    possible
        Which strengths mechanisms may have, and how common the great ones are; within their bounds without it.
    complete
        Solves what the library lacks; explanations stand by what it has without it.
    at_rest
        Least slow error of the force, over the greatest, where no repeats tell of it.
    """

    observed: Observations
    instrument: Instrument
    law: LawName
    library: Library
    mechanisms: Sequence[Mechanism]
    subject: Identity
    kind: str
    identified: Identified | None = None
    accuracy: Accuracy = field(default_factory=Accuracy)
    ends: TabulatedCorrection | None = None
    ruled_out: Mapping[str, str] = field(default_factory=dict)
    possible: Mapping[str, Occurrence] = field(default_factory=dict)
    complete: Complete | None = None
    at_rest: float = 0.0

    def nuisances(self, fitted: LinearisedFit) -> list[NuisanceEffect]:
        """Return what isn't known exactly does beside a fit's mechanisms."""
        library = fitted.problem.predictor.library
        changes = library.nuisances_beside([(m, values_of(fitted.values, m)) for m in fitted.mechanisms])
        stiffness = deep_stiffness(fitted.values)
        return nuisance_effects(changes, self.observed, fitted.prediction, self.accuracy, self.ends, stiffness)


def diagnose(
    given: DiagnosisInput, solved: SolvedResponses | None, progress: Progress, seed: int = 0, deadline: Deadline = NEVER
) -> Diagnosis:
    """Diagnose recordings: noise, base fit, location, explanations, verdict.

    Parameters
    ----------
    given
        The recordings, the body's responses and what is known of it.
    solved
        Full solutions, to confirm what is reported; emulated ones stand without it.
    progress
        Receives the steps.
    seed
        Of the draws that windows are judged by.
    deadline
        After which nothing more is solved.
    """
    observed, library, accuracy = given.observed, given.library, given.accuracy
    able, untested = shown_mechanisms(given.mechanisms, observed, given.ruled_out)
    unweighed = tuple(m for m in able if library.missing.get(m.name) == UNTRIED)
    able = [m for m in able if m.name not in library.missing]
    there = [m for m in given.mechanisms if m.name not in given.ruled_out]
    predictor = Predictor(observed, library, given.law, given.ends, accuracy.measured.get(DEEP_C10))
    progress.stage("fitting the base model")
    made = solved.solutions if solved is not None else 0
    problem, ordinary, error = _begun(given, predictor, solved)
    problem = replace(
        problem,
        measured=tuple(measured_strengths(accuracy, able)),
        possible=given.possible,
        unseen=tuple(unseen_of(there, observed, given.possible)),
        unweighed=unweighed,
        nuisances=given.nuisances if observed.channels else None,
    )
    identified = given.identified
    by_errors = identified is not None and identified.fit.weighting != "equal"
    base = fit(problem, (), ordinary.values, evaluations=0 if by_errors else None)
    progress.stage(f"weighing {len(able)} mechanisms")
    confirm = None if solved is None else partial(refitted_about_solutions, solved)
    explained = explain(base, able, confirm, ordinary.values, given.complete, deadline)
    problem = replace(problem, predictor=explained.base.problem.predictor)
    aside = _to_set_aside(problem, explained)
    if aside is not None:
        progress.stage(f"without {aside.described}")
        rest = problem.setting_aside(aside.readings)
        plain = ordinary_fit(rest, [base.values])
        alone = fit(rest, (), plain.values)
        again = explain(alone, able, confirm, plain.values, given.complete, deadline)
        if _leaves_something(again):
            aside = None
        else:
            problem, ordinary, base, explained = rest, plain, alone, again
    verdict, models = _verdict(explained)
    limits: tuple[Limit, ...] = ()
    tolerant = tolerantly(explained, able) if verdict == "unexplained" else None
    if verdict == "consistent" and not deadline.passed:
        progress.stage("what could hide")
        limits = limits_of(explained)
    progress.stage("where the base model is wrong")
    assessment = score_tests(base, able, seed)
    if identified is None or aside is not None:
        by_errors = base.lack_of_fit >= LEAST_CHANCE
    shown = explained.base if by_errors else ordinary_explanation(problem, ordinary, explained.base)
    if identified is not None and aside is None:
        shown = replace(shown, identified=identified.fit.estimates)
    return Diagnosis(
        verdict,
        given.law,
        observed,
        explained,
        shown,
        identified.fit if identified is not None and aside is None else None,
        models,
        assessment,
        held_out(shown.fit, problem.errors),
        tuple(held_out(m.fit) for m in models),
        {**library.missing, **untested},
        limits,
        given.ends is not None,
        (solved.solutions if solved is not None else 0) - made,
        error,
        misfit_of(problem, ordinary),
        given.subject,
        given.kind,
        seed,
        aside,
        bool(unweighed) or explained.cut,
        tolerant=tolerant,
    )


def _leaves_something(explained: Explained) -> bool:
    """Return whether the recordings ask for something unknown, by itself or beside what is named first."""
    verdict, models = _verdict(explained)
    return verdict == "unexplained" or (bool(models) and models[0].in_part)


def _to_set_aside(problem: LinearisedProblem, explained: Explained) -> SetAside | None:
    """Return a part of a trial that may be what asks for something unknown; a whole trial where nothing is named."""
    if not _leaves_something(explained):
        return None
    found = touched_part(problem.predictor.observed, problem.errors)
    return None if found is None or (found.whole and _verdict(explained)[1]) else found


def starts(law: LawName, middle: float) -> list[dict[str, float]]:
    """Return where searches for the base parameters begin, about a C10 in the middle (MPa)."""
    if law == "neo-hookean":
        return [{DEEP_C10: factor * middle, DEEP_C20: 0.0} for factor in (0.6, 1.5)]
    # Pressed deep, a little stiffening rules: a law almost without it is then far stiffer at first.
    factors = ((0.6, 1.0), (1.0, 0.3), (1.4, 0.1), (4.0, 0.1), (10.0, 0.1))
    return [{DEEP_C10: factor * middle, DEEP_C20: share * middle} for factor, share in factors]


def _begun(
    given: DiagnosisInput, predictor: Predictor, solved: SolvedResponses | None
) -> tuple[LinearisedProblem, LinearisedFit, float]:
    """Return the base model about its fit, with errors that are shares of its force, and the emulator's error there.

    The fit is what was identified, else one by ordinary least squares about a full solution. The noise is estimated
    anew once the trials' first contacts are fitted.
    """
    observed = predictor.observed
    noise = estimate_noise(observed, given.instrument, at_rest=given.at_rest)
    problem = LinearisedProblem(predictor, error_model(observed, noise, observed.values))
    error = math.nan
    if given.identified is None:
        middle = float(np.sqrt(np.prod(predictor.parameters[0].bounds)))
        found = ordinary_fit(problem, starts(predictor.law, middle))
    else:
        problem, found, error = _about(given.identified, problem)
    left = found.residual[: len(observed.force)]
    noise = estimate_noise(observed, given.instrument, left, given.at_rest)
    problem = replace(problem, errors=problem.errors_about(noise, found, given.nuisances(found)))
    return base_about_solution(problem, found, solved) if given.identified is None else (problem, found, error)


def _about(identified: Identified, problem: LinearisedProblem) -> tuple[LinearisedProblem, LinearisedFit, float]:
    """Return a problem that predicts what was identified where it was, the fit there, and the emulator's error."""
    predictor, (contacts, predicted) = problem.predictor, identified.stations
    known = {**identified.fit.values, **{onset_name(k): float(at) for k, at in enumerate(contacts)}}
    values = {one.name: known.get(one.name, 0.0) for one in predictor.parameters}
    offset = np.concatenate([predicted[one.name] for one in predictor.observed.data.channels]) - predictor(values)
    problem = problem.corrected(offset)
    forces = slice(len(predictor.observed.force))
    error = float(np.abs(offset[forces]).max() / np.abs(predicted["force"]).max())
    return problem, fit(problem, (), values, evaluations=0), error


def _verdict(explained: Explained) -> tuple[Verdict, tuple[Explanation, ...]]:
    if explained.adequacy >= ADEQUATE * explained.share:
        return "consistent", ()
    listed = explained.listed()
    if listed[0].unnamed:
        return "unexplained", ()
    models = tuple(e for e in listed if e.names)[:SHOWN_MOST]
    return ("named" if len(listed) == 1 else "ambiguous"), models


def ordinary_explanation(problem: LinearisedProblem, fitted: LinearisedFit, base: Explanation) -> Explanation:
    """Return an ordinary fit as an explanation that is shown, with its intervals.

    Parameters
    ----------
    problem
        The observations with their errors.
    fitted
        By equal weights.
    base
        The base model by its errors.
    """
    same = equally_weighted(problem, fitted.residual)
    weighed = fitted.sensitivities / np.diag(same.errors.dense)[:, None]
    spread = np.linalg.inv(fitted.sensitivities.T @ weighed + np.eye(len(fitted.free)))
    estimator = spread @ weighed.T
    covariance = sandwich(estimator, problem.errors.covariance) + spread @ spread
    return replace(
        base,
        fit=replace(fitted, problem=same),
        posterior=replace(base.posterior, mean=fitted.prior_z, covariance=covariance),
        degrees=variance_degrees(covariance, estimator, problem.errors),
    )
