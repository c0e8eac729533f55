"""What an answer rests on is solved in full, and nothing else; responses in closed form, no finite elements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from making_diagnosis import ClosedForm, problem_of, ramps

from legfem.inverse.explain import explain
from legfem.inverse.explanation import ADDS_FROM, log_bayes_factor
from legfem.inverse.library import Detail
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.screening import MATTERS, may_move, moves, rests_on
from legfem.mechanisms import mechanism_named

NAMES = ("compressibility", "fascia-stiffness", "strain-stiffening", "superficial-stiffness")
SOUGHT = [mechanism_named(name) for name in NAMES]
STIFF_FAT = {"superficial-stiffness.factor": 3.0}


@dataclass(frozen=True, eq=False)
class Screened(ClosedForm):
    """The closed form, of which mechanisms that aren't solved in full act too little, and the less the deeper."""

    detail: Detail = field(default_factory=Detail)

    def relative_change(self, mechanism, values, at, observed):
        """Return what is known of a mechanism."""
        exact = super().relative_change(mechanism, values, at, observed)
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
