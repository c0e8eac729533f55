"""Plans for a subject: after an ambiguous diagnosis, and before any test."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.diagnose.diagnosis import Diagnosis, slowest_of
from legfem.diagnose.explanation import Explanation
from legfem.diagnose.fit import Fit, NuisanceEffect, Problem
from legfem.diagnose.library import Library
from legfem.diagnose.library_build import build_library, rounded, shown_mechanisms
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.mechanisms.base import prior_of
from legfem.diagnose.nuisances import nuisance_effects
from legfem.diagnose.observations import Observations, blank_observations
from legfem.diagnose.predict import Predictor
from legfem.diagnose.run import STIFFENING, Diagnoser, accuracy_of, ruled_out_of
from legfem.inverse.errors import error_model
from legfem.inverse.trial_noise import Noise
from legfem.legs.correction_of_leg import choose_correction
from legfem.legs.subject import Subject
from legfem.plan.designs import Design, designs
from legfem.plan.reckon import Candidate, Reckoned, before_any_test, ranked, reckon
from legfem.plan.reckon_readings import reckon_readings
from legfem.solve.protocol import Protocol

USUAL_GAIN_SD = 0.01


@dataclass(frozen=True)
class Expected:
    """What a plan before any test is made for.

    Parameters
    ----------
    c10, c20
        Stiffness of the deep tissue that is expected (kPa).
    depth, rate
        Of the test that is meant (mm, mm/s).
    """

    c10: float
    c20: float
    depth: float
    rate: float


def plan_after(found: Diagnosis, subject: Subject, diagnoser: Diagnoser, progress: Progress) -> list[Reckoned]:
    """Return what could be done next, the best first; nothing unless the verdict is ambiguous.

    Parameters
    ----------
    found
        The diagnosis.
    subject
        Whose.
    diagnoser
        That made it.
    progress
        Told of solutions.
    """
    if found.verdict != "ambiguous":
        return []
    models = found.models
    rates = found.observed.rates
    library, _ = diagnoser.library(subject, found.observed, progress)
    tests = designs(found.observed.depth, rates[0], float(library.grid[-1]), found.observed.shows_air)
    asked = list(dict.fromkeys(m for model in models for m in model.fit.mechanisms))
    wider = _library(diagnoser, subject, tests, asked, library.middle, progress)
    plain = replace(found.base.problem.predictor, responses=wider, offset=0.0)
    candidates = [_candidate(model) for model in models]
    found_by_tests = _reckoned(
        tests, candidates, plain, wider, subject, found.errors.noise, found.best.posterior.gain_sd
    )
    accuracy = accuracy_of(subject)
    known = {one.effect for one in accuracy.effects}
    by_readings = reckon_readings([m for m in asked if m.name not in known], candidates, accuracy)
    return ranked([*found_by_tests, *by_readings])


def plan_before(subject: Subject, diagnoser: Diagnoser, expected: Expected, progress: Progress) -> list[Reckoned]:
    """Return what tests of a leg would tell, the most telling first.

    Parameters
    ----------
    subject
        The leg, without recordings.
    diagnoser
        Whose folder keeps the leg's responses.
    expected
        Stiffness and test.
    progress
        Told of solutions.
    """
    tests = designs(expected.depth, expected.rate, expected.depth)
    ends = choose_correction("auto", subject)
    every = blank_observations(list(dict.fromkeys(p for t in tests for p in t.protocols)))
    able, _ = shown_mechanisms(every, diagnoser.correction, ruled_out_of(subject, ends))
    library = _library(diagnoser, subject, tests, able, rounded(expected.c10), progress)
    able = [m for m in able if m.name not in library.missing]
    law = subject.tissues["deep"].law
    observed = blank_observations([Protocol.ramp(expected.depth, expected.rate)] * 3)
    predictor = Predictor(observed, library, law, ends, accuracy_of(subject).deep_C10)
    noise = _stated(subject, observed)
    values = {"C10": expected.c10, "C20": expected.c20}
    force = predictor(values)
    problem = Problem(predictor, error_model(observed.with_force(force), noise, force))
    base = _at(problem, values)
    candidates = before_any_test(problem, base, able)
    return ranked(_reckoned(tests, candidates, predictor, library, subject, noise, USUAL_GAIN_SD))


def _reckoned(
    tests: list[Design],
    candidates: list[Candidate],
    predictor: Predictor,
    library: Library,
    subject: Subject,
    noise: Noise,
    gain_sd: float,
) -> list[Reckoned]:
    """Return what tests are worth whose responses are known."""
    known = accuracy_of(subject)

    def nuisances(test: Design, blank: Observations, force: FloatArray) -> list[NuisanceEffect]:
        accuracy = replace(known, contour_sd=0.0) if test.outlines_known else known
        return nuisance_effects(library.nuisances, blank, force, accuracy)

    found = [reckon(test, candidates, predictor, nuisances, noise, gain_sd) for test in tests]
    return [one for one in found if one is not None]


def _library(
    diagnoser: Diagnoser,
    subject: Subject,
    tests: list[Design],
    asked: list[Mechanism],
    middle: float,
    progress: Progress,
) -> Library:
    """Return the leg's responses to all tests."""
    from legfem.diagnose.leg import solved_responses

    blank = blank_observations(list(dict.fromkeys(p for t in tests for p in t.protocols)))
    fine, coarse = solved_responses(subject, blank, diagnoser.folder)
    return build_library(
        fine, coarse, blank, asked, diagnoser.jobs, progress, STIFFENING[subject.tissues["deep"].law], middle
    )


def _candidate(model: Explanation) -> Candidate:
    name = " + ".join(model.names) or "something unknown"
    posterior = model.posterior
    return Candidate(name, model.fit, posterior.mean, posterior.covariance, model.probability)


def _stated(subject: Subject, observed: Observations) -> Noise:
    instrument = subject.instrument
    each = instrument.force_sd / float(np.sqrt(2))
    return Noise(
        each,
        each,
        slowest_of(observed),
        instrument.force_sd,
        instrument.displacement_sd,
        "the instrument's stated accuracy only (nothing was recorded)",
    )


def _at(problem: Problem, values: dict[str, float]) -> Fit:
    """Return a fit that stands at values."""
    parameters = problem.parameters(())
    departure = np.array([prior_of(p).departure(values.get(p.name, prior_of(p).centre)) for p in parameters])
    prediction = problem.predictor(values)
    nothing = np.zeros(len(prediction))
    slopes = np.zeros((len(prediction), len(parameters)))
    return Fit((), values, parameters, departure, prediction, nothing, slopes, nothing, slopes)
