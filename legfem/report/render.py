"""A page in each form that it is given in: HTML, plain text, Markdown, and its numbers as tables.

The page of HTML loads nothing, and its curves have a cursor and zoom, by Chart.js. Lines are switched on and off by the
check boxes of the page's own legend, which a keyboard reaches.
"""

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from legfem.common.documents import legfem_build, literal
from legfem.inverse.catalogue import key_of
from legfem.report import page as web
from legfem.report.curves import Curves, SortableTable
from legfem.report.folder import REPORT, ReportFile

if TYPE_CHECKING:
    import pandas as pd

    from legfem.inverse.fit import Fit


WIDTH = 100
"""Of a page in characters."""


def fill(text: str, indent: str = "") -> str:
    """Return text in lines of the page's width."""
    return textwrap.fill(
        text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
    )


def bullets(lines: Sequence[str]) -> str:
    """Return lines as a list."""
    return "\n".join(
        textwrap.fill(line, WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False)
        for line in lines
    )


_WIDE = 180
"""Characters of a page with a table of numbers."""
_SHORT = 30
"""Characters of a number, or of a name beside it, at most."""


def plain_page(page: web.WebPage, files: Sequence[ReportFile]) -> str:
    """Return the text of ``report.txt``: all that a page says, and what else was written."""
    blocks = [
        *_opening(page, underlined=True),
        *([_headline("Numbers") + _numbers(page.known)] if page.known else []),
        *(_headline(one.title) + body for one in page.chapters if (body := _chapter(one))),
        _headline("How to repeat it") + _repeat(page),
        *([_headline("Files") + listing(files)] if files else []),
    ]
    return "\n\n".join(blocks) + "\n"


def brief(page: web.WebPage, chapters: Sequence[str] = (web.TESTED,)) -> str:
    """Return what a page says first, its estimates and some chapters, for the terminal."""
    found = [one for one in page.known if one.provenance in ("estimated", "prior")]
    told = [_chapter(one) for one in page.chapters if one.title in chapters]
    return "\n\n".join([*_opening(page, underlined=False), *([_numbers(found)] if found else []), *told]) + "\n"


def _headline(name: str) -> str:
    return f"{name}\n{'-' * len(name)}\n"


def _opening(page: web.WebPage, underlined: bool) -> list[str]:
    line = "\n" + "=" * min(len(page.title), WIDTH) if underlined else ""
    data, given = page.kind_of_data, page.headline
    answers = [f"{question}: {answer}" for question, answer in given.answers]
    return [
        f"{page.title}{line}\n{page.subject}",
        f"*** {data.what.upper()} ***" + (f" ({data.explanation})" if data.explanation else ""),
        fill(f"{given.shown_heading.upper().rstrip('.')}. {given.sentence}"),
        bullets(answers),
        *([f"Warnings{page.warned}:\n{bullets(page.warnings)}"] if page.warnings else []),
    ]


def _numbers(known: Sequence[web.Known]) -> str:
    """Return numbers a line each, and what the words for their origin mean."""
    lines = []
    for one in known:
        interval = f"(95 % {one.interval})" if one.interval else ""
        number = " ".join(part for part in (one.value, interval) if part)
        remark = f"; {one.remark}" if one.remark else ""
        lines.append(f"{one.name}: {number}; {one.provenance}, {one.source}{remark}")
    used = dict.fromkeys(one.provenance for one in known)
    legend = "; ".join(f"{name}: {web.PROVENANCE[name]}" for name in used)
    return f"{bullets(lines)}\n\n{fill(f'({legend}.)')}" if lines else ""


def _chapter(chapter: web.Chapter) -> str:
    return "\n\n".join(text for block in chapter.blocks if (text := _block_as_text(block)))


def _block_as_text(block: web.Block) -> str:
    match block:
        case web.Prose():
            return fill(block.text)
        case web.Bullets():
            return bullets(block.items)
        case web.WebTable() | SortableTable() | web.Bars():
            return f"{fill(block.caption)}:\n{table(block.header, block.rows)}"
        case web.ResponseSurface():
            return f"{fill(block.header[0].capitalize())}:\n{table(block.header, block.rows)}"
        case web.Verbatim():
            return f"{block.title}:\n{block.text.rstrip()}"
    return ""  # What is to be looked at stands in the page for a browser, and in the figures.


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


def _repeat(page: web.WebPage) -> str:
    given = page.repeat
    versions = ", ".join(f"{name} {version}" for name, version in given.versions.items())
    numbers = ", ".join(f"{name} {value}" for name, value in given.numbers.items())
    lines = [given.command, *(fill(text) for text in (numbers, versions) if text)]
    return "\n".join(line for line in lines if line) or "From Python."


def listing(files: Sequence[ReportFile]) -> str:
    """Return a report's files and what each shows."""
    return "\n".join(f"{', '.join(path.name for path in entry.paths)}\n{fill(entry.shows, ' ' * 4)}" for entry in files)


MARKDOWN = "report.md"
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>|#~])")


def markdown_page(page: web.WebPage) -> str:
    """All that a page says, as Markdown (CommonMark with GitHub's tables)."""
    given = page.headline
    parts = [
        f"# {_text(page.title)}",
        f"{_text(page.subject)}. **{_text(str(page.kind_of_data))}**",
        f"**{_text(given.shown_heading.rstrip('.'))}.** {_text(given.sentence)}",
        _bullets([f"{question}: {answer}" for question, answer in given.answers]),
    ]
    if page.warnings:
        parts += [f"## Warnings{_text(page.warned)}", _bullets(page.warnings)]
    if page.known:
        rows = [[one.name, one.value, one.interval, one.provenance, one.source, one.remark] for one in page.known]
        used = dict.fromkeys(one.provenance for one in page.known)
        parts += [
            "## Numbers",
            _table(["number", "value", "95 % interval", "how it is known", "from what", "remark"], rows),
            _bullets([f"{name}: {web.PROVENANCE[name]}" for name in used]),
        ]
    parts += markdown_chapters(page.chapters)
    versions = ", ".join(f"{name} {version}" for name, version in page.repeat.versions.items())
    command = [_code(page.repeat.command)] if page.repeat.command else []
    return "\n\n".join([*parts, "## How to repeat it", *command, _text(versions)]) + "\n"


def markdown_chapters(chapters: Sequence[web.Chapter]) -> list[str]:
    """Headings and blocks of the chapters that have anything to be read."""
    parts = []
    for chapter in chapters:
        blocks = [text for block in chapter.blocks if (text := _block_as_markdown(block))]
        parts += [f"## {_text(chapter.title)}", *blocks] if blocks else []
    return parts


def _block_as_markdown(block: web.Block) -> str:
    """A block; nothing of one that is only to be looked at."""
    match block:
        case web.Prose():
            return _text(block.text)
        case web.Bullets():
            return _bullets(block.items)
        case (
            web.WebTable()
            | SortableTable()
            | web.Bars()
            | Curves()
            | web.PressedSection()
            | web.TurnedLeg()
            | web.ResponseSurface()
        ):
            return f"{_text(block.caption)}\n\n{_table(block.header, block.rows)}"
        case web.Verbatim():
            return f"{_text(block.title)}:\n\n{_code(block.text)}"
    return ""


def _code(text: str) -> str:
    """Text between fences that are longer than any in it."""
    fence = "`" * max(3, *(len(run) + 1 for run in re.findall("`+", text)), 3)
    return f"{fence}\n{text.rstrip()}\n{fence}"


def _bullets(items: Sequence[str]) -> str:
    return "\n".join(f"- {_text(item)}" for item in items)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(
        f"| {' | '.join(cell if number == 1 else _text(cell) for cell in line)} |" for number, line in enumerate(lines)
    )


def _text(text: str) -> str:
    """Text as it is: no character of it means markup."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def embed(data: Any) -> Markup:
    """Data as JSON that a page's script element can contain, whatever text is in it.

    ``<``, ``>``, ``&`` and ``'`` are written as escapes of JSON, and so is all that isn't ASCII (U+2028 and U+2029
    end a line in a script): no text ends the element or begins another. All pages embed data by this function.
    """
    return htmlsafe_json_dumps(data, allow_nan=False)


def rendered(page: web.WebPage) -> str:
    """Return a page as HTML that loads nothing."""
    environment = Environment(
        loader=PackageLoader("legfem", "resources/web"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["embed"] = embed
    blocks = [block for chapter in page.chapters for block in chapter.blocks]
    kinds = {block.kind for block in blocks}
    return environment.get_template("report.html").render(
        page=page,
        tone=page.headline.shown_heading,
        data=str(page.kind_of_data),
        provenances=web.PROVENANCE,
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

    known = _frame(vars(one) for one in page.known)
    first = known if estimates is None else _frame(row._asdict() for row in estimates.itertuples(index=False))
    csv, workbook = folder / CSV, folder / WORKBOOK
    first.assign(subject=literal(page.subject), origin=page.origin).to_csv(csv, index=False)
    with pd.ExcelWriter(workbook) as writer:
        if estimates is not None:
            first.to_excel(writer, sheet_name="estimates", index=False)
        known.to_excel(writer, sheet_name="numbers", index=False)
    shows = "the numbers, with intervals and verdicts, for a spreadsheet"
    return ReportFile([csv, workbook], shows)


def _frame(rows: Iterable[Mapping[str, Any]]) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame([{name: literal(value) for name, value in row.items()} for row in rows])


PAGE_FILES = (REPORT, web.PAGE, MARKDOWN, CSV, WORKBOOK)
"""Files that `write_page` writes."""


def write_page(
    page: web.WebPage, folder: Path, explore: str, files: Sequence[ReportFile], estimates: "pd.DataFrame | None" = None
) -> None:
    """Write ``report.html``, ``report.txt``, ``report.md``, ``numbers.csv`` and ``numbers.xlsx``.

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
    every = [web.listed(explore), markdown, *files, tables]
    (folder / REPORT).write_text(plain_page(page, every), encoding="utf-8")
