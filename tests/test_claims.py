"""Pages don't contradict themselves: claims are checked before they are written, and drawn ones are read."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import making_drawn as drawn
import making_pages as pages
import numpy as np
import pytest
import typer
from making_diagnosed import diagnosed
from making_results import result
from test_diagnosis_report import CASES

from legfem.api.results import Identification
from legfem.common.command_line import FAULT, command_context
from legfem.common.errors import ContradictionError, Doubt
from legfem.data import Instrument
from legfem.inverse.answer import Finding, FitNotice, doubted
from legfem.inverse.claims import check_diagnosis, check_fits
from legfem.inverse.fit import Goodness
from legfem.inverse.verdict import answer_of
from legfem.report.diagnosis_headline import headline
from legfem.report.diagnosis_numbers import evidence_table
from legfem.report.diagnosis_sentences import hidden_sentence
from legfem.report.estimates import high_or_low
from legfem.report.kinds import page_of
from legfem.report.page import WebPage
from legfem.report.render import plain_page
from legfem.specimens.details import compared, notices_about
from legfem.specimens.model_discrepancy import ApartTest, TestsAgreement

_NUMBER = r"(?<![\d.])[-+]?\d[\d,]*(?:\.\d+)?"
_C10 = re.compile(rf"C10 = ({_NUMBER}) kPa \(({_NUMBER}) to ({_NUMBER})\)")
_VALUE = re.compile(rf"({_NUMBER})(?: (?!members)[A-Za-z/%²]+)? \((?:95 % )?({_NUMBER}) to ({_NUMBER})\)")
_RANGE = re.compile(rf"C10 between ({_NUMBER}) and ({_NUMBER}) kPa")
_THEN = re.compile(rf"C10 would then be ({_NUMBER}) kPa(, beyond the range)?")
_CORRECTED = re.compile(rf"Corrected it is ({_NUMBER})(?: to ({_NUMBER}))? kPa")
_WRONG = ("does not fit", "do not agree", "disagree", "does not describe", "DO NOT RELY", "misses the")


def _float(text: str) -> float:
    return float(text.replace(",", ""))


def _half_digit(text: str) -> float:
    """Return by how much a written number may differ from the number."""
    return 0.5 * 10.0 ** -len(text.partition(".")[2])


def _outside(value: str, low: str, high: str) -> bool:
    slack = max(map(_half_digit, (value, low, high)))
    return not _float(low) - slack <= _float(value) <= _float(high) + slack


def values_outside(text: str, page: WebPage) -> Iterator[str]:
    """Yield values that lie outside of the interval beside them."""
    for found in _VALUE.finditer(text):
        if _outside(*found.groups()):
            yield found.group()


def c10_outside(text: str, page: WebPage) -> Iterator[str]:
    """Yield values of C10 that the range on the first lines doesn't hold, and isn't said not to."""
    first = page.headline.said
    ends = _RANGE.search(first) or _C10.search(first)
    if ends is None:
        return
    low, high = ends.groups()[-2:]
    for found in _THEN.finditer(text):
        if (_outside(found.group(1), low, high)) is not bool(found.group(2)):
            yield found.group()
    for found in _CORRECTED.finditer(text):
        for value in filter(None, found.groups()):
            if _outside(value, low, high):
                yield found.group()


def sound_and_not(text: str, page: WebPage) -> Iterator[str]:
    """Yield what is wrong on a page that says that nothing is."""
    problems = dict(page.headline.answers).get("Problems found", "")
    if page.headline.tone == "sound":
        said = " ".join([page.headline.said, *(answer for _, answer in page.headline.answers)])
        yield from (one for one in ("Check the doubtful", "cannot be determined", "disagree") if one in said)
    if re.search(r"(^|: )none( |\.)", problems, re.IGNORECASE) and page.headline.tone != "wrong":
        yield from (one for one in _WRONG if one in page.headline.said)
    if page.headline.tone == "wrong":
        yield from (one for one in ("The model fits", " law describes") if one in page.headline.said)


def no_number_and_one(text: str, page: WebPage) -> Iterator[str]:
    """Yield a number of C10 where the page says that there is none, or that it is to be used."""
    first, to_do = page.headline.said, dict(page.headline.answers).get("What to do", "")
    none = re.search(r"C10 is not determined|Report no number|cannot determine C10|stiffness C10 is at", first)
    if none and (found := _C10.search(first) or re.search("Use (C10|the (number|corrected|range))", to_do)):
        yield found.group()


def precision(text: str, page: WebPage) -> Iterator[str]:
    """Yield numbers with a precision, or of a size, that nobody has."""
    own = " ".join([page.headline.said, *(answer for _, answer in page.headline.answers), *page.warnings])
    yield from re.findall(r"\S*\de[-+]?\d+\S*", own)
    yield from (found for found in re.findall(r"(?:±|by|within) (\d{3,}(?:\.\d+)? %)", own) if found != "100 %")
    yield from re.findall(r"\d+\.\d{4,} %", text)
    for value, low, high in _VALUE.findall(own):
        if _float(low) > 0 and _float(high) > 10.5 * _float(low):
            yield f"{value} ({low} to {high})"
    yield from re.findall(r"p [<=] 0\.0000\d+", text)


def chances(text: str, page: WebPage) -> Iterator[str]:
    """Yield bars of chances that add up to more than one."""
    for chapter in page.chapters:
        for block in chapter.blocks:
            if block.kind == "bars" and block.header[1] == "probability" and sum(b.value for b in block.bars) > 100.1:
                yield block.caption


def done_already(text: str, page: WebPage) -> Iterator[str]:
    """Yield advice that the recordings followed: the drawn ones at two rates held for a minute, others reach 26 mm."""
    to_do = dict(page.headline.answers).get("What to do", "")
    if "rate2_1" in text:
        yield from (one for one in ("for a minute", "at two rates") if one in to_do)
    if "26 mm" in text and "greatest displacement used" in text:
        yield from (one for one in ("press deeper",) if one in to_do)


READ: tuple[Callable[[str, WebPage], Iterator[str]], ...] = (
    values_outside,
    c10_outside,
    sound_and_not,
    no_number_and_one,
    precision,
    chances,
    done_already,
)


def contradictions(page: WebPage) -> list[str]:
    text = " ".join(plain_page(page, []).split())
    return [f"{read.__name__}: {found}" for read in READ for found in read(text, page)]


@pytest.mark.parametrize("kind", drawn.KINDS)
def test_no_page_of_three_hundred_drawn_results_contradicts_itself(kind):
    """A result whose numbers contradict each other gives no page; one that gives a page says one thing."""
    count, made = drawn.KINDS[kind]
    wrong: dict[int, list[str]] = {}
    written = 0
    for seed in range(count):
        try:
            page = made(np.random.default_rng([seed, len(kind)]))
        except ContradictionError:
            continue
        written += 1
        if found := contradictions(page):
            wrong[seed] = found
    assert not wrong
    assert written > 0.9 * count, "sound results give pages"


def broken(seed: int = 3):
    """Return a result whose value lies outside of its interval."""
    fit = result("neo-hookean")
    (name, found), *_ = fit.estimates.items()
    return replace(fit, estimates={name: replace(found, ci95=(1.1 * found.value, 1.3 * found.value))})


def test_a_result_that_contradicts_itself_ends_the_run_with_a_fault_and_nothing_is_written(tmp_path: Path, capsys):
    out = tmp_path / "out"
    found = Identification(drawn._subject(), (broken(),))
    with pytest.raises(typer.Exit) as ended, command_context():
        found.write(out)
    assert ended.value.exit_code == FAULT == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("a fault of legfem, please report it: ") and "a value lies inside its interval" in line
    assert not list(out.glob("result*")) and not list(out.glob("report*"))
    with pytest.raises(ContradictionError):
        page_of([broken()])


CHANGES: Mapping[str, tuple[str, Callable]] = {
    "range": ("a range holds its value", lambda answer: replace(answer, values=_shifted(answer.values))),
    "tone": ("what does not fit is called so", lambda answer: replace(answer, finding=Finding.MISFIT)),
    "chances": ("as probable as all", lambda answer: replace(answer, causes=(*answer.causes, *answer.causes))),
}


def _shifted(values):
    return {name: replace(one, value=2 * one.ci95[1]) for name, one in values.items()}


@pytest.mark.parametrize("changed", CHANGES)
def test_claims_of_a_diagnosis_fail_where_its_answer_is_changed(changed):
    effects, bump, asked = CASES["named"]
    found = diagnosed(effects, bump=bump, asked=asked)
    answer = answer_of(found)
    check_diagnosis(found, answer)
    said, change = CHANGES[changed]
    with pytest.raises(ContradictionError, match=said):
        check_diagnosis(found, change(answer))


def test_a_cause_that_was_not_tested_is_not_named():
    effects, bump, asked = CASES["named"]
    found = diagnosed(effects, bump=bump, asked=asked)
    untested = {**found.untested, "fascia-stiffness": "a reason"}
    with pytest.raises(ContradictionError, match="that is named was tested"):
        check_diagnosis(replace(found, untested=untested), answer_of(found))


def test_a_grade_is_that_of_its_interval_and_a_fit_that_of_its_chance(tmp_path: Path):
    fit = result("neo-hookean", goodness=Goodness(30.0, 28, 0.3))
    check_fits([fit])
    (name, found), *_ = fit.estimates.items()
    wide = replace(found, ci95=(0.5 * found.value, 1.5 * found.value))
    with pytest.raises(ContradictionError, match="called identifiable"):
        check_fits([replace(fit, estimates={name: wide})])
    outside = replace(
        found, ci95=(0.99 * found.value, 2 * found.parameter.bounds[1]), identifiability="not identifiable"
    )
    with pytest.raises(ContradictionError, match="inside what was searched"):
        check_fits([replace(fit, estimates={name: outside})])
    assert all(contradictions(page_of([one])) == [] for one in pages.specimens(tmp_path))


def test_an_accuracy_by_which_any_law_would_fit_is_doubted(tmp_path: Path):
    """A lab.toml of another rig beside a specimen whose greatest force is a few newtons."""
    (fit,) = pages.specimens(tmp_path)
    peak = min(one.course.peak for one in compared(fit))
    for size, said in ((0.002, False), (0.2, True)):
        folder = replace(fit.details.folder, instrument=Instrument(size * peak, 0.01))
        told = notices_about(replace(fit, details=replace(fit.details, folder=folder)), (), ())
        fields = [one.parameters["field"] for one in told if one.code == FitNotice.DOUBTFUL]
        assert fields == ["instrument.force_sd_N"] * said


def test_tests_whose_forces_differ_from_the_others_are_not_fine(tmp_path: Path):
    """One set of constants is as good as sure, and yet two of three tests' factors exclude one."""
    (fit,) = pages.specimens(tmp_path)
    factors = (("a", 1.0), ("b", 1.10), ("c", 0.95))
    apart = TestsAgreement(0.8, tuple(ApartTest(n, 0.0, by, (by - 0.04, by + 0.04)) for n, by in factors))
    made = replace(fit, details=replace(fit.details, left_out=(), agreement=apart), notices=())
    assert not apart.disagree and apart.differ
    headline = page_of([made]).headline
    problems = dict(headline.answers)["Problems found"]
    assert headline.tone == "caution" and "b 1.10 (1.06 to 1.14) times" in problems and "leave open" in problems
    alike = TestsAgreement(0.8, tuple(ApartTest(name, 0.0, 1.0, (0.96, 1.04)) for name, _ in factors))
    same = page_of([replace(made, details=replace(made.details, agreement=alike))]).headline
    assert same.tone == "sound" and dict(same.answers)["Problems found"].startswith("None")


def test_a_stiffness_that_few_people_have_is_not_just_within_what_was_published():
    doubt = doubted([Doubt("subject.toml", "c10_deep", "17.1 kPa is stiffer than in 99 of 100 people", "check units")])
    ((_, answer),) = high_or_low("deep", 4.0, None, doubt)
    assert answer.startswith("Within what was published") and "Few people have it so, as a warning says." in answer
    assert "Few people" not in high_or_low("deep", 4.0)[0][1]


def test_what_hides_beyond_the_range_is_said_to():
    effects, bump, _ = CASES["consistent"]
    found = diagnosed(effects, bump=bump, asked=("preconditioning", "force-drift"))
    low, high = found.intervals["deep.C10"]
    beyond = {end.c10: not low <= end.c10 <= high for _, end in found.hidden}
    assert any(beyond.values()), "a first trial that is softer by an improbable course hides"
    for limit, end in found.hidden:
        assert hidden_sentence(found, limit, end).endswith("rarer than 1 in 20.") is beyond[end.c10]


def test_how_sure_a_cause_is_holds_if_something_was_left_out():
    effects, bump, asked = CASES["named"]
    found = diagnosed(effects, bump=bump, asked=asked)
    sure = dict(headline(found, ()).answers)["How sure"]
    assert sure.startswith("Over 99 % sure that the computer model left something out, and if so over 99 % sure of")
    rows = [row for row in evidence_table(found).rows]
    assert sum(float(re.findall(r"\d+", row[1])[0]) for row in rows if "below" not in row[1]) <= 101.0
