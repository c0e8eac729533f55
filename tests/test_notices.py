"""Notices: every code has words, and every word a code."""

import ast
from enum import StrEnum
from itertools import chain
from pathlib import Path

from legfem.inverse.answer import FitNotice, Notice
from legfem.legs.notices import LegNotice
from legfem.report.answers import NOTICES, sentence_of
from legfem.specimens.details import SpecimenNotice
from legfem.stockings.details import StockingNotice

KINDS: tuple[type[StrEnum], ...] = (FitNotice, LegNotice, SpecimenNotice, StockingNotice)


def test_every_code_has_words_and_is_used():
    codes = [code.value for code in chain(*KINDS)]
    assert sorted(codes) == sorted(NOTICES)
    texts = [path.read_text() for path in Path("legfem").rglob("*.py")]
    used = {
        ".".join(ast.unparse(node).split(".")[-2:])
        for text in texts
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Attribute)
    }
    assert used >= {f"{kind.__name__}.{code.name}" for kind in KINDS for code in kind}


def test_clauses_stand_where_a_parameter_is_given():
    told = {"stopped": 2, "solves": 9, "reach": "20 mm", "C10": (1e-3, 2e-3), "reason": "step too small"}
    assert sentence_of(Notice.of(FitNotice.SOLVES_STOPPED, **told)) == (
        "2 of 9 full solves stopped short of 20 mm at C10 1, 2 kPa; the search kept away from them (step too small)."
    )
    bare = {**told, "reach": "", "C10": (), "reason": ""}
    assert sentence_of(Notice.of(FitNotice.SOLVES_STOPPED, **bare)) == (
        "2 of 9 full solves stopped short; the search kept away from them."
    )
    apart = (("deep.C10", "low", 3.21), ("deep.C20", "high", -4.0))
    said = sentence_of(Notice.of(LegNotice.SITES_DISAGREE, chi_square=30.0, degrees_of_freedom=2, farthest=apart))
    assert "c10_deep departs most at low, by +3.2 standard errors; c20_deep departs most at high, by -4.0" in said
