"""Statistics of cohorts against published numbers, another library's, a dense algebra, and planted truths."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import statsmodels.formula.api as formulas
from making_cohort import LAW, Truth, fabricated

from legfem.cohort.agreement import MixedModel, agreement, limits
from legfem.cohort.statistics import _people_needed, statistics
from legfem.report.cohort_statistics import chapter


def test_the_correlation_is_that_of_shrout_and_fleiss():
    """Their example (1979, Table 2): ICC(2,1) = 0.29; pingouin 0.6.1 gives 0.289764 (0.02 to 0.76)."""
    judges = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
    found = agreement(np.array(judges, dtype=float))
    assert found.icc == pytest.approx(0.289764, abs=5e-7)
    assert found.icc95 == pytest.approx((0.02, 0.76), abs=0.005)


def test_the_limits_are_those_of_bland_and_altman():
    """Two flow meters (1986): -2.1 (-22.0 to 17.8), lower limit -78.1 and upper 73.9 l/min, each +-34.6."""
    large = [494, 395, 516, 434, 476, 557, 413, 442, 650, 433, 417, 656, 267, 478, 178, 423, 427]
    mini = [512, 430, 520, 428, 500, 600, 364, 380, 658, 445, 432, 626, 260, 477, 259, 350, 451]
    found = limits(np.subtract(large, mini).astype(float))
    assert (found.bias, *found.bias95) == pytest.approx((-2.1, -22.0, 17.8), abs=0.1)
    assert (found.low, found.high) == pytest.approx((-78.1, 73.9), abs=0.1)
    assert np.diff(found.low95)[0] / 2 == pytest.approx(34.6, rel=0.01)


def made(seed: int, own: float, people: int = 24, alike: float = 0.0) -> MixedModel:
    rng = np.random.default_rng(seed)
    person, leg = np.repeat(np.arange(people), 4), np.repeat(np.arange(2 * people), 2)
    x = np.column_stack([np.ones(4 * people), person % 2, rng.normal(size=4 * people)])
    errors = own * np.exp(0.5 * rng.normal(size=4 * people))
    y = x @ [0.1, 0.3, 0.0] + 0.3 * rng.normal(size=people)[person] + 0.1 * rng.normal(size=2 * people)[leg]
    y += 0.06 * rng.normal(size=4 * people) + errors * rng.normal(size=4 * people)
    together = alike * np.exp(0.2 * rng.normal(size=4 * people)) if alike else np.zeros(4 * people)
    y += together * rng.normal(size=2 * people)[leg]
    kept = rng.permutation(4 * people)[: 4 * people - 7]  # some tests are missing
    return MixedModel(y[kept], x[kept], errors[kept], together[kept], person[kept], leg[kept])


def test_without_own_errors_the_model_is_statsmodels_mixedlm():
    model = made(0, 0.0)
    found = model.fit()
    columns = {"y": model.y, "a": model.x[:, 1], "b": model.x[:, 2], "person": model.person, "leg": model.leg}
    data = pd.DataFrame(columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        other = formulas.mixedlm("y ~ a + b", data, groups="person", vc_formula={"leg": "0 + C(leg)"}, re_formula="1")
        theirs = other.fit(reml=True)
    assert found.effects == pytest.approx(theirs.fe_params.to_numpy(), abs=1e-4)
    sd = [*np.sqrt(theirs.cov_re.to_numpy().ravel()), *np.sqrt(theirs.vcomp), np.sqrt(theirs.scale)]
    assert found.sd == pytest.approx(sd, rel=1e-3)


def test_own_errors_and_those_of_a_legs_tests_together_enter_as_a_dense_covariance_says():
    model = made(1, 0.1, alike=0.12)
    owner = np.zeros(model.leg.max() + 1, dtype=int)
    owner[model.leg] = model.person

    def dense(sd):
        same_person = model.person[:, None] == model.person
        same_leg = model.leg[:, None] == model.leg
        whole = sd[0] ** 2 * same_person + (sd[1] ** 2 + np.outer(model.alike, model.alike)) * same_leg
        whole += np.diag(sd[2] ** 2 + model.own**2 + 1e-12)
        inverse = np.linalg.inv(whole)
        information = model.x.T @ inverse @ model.x
        effects = np.linalg.solve(information, model.x.T @ inverse @ model.y)
        left = model.y - model.x @ effects
        cost = np.linalg.slogdet(whole)[1] + left @ inverse @ left + np.linalg.slogdet(information)[1]
        return cost, effects, np.linalg.inv(information)

    for sd in (np.array([0.3, 0.1, 0.06]), np.array([0.0, 0.4, 0.0]), np.array([0.2, 0.0, 0.1])):
        for mine, theirs in zip(model._solved(sd, owner), dense(sd), strict=True):
            assert mine == pytest.approx(theirs, rel=1e-9, abs=1e-12)
    found = model.fit()
    for k in range(3):
        aside = np.array(found.sd)
        aside[k] *= 1.05
        assert dense(aside)[0] > dense(np.array(found.sd))[0], "the fit is the least cost"


@pytest.mark.slow
def test_planted_variances_and_differences_lie_in_their_intervals():
    truth = Truth(people=0.25, sides=0.1, sessions=0.06, error=0.05, group=0.3)
    inside = np.zeros(5)
    for seed in range(20):
        members, rows = fabricated(16, truth=truth, seed=seed)
        c10 = statistics(members.every, rows).parameters[0]
        group = next(one for one in c10.effects if one.of_group)
        planted = (truth.people, truth.sides, truth.sessions)
        inside += [
            *(low <= sd <= high for sd, (low, high) in zip(planted, c10.fitted.sd95, strict=True)),
            group.low <= truth.group <= group.high,
            c10.repeated[0].agreement.icc95[0] <= icc_of(truth) <= c10.repeated[0].agreement.icc95[1],
        ]
    assert inside.min() >= 17, inside


def icc_of(truth: Truth) -> float:
    legs = truth.people**2 + truth.sides**2 + truth.group**2 / 4
    return legs / (legs + truth.sessions**2 + truth.error**2)


def test_the_next_study_has_the_size_that_tables_give():
    """Cohen (1988): 64 in each group for half a standard deviation, 26 for 0.8."""
    assert (_people_needed(0.5), _people_needed(0.8)) == (64, 26)


def test_what_the_table_does_not_permit_is_said_with_the_reason():
    members, rows = fabricated(3, sides=1, sessions=1)
    found = statistics(members.every, rows)
    assert not any(one.repeated or one.effects for one in found.parameters)
    assert found.not_done == (
        "No agreement between sessions: the table has one session.",
        "No agreement between raters: the table has no rater.",
        "No mixed model: 3 people are too few for 3 effects (7 are needed).",
    )
    alone = [one for one in members.every if one.person == "P0000"]
    assert "Statistics need several people" in statistics(alone, rows[:1]).not_done[0]


def test_a_column_that_says_what_another_says_is_left_out():
    members, rows = fabricated(12, sides=1)
    every = [
        type(one)(one.name, one.folder, one.person, {**one.given, "rater": f"r{one.given['session']}"})
        for one in members.every
    ]
    said = statistics(every, rows).not_done
    assert "rater r2 against r1 is not in the mixed model: what stands before it says the same." in said


def test_a_parameter_that_is_zero_in_some_is_compared_as_it_is():
    members, rows = fabricated(12)
    found = rows[0].models[LAW]
    zero = replace(found.measures["c20_deep"], value=0.0)
    rows[0] = replace(rows[0], models={LAW: replace(found, measures={**found.measures, "c20_deep": zero})})
    c10, c20 = statistics(members.every, rows).parameters
    assert c10.logarithmic and not c20.logarithmic and not c20.needed
    tables = [getattr(block, "rows", ()) for block in chapter(statistics(members.every, rows)).blocks]
    texts = [cell for table in tables for row in table for cell in row]
    assert any(text.endswith(" kPa") for text in texts) and any(text.endswith(" %") for text in texts)
