"""The answer of a result as a value: it comes back from its document, and is worded alike."""

import math
from pathlib import Path

import making_pages as pages
import pytest
from making_diagnosed import diagnosed
from test_diagnosis_report import CASES

from legfem.inverse.answer import Answer, Finding, Value
from legfem.inverse.verdict import answer_of
from legfem.report.answers import headline_of


def read_back(answer: Answer) -> Answer:
    return Answer.read(answer.document())


@pytest.mark.parametrize("verdict", CASES)
def test_the_answer_of_a_diagnosis_comes_back_from_its_document(verdict):
    effects, bump, asked = CASES[verdict]
    answer = answer_of(diagnosed(effects, bump=bump, asked=asked), doubts=1)
    assert read_back(answer) == answer
    assert headline_of(read_back(answer)).said == headline_of(answer).said


def test_the_answer_of_specimens_is_worded_alike_from_its_document(tmp_path: Path):
    (fit,) = pages.specimens(tmp_path)
    assert headline_of(read_back(fit.answer)).said == headline_of(fit.answer).said


def test_numbers_that_are_not_finite_come_back_as_unknown():
    known = Value((-math.inf, math.nan), "kPa", 1.0, math.nan)
    back = read_back(Answer("leg", Finding.FITS, "caution", {"deep.C10": known})).values["deep.C10"]
    assert back.ci95 is not None and all(map(math.isnan, (*back.ci95, back.standard_error))) and back.value == 1.0


def test_doubtful_input_leaves_no_answer_sound():
    assert Answer("leg", Finding.FITS, "sound", doubts=2).tone_with_doubts == "caution"
    assert Answer("leg", Finding.MISFIT, "wrong", doubts=2).tone_with_doubts == "wrong"
