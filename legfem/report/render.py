"""A page in each form that it is given in: HTML, plain text, Markdown, its numbers as tables; its folder as a crate.

The page of HTML loads nothing, and its curves have a cursor and zoom, by Chart.js. Lines are switched on and off by the
check boxes of the page's own legend, which a keyboard reaches.

The crate is an RO-Crate 1.1 (https://w3id.org/ro/crate/1.1) that says from which files, by which command, seed and
versions, on which machine a folder was made; the run is a CreateAction. What was given stays where it is: the crate
names it by its content's hash, so that it tells nobody's folders.
"""

import os
import platform
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from legfem.common.documents import Contents, legfem_build, literal, write_document
from legfem.common.input_files import lab_of
from legfem.inverse.catalogue import key_of
from legfem.report import page as web
from legfem.report.folder import REPORT, ReportFile

if TYPE_CHECKING:
    import pandas as pd

    from legfem.inverse.fit import Fit

CRATE = "ro-crate-metadata.json"
_RO = "https://w3id.org/ro/crate/1.1"
_LICENSE = "that of the files which were given"


def write_crate(page: web.WebPage, folder: Path, files: Sequence[ReportFile]) -> ReportFile:
    """Write ``ro-crate-metadata.json``.

    Parameters
    ----------
    page
        What the results say, and how they were made.
    folder
        Where they are made; in the end they lie in the one above.
    files
        What they are.
    """
    graph: list[dict[str, Any]] = []

    def added(kind: str, entities: Mapping[str, Mapping[str, str]]) -> list[dict[str, str]]:
        kinds = {key: "Dataset" if key.endswith("/") else kind for key in entities}
        graph.extend({"@id": key, "@type": kinds[key], **more} for key, more in entities.items())
        return [{"@id": key} for key in entities]

    def named(kind: str, what: str, values: Mapping[str, str]) -> list[dict[str, str]]:
        return added(kind, {f"#{name}": {"name": name, what: value} for name, value in values.items()})

    repeat, shown = page.repeat, {path.name: one.shows for one in files for path in one.paths}
    numbers = {**repeat.numbers, "machine": f"{platform.platform()}, {os.cpu_count()} processors"}
    inputs = _inputs(repeat.inputs, folder.parent) if repeat.inputs else ()
    given = added("File", {f"urn:sha256:{digest}": {"name": name, "sha256": digest} for name, digest in inputs})
    slashes = {name: "/" * (folder / name).is_dir() for name in shown}
    made = added("File", {quote(k) + slashes[k]: {"name": k, "description": v} for k, v in shown.items()})
    action: dict[str, Any] = {"@id": "#run", "@type": "CreateAction", "name": repeat.command or "a call from Python"}
    action["instrument"] = named("SoftwareApplication", "version", repeat.versions)
    action["object"], action["result"] = given + named("PropertyValue", "value", numbers), made
    about = {"name": page.title, "description": page.headline.said, "datePublished": page.made.isoformat()}
    parts: dict[str, Any] = {"license": _LICENSE, "hasPart": made + given, "mentions": {"@id": "#run"}}
    root = {"@id": "./", "@type": "Dataset", **about, **parts}
    itself = {"@id": CRATE, "@type": "CreativeWork", "about": {"@id": "./"}, "conformsTo": {"@id": _RO}}
    context = [f"{_RO}/context", {"sha256": "https://schema.org/sha256"}]
    path = write_document(folder / CRATE, {"@context": context, "@graph": [itself, root, action, *graph]})
    return ReportFile([path], "what was given, by its hash, and by what all this was made (an RO-Crate)")


def _inputs(folder: Path, out: Path) -> Iterator[tuple[str, str]]:
    """Yield names and hashes of the files in a folder that was given, without results, and of its lab's file."""
    results = {out, *(crate.parent for crate in folder.rglob(CRATE))} - {folder}
    for name, digest in Contents(folder).digest():
        if "/." not in f"/{name}" and results.isdisjoint((folder / name).parents):
            yield name, digest
    if (lab := lab_of(folder)) is not None:
        yield lab.name, Contents(lab).digest()[0][1]


WIDTH = 100
"""Of a page in characters."""


def fill(text: str, indent: str = "") -> str:
    """Return text in lines of the page's width."""
    return textwrap.fill(
        text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
    )


def bullet(text: str) -> str:
    """Return a text as an item of a list."""
    return textwrap.fill(text, WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False)


def bullets(lines: Sequence[str]) -> str:
    """Return lines as a list."""
    return "\n".join(map(bullet, lines))


_WIDE = 180
"""Characters of a page with a table of numbers."""
_SHORT = 30
"""Characters of a number, or of a name beside it, at most."""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return columns as wide as they need; an item a row where a page isn't as wide as that.

    Numbers stay in columns on a wider page, too.
    """
    cells = [list(header), *map(list, rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    if sum(widths) + 2 * len(widths) > (_WIDE if max(widths) <= _SHORT else WIDTH):
        labels = [f"{name}: " if len(header) > 2 else "" for name in header[1:]]
        return bullets(
            [f"{name}: " + "; ".join(f"{h}{c}" for h, c in zip(labels, more, strict=True) if c) for name, *more in rows]
        )
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells
    )


MARKDOWN = "report.md"
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>|#~])")


def _plain(text: str) -> str:
    """Text as it is in Markdown: no character of it means markup."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def _fenced(text: str) -> str:
    """Text between fences that are longer than any in it."""
    fence = "`" * max(3, *(len(run) + 1 for run in re.findall("`+", text)), 3)
    return f"{fence}\n{text.rstrip()}\n{fence}"


def embed(data: Any) -> Markup:
    """Data as JSON that a page's script element can contain, whatever text is in it.

    ``<``, ``>``, ``&`` and ``'`` are written as escapes of JSON, and so is all that isn't ASCII (U+2028 and U+2029
    end a line in a script): no text ends the element or begins another. All pages embed data by this function.
    """
    return htmlsafe_json_dumps(data, allow_nan=False)


_WRITTEN = ("prose", "bullets", "table", "sortable", "bars", "response", "verbatim")
"""Kinds of blocks that a text has: others are to be looked at, on the page for a browser and in the figures."""
_TOLD = (*_WRITTEN, "curves", "pressed", "turned")
"""Kinds whose words or table Markdown has."""


@cache
def _template(name: str) -> Template:
    environment = Environment(
        loader=PackageLoader("legfem", "resources/web"),
        autoescape=name.endswith((".html", ".svg")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"embed": embed, "fill": fill, "bullet": bullet, "plain": _plain, "fenced": _fenced}
    environment.globals |= {"provenances": web.PROVENANCE, "table": table, "width": WIDTH}
    environment.globals |= {"written": _WRITTEN, "told": _TOLD}
    return environment.get_template(name)


def filled(name: str, **given: Any) -> str:
    """Return a text or picture whose template stands in ``resources/web``."""
    return _template(name).render(given)


def plain_page(page: web.WebPage, files: Sequence[ReportFile]) -> str:
    """Return the text of ``report.txt``: all that a page says, and what else was written."""
    told = [one for one in page.chapters if any(block.kind in _WRITTEN for block in one.blocks)]
    return filled(REPORT, page=page, known=page.known, chapters=told, files=files, brief=False).rstrip() + "\n"


def brief(page: web.WebPage, chapters: Sequence[str] = (web.TESTED,)) -> str:
    """Return what a page says first, its estimates and some chapters, for the terminal."""
    found = [one for one in page.known if one.provenance in ("estimated", "prior")]
    told = [one for one in page.chapters if one.title in chapters]
    return filled(REPORT, page=page, known=found, chapters=told, files=(), brief=True).rstrip() + "\n"


def markdown_page(page: web.WebPage) -> str:
    """All that a page says, as Markdown (CommonMark with GitHub's tables)."""
    return filled(MARKDOWN, page=page).rstrip() + "\n"


def markdown_chapters(chapters: Sequence[web.Chapter]) -> str:
    """Headings and blocks of the chapters that have anything to be read."""
    written = vars(_template("blocks.md").module)["chapters"]
    return str(written(chapters)).rstrip()


def rendered(page: web.WebPage) -> str:
    """Return a page as HTML that loads nothing."""
    kinds = {block.kind for chapter in page.chapters for block in chapter.blocks}
    return filled(
        web.PAGE,
        page=page,
        tone=page.headline.shown_heading,
        data=str(page.kind_of_data),
        scripts=list(dict.fromkeys(name for kind in _SCRIPTS if kind in kinds for name in _SCRIPTS[kind])),
        legfem=legfem_build(),
    )


_CHARTS = ("chart.umd.min.js", "chartjs-plugin-zoom.min.js")
_SCRIPTS: Mapping[str, Sequence[str]] = {
    "curves": (*_CHARTS, "plots.js"),
    "pressed": ("scale.js", "press.js"),
    "turned": ("scale.js", "turn.js"),
    "response": (*_CHARTS, "scale.js", "response.js"),
    "sortable": ("scale.js", "many.js"),
    "forest": ("scale.js", "many.js"),
    "bundle": ("scale.js", "many.js"),
}
"""By the kind of a block, in their order."""


CSV, WORKBOOK = "numbers.csv", "numbers.xlsx"


def estimates_frame(fits: "Sequence[Fit[Any]]") -> "pd.DataFrame":
    """A row a parameter, or what was computed with them, and law: value, 95 % interval, unit and verdict."""
    import pandas as pd

    rows: list[tuple[Any, ...]] = []
    for fit in fits:
        for name, found in fit.estimates.items():
            shown = found.shown
            rows.append((fit.law, key_of(name), shown.value, *shown.ci95, shown.unit, found.identifiability))
        for key, one in fit.computed.items():
            rows.append((fit.law, key, one.value, *one.ci95, one.unit, ""))
    return pd.DataFrame(rows, columns=["law", "parameter", "value", "low", "high", "unit", "identifiability"])


def write_tables(page: web.WebPage, folder: Path, estimates: "pd.DataFrame | None" = None) -> ReportFile:
    """Write a page's numbers as CSV and as a workbook.

    Parameters
    ----------
    page
        Its known numbers, with where they come from, are the workbook's second sheet, and all of a page without
        estimates.
    folder
        Where the files go.
    estimates
        A row a parameter, with numbers as numbers.
    """
    import pandas as pd

    known = pd.DataFrame(map(vars, page.known)).map(literal)
    first = known if estimates is None else estimates.map(literal)
    csv, workbook = folder / CSV, folder / WORKBOOK
    first.assign(subject=literal(page.subject), origin=page.origin).to_csv(csv, index=False)
    with pd.ExcelWriter(workbook) as writer:
        if estimates is not None:
            first.to_excel(writer, sheet_name="estimates", index=False)
        known.to_excel(writer, sheet_name="numbers", index=False)
    shows = "the numbers, with intervals and verdicts, for a spreadsheet"
    return ReportFile([csv, workbook], shows)


PAGE_FILES = (REPORT, web.PAGE, MARKDOWN, CSV, WORKBOOK, CRATE)
"""Files that `write_page` writes."""


def write_page(
    page: web.WebPage, folder: Path, explore: str, files: Sequence[ReportFile], estimates: "pd.DataFrame | None" = None
) -> None:
    """Write ``report.html``, ``report.txt``, ``report.md``, ``numbers.csv``, ``numbers.xlsx`` and the crate.

    Parameters
    ----------
    page
        What they say.
    folder
        Where they go.
    explore
        What there is to explore on the page for a browser, in words.
    files
        What else stands in the folder.
    estimates
        A row a parameter; the page's known numbers without it.
    """
    (folder / web.PAGE).write_text(rendered(page), encoding="utf-8")
    (folder / MARKDOWN).write_text(markdown_page(page), encoding="utf-8")
    tables = write_tables(page, folder, estimates)
    markdown = ReportFile([Path(MARKDOWN)], "the same as Markdown")
    every = [web.listed(explore), markdown, *(one for one in files if one.paths), tables]
    made_from = write_crate(page, folder, [*every, ReportFile([Path(REPORT)], "the same as text")])
    (folder / REPORT).write_text(plain_page(page, [*every, made_from]), encoding="utf-8")
