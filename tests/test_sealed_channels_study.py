"""The study of sealed recordings with channels: what its tables count."""

from __future__ import annotations

import pytest

from studies.sealed_channels.__main__ import names_f1, table
from studies.sealed_channels.cases import SUBSETS
from studies.sealed_channels.diagnosing import Said


def said(case: int, truth: list[str], first: list[str], subset: str = "all", holds: bool = True) -> Said:
    kind = ("none", "single", "pair")[len(truth)]
    verdict = "named" if first else "consistent"
    c10 = (0.6, 1.0) if holds else (0.9, 1.0)
    return Said(case, kind, subset, truth, verdict, first, [first], 0.9, c10, 0.8, 1.0)


def test_names_count_by_what_is_there_and_by_what_is_said() -> None:
    """One of two of a pair, a wrong name for a single, a null without one: 2 * 1 / (1 + 2 + 1 + 1)."""
    cases = [said(0, ["a", "b"], ["a"]), said(1, ["a"], ["c"]), said(2, [], [])]
    assert names_f1(cases) == pytest.approx(0.4)
    assert names_f1([said(0, ["a", "b"], ["b", "a"])]) == 1.0
    assert names_f1([said(0, [], ["a"])]) == 0.0
    assert names_f1([said(0, [], [])]) == 1.0


def test_the_table_has_a_row_for_each_subset_and_each_case() -> None:
    """Counts of what is right; what is right is bold."""
    found = [said(k, ["a"], ["a"] if k else ["b"], subset, k < 2) for k in range(3) for subset in SUBSETS]
    lines = table(found).splitlines()
    (every,) = (line for line in lines if line.startswith("| all "))
    cells = [cell.strip() for cell in every.split("|")]
    assert cells[2].startswith("2/3") and cells[7] == "0.67" and cells[8].startswith("2/3")
    assert sum(line.startswith(("| 0 ", "| 1 ", "| 2 ")) for line in lines) == 3
    assert "**a**" in next(line for line in lines if line.startswith("| 1 "))
    assert "**" not in next(line for line in lines if line.startswith("| 0 "))
