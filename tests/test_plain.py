"""A run's page as plain text: it says all that the page for a browser says."""

from __future__ import annotations

from pathlib import Path

import pytest

from legfem.report.folder import RESULT, ReportFile
from legfem.report.page import (
    PROVENANCE,
    Bars,
    Bullets,
    Chapter,
    Headline,
    Known,
    LabelledBar,
    Prose,
    Repeat,
    Verbatim,
    WebPage,
    WebTable,
)
from legfem.report.render import brief, plain_page

LONG = "a sheet round the muscle, its fascia, holds it together"


@pytest.fixture
def page() -> WebPage:
    tables = [
        WebTable("Narrow", ["site", "rms"], [["calf", "0.1"], ["shin", "0.2"]]),
        WebTable("Wide", ["cause", "what", "more"], [["fascia", LONG, LONG], ["none", LONG, ""]]),
        Bars("Shares", ("part", "share"), [LabelledBar("half", 0.5, "50 %")]),
    ]
    return WebPage(
        title="How stiff is it?",
        subject="a leg",
        origin="simulated",
        headline=Headline("caution", "It is soft.", [("How sure", "Not at all.")]),
        warnings=["Take care."],
        known=[
            Known("C10", "1.0 kPa", "estimated", "2 recordings", "0.9 to 1.1", "identifiable"),
            Known("length", "50 mm", "assumed", "subject.toml"),
        ],
        chapters=[
            Chapter("What was tested", [Prose("All of it."), Bullets(["once", "twice"])]),
            Chapter("Numbers by site", [*tables, Verbatim("As printed", "  x = 1\n")]),
            Chapter("Nothing to read", []),
        ],
        repeat=Repeat("identify --subject 3", {"legfem": "1.2"}, {"seed": "7"}),
    )


def test_every_word_of_a_page_is_in_its_text(page):
    text = plain_page(page, [ReportFile([Path("fit.png")], "the fit"), RESULT])
    words = " ".join(text.split())
    for said in (
        "How stiff is it?",
        "a leg",
        "*** SIMULATED DATA ***",
        "READ WITH CAUTION. It is soft.",
        "How sure: Not at all.",
        "Take care.",
        "All of it.",
        "- once",
        "- twice",
        "50 %",
        "C10: 1.0 kPa (95 % 0.9 to 1.1); estimated, 2 recordings; identifiable",
        "length: 50 mm; assumed, subject.toml",
        PROVENANCE["assumed"],
        "x = 1",
        "identify --subject 3",
        "seed 7",
        "legfem 1.2",
        "fit.png the fit",
        "result.json",
    ):
        assert said in words, said
    assert "site  rms\ncalf  0.1\nshin  0.2" in text
    assert f"fascia: what: {LONG}; more: {LONG} - none: what: {LONG}" in words
    assert max(map(len, text.splitlines())) <= 100
    assert "Nothing to read" not in text
    assert PROVENANCE["measured"] not in words, "no word is explained that isn't used"


def test_a_terminal_is_told_the_verdict_what_was_found_and_the_tests(page):
    text = brief(page)
    for said in ("It is soft.", "Take care.", "C10: 1.0 kPa", "All of it."):
        assert said in text
    for left in ("length", "calf", "fit.png", "identify --subject"):
        assert left not in text
    assert "calf" in brief(page, ("Numbers by site",))
