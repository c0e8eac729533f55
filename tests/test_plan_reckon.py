"""What a further test is worth: more with less noise, nothing for twins, less as forms are off."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from making_diagnosed import diagnosed
from making_diagnosis import NOISE

import legfem as lf
from legfem.geometry.section import CALF, LIMBS
from legfem.inverse import plan as reckoning
from legfem.inverse.explanation import Explanation
from legfem.inverse.linearised import nuisance_effects
from legfem.inverse.observations import Observations, blank_observations
from legfem.inverse.plan import Candidate, Design, evaluate_design
from legfem.inverse.predictor import onset_name
from legfem.inverse.verdict import Diagnosis
from legfem.legs.finite_element_models import solved_responses
from legfem.legs.nuisances import ShapeAccuracy
from legfem.legs.plan import plan_after
from legfem.mechanisms import mechanism_named
from legfem.solve.protocol import Protocol

TWINS = ("fascia-stiffness", "prestress", "force-drift")
"""The first two are alike in closed form."""
RAMP = Protocol.ramp(20.0, 0.4)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnosed({"fascia-stiffness.factor": 4.0}, asked=TWINS)


def candidate(model: Explanation) -> Candidate:
    posterior, name = model.posterior, " + ".join(model.names) or "nothing"
    return Candidate(name, model.fit, posterior.mean, posterior.covariance, model.probability)


def chance(found: Diagnosis, others: list[Candidate], noise=NOISE, repeats: int = 3) -> float:
    predictor = found.weighted_base.problem.predictor

    def nuisances(design, blank, force):
        return nuisance_effects(predictor.responses.nuisances, blank, force, ShapeAccuracy(bones=LIMBS[CALF]))

    worth = evaluate_design(Design("again", (RAMP,) * repeats), others, predictor, nuisances, noise, 0.01)
    assert worth is not None and worth.chance == pytest.approx(min(worth.chances.values()), abs=1)
    assert all(0.0 <= one <= 1.0 for one in worth.chances.values())
    return worth.chance


@pytest.fixture
def against_nothing(found) -> list[Candidate]:
    stiff = next(m for m in found.models if m.names == ("fascia-stiffness",))
    return [candidate(stiff), candidate(found.weighted_base)]


def narrowed(found: Diagnosis, base: Candidate, repeats: int) -> float:
    predictor = found.weighted_base.problem.predictor
    worth = evaluate_design(Design("again", (RAMP,) * repeats), [base], predictor, lambda *_: [], NOISE, 0.01)
    assert worth is not None
    return worth.narrows[0]


def test_repeats_narrow_c10_down_to_what_errs_alike_in_all(found, against_nothing):
    base = against_nothing[1]
    known = [narrowed(found, base, repeats) for repeats in (1, 3, 12, 100)]
    assert known == sorted(known, reverse=True) and known[0] < 1.0
    problem = base.fit.problem
    (gain,) = problem.errors.stated.values()
    other = replace(problem, errors=replace(problem.errors, stated={"another load cell's gain": gain}))
    # A second load cell errs by itself, and the mean of both is known better.
    assert narrowed(found, replace(base, fit=replace(base.fit, problem=other)), 100) < 0.85 * known[-1]


def test_twins_are_told_apart_by_no_repeat(found, against_nothing):
    twins = [candidate(m) for m in found.models]
    assert chance(found, twins) < 0.05 < chance(found, against_nothing)


def test_less_noise_and_more_repeats_tell_more(found, against_nothing):
    loud = replace(NOISE, white_sd=10 * NOISE.white_sd, slow_sd=10 * NOISE.slow_sd)
    assert chance(found, against_nothing, loud) < chance(found, against_nothing)
    once, thrice = (chance(found, against_nothing, loud, n) for n in (1, 6))
    assert once < thrice


def test_a_form_that_is_off_tells_less(found, against_nothing, monkeypatch):
    monkeypatch.setattr(reckoning, "INEXACT", 0.0)
    exact = chance(found, against_nothing)
    monkeypatch.setattr(reckoning, "INEXACT", 1.0)
    assert chance(found, against_nothing) < exact
    monkeypatch.setattr(reckoning, "INEXACT_SHARE", 0.05)
    assert chance(found, against_nothing) > 0.5 * exact, "a small share takes little"


def test_a_planned_test_has_its_own_first_contact_and_the_moment_of_a_contraction(found):
    predictor, values = found.weighted_base.problem.predictor, found.weighted_base.fit.values
    contraction = mechanism_named("muscle-contraction")
    tenses = contraction.by_full_name({"stiffening": 0.3, "onset": 0.5, "rise": 0.05, "away": 2.0})
    again = Design("again", (RAMP,))
    relaxed = reckoning._readings(predictor, (), values, again)
    tensed = reckoning._readings(predictor, (contraction,), {**values, **tenses}, again)
    before = predictor.observed.time < 0.5 * predictor.observed.time.max()
    np.testing.assert_allclose(tensed[before], relaxed[before], rtol=1e-14)
    assert tensed[-1] > 1.1 * relaxed[-1]
    np.testing.assert_array_equal(reckoning._readings(predictor, (), {**values, onset_name(0): 0.4}, again), relaxed)


def test_what_has_no_effect_has_no_form(found):
    nothing = candidate(found.weighted_base)
    predictor = found.weighted_base.problem.predictor
    force = predictor(nothing.fit.values)
    assert not np.any(reckoning._inexact(predictor.observed, force, np.zeros_like(force)))


class AskedError(Exception):
    """What is to be solved for a plan."""


class Noting:
    """A diagnoser that is asked."""

    def tabulating(self, subject: lf.Readings, observed: Observations, *_: object) -> None:
        raise AskedError(solved_responses(subject, observed, None)[1].depth)


@pytest.mark.parametrize("depth", [29.8, 24.65, 20.0, 19.99])
def test_what_could_be_done_next_is_foretold_by_the_diagnosis_own_responses(depth: float):
    leg, observed = lf.load_subject("3"), blank_observations([Protocol.ramp(depth, 0.4)])
    responses = solved_responses(leg, observed, None)[1]
    predictor = SimpleNamespace(library=SimpleNamespace(grid=responses.grid, middle=1e-3))
    base = SimpleNamespace(problem=SimpleNamespace(predictor=predictor))
    found = SimpleNamespace(verdict="ambiguous", models=[], observed=observed, base_model=base)
    with pytest.raises(AskedError) as asked:
        plan_after(found, leg, Noting(), None)  # type: ignore[arg-type]
    assert asked.value.args == (responses.depth,)
