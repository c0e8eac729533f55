"""What a page says, part by part, and how it becomes one file of HTML."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import ClassVar, Literal

from jinja2 import Environment, PackageLoader, StrictUndefined

from legfem.common.versions import legfem_version
from legfem.report.folder import REPORT, ReportFile
from legfem.report.web.bars import Bars
from legfem.report.web.curves import Curves, embedded
from legfem.report.web.response import ResponseSurface
from legfem.report.web.section import PressedSection, StillSection
from legfem.report.web.turned import TurnedLeg
from legfem.report.words import ORIGINS

PAGE = "report.html"
TESTED = "What was tested"
"""A chapter of many pages."""
Tone = Literal["sound", "caution", "open", "wrong"]
Provenance = Literal["measured", "reconstructed", "simulated", "estimated", "computed", "assumed", "prior"]
TONES: Mapping[Tone, str] = {
    "sound": "Nothing speaks against the model",
    "caution": "Read with caution",
    "open": "Not settled",
    "wrong": "The model is wrong here",
}
_MONTHS = (
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
)
PROVENANCE: Mapping[Provenance, str] = {
    "measured": "read off measurements of this leg",
    "reconstructed": "read off reconstructed data; nothing was measured",
    "simulated": "read off simulated data; nothing was measured",
    "estimated": "found here, by fitting the model to what was measured",
    "computed": "computed here, by the model with the numbers above and below",
    "assumed": "taken as exact; not checked here",
    "prior": "known beforehand with a stated error, which the intervals carry",
}


@dataclass(frozen=True)
class Headline:
    """The verdict, for someone who knows no statistics."""

    tone: Tone
    sentence: str
    answers: Sequence[tuple[str, str]]
    """Questions that such a reader has, in their order, each with its answer."""
    heading: str = ""
    """In place of the tone's, where a page judges no model."""


@dataclass(frozen=True)
class Known:
    """One number that the result has or rests on, and where it comes from."""

    name: str
    value: str
    provenance: Provenance
    source: str
    interval: str = ""
    """95 %; empty where there is none."""
    remark: str = ""


@dataclass(frozen=True)
class Prose:
    """A paragraph."""

    kind: ClassVar[str] = "prose"
    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    kind: ClassVar[str] = "bullets"
    items: Sequence[str]


@dataclass(frozen=True)
class WebTable:
    """A table; its first column names the rows."""

    kind: ClassVar[str] = "table"
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    folded: bool = False
    """Whether it opens only when asked for."""


@dataclass(frozen=True)
class Verbatim:
    """A text as it was printed, folded away."""

    kind: ClassVar[str] = "verbatim"
    title: str
    text: str


Block = (
    Prose | Bullets | WebTable | Verbatim | Bars | Curves | PressedSection | StillSection | ResponseSurface | TurnedLeg
)
_SCRIPTS: Mapping[str, str] = {"pressed": "press.js", "turned": "turn.js", "response": "response.js"}


@dataclass(frozen=True)
class Chapter:
    """What stands under one heading."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Repeat:
    """How the run is made again."""

    command: str
    """Empty where it was called from Python."""
    versions: Mapping[str, str]
    numbers: Mapping[str, str] = field(default_factory=dict)
    """Seed and the like, as people write them."""


@dataclass(frozen=True)
class WebPage:
    """A run's page."""

    title: str
    subject: str
    origin: str
    """``measured``, ``reconstructed`` or ``simulated``."""
    headline: Headline
    warnings: Sequence[str]
    known: Sequence[Known]
    chapters: Sequence[Chapter]
    """In their order; the table of what is known follows the first."""
    repeat: Repeat
    data: str = ""
    """What kind of data, in words, where `ORIGINS` don't say it."""
    warned: str = ""
    """Whom the warnings are for, where it isn't the reader."""
    made: date = field(default_factory=date.today)

    @property
    def made_on(self) -> str:
        """The day, as people of all countries read it."""
        return f"{self.made.day} {_MONTHS[self.made.month - 1]} {self.made.year}"


def listed(explore: str) -> ReportFile:
    """Return a page's entry in a report's list of files: what there is to explore."""
    return ReportFile([Path(PAGE)], f"all of it on one page for a browser, with {explore} to explore")


def write_page(page: WebPage, folder: Path, text: str = "") -> None:
    """Write ``report.html`` into a folder, and ``report.txt`` where a text is given."""
    (folder / PAGE).write_text(rendered(page), encoding="utf-8")
    if text:
        (folder / REPORT).write_text(text, encoding="utf-8")


def rendered(page: WebPage) -> str:
    """Return a page as HTML that loads nothing."""
    environment = Environment(
        loader=PackageLoader("legfem", "resources/web"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    blocks = [block for chapter in page.chapters for block in chapter.blocks]
    kinds = {block.kind for block in blocks}
    return environment.get_template("report.html").render(
        page=page,
        tone=page.headline.heading or TONES[page.headline.tone],
        data=page.data or ORIGINS[page.origin],
        provenances=PROVENANCE,
        plots=embedded([b for b in blocks if isinstance(b, Curves | ResponseSurface)]),
        scripts=[name for kind, name in _SCRIPTS.items() if kind in kinds],
        legfem=legfem_version(),
    )


def command_line() -> str:
    """Return the command that is running, as it can be given again; empty outside of one."""
    spec = sys.modules["__main__"].__spec__
    if spec is not None and spec.name.startswith(("legfem", "studies")):
        program = f"python -m {spec.parent}"
    elif Path(sys.argv[0]).name == "legfem":
        program = "legfem"
    else:
        return ""
    return f"{program} {shlex.join(sys.argv[1:])}".strip()
