"""Text that a page shows is never markup: in its elements, attributes, scripts, Markdown and tables."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from making_stocking import COARSEST, short_leg, write_shape

from legfem.common.progress import Silent
from legfem.inverse.elastography import ShearModulus
from legfem.report.curves import Curves, Line
from legfem.report.kinds import page_of
from legfem.report.page import (
    Bars,
    Bullets,
    Chapter,
    Headline,
    Known,
    LabelledBar,
    PressedSection,
    Prose,
    Repeat,
    ResponseSurface,
    Slider,
    StillSection,
    SurfaceFactor,
    SurfaceMetric,
    TurnedLeg,
    Verbatim,
    View,
    WebPage,
    WebTable,
)
from legfem.report.render import embed, markdown_page, rendered, write_tables
from legfem.report.words import DataKind
from legfem.stockings.details import StockingFit
from legfem.stockings.identification import assessed, identify_in_stocking
from legfem.stockings.loading import load_leg

PLANTED = (
    "<planted>x</planted>",
    '"><planted onload=1>',
    "</script><planted>",
    "<!--<script><planted>",
    "'-->]]><planted>\u2028\u2029",
    "</title></style></textarea><planted>",
)


class Elements(HTMLParser):
    """All elements that a page has, comments, and what its scripts contain."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: set[str] = set()
        self.comments: list[str] = []
        self.scripts: list[tuple[dict[str, str | None], list[str]]] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes |= {name for name, _ in attrs}
        if tag == "script":
            self.scripts.append((dict(attrs), []))

    def handle_data(self, data):
        if self.cdata_elem == "script":
            self.scripts[-1][1].append(data)

    def handle_comment(self, data):
        self.comments.append(data)


def page_saying(text: str) -> WebPage:
    """Every block there is, with a text in each of its fields."""
    x = np.linspace(0.0, 1.0, 5)
    surface = ResponseSurface(
        text, [SurfaceFactor(text, (text, text, text))] * 2, [SurfaceMetric(text, text, [((), 1.0)])], [text], [[text]]
    )
    blocks = [
        Prose(text),
        Bullets([text]),
        WebTable(text, [text, text], [[text, text]]),
        WebTable(text, [text], [[text]], folded=True),
        Verbatim(text, text),
        Bars(text, (text, text), [LabelledBar(text, 1.0, text, (0.5, 1.5))]),
        Curves("curves", text, text, x, text, text, [Line(text, x, x)], x, text, [(0.1, 0.2)], text, text),
        PressedSection(text, {text: [text]}, 1.0, [text], [[text] * 5], [(text, "red")]),
        StillSection(text, "0 0 1 1", [(text, "red", "0,0 1,1 1,0")], (0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)),
        surface,
        TurnedLeg(text, {text: [text]}, Slider(text, (0.0, 1.0), text), View([text] * 8), [text], [text], [[text]]),
    ]
    return WebPage(
        text,
        text,
        "measured",
        Headline("sound", text, [(text, text)], text),
        [text],
        [Known(text, text, "estimated", text, text, text)],
        [Chapter(text, blocks)],
        Repeat(text, {text: text}, {text: text}),
        data=DataKind(text, text),
        warned=text,
    )


@pytest.fixture(scope="module")
def plain() -> Elements:
    read = Elements()
    read.feed(rendered(page_saying("words")))
    return read


@pytest.mark.parametrize("text", PLANTED)
def test_markup_in_any_text_of_a_page_is_text(text, plain):
    read = Elements()
    read.feed(rendered(page_saying(text)))
    assert read.tags == plain.tags, "no element more or less"
    assert read.attributes == plain.attributes
    assert read.comments == plain.comments


@pytest.mark.parametrize("text", PLANTED)
def test_data_in_a_script_is_what_it_was(text):
    read = Elements()
    read.feed(rendered(page_saying(text)))
    data = ["".join(content) for attributes, content in read.scripts if attributes.get("type") == "application/json"]
    own = [json.loads(one) for one in data if '"roots"' not in one]
    assert {text: [text]} in own
    for one in data:
        assert not any(end in one for end in ("</", "<!--", "\u2028", "\u2029"))


def test_embedded_data_refuses_what_json_cannot_say():
    with pytest.raises(ValueError, match="JSON"):
        embed({"force": float("nan")})


def test_markdown_shows_markup_as_text():
    text = markdown_page(page_saying("<b>*a* | `b` [c](d)"))
    outside = "".join(text.split("```")[::2])
    assert "<b>" not in outside and r"\<b\>" in outside
    assert r"\| \`b\` \[c\](d)" in text


def test_a_spreadsheet_takes_no_name_for_a_formula(tmp_path):
    write_tables(page_saying("=HYPERLINK(1)"), tmp_path)
    with (tmp_path / "numbers.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["name"] == row["subject"] == "'=HYPERLINK(1)"


def written_from(folder: Path, text: str, solved: StockingFit | None = None) -> tuple[StockingFit, Elements]:
    """The fit of a short leg's folder with a text wherever the folder may have one, or solved before, and its page."""
    folder.mkdir()
    write_shape(short_leg(), folder / "bare.csv")
    quoted = json.dumps(text)
    (folder / "leg.toml").write_text(f"""id = "x"
title = {quoted}
origin = "simulated"
bare.contours = "bare.csv"
stocking.compression_class = "2"
tissues = {{deep = {{C10_kPa = 3.0}}, superficial = {{C10_kPa = 2.0}}}}
posture.heart_mm = 1200
veins = [{{name = {quoted}, position_mm = [0.0, 0.0, 80.0]}}]
sensor = [{{name = {quoted}, position_mm = [0.0, 55.0, 80.0], pressure_mmHg = 200, instrument = "PicoPress"}}]
""")
    shear = ShearModulus("superficial", "along", 4e-3, 1e-3, text)
    leg = replace(load_leg(folder), elastography=(shear,))
    if solved is None:
        found = identify_in_stocking(leg, Silent(), mesh=COARSEST)
    else:
        found = assessed(replace(solved.details, leg=leg), solved.log, solved.settings)
    page = Elements()
    page.feed(rendered(page_of([found], command=f"run {text}")))
    return found, page


def test_markup_in_any_text_of_a_folder_is_text_in_its_page(tmp_path):
    planted = "".join(PLANTED)
    found, page = written_from(tmp_path / "planted", planted)
    _, plain = written_from(tmp_path / "plain", "words", found)
    assert page.tags == plain.tags and page.attributes == plain.attributes and page.comments == plain.comments
    (turned,) = [content for attributes, content in page.scripts if attributes.get("id") == "turn-data"]
    names = [marked["name"] for marked in json.loads("".join(turned))["marked"]]
    assert [name.startswith(planted) for name in names] == [True], "the vein's name is as it was given"
