"""Pages are in plain English: a list of words and turns that may not appear in what users read."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import making_pages as pages
import pytest
from making_diagnosed import diagnosed
from test_diagnosis_report import CASES

from legfem.inverse.catalogue import parameter_of
from legfem.inverse.plan import Design, DesignValue
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.kinds import page_of
from legfem.report.page import WebPage
from legfem.report.render import plain_page

ROOT = Path(__file__).resolve().parents[1]
_EXPONENT, _KEY = r"\d\.\d+e\+\d+", r"(deep|superficial|fascia|muscle|fat)\.[CD][12]0?"
UNWANTED = {
    r"reckon\w*": "calculate",
    r"mend(s|ed|ing)?": "fix",
    r"(not|\w+n't|cannot) be told": "cannot be determined",
    r"(not|\w+n't|cannot) tell": "cannot determine",
    r"told (from|apart)": "distinguished",
    r"holds? the true": "contains the true value",
    r"hold (true|19|90)": "contain",
    r"holds? (no|one|another|bytes|units|strain|recordings|\d+|the pain)\b": "contain",
    r"is no (such )?(number|text|unit|name|plain|path|pattern|parameter|value|list|leg|whole)": "is not a",
    r"is of no use": "has no effect",
    r"times smaller": "smaller by a factor",
    r"nothing speaks against": "the model fits",
    r"ask(s|ed)? for (its|a|no) further": "needs",
    r"beforehand": "before the test",
    r"in vain": "without success",
    r"unseen": "without a sign, not detected",
    r"likely causes, listed": "the cause's name, or at least two causes",
    r"can't be said": "the recordings do not show",
    r"leaves as it is": "does not reduce",
    r"of what was open": "of the range that was searched",
    r"known within [1-9]\d\d+ %": "cannot be determined",
    r"1 recordings": "1 recording",
    r"python -m legfem": "legfem",
    r"isn't stated of the test": "that the folder leaves open",
    r"(loses|keeps) or (loses|keeps) more volume": "more (or less) compressible than assumed",
    r"sd from (its|their) prior": "moved by",
    _EXPONENT: "a number with its digits",
    _KEY: "C10 of the muscle",
}
"""What may not be in a page, and what to say in its place."""
ALLOWED = {r"likely causes, listed": r"one of ([2-9]|\d\d+) less likely causes, listed"}


def said(page: WebPage) -> Iterator[tuple[str, str]]:
    """Unwanted turns in a page, each with its surroundings."""
    text = " ".join(plain_page(page, []).split())
    own = text.replace(page.repeat.command, "") if page.repeat.command else text
    for turn, instead in UNWANTED.items():
        for found in re.finditer(rf"\b{turn}", own, re.IGNORECASE):
            around = own[max(found.start() - 40, 0) : found.end() + 40]
            if not (turn in ALLOWED and re.search(ALLOWED[turn], around)):
                yield f"...{around}...", instead


@pytest.mark.parametrize("kind", ["identification", "identification-3d", "plan", "specimen"])
def test_pages_are_in_plain_english(kind, tmp_path: Path):
    assert list(said(pages.PAGES[kind](tmp_path))) == []


@pytest.mark.parametrize("verdict", CASES)
def test_pages_of_a_diagnosis_are_in_plain_english(verdict, tmp_path: Path):
    effects, bump, asked = CASES[verdict]
    found = diagnosed(effects, bump=bump, asked=asked)
    plan = [DesignValue(Design("press to 25 mm", ()), {}, 0.7)]
    for lines in ((), plan):
        page = diagnosis_web_page(found, pages.subject_in(tmp_path), lines)
        assert list(said(page)) == []
        # What to report and what to use are one thing.
        use = dict(page.headline.answers)["What to do"]
        assert not (page.headline.sentence.startswith("Report a range") and "Use the corrected number" in use)


def test_the_first_line_of_an_identification_is_the_number_that_was_asked_for(tmp_path: Path):
    page = pages.identified(tmp_path)
    sentence = (
        r"Muscle stiffness C10 = [\d.]+ kPa \([\d.]+ to [\d.]+\), shear modulus G = [\d.]+ kPa, Young's modulus E = "
    )
    assert re.match(sentence, page.headline.sentence)


def test_a_specimen_of_layers_has_each_stiffness_first_and_one_recording_is_no_several(tmp_path: Path):
    (fit,) = pages.specimens(tmp_path)
    (found,) = fit.estimates.values()
    one = replace(fit.tests[0], fitted=False), *(replace(test, fitted=True) for test in fit.tests[-1:])
    layered = replace(fit, estimates={"muscle.C10": replace(found, parameter=MUSCLE)}, tests=one)
    page = page_of([layered])
    assert page.headline.sentence.startswith(
        "Muscle stiffness C10 = 5.00 kPa (4.80 to 5.20), shear modulus G = 10.0 kPa"
    )
    assert "C10 is known" not in page.headline.sentence and "C10 of the muscle is known" in plain_page(page, [])
    assert "1 recording was fitted from first contact" in " ".join(plain_page(page, []).split())
    assert list(said(page)) == []


def test_an_interval_that_is_all_that_was_searched_is_called_not_determined(tmp_path: Path):
    """As of a law's parameters that trade against each other: its ends say where the search ended."""
    (fit,) = pages.specimens(tmp_path)
    (found,) = fit.estimates.values()
    open_ = replace(found, ci95=found.parameter.bounds, identifiability="not identifiable")
    text = plain_page(page_of([replace(fit, estimates={"deep.C10": open_})]), [])
    text = " ".join(text.split())
    assert "Tissue stiffness C10 is not determined." in text and "These recordings do not determine C10" in text
    assert f" to {1e3 * found.parameter.bounds[1]:g}" not in text


def test_an_interval_of_no_width_at_a_bound_is_no_precise_number(tmp_path: Path):
    (fit,) = pages.specimens(tmp_path)
    (found,) = fit.estimates.values()
    bound = found.parameter.bounds[0]
    stuck = replace(found, value=bound, ci95=(bound, bound), identifiability="not identifiable")
    sure = dict(page_of([replace(fit, estimates={"deep.C10": stuck})]).headline.answers)["How sure"]
    assert "at most 0.020 kPa, where its search ended" in sure and "± 0 %" not in sure
    assert page_of([replace(fit, estimates={"deep.C10": stuck})]).headline.sentence.startswith(
        "Tissue stiffness C10 is at most 0.020 kPa."
    )


MUSCLE = parameter_of("muscle.C10", {"muscle.C10": 5e-3})


TOLD = {
    turn: instead
    for turn, instead in UNWANTED.items()
    if turn not in ("beforehand", "unseen", r"likely causes, listed", r"python -m legfem", _EXPONENT, _KEY)
}
"""What no text of the package may have; pages are read as a whole above."""


def texts_of(path: Path) -> Iterator[tuple[int, str]]:
    """Strings of a module that aren't its documentation; lines of a table of texts."""
    if path.suffix == ".toml":
        yield from enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        return
    tree = ast.parse(path.read_text(encoding="utf-8"))
    told = {id(one.value) for one in ast.walk(tree) if isinstance(one, ast.Expr)}
    for one in ast.walk(tree):
        if isinstance(one, ast.Constant) and isinstance(one.value, str) and id(one) not in told and " " in one.value:
            yield one.lineno, one.value


def test_what_the_package_says_is_in_plain_english():
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {turn}: say {instead}"
        for path in sorted([*(ROOT / "legfem").rglob("*.py"), *(ROOT / "legfem/resources").rglob("*.toml")])
        for line, text in texts_of(path)
        for turn, instead in TOLD.items()
        if re.search(rf"\b{turn}", text, re.IGNORECASE)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "page", [*ROOT.glob("docs/*.md"), *ROOT.glob("docs/tutorials/*.md"), ROOT / "README.md"], ids=str
)
def test_documents_for_users_are_in_plain_english(page: Path):
    text = " ".join(page.read_text(encoding="utf-8").split())
    if page.name == "old-and-new-names.md":
        return
    wrong = [f"{turn}: say {instead}" for turn, instead in TOLD.items() if re.search(rf"\b{turn}", text, re.IGNORECASE)]
    assert not wrong
