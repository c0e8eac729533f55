"""The study of sealed cases: what is concealed on a leg, and what its tables count."""

from __future__ import annotations

import numpy as np
import pytest

from studies.cases.sealed import Said
from studies.cases.sealed_draw import PROGRAMMES, SUBSETS, Laid, channel_cases, subsets_of
from studies.cases.sealed_page import names_f1, page


def said(case: int, truth: list[str], first: list[str], subset: str = "all", **others) -> Said:
    given = {
        "kind": ("none", "single", "pair")[len(truth)],
        "concealed": "+".join(truth) or "nothing",
        "verdict": "named" if first else "consistent",
        "listed": [first] if first else [],
        "probability": 0.9,
        "stated": first,
        "unknown": False,
        "may_hide": [],
        "answer": "Yes.",
        "c10": 0.8,
        "interval": (0.6, 1.0),
        "true_c10": 0.8,
        "seconds": 1.0,
        **others,
    }
    return Said(case=case, truth=truth, subset=subset, **given)


def test_names_count_by_what_is_there_and_by_what_is_said() -> None:
    """One of two of a pair, a wrong name for a single, a null without one: 2 * 1 / (1 + 2 + 1 + 1)."""
    cases = [said(0, ["a", "b"], ["a"]), said(1, ["a"], ["c"]), said(2, [], [])]
    assert names_f1(cases) == pytest.approx(0.4)
    assert names_f1([said(0, ["a", "b"], ["b", "a"])]) == 1.0
    assert names_f1([said(0, [], ["a"])]) == 0.0
    assert names_f1([said(0, [], [])]) == 1.0


def test_a_statement_is_right_where_all_that_it_names_is_there() -> None:
    """One of two is right, a name for another isn't, nothing said of an effect doesn't count, doubt doesn't either."""
    assert said(0, ["a", "b"], ["a"]).sure is True and not said(0, ["a", "b"], ["a"]).right
    assert said(0, ["a"], ["c"]).sure is False and said(0, ["a"], ["c"]).wrong
    assert said(0, ["a"], []).sure is None and said(0, [], []).sure is True
    assert said(0, ["a"], ["c"], probability=0.7).sure is None
    drained = said(0, ["a"], [], kind="outside", verdict="unexplained", unknown=True)
    assert drained.sure is True and drained.told and not drained.right
    assert said(0, ["a"], [], may_hide=["a"]).told and not said(0, ["a"], [], may_hide=["b"]).told


def test_yes_beside_a_number_that_is_off() -> None:
    assert said(0, ["a"], [], true_c10=0.65).wrong_yes and not said(0, ["a"], [], true_c10=0.65, answer="No").wrong_yes
    assert not said(0, ["a"], []).wrong_yes


def test_the_page_has_a_row_for_each_kind_and_each_case() -> None:
    found = [
        said(k, ["a"], ["a"] if k else ["b"], subset, interval=(0.6, 1.0) if k < 2 else (0.9, 1.0))
        for k in range(3)
        for subset in SUBSETS
    ]
    lines = page(found).splitlines()
    (single,) = (line for line in lines if line.startswith("| all | single "))
    cells = [cell.strip() for cell in single.split("|")]
    assert cells[3:6] == ["3", "2/3", "2/3"] and cells[9] == "2/3" and cells[11] == "2/3"
    (wrong,) = (line for line in lines if line.startswith("| all | wrong name "))
    assert wrong.split("|")[3].strip() == "1"
    assert "**a**" in next(line for line in lines if line.startswith("| 1 "))
    assert "**outside**" in next(line for line in lines if line.startswith("| 2 "))


def test_cases_of_one_leg_share_two_stiffnesses_and_all_kinds() -> None:
    cases = channel_cases(3, 5)
    assert [case.number for case in cases] == list(range(len(cases)))
    for leg in range(3):
        own = [case for case in cases if case.leg == leg]
        assert len({case.c10_kpa for case in own}) == 2
        assert {case.kind for case in own} == {"none", "single", "pair", "outside"}
    outside = [case.kind == "outside" for case in cases]
    assert np.mean(outside) == pytest.approx(1 / 3)
    assert np.mean([case.code == "felupe" for case in cases]) > 1 / 3
    for case in cases:
        assert {"force alone", "all"} <= set(subsets_of(case)) <= set(SUBSETS)
    assert {programme for programme, _ in SUBSETS.values()} == set(PROGRAMMES)


def test_an_image_that_is_turned_shows_displacements_turned_back() -> None:
    laid = Laid(np.array([1.0, -2.0]), np.deg2rad(90.0), np.array([5.0, 5.0]))
    np.testing.assert_allclose(laid.truly(np.array([[7.0, 5.0]])), [[6.0, 5.0]])
    np.testing.assert_allclose(laid.seen(np.array([[0.0, 3.0]])), [[3.0, 0.0]], atol=1e-12)
