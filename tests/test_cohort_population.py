"""The population of a cohort: against closed forms and the mixed model, and as a prior for new legs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_cohort import Truth, fabricated
from pydantic import TypeAdapter

import legfem as lf
from legfem.cohort.population_model import (
    Hierarchy,
    Likelihoods,
    PopulationSampler,
    hierarchy_of,
    population_document,
    sampled,
)
from legfem.cohort.rows import Measure, models_of
from legfem.inverse.parse_parameters import deep_prior, read_prior
from legfem.inverse.population import cohort_prior
from legfem.inverse.stored import StoredExplanation, StoredModel


def test_a_likelihood_has_the_widths_of_its_interval_and_is_flat_where_that_is_open() -> None:
    closed = Measure(2.0, 1.0, 3.0, None, "kPa")
    mixed = Measure(1.0, 0.5, 2.0, None, "kPa", explanations=((0.75, 1.0, 0.9, 1.2), (0.25, 2.0, None, 2.5)))
    found = Likelihoods.of([closed, mixed])
    assert found.below[0, 0] == pytest.approx(math.log(2) / 1.96) and found.above[0, 0] == pytest.approx(
        math.log(1.5) / 1.96
    )
    assert np.exp(found.log_weight).tolist() == [[1.0, 0.0], [0.75, 0.25]]
    assert found.below[1, 1] > 4 * found.above[1, 1]


def stored(model: dict) -> StoredModel:
    return TypeAdapter(StoredModel).validate_python(model)


def test_a_standard_error_is_taken_apart_by_whom_it_is_shared_with() -> None:
    shares = {"recordings": 0.5, "model": 0.2, "priors": 0.3}
    entry = {"value": 2.0, "unit": "kPa", "standard_error": 0.1, "ci95": [1.75, 2.25], "share_of_squared_error": shares}
    law = {"parameters": {"c10_deep": entry}}
    one = models_of({"neo-hookean": stored(law)})["neo-hookean"].measures["c10_deep"]
    assert one.sd == pytest.approx(0.1) and one.alike == pytest.approx(0.5)
    alone, among = Likelihoods.of([one]), Likelihoods.of([one], repeated=True)
    mean = 0.5 * (alone.below + alone.above)[0, 0]
    assert mean == pytest.approx(one.sd / 2.0, rel=0.01) and alone.below > alone.above
    assert among.alike[0] == pytest.approx(mean * math.sqrt(0.5)) and not alone.alike.any()
    np.testing.assert_allclose(among.below**2 + among.above**2, 0.5 * (alone.below**2 + alone.above**2))


@pytest.mark.slow
def test_draws_are_those_of_a_closed_form() -> None:
    """One test each of nobody known: theta's posterior is its likelihood, a mixture of two."""
    given = Hierarchy((), np.zeros((1, 0)), {})
    parts = Likelihoods(np.log([[0.7, 0.3]]), np.array([[0.0, 0.6]]), np.full((1, 2), 0.2), np.full((1, 2), 0.2))
    theta = PopulationSampler(given, draws=4000, warm_up=1000).draw(parts, 3).theta[:, 0]
    # The prior of theta is flat beside both.
    assert np.mean(theta) == pytest.approx(0.3 * 0.6, abs=0.05)
    assert np.std(theta) == pytest.approx(math.sqrt(0.2**2 + 0.3 * 0.7 * 0.6**2), abs=0.03)


@pytest.fixture(scope="module")
def cohort():
    truth = Truth(people=0.25, sides=0.1, sessions=0.05, error=0.05, group=0.3)
    members, rows = fabricated(16, truth=truth, seed=4)
    return members, rows, sampled(members.every, rows, "c10_deep"), truth


@pytest.mark.slow
def test_planted_spreads_and_a_group_are_found_and_tests_are_drawn_together(cohort) -> None:
    _, rows, found, truth = cohort
    assert found.draws.divergent < 10 and found.draws.effective > 50
    for level, planted in (("person", truth.people), ("leg", truth.sides), ("test", truth.sessions)):
        low, high = np.quantile(found.draws.sd[level], (0.005, 0.995))
        assert low < planted < high, level
    low, high = np.quantile(
        found.draws.effects[:, found.given.names.index("group patient against control")], (0.01, 0.99)
    )
    assert low < truth.group < high
    own = np.log([row.models["reduced-polynomial"].measures["c10_deep"].value for row in rows])
    shrunk = found.draws.theta.mean(axis=0)
    assert np.std(shrunk) < np.std(own) and np.corrcoef(shrunk, own)[0, 1] > 0.95
    wide = math.sqrt(truth.people**2 + truth.group**2 / 4 + truth.sides**2)
    assert 0.6 * wide < found.log_sd < 1.8 * wide


@pytest.mark.slow
def test_its_file_is_a_prior_for_new_legs(cohort, tmp_path: Path) -> None:
    members, rows, found, _ = cohort
    path = tmp_path / "population.json"
    path.write_text(json.dumps(population_document((found,), members, rows), allow_nan=False))
    prior = cohort_prior("deep.C10", path)
    assert (prior.scale, prior.sd) == ("log", found.log_sd)
    assert prior.centre == pytest.approx(1e-3 * math.exp(found.log_median))
    assert "16 people of study" in prior.source
    assert read_prior(f"deep.C10={path}", {"deep.C10": 1e-3}) == ("deep.C10", prior)
    assert deep_prior([f"deep.C10={path}"]) == prior
    with pytest.raises(lf.InputError, match=r"c10_superficial: is not in it; there is c10_deep"):
        cohort_prior("superficial.C10", path)
    path.write_text("{}")
    with pytest.raises(lf.InputError, match=r"contains no population; give the population\.json"):
        cohort_prior("deep.C10", path)
    with pytest.raises(lf.InputError, match=r"can't be taken by a diagnosis; give one of deep\.C10"):
        deep_prior(["deep.C10=population"] * 2)


def test_a_rig_that_steps_is_in_the_design_and_too_few_people_are_one_line() -> None:
    members, rows = fabricated(40, truth=Truth(sessions=0.02, error=0.02, drift=0.08))
    given, known, names = hierarchy_of(members.every, rows, "c10_deep")
    assert any(name.startswith("step 2026-") for name in given.names)
    assert list(given.levels) == ["person", "leg", "visit", "test"] and len(names) == len(known.centre) == 160
    with pytest.raises(lf.InputError, match="3 people have one; a population needs 5"):
        hierarchy_of(members.every[:12], rows[:12], "c10_deep")


def test_explanations_of_a_diagnosis_come_without_that_nothing_was_left_out() -> None:
    each = {"c10_deep": {"value": 1.0, "unit": "kPa", "ci95": [0.8, 1.3]}}
    explanations = [
        {"mechanisms": [], "unknown": False, "probability": 0.6, "parameters": each},
        {"mechanisms": ["contact-slip"], "unknown": False, "probability": 0.3, "parameters": each},
        {"mechanisms": [], "unknown": True, "probability": 0.1, "parameters": each},
    ]
    law, weighed = stored({"parameters": each}), TypeAdapter(list[StoredExplanation]).validate_python(explanations)
    found = models_of({"neo-hookean": law}, law, weighed)["after repair"].measures["c10_deep"]
    assert [part[0] for part in found.explanations] == [0.3, 0.1]
    assert replace(found, explanations=()).value == 1.0


def test_priors_that_would_count_twice_are_refused_before_anything_is_done(tmp_path):
    with pytest.raises(lf.InputError, match="would count twice"):
        lf.cohort(tmp_path, prior=["superficial.C10=population"], population=True, out=tmp_path / "out", progress=False)
