"""A page of HTML read strictly, for tests: what it says, and what is wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser
from itertools import pairwise

# HTML5's elements without an end, and SVG's that are written without one.
VOID = {"meta", "link", "input", "img", "br", "hr", "col"}
LOADING = {"src", "href", "xlink:href", "srcset", "data", "action", "poster"}


@dataclass
class Read(HTMLParser):
    """Elements that stand open, what they say, and faults."""

    text: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    ids: list[str] = field(default_factory=list)
    wanted: list[str] = field(default_factory=list)
    headings: list[int] = field(default_factory=list)
    open: list[str] = field(default_factory=list)
    attributes: dict[str, str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if len(given) != len(attrs):
            self.faults.append(f"{tag} has an attribute twice")
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        given = dict(attrs)
        if tag == "html":
            self.attributes = given
        if "id" in given:
            self.ids.append(given["id"])
        for name in LOADING & given.keys():
            value = given[name]
            if value.startswith("#"):
                self.wanted.append(value[1:])
            elif not value.startswith("data:"):
                self.loads.append(value)
        for name in {"for", "aria-labelledby"} & given.keys():
            self.wanted += given[name].split()
        if len(tag) == 2 and tag[0] == "h" and tag[1].isdigit():
            self.headings.append(int(tag[1]))
        if tag == "img" and not given.get("alt"):
            self.faults.append("a picture without alt")
        if given.get("role") == "img" and not given.get("aria-label"):
            self.faults.append("an image without a label")

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at {self.getpos()} closes another element")

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.text.append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


def read(html: str) -> Read:
    """Read a page and check what every page must be."""
    page = Read()
    page.feed(html)
    page.close()
    assert html.startswith("<!DOCTYPE html>")
    assert not page.open and not page.faults, page.faults
    assert page.loads == [], "a page loads nothing"
    assert len(page.ids) == len(set(page.ids))
    assert set(page.wanted) <= set(page.ids), "links and labels point at something"
    assert page.attributes["lang"] == "en"
    assert page.headings[0] == 1 and page.headings.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(page.headings))
    assert "default-src 'none'" in html
    return page
