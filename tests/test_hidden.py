"""What could hide: profiles of strengths, beside closed forms, and what a report makes of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from making_diagnosis import (
    INSTRUMENT,
    MADE,
    TRUTH,
    ClosedForm,
    LinearDrift,
    force_at,
    noisy,
    observations,
    problem_of,
    ramps,
    relaxed,
    two_rates,
)
from scipy.stats import norm

from legfem.common.progress import Silent
from legfem.geometry.section import CALF, LIMBS
from legfem.inverse.accuracy import MeasuredStrength
from legfem.inverse.averaging import Weighted, _beside_unseen, unseen_of
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.correction import read_fibres
from legfem.inverse.diagnose import DiagnosisInput, diagnose
from legfem.inverse.evidence import Evidence, possible_discrepancies
from legfem.inverse.explanation import Explanation
from legfem.inverse.hidden import profile_of
from legfem.inverse.laplace import laplace_posterior
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import Occurrence, Unseen, shown_mechanisms
from legfem.inverse.parameter import Prior
from legfem.inverse.posterior import Mixture
from legfem.inverse.verdict import TRUSTED, shift_of
from legfem.legs.diagnosis import WITHOUT_ENDS
from legfem.legs.nuisances import ShapeAccuracy
from legfem.mechanisms import OCCURRENCES, mechanism_named, mechanisms
from legfem.mechanisms.time_dependence import carried
from legfem.report.diagnosis_headline import headline
from legfem.report.diagnosis_sentences import hidden_sentence

DRIFT = "force-drift.rate"


@dataclass(frozen=True, eq=False)
class Hiding(ClosedForm):
    """Responses to a lump that are those to a stiffer muscle everywhere, so that C10 takes its place."""

    def relative_change(self, acting, at, observed):
        mechanism, values = acting
        if mechanism.name != "uneven-muscle":
            return super().relative_change(acting, at, observed)
        c10, c20 = at
        more = 1 + 0.3 * np.log(values["factor"])
        d = np.maximum(observed.displacement, 1e-6)
        return force_at(more * c10, more * c20, d) / force_at(c10, c20, d) - 1.0


@dataclass(frozen=True, eq=False)
class Edged(Hiding):
    """The same with an edge: what the lump does waxes and wanes by some per cent of itself over the depth."""

    def relative_change(self, acting, at, observed):
        mechanism, _ = acting
        change = super().relative_change(acting, at, observed)
        waves = 0.06 * np.cos(observed.displacement / 4.0) if mechanism.name == "uneven-muscle" else 0.0
        return change * (1 + waves)


def lump(factor, possible=OCCURRENCES, truth=Hiding):
    """Return the diagnosis of a leg with a lump that a refit hides, C10 1.0 and C20 0.6 kPa about it."""
    observed, predictor = observations(ramps())
    predictor = replace(predictor, responses=truth())
    mechanism = mechanism_named("uneven-muscle")
    values = {DEEP_C10: 0.001, DEEP_C20: 0.0006, "uneven-muscle.factor": factor}
    observed = noisy(observed, predictor(values, [mechanism]), 1)
    asked = ("uneven-muscle", "force-drift", "support-compliance", "superficial-stiffness")
    able, _ = shown_mechanisms(mechanisms(), observed, WITHOUT_ENDS)
    library = Hiding(missing={m.name: "not asked" for m in able if m.name not in asked})
    return told(observed, library, possible)


def told(observed, library, possible):
    """Return the diagnosis by a library, of a leg as it is usually known."""
    given = DiagnosisInput(
        observed,
        INSTRUMENT,
        "reduced-polynomial",
        library,
        mechanisms(),
        MADE,
        "leg",
        accuracy=ShapeAccuracy(bones=LIMBS[CALF]),
        ruled_out=WITHOUT_ENDS,
        possible=possible or {},
    )
    return diagnose(given, None, Silent())


def relaxing(possible=OCCURRENCES):
    """Return the diagnosis of a leg that is stiffer by a tenth as it is loaded than in the end, C10 1.0 kPa there.

    It relaxes by one dashpot, slower than a loading, and between the times of the library's branches.
    """
    observed, predictor = observations(ramps())
    force = predictor({DEEP_C10: 0.001, DEEP_C20: 0.0006})
    behind = relaxed(observed.protocols[0], observed.time, 400.0)
    force *= 1.0 + 0.12 * behind / np.maximum(observed.displacement, 1e-9)
    able, _ = shown_mechanisms(mechanisms(), observed, WITHOUT_ENDS)
    asked = ("force-drift", "preconditioning")
    library = ClosedForm(missing={m.name: "not asked" for m in able if m.name not in asked})
    observed = noisy(observed, force, 1)
    return told(observed, library, possible)


def drifting(measured=()):
    """Return the explanation of recordings by a drift, and the base model's fit."""
    problem, _ = problem_of(ramps(), seed=3)
    problem = replace(problem, measured=measured)
    base = fit(problem, (), TRUTH)
    mine = fit(problem, [LinearDrift()], {**base.values, DRIFT: 0.002})
    evidence = Evidence(problem.errors, possible_discrepancies(problem.predictor.observed, base.prediction))
    posterior = laplace_posterior(evidence, mine, [0.0] + [-np.inf] * (len(evidence.unknowns) - 1))
    return Explanation(mine, posterior, 0.0, False, False), base


def normal_equations(one):
    """Return the middle and sd of a drift (N/s) without a prior of its own, all else at its best."""
    fitted = one.fit
    k = fitted.free.index(DRIFT)
    own = np.eye(len(fitted.free))
    own[k, k] = 0.0
    information = fitted.jacobian.T @ fitted.jacobian + own
    gradient = fitted.jacobian.T @ fitted.whitened - own @ fitted.prior_z
    at = fitted.prior_z + np.linalg.solve(information, gradient)
    prior = fitted.parameters[k].prior
    return prior.value_at(at[k]), prior.sd * np.sqrt(np.linalg.inv(information)[k, k])


def test_limits_are_those_of_the_normal_equations_where_the_problem_is_linear():
    one, base = drifting()
    limit = profile_of(one, base).limit(base)
    middle, sd = normal_equations(one)
    assert not limit.open
    assert limit.low == pytest.approx(middle - 1.96 * sd, abs=0.03 * sd)
    assert limit.high == pytest.approx(middle + 1.96 * sd, abs=0.03 * sd)


def test_a_reading_of_the_strength_counts_in_its_limits():
    alone, base = drifting()
    middle, sd = normal_equations(alone)
    mechanism = LinearDrift()
    scale = mechanism.parameters[0].prior.sd
    one, _ = drifting((MeasuredStrength(mechanism, middle / scale, sd / scale),))
    limit = profile_of(one, base).limit(base)
    # Twice as much is known, of the same middle.
    assert limit.high - limit.low == pytest.approx(2 * 1.96 * sd / np.sqrt(2.0), rel=0.03)


def test_what_is_impossible_is_no_limit_and_an_end_that_is_reached_is_open():
    one, base = drifting()
    middle, sd = normal_equations(one)
    limit = profile_of(one, base, Occurrence(middle - 0.5 * sd, middle + 5 * sd)).limit(base)
    assert limit.open_low and not limit.open_high
    assert limit.low == pytest.approx(middle - 0.5 * sd, abs=1e-6)


def test_a_lump_that_a_refit_hides_leaves_its_limit_open_and_the_answer_is_not_yes():
    found = lump(10.0)
    assert found.verdict == "consistent"
    limit = next(one for one in found.limits if one.name == "uneven-muscle")
    assert limit.open_low and limit.open_high and limit.high == pytest.approx(10.0)
    # The base model takes the lump for a muscle that is stiffer by 0.3 ln 10.
    assert found.base_model.value(DEEP_C10) == pytest.approx(1e-3 * (1 + 0.3 * np.log(10.0)), rel=0.03)
    assert limit.stiffness[DEEP_C10][0] == pytest.approx(1e-3, rel=0.03)
    assert found.limits[0] is limit and shift_of(limit, found.weighted_base.fit) > TRUSTED
    answer = headline(found, ())
    assert answer.heading.startswith("The model fits, and C10 may be off by ")
    assert "Report a range" in answer.sentence
    soft, hard = limit.ends
    assert soft.values["factor"] == pytest.approx(0.25) and hard.values["factor"] == pytest.approx(10.0)
    assert soft.open and hard.open and hard.c10 == pytest.approx(1e-3, rel=0.03)
    said = hidden_sentence(found, limit, hard)
    assert said.startswith(
        "A region of the muscle of 10 times the stiffness of the rest would not have been detected; C10"
    )
    assert said in dict(answer.answers)["Problems found"]


def test_the_interval_holds_what_a_lump_hides_for_great_strengths_are_common():
    usual, found = lump(4.0, possible={}), lump(4.0)
    assert found.base_model.value(DEEP_C10) > 1.3e-3
    assert found.intervals[DEEP_C10][0] < 1e-3 < usual.intervals[DEEP_C10][0]


def test_what_a_loading_alone_can_not_show_of_relaxation_counts_in_the_interval():
    shown, found = relaxing(possible={}), relaxing()
    assert (found.verdict, found.explained.every[0].names) == (shown.verdict, shown.explained.every[0].names)
    assert found.verdict == "consistent"
    assert found.intervals[DEEP_C10][0] < 1e-3 < shown.intervals[DEEP_C10][0]
    assert found.intervals[DEEP_C20][0] < shown.intervals[DEEP_C20][0]
    # What it is at its rate is no narrower on the other side, and no wider.
    assert 0.97 < found.intervals[DEEP_C10][1] / shown.intervals[DEEP_C10][1] <= 1.0
    said = headline(found, ())
    assert headline(shown, ()).heading == "Yes." and said.heading.startswith("The model fits, and C10 may be off by")
    assert "relaxes while it is held" in dict(said.answers)["Problems found"]
    assert "hold the deepest position" in dict(said.answers)["What to do"]


def test_what_is_unseen_of_a_linear_loading_is_the_dashpots_by_hand():
    """At a constant rate a branch of time T carries T / t (1 - exp(-t / T)) of a force that is proportional to t."""
    observed, _ = observations(ramps(1))
    observed = observed.with_force(observed.time)
    t = observed.time
    for time in (1.2, 48.0):
        by_hand = np.sum(t * time * -np.expm1(-t / time)) / np.sum(t**2)
        assert carried(observed, time) == pytest.approx(by_hand, rel=1e-9)
    (unseen,) = unseen_of([mechanism_named("viscoelasticity")], observed, OCCURRENCES)
    low, high = (unseen.factors[k] for k in (0, -1))
    assert 1.0 < low < 1.02 and 1.15 < high < 1.0 + 0.38 * carried(observed, 600.0)
    held, _ = observations(two_rates())
    assert not list(unseen_of([mechanism_named("viscoelasticity")], held, OCCURRENCES)), "a hold shows it"


def test_what_fibres_hide_in_the_stiffness_is_the_tables_whatever_is_recorded():
    """At one depth, the table's errors nought in the middle: the table's own factors, for ln r apart evenly."""
    observed, _ = observations(two_rates())
    deepest = observed.displacement == observed.displacement.max()
    observed = observed.with_force(np.where(deepest, 1.0, 0.0))
    (unseen,) = unseen_of([mechanism_named("muscle-fibres")], observed, OCCURRENCES)
    middle = np.array(unseen.factors).reshape(5, 5)[:, 2]
    depth = observed.displacement[deepest][:1]
    by_hand = [np.exp(read_fibres().log_at(ratio, depth)[0]) for ratio in np.geomspace(1.2, 3.0, 5)]
    np.testing.assert_allclose(middle, by_hand, rtol=1e-9)
    assert 1.0 < min(unseen.factors) < 1.03 and 1.25 < max(unseen.factors) < 1.6


def test_an_interval_beside_what_is_unseen_is_the_mixture_by_hand():
    """Half of it as it is seen, half divided by one of two factors: of a logarithm, and of a number itself."""
    given = Mixture(np.ones(1), np.array([0.1]), np.array([0.2]), np.array([np.inf]))
    for prior in (Prior(1.0, 0.5, "log"), Prior(1.0, 0.5)):
        unseen = Unseen(mechanism_named("muscle-fibres"), (1.1, 1.3))
        found = _beside_unseen([Weighted(("dermis",), 0.7, given)], prior, [unseen])
        named = _beside_unseen([Weighted(("muscle-fibres",), 0.7, given)], prior, [unseen])
        assert named.below(0.3) == pytest.approx(given.below(0.3), rel=1e-12), "what names it has it"

        def by_hand(value, prior=prior):
            parts = [norm.cdf((prior.departure(f * value) - 0.1) / 0.2) for f in (1.0, 1.1, 1.3)]
            return 0.5 * parts[0] + 0.25 * (parts[1] + parts[2])

        for value in (0.7, 0.9, 1.1):
            assert found.below(prior.departure(value)) == pytest.approx(by_hand(value), rel=1e-9)


def test_neighbours_of_a_mixture_are_merged_without_moving_its_ends():
    at = np.linspace(-1.0, 1.0, 161)
    weights = np.concatenate([[0.0], norm.pdf(at[1:], 0.3, 0.4)])
    given = Mixture(weights / weights.sum(), at, 0.2 + 0.1 * at**2, np.full(161, np.inf))
    merged = given.merged(30)
    assert len(merged.weights) <= 30 and merged.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(merged.moments, given.moments, rtol=1e-12)
    for probability in (0.025, 0.5, 0.975):
        assert merged.quantile(probability) == pytest.approx(given.quantile(probability), abs=2e-3)


def test_a_lump_whose_form_is_not_the_librarys_is_not_contradicted_by_its_form():
    """A tenth of its whole effect may be its form's: without that what an edge does would close the interval."""
    found = lump(6.0, truth=Edged)
    low, high = found.intervals[DEEP_C10]
    assert low < 1e-3 < high
    assert not headline(found, ()).heading.startswith("Yes")
