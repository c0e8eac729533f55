"""What a page says, part by part: a verdict, numbers, and chapters of blocks, whatever they are rendered to."""

import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import Any, ClassVar, Literal

from legfem.common.documents import row_cells
from legfem.inverse.answer import Tone
from legfem.report.curves import Block as Block  # blocks of other files are made there
from legfem.report.folder import ReportFile
from legfem.report.style import BONE_COLOUR, REGION_COLOURS
from legfem.report.words import ORIGINS, WORDS, DataKind

PAGE = "report.html"
TESTED = "What was tested"
"""A chapter of many pages."""
Provenance = Literal["measured", "reconstructed", "simulated", "estimated", "computed", "assumed", "prior"]
TONES: Mapping[Tone, str] = WORDS["tones"]
PROVENANCE: Mapping[Provenance, str] = WORDS["provenances"]
SURFACE_CELLS = 21
"""Along either axis."""


@dataclass(frozen=True)
class Headline:
    """The verdict, for someone who knows no statistics."""

    tone: Tone
    sentence: str
    answers: Sequence[tuple[str, str]]
    """Questions that such a reader has, in their order, each with its answer."""
    heading: str = ""
    """In place of the tone's, where a page judges no model."""

    @property
    def shown_heading(self) -> str:
        """The heading, else the tone's."""
        return self.heading or TONES[self.tone]

    @property
    def said(self) -> str:
        """Heading and sentence, as one line."""
        return f"{self.shown_heading.rstrip('.')}. {self.sentence}"

    def doubted(self, doubts: int) -> "Headline":
        """Return the verdict where some of what was given is unlikely: whatever the model says rests on that.

        Parameters
        ----------
        doubts
            How many.
        """
        if not doubts:
            return self
        many = doubts > 1
        found = (
            f"{doubts} input{'s are' if many else ' is'} doubtful (see the warnings); if "
            f"{'one of them' if many else 'it'} is wrong, the result may be wrong, too. Apart from that: "
        )
        first = {"Problems found": found, "What to do": "Check the doubtful input first. Then: "}
        return replace(
            self,
            tone="caution" if self.tone == "sound" else self.tone,
            answers=[(question, _then(first.get(question, ""), answer)) for question, answer in self.answers],
            heading=self.heading
            if self.tone == "wrong"
            else _then("Check the doubtful input first. If it is right: ", self.shown_heading),
        )


def _then(before: str, text: str) -> str:
    """Return a sentence behind a colon."""
    return f"{before}{text[:1].lower()}{text[1:]}" if before else text


@dataclass(frozen=True)
class Known:
    """One number in the result, or that it depends on, and where it comes from."""

    name: str
    value: str
    provenance: Provenance
    source: str
    interval: str = ""
    """95 %; empty where there is none."""
    remark: str = ""


@dataclass(frozen=True)
class Prose(Block):
    """A paragraph."""

    kind: ClassVar[str] = "prose"
    text: str


@dataclass(frozen=True)
class Bullets(Block):
    """A list of sentences."""

    kind: ClassVar[str] = "bullets"
    items: Sequence[str]


@dataclass(frozen=True)
class WebTable(Block):
    """A table; its first column names the rows."""

    kind: ClassVar[str] = "table"
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    folded: bool = False
    """Whether it opens only when asked for."""

    @classmethod
    def of(cls, caption: str, rows: Iterable[Mapping[str, str]], folded: bool = False) -> "WebTable":
        """Return the table of rows, one at least, that name their columns alike."""
        return cls(caption, *row_cells(rows), folded)


@dataclass(frozen=True)
class Verbatim(Block):
    """A text as it was printed, folded away."""

    kind: ClassVar[str] = "verbatim"
    title: str
    text: str


@dataclass(frozen=True)
class LabelledBar:
    """One number."""

    name: str
    value: float
    text: str
    """Value and interval as people read them."""
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Bars(Block):
    """Numbers of one unit beside each other."""

    kind: ClassVar[str] = "bars"
    caption: str
    header: tuple[str, str]
    """Of names and of values."""
    bars: Sequence[LabelledBar]
    greatest: float | None = None
    """Where they may end; the greatest value's or interval's end by default."""

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Names and values as a table."""
        return [(one.name, one.text) for one in self.bars]

    @property
    def drawn(self) -> list[LabelledBar]:
        """Return the bars as they are drawn: values and ends of intervals are per cent of the greatest."""
        ends = [max(b.value, b.interval[1] if b.interval else b.value) for b in self.bars]
        greatest = max(ends, default=1.0) if self.greatest is None else self.greatest

        def at(value: float) -> float:
            share = value / greatest if greatest > 0 else 0.0
            return round(100 * min(max(share, 0.0), 1.0), 2)

        return [
            replace(b, value=at(b.value), interval=(at(b.interval[0]), at(b.interval[1])) if b.interval else None)
            for b in self.bars
        ]


@dataclass(frozen=True, eq=False)
class PressedSection(Block):
    """A section's mesh that a reader presses, coloured by a measure or by tissue."""

    kind: ClassVar[str] = "pressed"
    caption: str
    data: Mapping[str, Any]
    """What ``press.js`` reads."""
    deepest: float
    """mm."""
    measures: list[str]
    """Names of what it is coloured by."""
    rows: list[list[str]]
    """Displacement, force and greatest measures of every state."""
    tissues: list[tuple[str, str]]
    """Names and colours."""
    header: ClassVar[list[str]] = WORDS["pressed_section"]


@dataclass(frozen=True)
class Mark:
    """A circle on a section, y downwards, mm."""

    name: str
    x: float
    y: float
    radius: float
    colour: str


@dataclass(frozen=True)
class Arrow:
    """An arrow on a section, y downwards, mm."""

    name: str
    x: float
    y: float
    dx: float
    dy: float
    colour: str


@dataclass(frozen=True)
class StillSection(Block):
    """The contours of a section and the indenter where it first touches."""

    kind: ClassVar[str] = "still"
    caption: str
    view: str
    """SVG's viewBox, y downwards."""
    outlines: list[tuple[str, str, str]]
    """Name, colour and points of every closed contour."""
    indenter: tuple[float, float, float]
    """Centre and radius, y downwards."""
    travel: tuple[float, float, float, float]
    """Line from the centre along the indenter's travel."""
    marks: Sequence[Mark] = ()
    arrows: Sequence[Arrow] = ()
    key: str = ""
    """Of a page's further sections: each has a name of its own."""


@dataclass(frozen=True)
class Slider:
    """What a reader moves, through the states; between them pictures are in proportion."""

    label: str
    stops: Sequence[float]
    """Places of the states along it, increasing from 0."""
    unit: str
    """With the space before it, if any."""
    step: float = 1.0
    digits: int = 0
    force: Sequence[float] = ()
    """N, of the states; empty where there is none."""

    @property
    def most(self) -> float:
        """Its end."""
        return self.stops[-1]


@dataclass(frozen=True)
class View:
    """How a leg is looked at first, and what eight views round it are called."""

    names: Sequence[str]
    """At 0, 45, ... degrees from the front, -y."""
    turn_deg: float = -30.0
    exaggerates: bool = True
    """Whether movements may be shown five times as large."""


@dataclass(frozen=True)
class TurnedLeg(Block):
    """A leg that is turned, and loaded with a slider."""

    kind: ClassVar[str] = "turned"
    caption: str
    data: Mapping[str, object]
    """What ``turn.js`` reads."""
    slider: Slider
    view: View
    fields: Sequence[str]
    """Names of the skin's colours."""
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """The same as a table."""
    tissues: ClassVar[list[tuple[str, str]]] = [("muscle", REGION_COLOURS["deep"]), ("bone (fixed)", BONE_COLOUR)]


@dataclass(frozen=True)
class SurfaceFactor:
    """What is varied from -1 to +1."""

    label: str
    levels: tuple[str, str, str]
    """At -1, 0 and +1, as people read them."""


@dataclass(frozen=True)
class SurfaceMetric:
    """What is predicted."""

    label: str
    unit: str
    terms: Sequence[tuple[Sequence[int], float]]
    """The factors' numbers in a term (none for the mean, two for an interaction), and its coefficient."""


@dataclass(frozen=True, eq=False)
class ResponseSurface(Block):
    """A map of a metric over two factors; the others are set with sliders."""

    kind: ClassVar[str] = "response"
    name: ClassVar[str] = "response"
    caption: str
    factors: Sequence[SurfaceFactor]
    metrics: Sequence[SurfaceMetric]
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """The coefficients as a table."""
    shown: tuple[int, int] = (0, 1)
    """Numbers of the factors on the axes at first."""

    @property
    def data(self) -> dict[str, Any]:
        """What ``response.js`` reads."""
        return {
            "cells": SURFACE_CELLS,
            "factors": list(map(vars, self.factors)),
            "metrics": list(map(vars, self.metrics)),
        }


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
    inputs: Path | None = None
    """Folder that was given."""


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
    data: DataKind | None = None
    """What kind of data, where `ORIGINS` don't say it."""
    warned: str = ""
    """Whom the warnings are for, where it isn't the reader."""
    made: date = field(default_factory=date.today)

    @property
    def kind_of_data(self) -> DataKind:
        """What kind of data."""
        return self.data or ORIGINS[self.origin]

    @property
    def made_on(self) -> str:
        """The day, as people of all countries read it."""
        return f"{self.made.day} {self.made:%B %Y}"


def listed(explore: str) -> ReportFile:
    """Return a page's entry in a report's list of files: what there is to explore."""
    return ReportFile([Path(PAGE)], f"all of it on one page for a browser, with {explore} to explore")


def command_line() -> str:
    """Return the command that is running, as it can be given again; empty outside of one."""
    spec = sys.modules["__main__"].__spec__
    if sys.argv[0].startswith("legfem "):  # as `legfem.__main__` leaves it, with the command's name
        program = sys.argv[0]
    elif spec is not None and spec.name.startswith(("legfem", "studies")):
        module = str(spec.parent)
        program = module.replace(".", " ") if module.startswith("legfem.") else f"python -m {module}"
    else:
        return ""
    return f"{program} {shlex.join(sys.argv[1:])}".strip()
