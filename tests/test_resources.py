"""Tables of values that come with legfem know all that the code asks them for."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from string import Formatter
from typing import get_args

import pytest

import legfem
from legfem.common.resources import resource
from legfem.data.formats import labels
from legfem.data.quality import GRADES
from legfem.data.ranges import RANGES
from legfem.inverse.answer import Tone
from legfem.inverse.catalogue import LawName
from legfem.inverse.comparison import ErrorSource, Weighting
from legfem.inverse.readings import RELAXATION
from legfem.mechanisms import OCCURRENCES, mechanisms
from legfem.report import page
from legfem.report.words import LAW_NAMES, ORIGINS, WORDS
from legfem.stockings.levels import LEVELS


@pytest.mark.parametrize("name", RANGES)
def test_what_is_usual_is_possible(name):
    one = RANGES[name]
    assert one.possible[0] <= one.usual[0] < one.usual[1] <= one.possible[1]
    assert one.published is None or (one.usual[0] <= one.published[0] < one.published[1] <= one.usual[1])
    assert all(factor > 0 and factor != 1 for factor in one.units.values())


def test_every_unit_measures_a_quantity_that_columns_have():
    assert {one.quantity for one in map(labels.unit_named, labels.UNIT_OF.values()) if one} == set(labels.UNIT_OF)
    assert {one.quantity for one in labels._KNOWN.values()} == {*labels.UNIT_OF, None}
    assert set(labels.WORDS) < set(labels.UNIT_OF)


def test_what_may_occur_is_a_mechanism_within_its_bounds():
    first = {one.name: one.parameters[0] for one in mechanisms()}
    for name, one in OCCURRENCES.items():
        low, high = first[name].bounds
        assert low <= one.low < one.high <= high, name


def test_every_value_that_a_page_words_has_words():
    assert set(LAW_NAMES) == set(WORDS["energies"]) == set(get_args(LawName))
    assert set(page.TONES) == set(get_args(Tone))
    assert set(page.PROVENANCE) == set(get_args(page.Provenance))
    assert set(WORDS["sources_of_error"]) == set(get_args(ErrorSource)) - {"recordings", "ends"}
    assert set(WORDS["weightings"]) == set(get_args(Weighting))
    assert {name.rpartition(".")[2] for name in RELAXATION} == set(WORDS["relaxation"])
    assert set(WORDS["levels"]) == set(LEVELS)
    assert set(WORDS["grades"]) == set(GRADES)
    assert set(WORDS["judged"]) == {*get_args(Tone), ""}
    assert set(ORIGINS) == {"measured", "reconstructed", "simulated"}


def test_every_paragraph_that_a_page_says_is_there_and_none_is_left_over():
    texts = [path.read_text(encoding="utf-8") for path in Path(legfem.__file__).parent.rglob("*.py")]
    said = {key for text in texts for key in re.findall(r"""(?:TOLD|WORDS\["told"\])\[["'](\w+)["']\]""", text)}
    assert said == {*WORDS["told"], *resource("app/words", dict[str, dict[str, str]])["told"]}


def _named_in(function: ast.AST, call: ast.Call) -> set[str]:
    """Return the names that a call of format gives, with the keys of what it unpacks."""
    given = {one.arg for one in call.keywords if one.arg}
    if any(one.arg is None for one in call.keywords):
        tables = [one for one in ast.walk(function) if isinstance(one, ast.Dict)]
        given |= {key.value for table in tables for key in table.keys if isinstance(key, ast.Constant)}
        given |= set("xyz")
    return given


def test_every_paragraph_gets_the_values_that_it_names():
    checked = 0
    for path in sorted(Path(legfem.__file__).parent.rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text())):
            for call in ast.walk(function) if isinstance(function, ast.FunctionDef) else ():
                match call:
                    case ast.Call(ast.Attribute(ast.Subscript(ast.Name("TOLD"), ast.Constant(str(key))), "format")):
                        fields = {name for _, name, _, _ in Formatter().parse(WORDS["told"][key]) if name}
                        names = {re.split(r"[.\[]", name)[0] for name in fields}
                        given = _named_in(function, call)
                        assert names <= given, (key, names - given)
                        assert {one.arg for one in call.keywords if one.arg} <= names, key
                        checked += 1
    assert checked > 40
