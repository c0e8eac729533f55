"""Explanations and their probabilities, on responses in closed form, no finite elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import diagnosed, diagnosed_of
from making_diagnosis import (
    GRID,
    TRUTH,
    ClosedForm,
    fat,
    noisy,
    one_at_each_rate,
    problem_of,
    ramps,
)
from scipy.optimize import brentq
from scipy.stats import norm
from scipy.stats import t as student_t

from legfem.diagnose.averaged import averaged_interval
from legfem.diagnose.explain import (
    CONFIRMED_FROM,
    PRIOR_NONE,
    PRIOR_PAIR,
    PRIOR_SINGLE,
    PRIOR_UNKNOWN,
    explain,
)
from legfem.diagnose.explanation import HELD, INEXACT, Explained, Explanation
from legfem.diagnose.fit import Fit, Problem, fit
from legfem.diagnose.limits import limits_of
from legfem.diagnose.mechanisms import mechanism_named
from legfem.diagnose.nuisances import (
    GEOMETRY_DOF,
    MATERIAL_LOG_SD,
    Accuracy,
    Nuisances,
    variance_degrees,
)
from legfem.diagnose.predict import onset_name
from legfem.diagnose.remains import explained_share, remains_of
from legfem.inference.errors import error_model

SOUGHT = tuple(
    mechanism_named(name)
    for name in ("contact-onset", "force-drift", "preconditioning", "support-compliance")
)


@pytest.mark.parametrize(
    ("effects", "recordings"),
    [
        ({"contact-onset.offset": 0.3}, ramps),
        (
            {"preconditioning.softening": 0.25, "preconditioning.fading": 0.3,
             "preconditioning.slope": -0.8},
            ramps,
        ),
        (
            {"muscle-contraction.stiffening": 0.12, "muscle-contraction.onset": 0.5,
             "muscle-contraction.rise": 0.08},
            ramps,
        ),
        (
            {"viscoelasticity.ratio": 0.1, "viscoelasticity.relaxation_time": 8.0,
             "viscoelasticity.spread": 1.0},
            one_at_each_rate,
        ),
        ({"support-compliance.compliance": 0.15}, ramps),
    ],
)  # fmt: skip
def test_a_single_effect_is_named_and_its_bias_removed(effects, recordings):
    problem, base = problem_of(recordings(), effects, seed=3)
    name = next(iter(effects)).split(".")[0]
    sought = dict.fromkeys([*SOUGHT, mechanism_named(name)])
    explained = explain(problem, base, list(sought))
    best = explained.every[0]
    assert best.names == (name,)
    assert explained.base.probability < 0.05
    assert sum(e.probability for e in explained.every if name in e.names) > 0.9
    before = abs(explained.base.value("C10") / TRUTH["C10"] - 1)
    after = abs(best.value("C10") / TRUTH["C10"] - 1)
    assert after < 0.03
    assert after < before or before < 0.01
    strength = next(iter(effects))
    low, high = best.interval(strength, float(norm.sf(3.5)))
    assert low <= effects[strength] <= high
    low, high = averaged_interval(explained, "C10")
    assert low <= TRUTH["C10"] <= high


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_named_where_nothing_is(seed):
    problem, base = problem_of(ramps(), seed=seed)
    explained = explain(problem, base, SOUGHT)
    assert explained.every[0].nothing
    assert explained.base.probability > 0.7
    assert all(len(e.names) < 2 for e in explained.every), "no pairs where nothing asks for more"
    said = explained.statements()
    assert said[0].nothing_shows and said[0].probability == pytest.approx(explained.soundness)
    assert said[0].probability > explained.base.probability, "what adds nothing counts, too"
    assert sum(one.probability for one in said) == pytest.approx(1.0)


def test_probabilities_sum_to_one_and_explanations_are_listed_to_nine_tenths():
    problem, base = problem_of(ramps(), {"contact-onset.offset": 0.25}, seed=5)
    explained = explain(problem, base, SOUGHT)
    shares = [e.probability for e in explained.every]
    assert sum(shares) == pytest.approx(1.0)
    assert shares == sorted(shares, reverse=True)
    listed = explained.listed()
    held = [e.probability for e in listed]
    assert sum(held) >= HELD > sum(held[:-1])
    assert listed[0].names == ("contact-onset",)
    assert not any(e.nothing for e in listed)
    said = explained.statements()
    assert said[0].names == ("contact-onset",)
    assert sum(one.probability for one in said) == pytest.approx(1.0)
    assert pytest.approx(1.0) == PRIOR_NONE + PRIOR_SINGLE + PRIOR_PAIR + PRIOR_UNKNOWN


def test_a_ripple_is_located_and_not_explained():
    observed = problem_of(ramps())[0].predictor.observed
    ripple = 0.2 * np.sin(2 * np.pi * observed.displacement / 3.0)
    problem, base = problem_of(ramps(), seed=2, extra=ripple)
    explained = explain(problem, base, SOUGHT)
    assert explained.every[0].unknown
    assert explained.every[0].probability > 0.9
    assert not explained.every[0].names


@pytest.mark.parametrize(("size", "sound"), [(0.5, True), (4.0, False)])
def test_an_error_below_a_trial_s_noise_is_no_contradiction(size, sound):
    blank = problem_of(ramps())[0]
    observed, noise = blank.predictor.observed, float(blank.errors.trial_sd.max())
    ripple = size * noise * np.sin(2 * np.pi * observed.displacement / 3.0)
    problem, base = problem_of(ramps(), seed=2, extra=ripple)
    explained = explain(problem, base, SOUGHT)
    assert (explained.soundness >= 0.5) is sound


def test_two_effects_are_explained_by_the_pair():
    effects = {"support-compliance.compliance": 0.2, "preconditioning.softening": 0.3,
               "preconditioning.fading": 0.2}  # fmt: skip
    problem, base = problem_of(ramps(), effects, seed=4)
    best = explain(problem, base, SOUGHT).every[0]
    assert set(best.names) == {"preconditioning", "support-compliance"}
    assert best.value("C10") == pytest.approx(TRUTH["C10"], rel=0.04)


def test_behind_one_effect_that_suffices_others_are_tried_and_widen_the_interval():
    """A small second effect, which the gains take up: C10 by the first alone is too sure."""
    effects = {"support-compliance.compliance": 0.3, "preconditioning.softening": 0.06,
               "preconditioning.fading": 0.9}  # fmt: skip
    problem, base = problem_of(ramps(), effects, seed=7)
    explained = explain(problem, base, SOUGHT)
    best = explained.every[0]
    assert best.names == ("support-compliance",)
    beside = {frozenset(e.names) for e in explained.every if len(e.names) == 2}
    assert {frozenset([*best.names, m.name]) for m in SOUGHT if m.name not in best.names} <= beside
    low, high = averaged_interval(explained, "C10")
    alone = best.interval("C10")
    assert high - low > 1.02 * (alone[1] - alone[0])
    assert low < TRUTH["C10"] < high


def test_the_interval_of_consistent_recordings_has_room_for_what_they_may_hide():
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.006}, seed=1)
    explained = explain(problem, base, SOUGHT)
    assert explained.every[0].nothing and explained.soundness > 0.9
    low, high = averaged_interval(explained, "C10")
    alone = explained.base.interval("C10")
    assert low < TRUTH["C10"] < high
    assert high - low > 1.3 * (alone[1] - alone[0])
    surer = [replace(e, probability=100 * e.probability) if e.nothing else e
             for e in explained.every]  # fmt: skip
    again = averaged_interval(replace(explained, every=tuple(surer)), "C10")
    assert again == pytest.approx((low, high)), "nothing at all is no explanation of a leg"


def test_a_pair_that_adds_nothing_takes_the_solution_of_its_one_mechanism():
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.3}, seed=3)
    asked = []

    def confirm(given: Problem, fitted: Fit) -> tuple[Problem, Fit, bool]:
        asked.append(fitted.names)
        shifted = given.corrected(0.002 * fitted.prediction)
        return shifted, fit(shifted, fitted.mechanisms, fitted.values), True

    explained = explain(problem, base, SOUGHT, confirm)
    assert asked == [("support-compliance",)]
    pairs = [e for e in explained.every if len(e.names) == 2 and "support-compliance" in e.names]
    assert len(pairs) == len(SOUGHT) - 1
    assert all(np.any(e.problem.predictor.offset != 0.0) for e in pairs)


def test_a_pair_that_is_more_than_either_takes_a_solution_of_its_own():
    effects = {"support-compliance.compliance": 0.2, "preconditioning.softening": 0.3,
               "preconditioning.fading": 0.2}  # fmt: skip
    problem, base = problem_of(ramps(), effects, seed=4)
    asked = []

    def confirm(given: Problem, fitted: Fit) -> tuple[Problem, Fit, bool]:
        asked.append(frozenset(fitted.names))
        shifted = given.corrected(0.002 * fitted.prediction)
        return shifted, fit(shifted, fitted.mechanisms, fitted.values), True

    best = explain(problem, base, SOUGHT, confirm).every[0]
    assert set(best.names) == {"preconditioning", "support-compliance"} and best.confirmed
    assert asked.count(frozenset(best.names)) == 1


def test_what_full_solutions_put_first_is_tried_in_pairs_with_all(monkeypatch):
    """The emulator may be off by more than what tells two mechanisms apart."""
    monkeypatch.setattr("legfem.diagnose.explain.PAIRS_OF", 1)
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.3}, seed=3)
    wave = 0.3 * np.sin(2 * problem.predictor.observed.displacement)

    def confirm(given: Problem, fitted: Fit) -> tuple[Problem, Fit, bool]:
        shifted = given.corrected(wave if "support-compliance" in fitted.names else 0.0 * wave)
        return shifted, fit(shifted, fitted.mechanisms, fitted.values), True

    def first_and_tried(found: Explained) -> tuple[str, set[str]]:
        (first,) = next(e.names for e in found.every if len(e.names) == 1)
        pairs = [set(e.names) for e in found.every if len(e.names) == 2 and first in e.names]
        return first, set.union(*pairs)

    everything = {m.name for m in SOUGHT}
    assert first_and_tried(explain(problem, base, SOUGHT)) == ("support-compliance", everything)
    first, tried = first_and_tried(explain(problem, base, SOUGHT, confirm))
    assert first != "support-compliance" and tried == everything


def test_all_that_may_be_what_was_left_out_is_tried_in_pairs_with_all(monkeypatch):
    """Pairs that explain no more count for their mechanism: fewer would be held against it."""
    monkeypatch.setattr("legfem.diagnose.explain.PAIRS_OF", 1)
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.005}, seed=3)
    found = explain(problem, base, SOUGHT).every
    likely = [e.names[0] for e in found if len(e.names) == 1 and e.probability > CONFIRMED_FROM]
    assert set(likely) == {"support-compliance", "force-drift"}
    tried = {frozenset(e.names) for e in found}
    for name in likely:
        assert {frozenset([name, m.name]) for m in SOUGHT if m.name != name} <= tried


def test_a_variance_that_a_bound_makes_small_keeps_its_degrees_of_freedom():
    """A bound takes variance away, not what the errors' sizes are known by."""
    problem, base = problem_of(ramps(), seed=1)
    known, names = 0.1 * base.change[:, :1], ("outline of the skin, mode 1",)
    problem = problem.with_errors(replace(problem.errors, known=known, names=names))
    one = explain(problem, base, SOUGHT[:1]).base
    assert np.isfinite(one.degrees_of_freedom[0])
    posterior = replace(one.posterior, covariance=1e-6 * one.posterior.covariance)
    assert replace(one, posterior=posterior).degrees_of_freedom[0] >= GEOMETRY_DOF


def test_a_first_trial_stiffer_by_a_share_that_varies_with_depth_is_named_preconditioning():
    """15.5 % at touch and 9.5 % at full depth of the force itself: not the library's form."""
    observed = problem_of(ramps())[0].predictor.observed
    force = problem_of(ramps())[0].predictor(TRUTH)
    share = 0.155 - 0.06 * observed.displacement / observed.depth
    extra = np.where(observed.trial == 0, share * force, 0.0)
    problem, base = problem_of(ramps(), seed=6, extra=extra)
    explained = explain(problem, base, SOUGHT)
    best = explained.every[0]
    assert best.names == ("preconditioning",)
    assert explained.base.probability < 0.01
    assert best.value("C10") == pytest.approx(TRUTH["C10"], rel=0.03)
    assert best.fit.prediction == pytest.approx(problem.predictor.observed.force, abs=0.6)


@pytest.mark.parametrize(("factor", "named"), [(1.25, False), (6.0, True)])
def test_fat_is_named_only_beyond_what_is_known_of_it(factor, named):
    """A factor within its prior is taken up as an effect; six times as stiff is a finding."""
    problem, _ = problem_of(ramps())
    observed, predictor = problem.predictor.observed, problem.predictor
    mechanism = mechanism_named("superficial-stiffness")
    force = predictor({**TRUTH, "superficial-stiffness.factor": factor}, [mechanism])
    known = Nuisances(GRID, {}, {"superficial.C10": fat(GRID)})
    effects = known.effects(observed, force, Accuracy())
    seen = noisy(observed.with_force(force), force, 3)
    errors = error_model(seen, problem.errors.noise, force, effects)
    problem = Problem(replace(predictor, observed=seen), errors)
    base = fit(problem, (), TRUTH)
    explained = explain(problem, base, [*SOUGHT, mechanism])
    assert (explained.every[0].names == (mechanism.name,)) == named
    assert explained.every[0].nothing != named
    if not named:
        fats = dict(zip(errors.names, explained.base.posterior.effects, strict=True))
        expected = np.log(factor) / MATERIAL_LOG_SD["superficial.C10"]
        assert fats["stiffness of the fat"] == pytest.approx(expected, abs=1.0)


def explanation(like: Explanation, mean: float, sd: float, probability: float) -> Explanation:
    """Return an explanation whose first parameter is normal; the others stay."""
    p = like.posterior
    mean_of, spread = p.mean.copy(), p.covariance.copy()
    mean_of[0], spread[0, 0] = mean, sd**2
    posterior = replace(p, mean=mean_of, covariance=spread)
    return replace(like, posterior=posterior, probability=probability)


def test_an_averaged_interval_is_that_of_a_mixture_of_distributions():
    """C10's logarithm is normal in one, Student's in the other: the mixture's quantiles by hand."""
    problem, base = problem_of(ramps(), seed=1)
    like = explain(problem, base, []).base
    one, other = explanation(like, 0.0, 0.02, 0.7), explanation(like, 0.2, 0.05, 0.3)
    one = replace(one, degrees=np.full(len(base.free), np.inf))
    other = replace(other, degrees=np.full(len(base.free), 4.0))
    prior = base.parameters[0].prior

    def share_below(c10: float) -> float:
        z = np.log(c10 / prior.centre) / prior.sd
        return 0.7 * norm.cdf(z / 0.02) + 0.3 * student_t.cdf((z - 0.2) / 0.05, 4)

    expected = [brentq(lambda c10, p=p: share_below(c10) - p, 0.06, 19.0) for p in (0.025, 0.975)]
    found = averaged_interval(Explained((one, other), one), "C10")
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    alone = averaged_interval(Explained((replace(one, probability=1.0),), one), "C10")
    np.testing.assert_allclose(alone, one.interval("C10"), rtol=1e-6)
    assert averaged_interval(Explained((one, other), one), "drag.size") is None


def test_limits_hold_what_is_there_and_are_small_where_nothing_is():
    problem, base = problem_of(ramps(), seed=1)
    quiet = {limit.name: limit for limit in limits_of(explain(problem, base, SOUGHT))}
    assert set(quiet) == {m.name for m in SOUGHT}
    compliance = quiet["support-compliance"]
    assert compliance.low == 0.0, "one sign is possible"
    assert 0.0 < compliance.high < 0.15
    drift = quiet["force-drift"]
    assert drift.low < 0.0 < drift.high
    assert (drift.parameter, drift.unit) == ("rate", "N/s")
    most = max(abs(drift.low), abs(drift.high)) * problem.predictor.observed.time.max()
    assert drift.effect == pytest.approx(most, rel=1e-6)
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.15}, seed=1)
    loud = {limit.name: limit for limit in limits_of(explain(problem, base, SOUGHT))}
    assert loud["support-compliance"].high > 0.15


def test_what_remains_beside_a_right_name_is_told_with_trial_and_place():
    """A support that gave way, and in the first trial 0.4 N that nothing makes beyond 15 mm."""
    effects = {"support-compliance.compliance": 0.25}
    problem, _ = problem_of(ramps(), effects, seed=1)
    observed = problem.predictor.observed
    late = np.clip((observed.displacement - 12) / 6, 0.0, 1.0)
    extra = np.where(observed.trial == 0, 0.4 * late**2, 0.0)
    found = diagnosed_of(
        observed.with_force(observed.force + extra), ("support-compliance", "force-drift")
    )
    model = next(e for e in found.explained.every if e.names == ("support-compliance",))
    assert model.in_part
    left = remains_of(found, model)
    assert left == sorted(left, key=lambda r: -abs(r.size_N))
    first = left[0]
    assert (first.trial, first.phase) == ("trial1", "loading")
    assert 12 < first.displacement_mm[0] < 18 < first.displacement_mm[1]
    assert 0.05 < first.size_N < 0.45
    assert {r.trial for r in left} == {"trial1"}
    assert 0.0 < explained_share(found, model) < 1.0


def test_nothing_remains_beside_an_explanation_that_suits():
    found = diagnosed({"support-compliance.compliance": 0.15}, asked=("support-compliance",))
    model = found.models[0]
    assert not model.in_part
    for unknown, in_part in ((INEXACT, False), (INEXACT + 0.1, False), (0.8, True), (1.0, True)):
        posterior = replace(model.posterior, unknown=unknown)
        assert replace(model, posterior=posterior).in_part is in_part  # no coin's toss
    assert remains_of(found, model) == []
    assert explained_share(found, model) > 0.9
    assert explained_share(found, found.alone) == pytest.approx(0.0, abs=1e-9)


def test_an_explanation_that_a_full_solution_cannot_confirm_loses_weight():
    problem, base = problem_of(ramps(), {"contact-onset.offset": 0.3}, seed=3)
    asked = SOUGHT[:2]
    plain = explain(problem, base, asked)
    calls = []

    def confirm(given, fitted):
        calls.append(fitted.names)
        return given, fitted, "contact-onset" not in fitted.names

    found = explain(problem, base, asked, confirm)
    assert ("contact-onset",) in calls
    assert len(calls) == len(set(calls)), "none is confirmed twice"

    def odds(explained):
        one = next(e for e in explained.every if e.names == ("contact-onset",))
        return np.log(one.probability / explained.base.probability)

    assert odds(plain) - odds(found) == pytest.approx(3.0, abs=1e-6)


def test_a_stopped_response_is_no_number_in_the_prediction():
    problem, _ = problem_of(ramps(), seed=1)

    class Stopped(ClosedForm):
        def curve(self, c10, c20):
            return np.full(len(self.grid), np.nan)

    predictor = replace(problem.predictor, responses=Stopped())
    assert np.isnan(predictor({**TRUTH, onset_name(0): 0.1})).all()


def test_what_is_known_poorly_of_the_leg_widens_intervals():
    """An effect of the outlines that is all that errs: its own degrees of freedom remain."""
    problem, base = problem_of(ramps(), seed=1)
    errors = problem.errors
    effect = base.change[:, :1]
    known = replace(errors, known=effect, names=("outline of the skin, mode 1",))
    estimator = np.linalg.pinv(base.change)
    variance = np.full((len(base.free),) * 2, 1.0)
    degrees = variance_degrees(variance, estimator, known)
    assert degrees[0] == pytest.approx(3.0)
    exact = replace(known, names=("load cell's gain",))
    assert variance_degrees(variance, estimator, exact)[0] == np.inf
