"""What an answer rests on is solved in full, and nothing else; responses in closed form, no finite elements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import count

import numpy as np
import pytest
from making_diagnosed import diagnosed
from making_diagnosis import ClosedForm, observations, problem_of, ramps

from legfem.api.loading import seconds_of
from legfem.common.errors import InputError
from legfem.common.progress import NEVER, Deadline, Silent, TimeIsUpError, Until
from legfem.experiments.experiment import Solved
from legfem.inverse.answer import Finding, FitNotice
from legfem.inverse.averaging import averaged_intervals
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.explain import explain
from legfem.inverse.explanation import ADDS_FROM, log_bayes_factor
from legfem.inverse.library import UNTRIED, Detail
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import Task, outcomes_of
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.responses import SolvedResponses
from legfem.inverse.screening import MATTERS, may_move, moves, rests_on
from legfem.inverse.verdict import answer_of, solution_notices
from legfem.mechanisms import TissueMechanism, mechanism_named
from legfem.report.answers import sentence_of
from legfem.report.diagnosis_headline import headline

NAMES = ("compressibility", "fascia-stiffness", "strain-stiffening", "superficial-stiffness")
SOUGHT = [mechanism_named(name) for name in NAMES]
STIFF_FAT = {"superficial-stiffness.factor": 3.0}


@dataclass(frozen=True, eq=False)
class Screened(ClosedForm):
    """The closed form, of which mechanisms that aren't solved in full act too little, and the less the deeper."""

    detail: Detail = field(default_factory=Detail)

    def relative_change(self, acting, at, observed):
        """Return what is known of a mechanism."""
        mechanism, _ = acting
        exact = super().relative_change(acting, at, observed)
        return exact if mechanism.name in self.detail.whole else exact * (0.9 - 0.5 * observed.displacement / 20)

    def knows_no_more(self, before, names):
        """Whether nothing of mechanisms became known."""
        return not (self.detail.whole - before.detail.whole) & set(names)


def base_of(responses: ClosedForm, effects: dict[str, float] | None = None) -> LinearisedFit:
    _, base = problem_of(ramps(), effects, seed=3)
    predictor = replace(base.problem.predictor, responses=responses)
    return replace(base, problem=replace(base.problem, predictor=predictor))


def test_what_is_named_is_solved_in_full_and_says_the_same():
    asked = []

    def complete(detail: Detail) -> Screened:
        asked.append(detail)
        return Screened(detail=detail)

    found = explain(base_of(Screened(), STIFF_FAT), SOUGHT, complete=complete)
    exact = explain(base_of(ClosedForm(), STIFF_FAT), SOUGHT)
    rough = explain(base_of(Screened(), STIFF_FAT), SOUGHT)
    first, true, screened = (one.every[0] for one in (found, exact, rough))
    assert first.names == true.names == ("superficial-stiffness",)
    np.testing.assert_allclose(first.posterior.log_evidence, true.posterior.log_evidence, atol=0.01)
    assert abs(screened.posterior.log_evidence - true.posterior.log_evidence) > 0.05, "nothing to mend"
    assert "superficial-stiffness" in asked[0].whole
    known = found.base.problem.predictor.responses.detail
    assert all(moves(one, found.every) < MATTERS for one in found.every if set(one.names) - known.whole)


def test_nothing_is_solved_in_full_where_nothing_adds():
    def complete(detail: Detail) -> Screened:
        raise AssertionError(f"asked for {detail}")

    found = explain(base_of(Screened()), SOUGHT, complete=complete)
    singles = [one for one in found.every if len(one.names) == 1]
    assert len(singles) == len(SOUGHT)
    assert all(log_bayes_factor(one, found.base) + may_move(one, found.every) < ADDS_FROM for one in singles)
    assert rests_on(found.every, Detail()) == Detail()


def test_two_at_once_are_asked_for_where_they_explain_more_than_one():
    both = {**STIFF_FAT, "strain-stiffening.coefficient": 0.6}
    found = explain(base_of(ClosedForm(), both), SOUGHT)
    pair = frozenset(found.every[0].names)
    assert pair == {"superficial-stiffness", "strain-stiffening"}
    assert pair in rests_on(found.every, Detail.of_all(SOUGHT, pairs=False)).pairs
    assert rests_on(found.every, Detail.of_all(SOUGHT)) == Detail.of_all(SOUGHT)


def test_nothing_is_solved_after_a_deadline_and_the_answer_says_so():
    def complete(detail: Detail) -> Screened:
        raise AssertionError(f"asked for {detail}")

    over = Deadline.after(0.0)
    assert over.passed and not NEVER.passed and not Deadline.after(3600.0).passed
    found = explain(base_of(Screened(), STIFF_FAT), SOUGHT, complete=complete, deadline=over)
    assert found.every[0].names == ("superficial-stiffness",)
    assert found.cut and not explain(base_of(Screened(), {}), SOUGHT, complete=complete, deadline=over).cut

    def cut(detail: Detail) -> Screened:
        raise TimeIsUpError

    found = explain(base_of(Screened(), STIFF_FAT), SOUGHT, complete=cut)
    assert found.cut and found.every[0].names == ("superficial-stiffness",), "a part counts for nothing"

    whole = diagnosed({})
    assert answer_of(whole).finding is not Finding.PROVISIONAL
    left = replace(whole, untested={**whole.untested, "dermis": UNTRIED}, provisional=True)
    weighed, every = left.weighed
    assert every == weighed + 1
    told = headline(left, ())
    assert told.heading == f"Provisional: {weighed} of {every} effects weighed."
    assert told.sentence.startswith("So far: C10 = ") and told.tone == "open"
    assert [question for question, _ in told.answers] == ["Problems found so far", "What to do"]
    (notice,) = [one for one in solution_notices(left) if one.code == FitNotice.PROVISIONAL]
    assert f"when {weighed} of {every} effects were weighed" in sentence_of(notice)


class Stopping:
    """A leg whose solutions never come to their end."""

    assumed = geometric = ()

    def follow(self, protocol, deep, solution, sensitivities=()):
        """Say that it stopped."""
        return Solved.nothing("the step became too small")

    def described(self, variant):
        """Return nothing in particular."""
        return variant


def test_mechanisms_come_after_the_base_model_and_are_left_after_a_deadline(tmp_path):
    responses = SolvedResponses(Stopping(), 20.0, tmp_path, {})
    asked = [one for one in SOUGHT if isinstance(one, TissueMechanism)]
    elastic = [Task((1e-3 * factor, 0.0)) for factor in (0.5, 1.0, 2.0)]
    tasks = [*elastic, *(Task((1e-3, 0.0), one, one.strengths[0]) for one in asked)]
    ticks = count()
    begun = outcomes_of(responses, tasks, 1, Until(Silent(), Deadline(3.0, lambda: float(next(ticks)))))
    assert sorted(begun) == [0, 1, 2, 3]
    assert len(outcomes_of(responses, tasks, 1, Silent())) == len(tasks)


def test_a_detail_that_was_solved_in_part_is_none(tmp_path):
    responses, ticks = SolvedResponses(Stopping(), 20.0, tmp_path, {}), count()
    observed, _ = observations(ramps())
    told, detail = Until(Silent(), Deadline(6.0, lambda: float(next(ticks)))), Detail(frozenset(NAMES))
    with pytest.raises(TimeIsUpError):
        build_library(responses, observed, SOUGHT, 1, told, 1e-3, detail=detail)
    assert next(ticks) == 7, "in the middle of a mechanism's"


def test_what_was_not_weighed_leaves_statements_less_sure_and_C10_wider():
    base = base_of(Screened(), STIFF_FAT)
    waiting = tuple(mechanism_named(name) for name in ("dermis", "prestress", "support-compliance", "indenter-tilt"))
    problem = replace(base.problem, unweighed=waiting)
    whole, part = (explain(replace(base, problem=one), SOUGHT) for one in (base.problem, problem))
    assert whole.share == 1.0 and 0.45 < part.share < 0.8
    assert sum(one.probability for one in part.statements()) == pytest.approx(part.share, abs=1e-6)
    assert part.statements()[0].names == ("superficial-stiffness",) and part.statements()[0].probability < 0.8
    (low, high), (lower, higher) = (next(averaged_intervals(one, DEEP_C10)) for one in (whole, part))
    assert lower < 0.9 * low and higher > 1.1 * high


def test_until_ends_work_between_two_units_once_time_is_over():
    ticks, done = count(), []
    told = Until(Silent(), Deadline(2.0, lambda: float(next(ticks))))
    with pytest.raises(TimeIsUpError):
        for unit in range(9):
            done.append(unit)
            told.advance("a unit")
    assert done == [0, 1, 2]


@pytest.mark.parametrize("given", ["soon", "0s", "-3s", ""])
def test_a_time_that_is_none_is_refused(given):
    with pytest.raises(InputError, match="is not a time"):
        seconds_of("within", given)
    assert seconds_of("within", "2min") == 120.0
