"""Fits with what is known beforehand, and what they predict that they weren't fitted to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from making_diagnosis import TRUTH, ClosedForm, noisy, one_at_each_rate, problem_of, ramps, two_rates
from scipy.stats import truncnorm

from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.errors import error_model
from legfem.inverse.evidence import Discrepancy, Evidence
from legfem.inverse.linearised import LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import strength
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.predictive import folds_of, held_out
from legfem.inverse.predictor import onset_name
from legfem.mechanisms import Mechanism, mechanism_named


@dataclass(frozen=True)
class Drag(Mechanism):
    """A constant force, and one part of it that no recording shows."""

    name: ClassVar[str] = "drag"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("size", "N", "of the force", 0.5, (0.0, 5.0)),
        Parameter("unseen", "-", (-3.0, 3.0), Prior(0.0, 0.7, "linear", "made")),
        Parameter("share", "-", (-3.0, 3.0), Prior(0.0, 0.5, "linear", "made")),
    )

    def added_force(self, values, observed):
        """Return the force (n,), N."""
        late = observed.displacement / observed.depth
        return values["size"] * (1 + values["share"] * late**2)


@pytest.fixture(scope="module")
def dragged():
    problem, base = problem_of(ramps(), seed=7)
    observed = problem.predictor.observed
    loaded = observed.with_force(observed.force + Drag().added_force({"size": 0.4, "share": 0.5}, observed))
    problem = LinearisedProblem(replace(problem.predictor, observed=loaded), problem.errors)
    return problem, fit(problem, [Drag()], base.values)


def test_what_is_known_beforehand_holds_a_parameter_that_the_data_do_not_see(dragged):
    _, found = dragged
    assert found.values["drag.unseen"] == pytest.approx(0.0, abs=1e-6)
    assert found.sd("drag.unseen") == pytest.approx(0.7, rel=1e-6)
    assert 0.0 < found.sd("drag.share") < 0.5
    away = {name: z for name, z in zip(found.free, found.prior_z, strict=True)}
    assert away["drag.share"] == pytest.approx(found.values["drag.share"] / 0.5, rel=1e-6)
    assert found.cost - found.chi2 == pytest.approx(sum(z**2 for z in away.values()))


def test_an_unseen_parameter_costs_no_evidence(dragged):
    """Nor is more known of it than beforehand: its prior, between its bounds."""
    problem, found = dragged
    evidence = Evidence(problem.errors, [Discrepancy(None, 0.0, 0.0)])
    given = found.linearised
    seen = np.array(found.free) != "drag.unseen"
    without = replace(
        given, jacobian=given.jacobian[:, seen], prior_z=given.prior_z[seen], low=given.low[seen], high=given.high[seen]
    )
    one, other = evidence.of(given), evidence.of(without)
    assert one.log_evidence == pytest.approx(other.log_evidence, abs=1e-6)
    k = found.free.index("drag.unseen")
    beforehand = truncnorm(given.low[k], given.high[k])
    assert one.covariance[k, k] == pytest.approx(beforehand.var(), rel=1e-6)


def test_a_fit_s_error_and_derivatives_are_those_of_the_prediction(dragged):
    problem, found = dragged
    assert abs(found.values[DEEP_C10] - TRUTH[DEEP_C10]) < 1.96 * found.sd(DEEP_C10)
    step = np.zeros(len(found.free))
    step[0] = 1e-4
    moved = problem.predictor(found.moved(found.prior_z + step), found.mechanisms)
    np.testing.assert_allclose((moved - found.prediction) / 1e-4, found.sensitivities[:, 0], rtol=2e-3, atol=1e-3)
    assert found.at_bound == ()


class TwoMinima(ClosedForm):
    """A response that turns back: factors somewhat above one lower what large ones raise."""

    def relative_change(self, acting, stiffness, observed):
        """Return it (n,)."""
        log = np.log(acting[1]["factor"])
        return 5e-3 * log**2 * (log - 1.5) * np.cos(0.12 * observed.displacement)


def test_a_search_begins_on_both_sides_of_a_hill():
    problem, base = problem_of(one_at_each_rate(), seed=8)
    predictor = replace(problem.predictor, responses=TwoMinima())
    mechanism = mechanism_named("compressibility")
    force = predictor({**TRUTH, "compressibility.factor": 25.0}, [mechanism])
    seen = noisy(predictor.observed, force, 8)
    errors = error_model(seen, problem.errors.noise, force)
    found = fit(LinearisedProblem(replace(predictor, observed=seen), errors), [mechanism], base.values)
    assert found.values["compressibility.factor"] > 12.0, "the near side ends below 5"
    sd = found.sd("compressibility.factor")
    assert found.values["compressibility.factor"] == pytest.approx(25.0, abs=3 * sd)
    assert found.values[DEEP_C10] == pytest.approx(TRUTH[DEEP_C10], rel=0.03)


def test_held_out_data_are_predicted_better_with_the_right_mechanism():
    effects = {"viscoelasticity.ratio": 0.1, "viscoelasticity.relaxation_time": 8.0}
    problem, base = problem_of(one_at_each_rate(), effects, seed=5)
    assert "each protocol" in folds_of(problem.predictor.observed)[0]
    repaired = fit(problem, [mechanism_named("viscoelasticity")], base.values)
    before, after = held_out(base), held_out(repaired)
    assert after.rmse < 0.5 * before.rmse
    # A trial's own gain is most of its error, and it has but one.
    assert after.rmse < 2.5 * after.noise


@pytest.mark.parametrize("recordings", [two_rates, ramps])
def test_trials_before_the_tissue_settled_do_not_spoil_what_is_held_out(recordings):
    """Earlier trials can't be predicted from later ones: the first is never held out."""
    effects = {"preconditioning.softening": 0.3, "preconditioning.fading": 0.5}
    problem, base = problem_of(recordings(), effects, seed=6)
    _, folds = folds_of(problem.predictor.observed)
    assert not any(fold[problem.predictor.observed.trial == 0].any() for fold in folds)
    repaired = fit(problem, [mechanism_named("preconditioning")], base.values)
    before, after = held_out(base), held_out(repaired)
    assert after.rmse < 0.7 * before.rmse
    # A trial's own gain is most of its error, and it has but one.
    assert after.rmse < 2.5 * after.noise


def test_what_is_held_out_of_few_recordings_is_a_later_phase_or_the_deepest_third():
    alone, _ = problem_of(ramps(1))
    assert folds_of(alone.predictor.observed)[0] == "the deepest third"
    cycle, _ = problem_of(two_rates()[:1])
    assert folds_of(cycle.predictor.observed)[0] == "hold and unloading"
    several, _ = problem_of(ramps())
    how, folds = folds_of(several.predictor.observed)
    assert "first" in how and len(folds) == 2


def test_a_held_out_trial_keeps_the_first_contact_that_was_found():
    """No other trial tells where one was touched: it isn't predicted from none."""
    _, base = problem_of(ramps(), {onset_name(2): 0.3}, seed=6)
    assert base.values[onset_name(2)] > 0.02
    found = held_out(base)
    assert found.rmse < 3 * found.noise
