"""The score of sealed cases: it counts what it says."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from legfem.inverse.explain import PRIOR_NONE, PRIOR_SINGLE
from studies.concealed.cases import make_cases
from studies.concealed.page import cases_page, figure, page, reliability, scored_document, summarise
from studies.concealed.scoring import Explained, Scored, at_base_rates


def scored(number, names, *models, kind="single", twin_of=None, size=9.0, sure=0.95, **changed):
    """Return a scored case; its C10 was 20 % off before repair."""
    case = replace(
        make_cases(20, 1, 2)[0],
        number=number,
        kind=kind,
        twin_of=twin_of,
        outside=(),
        effects=tuple((name, (("strength", 1.0),)) for name in names),
    )
    if kind == "pair":
        changed = {"parts": tuple((name, 9.0) for name in names), **changed}
    verdict = ("consistent", "named", "ambiguous")[min(len(models), 2)]
    rest = (1 - sure) / max(len(models) - 1, 1)
    explanations = tuple(Explained(model, False, sure if k == 0 else rest) for k, model in enumerate(models or ((),)))
    usual = Scored(
        case, verdict, models, explanations, size, 0.05, (8, 1, 1), 0.2, 0.01, True, 12.0, 3, 0.05, explanations
    )
    return replace(usual, **changed)


def everything():
    return [
        scored(0, ["a"], ("a",)),
        scored(1, ["a"], ("b",), ("a",), sure=0.7, bias_after=0.05),
        scored(2, ["a"], ("b",)),
        scored(3, ["a", "b"], ("b", "a"), kind="pair", covered=False),
        scored(4, [], kind="none", size=0.0),
        scored(5, ["a"], size=1.0),
        scored(6, ["a"], ("a",), twin_of=0),
        scored(7, ["a"], ("a",), ("b",), twin_of=1),
    ]


def test_scores_count_what_they_say():
    summary = summarise(everything())
    alone, _, pairs, _, both, _ = summary.named
    assert (both.first.count, both.first.total) == (2, 4)
    assert (both.in_set.count, both.in_set.total) == (3, 4)
    assert (alone.first.count, alone.in_set.count, alone.first.total) == (1, 2, 3)
    assert (pairs.first.count, pairs.in_said.count, pairs.first.total) == (1, 1, 1)
    assert summary.median_set == 1 and summary.median_said == 1
    assert (summary.false_alarms.count, summary.false_alarms.total) == (0, 1)
    assert (summary.covered.count, summary.covered.total) == (5, 6)
    assert summary.same_answer.count == 2
    assert summary.f1 == pytest.approx(0.8 * 2 / (0.8 * 2 + 0.2))
    assert summary.bias_before == pytest.approx(0.2)
    assert summary.bias_after == pytest.approx(0.01)
    sizes = {(low, high): first.total for low, high, first, _ in summary.by_size}
    assert sizes[0.0, 2.0] == 1 and sizes[8.0, 16.0] == 4
    near = [replace(s, apart=(1.0, 9.0)[s.first]) for s in everything()]
    apart = [(first.count, first.total, held.count) for *_, first, held in summarise(near).by_apart]
    # One alone is named first, one listed, one neither; pairs and what is small don't count.
    assert apart == [(0, 2, 1), (0, 0, 0), (0, 0, 0), (1, 1, 1), (0, 0, 0)]


@pytest.mark.parametrize(
    ("sizes", "right"),
    [((9.0, 9.0), {"ab"}), ((9.0, 1.0), {"ab", "a"}), ((1.0, 9.0), {"ab", "b"}), ((1.0, 1.0), {"ab", "a", "b"})],
)
def test_of_two_effects_those_are_asked_for_that_show_beside_the_other(sizes, right):
    for called in ("a", "b", "ab", "ac", "c"):
        parts = tuple(zip("ab", sizes, strict=True))
        one = scored(0, ["a", "b"], tuple(called), kind="pair", parts=parts)
        found, right_now = summarise([one]), called in right
        whole, shows = found.named[2:4]
        assert shows.first.count == shows.in_set.count == shows.in_said.count == right_now
        assert whole.first.count == whole.in_set.count == whole.in_said.count == (called == "ab")
        assert one.first_shows == one.in_said == right_now
        assert found.reliability_shows[-1].right.count == right_now
        assert found.reliability[-1].right.count == (called == "ab")


def test_two_effects_that_do_not_show_together_are_asked_for_whole():
    parts = (("a", 1.0), ("b", 1.0))
    one = scored(0, ["a", "b"], ("a",), kind="pair", size=2.0, parts=parts)
    assert not one.first_shows and not one.in_said


def test_the_reports_set_is_what_it_says_until_ninety_percent():
    said = tuple(Explained(names, False, p) for names, p in ((("b",), 0.6), (("a",), 0.31), ((), 0.09)))
    every = tuple(Explained((*names, k), False, 0.12) for names in (("a",), ("b",)) for k in "cdef")
    found = summarise([scored(0, ["a"], ("b",), ("a",), said=said, explanations=every)])
    assert (found.median_set, found.median_said) == (8, 2)
    alone = found.named[0]
    assert (alone.in_set.count, alone.in_said.count, alone.first.count) == (0, 1, 0)


def test_reliability_sets_probabilities_beside_what_is_right():
    one, other = reliability(everything()[:6])[2:]
    assert (one.right.count, one.right.total) == (0, 1)
    assert one.stated == pytest.approx(0.7)
    # Two names are right, and that nothing shows is of the null and the effect too small to see.
    assert (other.right.count, other.right.total) == (4, 5)


def test_priors_are_exchanged_for_the_studys_shares():
    assumed = [Explained((), False, PRIOR_NONE), Explained(("a",), False, PRIOR_SINGLE), Explained(("b",), False, 0)]
    shares, first = at_base_rates(assumed)
    # Of 0.15 cases without effect and 0.58 single ones, and a third of 0.15 that have a name.
    np.testing.assert_allclose(shares, [0.15 / 0.78, 0.63 / 0.78, 0])
    assert first == 1


def test_that_nothing_shows_is_right_of_what_is_too_small_to_see():
    small = scored(0, ["a"], size=1.0, nothing_shows=0.95)
    large = scored(1, ["a"], size=9.0, nothing_shows=0.9)
    found = summarise([small, large]).nothing_shows[-1]
    assert (found.right.count, found.right.total) == (1, 2)
    assert found.stated == pytest.approx(0.925)


def test_stiffness_is_counted_by_leg():
    cases = [scored(k, ["a"], ("a",), covered=k > 0, bias_after=0.1 * k) for k in range(4)]
    cases = [replace(s, case=replace(s.case, leg=k // 2)) for k, s in enumerate(cases)]
    (one, first, error), (other, second, _) = summarise(cases).by_leg
    assert (one, first.count, first.total) == (0, 1, 2)
    assert (other, second.count, second.total) == (1, 2, 2)
    assert error == pytest.approx(0.05)


def test_outside_the_library_only_unexplained_is_right():
    unknown = (Explained((), True, 0.9),)
    unexplained = scored(0, [], kind="outside", verdict="unexplained", explanations=unknown)
    ambiguous = scored(1, [], ("a",), ("b",), kind="outside")
    summary = summarise([unexplained, ambiguous, scored(2, ["a"], ("a",))])
    assert (summary.outside.count, summary.outside.total) == (1, 2)
    assert unexplained.in_set and not ambiguous.in_set


def test_pages_and_figure_show_every_case():
    cases = everything()[1:5] + everything()[7:]
    named = [
        replace(
            s,
            case=replace(
                s.case,
                effects=tuple(({"a": "force-drift", "b": "contact-slip"}[name], v) for name, v in s.case.effects),
            ),
        )
        for s in cases
    ]
    summary = summarise(named)
    assert "| force-drift | a load cell that warms up" in page(named, summary)
    pair = [s for s in named if s.parts]
    pair = [replace(s, parts=(("contact-slip", 1.5), ("force-drift", 7.0))) for s in pair]
    assert "| force-drift + contact-slip | 5.0%, 9.0 (7.0, 1.5) |" in cases_page(pair)
    assert "| ambiguous: b or a | ambiguous: a or b | +20.0%, +5.0% | yes |" in cases_page(named)
    assert len(figure(named, summary).axes) == 2
    assert json.loads(json.dumps(scored_document(named, summary)))["origin"] == "simulated"
