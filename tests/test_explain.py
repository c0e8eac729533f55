"""Explanations and their probabilities, on responses in closed form, no finite elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import GRID, SOUGHT, TRUTH, fat, noisy, one_at_each_rate, problem_of, ramps
from scipy.stats import norm

from legfem.geometry.section import CALF, LIMBS
from legfem.inverse import explain as explain_module
from legfem.inverse.accuracy import MATERIAL_LOG_SD
from legfem.inverse.averaging import averaged_intervals
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.errors import error_model
from legfem.inverse.evidence import Evidence, possible_discrepancies
from legfem.inverse.explain import CONFIRMED_FROM, PRIOR_NONE, PRIOR_PAIR, PRIOR_SINGLE, PRIOR_UNKNOWN, explain
from legfem.inverse.explanation import HELD, Explained
from legfem.inverse.laplace import gain_of_widths, laplace_posterior
from legfem.inverse.library import NuisanceChanges
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem, nuisance_effects
from legfem.inverse.map_fit import fit
from legfem.legs.nuisances import ShapeAccuracy
from legfem.mechanisms import mechanism_named


@pytest.mark.parametrize(
    ("effects", "recordings"),
    [
        ({"contact-onset.offset": 0.3}, ramps),
        ({"preconditioning.softening": 0.25, "preconditioning.fading": 0.3, "preconditioning.slope": -0.8}, ramps),
        pytest.param(
            {
                "muscle-contraction.stiffening": 0.12,
                "muscle-contraction.onset": 0.5,
                "muscle-contraction.rise": 0.08,
                "muscle-contraction.away": 2.0,
            },
            ramps,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {
                "muscle-contraction.stiffening": 0.12,
                "muscle-contraction.onset": 0.6,
                "muscle-contraction.rise": 0.04,
                "muscle-contraction.away": 0.12,
            },
            ramps,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {
                "leg-movement.shift": 0.5,
                "leg-movement.onset": 0.6,
                "leg-movement.rise": 0.04,
                "leg-movement.away": 0.12,
            },
            ramps,
            marks=pytest.mark.slow,
        ),
        (
            {"viscoelasticity.ratio": 0.1, "viscoelasticity.relaxation_time": 8.0, "viscoelasticity.spread": 1.0},
            one_at_each_rate,
        ),
        ({"support-compliance.compliance": 0.15}, ramps),
    ],
)
def test_a_single_effect_is_named_and_its_bias_removed(effects, recordings):
    _, base = problem_of(recordings(), effects, seed=3)
    name = next(iter(effects)).split(".")[0]
    sought = dict.fromkeys([*SOUGHT, mechanism_named(name)])
    explained = explain(base, list(sought))
    best = explained.every[0]
    assert best.names == (name,)
    assert explained.base.probability < 0.05
    assert sum(e.probability for e in explained.every if name in e.names) > 0.9
    before = abs(explained.base.value(DEEP_C10) / TRUTH[DEEP_C10] - 1)
    after = abs(best.value(DEEP_C10) / TRUTH[DEEP_C10] - 1)
    assert after < 0.03
    assert after < before or before < 0.01
    strength = next(iter(effects))
    low, high = best.interval(strength, float(norm.sf(3.5)))
    assert low <= effects[strength] <= high
    low, high = next(averaged_intervals(explained, DEEP_C10))
    assert low <= TRUTH[DEEP_C10] <= high


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_named_where_nothing_is(seed):
    _, base = problem_of(ramps(), seed=seed)
    explained = explain(base, SOUGHT)
    assert explained.every[0].is_base
    assert explained.base.probability > 0.68 and explained.adequacy > 0.99
    assert all(len(e.names) < 2 for e in explained.every), "no pairs where nothing asks for more"
    said = explained.statements()
    assert said[0].nothing_shows and said[0].probability == pytest.approx(explained.adequacy)
    assert said[0].probability > explained.base.probability, "what adds nothing counts, too"
    assert sum(one.probability for one in said) == pytest.approx(1.0)


def test_probabilities_sum_to_one_and_explanations_are_listed_to_nine_tenths():
    _, base = problem_of(ramps(), {"contact-onset.offset": 0.25}, seed=5)
    explained = explain(base, SOUGHT)
    shares = [e.probability for e in explained.every]
    assert sum(shares) == pytest.approx(1.0)
    assert shares == sorted(shares, reverse=True)
    listed = explained.listed()
    held = [e.probability for e in listed]
    assert sum(held) >= HELD > sum(held[:-1])
    assert listed[0].names == ("contact-onset",)
    assert not any(e.is_base for e in listed)
    said = explained.statements()
    assert said[0].names == ("contact-onset",)
    assert sum(one.probability for one in said) == pytest.approx(1.0)
    assert pytest.approx(1.0) == PRIOR_NONE + PRIOR_SINGLE + PRIOR_PAIR + PRIOR_UNKNOWN


def test_a_ripple_is_located_and_not_explained():
    observed = problem_of(ramps())[0].predictor.observed
    ripple = 0.2 * np.sin(2 * np.pi * observed.displacement / 3.0)
    _, base = problem_of(ramps(), seed=2, extra=ripple)
    explained = explain(base, SOUGHT)
    assert explained.every[0].unnamed
    assert explained.every[0].probability > 0.9
    assert not explained.every[0].names


@pytest.mark.parametrize(("size", "sound"), [(0.5, True), (4.0, False)])
def test_an_error_below_a_trial_s_noise_is_no_contradiction(size, sound):
    blank = problem_of(ramps())[0]
    observed, noise = blank.predictor.observed, float(blank.errors.trial_sd.max())
    ripple = size * noise * np.sin(2 * np.pi * observed.displacement / 3.0)
    _, base = problem_of(ramps(), seed=2, extra=ripple)
    explained = explain(base, SOUGHT)
    assert (explained.adequacy >= 0.5) is sound


def test_two_effects_are_explained_by_the_pair():
    effects = {"support-compliance.compliance": 0.2, "preconditioning.softening": 0.3, "preconditioning.fading": 0.2}
    _, base = problem_of(ramps(), effects, seed=4)
    best = explain(base, SOUGHT).every[0]
    assert set(best.names) == {"preconditioning", "support-compliance"}
    assert best.value(DEEP_C10) == pytest.approx(TRUTH[DEEP_C10], rel=0.04)


def test_behind_one_effect_that_suffices_others_are_tried_and_widen_the_interval():
    """A small second effect, which the gains take up: C10 by the first alone is too sure."""
    effects = {"support-compliance.compliance": 0.3, "preconditioning.softening": 0.06, "preconditioning.fading": 0.9}
    _, base = problem_of(ramps(), effects, seed=7)
    explained = explain(base, SOUGHT)
    best = explained.every[0]
    assert best.names == ("support-compliance",)
    beside = {frozenset(e.names) for e in explained.every if len(e.names) == 2}
    assert {frozenset([*best.names, m.name]) for m in SOUGHT if m.name not in best.names} <= beside
    low, high = next(averaged_intervals(explained, DEEP_C10))
    alone = best.interval(DEEP_C10)
    assert high - low > 1.02 * (alone[1] - alone[0])
    assert low < TRUTH[DEEP_C10] < high


def test_the_interval_of_consistent_recordings_has_room_for_what_they_may_hide():
    _, base = problem_of(ramps(), {"support-compliance.compliance": 0.006}, seed=1)
    explained = explain(base, SOUGHT)
    assert explained.every[0].is_base and explained.adequacy > 0.9
    low, high = next(averaged_intervals(explained, DEEP_C10))
    alone = explained.base.interval(DEEP_C10)
    assert low < TRUTH[DEEP_C10] < high
    assert high - low > 1.3 * (alone[1] - alone[0])
    surer = [replace(e, probability=100 * e.probability) if e.is_base else e for e in explained.every]
    again = next(averaged_intervals(replace(explained, every=tuple(surer)), DEEP_C10))
    assert again == pytest.approx((low, high)), "nothing at all is no explanation of a leg"


def test_a_pair_that_adds_nothing_takes_the_solution_of_its_one_mechanism():
    _, base = problem_of(ramps(), {"support-compliance.compliance": 0.3}, seed=3)
    asked = []

    def confirm(fitted: LinearisedFit) -> LinearisedFit:
        asked.append(fitted.names)
        shifted = fitted.problem.corrected(0.002 * fitted.prediction)
        return fit(shifted, fitted.mechanisms, fitted.values)

    explained = explain(base, SOUGHT, confirm)
    assert asked == [("support-compliance",)]
    pairs = [e for e in explained.every if len(e.names) == 2 and "support-compliance" in e.names]
    assert len(pairs) == len(SOUGHT) - 1
    assert all(np.any(e.problem.predictor.offset != 0.0) for e in pairs)


def test_a_pair_that_is_more_than_either_takes_a_solution_of_its_own():
    effects = {"support-compliance.compliance": 0.2, "preconditioning.softening": 0.3, "preconditioning.fading": 0.2}
    _, base = problem_of(ramps(), effects, seed=4)
    asked = []

    def confirm(fitted: LinearisedFit) -> LinearisedFit:
        asked.append(frozenset(fitted.names))
        shifted = fitted.problem.corrected(0.002 * fitted.prediction)
        return fit(shifted, fitted.mechanisms, fitted.values)

    best = explain(base, SOUGHT, confirm).every[0]
    assert set(best.names) == {"preconditioning", "support-compliance"} and best.confirmed
    assert asked.count(frozenset(best.names)) == 1


def test_what_full_solutions_put_first_is_tried_in_pairs_with_all(monkeypatch):
    """The emulator may be off by more than what tells two mechanisms apart."""
    monkeypatch.setattr("legfem.inverse.explain.PAIRS_OF", 1)
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.3}, seed=3)
    wave = 0.3 * np.sin(2 * problem.predictor.observed.displacement)

    def confirm(fitted: LinearisedFit) -> LinearisedFit:
        shifted = fitted.problem.corrected(wave if "support-compliance" in fitted.names else 0.0 * wave)
        return fit(shifted, fitted.mechanisms, fitted.values)

    def first_and_tried(found: Explained) -> tuple[str, set[str]]:
        (first,) = next(e.names for e in found.every if len(e.names) == 1)
        pairs = [set(e.names) for e in found.every if len(e.names) == 2 and first in e.names]
        return first, set.union(*pairs)

    everything = {m.name for m in SOUGHT}
    assert first_and_tried(explain(base, SOUGHT)) == ("support-compliance", everything)
    first, tried = first_and_tried(explain(base, SOUGHT, confirm))
    assert first != "support-compliance" and tried == everything


def test_all_that_may_be_what_was_left_out_is_tried_in_pairs_with_all(monkeypatch):
    """Pairs that explain no more count for their mechanism: fewer would be held against it."""
    monkeypatch.setattr("legfem.inverse.explain.PAIRS_OF", 1)
    _, base = problem_of(ramps(), {"support-compliance.compliance": 0.003}, seed=3)
    found = explain(base, SOUGHT).every
    likely = [e.names[0] for e in found if len(e.names) == 1 and e.probability > CONFIRMED_FROM]
    assert set(likely) == {"support-compliance", "force-drift"}
    tried = {frozenset(e.names) for e in found}
    for name in likely:
        assert {frozenset([name, m.name]) for m in SOUGHT if m.name != name} <= tried


def test_a_first_trial_stiffer_by_a_share_that_varies_with_depth_is_named_preconditioning():
    """15.5 % at touch and 9.5 % at full depth of the force itself: not the library's form."""
    observed = problem_of(ramps())[0].predictor.observed
    force = problem_of(ramps())[0].predictor(TRUTH)
    share = 0.155 - 0.06 * observed.displacement / observed.depth
    extra = np.where(observed.trial == 0, share * force, 0.0)
    problem, base = problem_of(ramps(), seed=6, extra=extra)
    explained = explain(base, SOUGHT)
    best = explained.every[0]
    assert best.names == ("preconditioning",)
    assert explained.base.probability < 0.01
    assert best.value(DEEP_C10) == pytest.approx(TRUTH[DEEP_C10], rel=0.03)
    assert best.fit.prediction == pytest.approx(problem.predictor.observed.force, abs=0.6)


@pytest.mark.parametrize(("factor", "named"), [(1.25, False), (6.0, True)])
def test_fat_is_named_only_beyond_what_is_known_of_it(factor, named):
    """A factor within its prior is taken up as an effect; six times as stiff is a finding."""
    problem, _ = problem_of(ramps())
    observed, predictor = problem.predictor.observed, problem.predictor
    mechanism = mechanism_named("superficial-stiffness")
    force = predictor({**TRUTH, "superficial-stiffness.factor": factor}, [mechanism])
    known = NuisanceChanges(GRID, {}, {"superficial.C10": {"force": fat(GRID)}})
    effects = nuisance_effects(known, observed, force, ShapeAccuracy(bones=LIMBS[CALF]))
    seen = noisy(observed.with_force(force), force, 3)
    errors = error_model(seen, problem.errors.noise, force, effects)
    problem = LinearisedProblem(replace(predictor, observed=seen), errors)
    base = fit(problem, (), TRUTH)
    explained = explain(base, [*SOUGHT, mechanism])
    assert (explained.every[0].names == (mechanism.name,)) == named
    assert explained.every[0].is_base != named
    if not named:
        fats = dict(zip(errors.names, explained.base.posterior.effects, strict=True))
        expected = np.log(factor) / MATERIAL_LOG_SD["superficial.C10"]
        assert fats["stiffness of the fat"] == pytest.approx(expected, abs=1.0)


def test_an_explanation_that_a_full_solution_cannot_confirm_loses_weight():
    _, base = problem_of(ramps(), {"contact-onset.offset": 0.3}, seed=3)
    asked = SOUGHT[:2]
    plain = explain(base, asked)
    calls = []

    def confirm(fitted):
        calls.append(fitted.names)
        return None if "contact-onset" in fitted.names else fitted

    found = explain(base, asked, confirm)
    assert ("contact-onset",) in calls
    assert len(calls) == len(set(calls)), "none is confirmed twice"

    def odds(explained):
        one = next(e for e in explained.every if e.names == ("contact-onset",))
        return np.log(one.probability / explained.base.probability)

    assert odds(plain) - odds(found) == pytest.approx(3.0, abs=1e-6)


def test_a_mechanism_is_fitted_anew_from_where_a_pair_has_it(monkeypatch):
    """Its own search ended beside the minimum; without that it stays there."""
    _, base = problem_of(ramps(), {"contact-onset.offset": 0.3}, seed=3)
    name = "contact-onset"

    def search_that_ends_early(own, mechanisms, start):
        early = [m.name for m in mechanisms] == [name] and f"{name}.offset" not in start
        begun = {f"{name}.offset": 0.05, **start} if early else start
        return fit(own, mechanisms, begun, evaluations=1 if early else None)

    monkeypatch.setattr(explain_module, "fit", search_that_ends_early)

    def offset() -> float:
        alone = next(e for e in explain(base, SOUGHT).every if e.names == (name,))
        return alone.fit.values[f"{name}.offset"]

    assert offset() == pytest.approx(0.3, abs=0.1)
    monkeypatch.setattr(explain_module._Sought, "begun_anew", lambda _, found: found)
    assert offset() < 0.1


def test_a_strength_is_integrated_out_as_its_explanation_was_weighed(monkeypatch):
    """By the same errors as its fit's, with the same shares of what is unknown beside it."""
    observed = problem_of(ramps())[0].predictor.observed
    wave = 0.08 * np.sin(np.pi * observed.displacement / 6)
    problem, base = problem_of(ramps(), {"contact-onset.offset": 1.0}, seed=1, extra=wave)
    seen = []
    monkeypatch.setattr(
        explain_module,
        "integrate_strength",
        lambda fitted, posterior, of: seen.append((fitted, of.args[0])) or posterior,
    )
    weighed = [e for e in explain(base, SOUGHT).every if e.strength_integrated]
    assert {e.fit_without_discrepancy is None for e in weighed} == {True, False}
    for fitted, explanation in seen:
        (one,) = (e for e in weighed if e.fit.prediction is fitted.prediction)
        assert explanation.log_discrepancy_weights == one.log_discrepancy_weights
        assert (fitted.problem is one.problem) is (one.fit_without_discrepancy is None)
        again = laplace_posterior(
            Evidence(problem.errors, possible_discrepancies(observed, base.prediction)),
            fitted,
            list(one.log_discrepancy_weights),
        )
        of_any_width = again.log_evidence + gain_of_widths(fitted, again)
        assert of_any_width == pytest.approx(one.posterior.log_evidence)
