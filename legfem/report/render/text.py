"""A run's page as plain text: ``report.txt``, and its beginning for the terminal."""

import textwrap
from collections.abc import Sequence

from legfem.report.folder import ReportFile
from legfem.report.many import SortableTable
from legfem.report.page import (
    PROVENANCE,
    TESTED,
    TONES,
    Bars,
    Block,
    Bullets,
    Chapter,
    Known,
    Prose,
    ResponseSurface,
    Verbatim,
    WebPage,
    WebTable,
)
from legfem.report.words import ORIGINS

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


def plain_page(page: WebPage, files: Sequence[ReportFile]) -> str:
    """Return the text of ``report.txt``: all that a page says, and what else was written."""
    blocks = [
        *_opening(page, underlined=True),
        *([_headline("Numbers") + _numbers(page.known)] if page.known else []),
        *(_headline(one.title) + body for one in page.chapters if (body := _chapter(one))),
        _headline("How to repeat it") + _repeat(page),
        *([_headline("Files") + listing(files)] if files else []),
    ]
    return "\n\n".join(blocks) + "\n"


def brief(page: WebPage, chapters: Sequence[str] = (TESTED,)) -> str:
    """Return what a page says first, its estimates and some chapters, for the terminal."""
    found = [one for one in page.known if one.provenance in ("estimated", "prior")]
    told = [_chapter(one) for one in page.chapters if one.title in chapters]
    return "\n\n".join([*_opening(page, underlined=False), *([_numbers(found)] if found else []), *told]) + "\n"


def _headline(name: str) -> str:
    return f"{name}\n{'-' * len(name)}\n"


def _opening(page: WebPage, underlined: bool) -> list[str]:
    line = "\n" + "=" * min(len(page.title), WIDTH) if underlined else ""
    data = page.data or ORIGINS[page.origin]
    what, _, explanation = data.partition(" (")
    given = page.headline
    answers = [f"{question}: {answer}" for question, answer in given.answers]
    return [
        f"{page.title}{line}\n{page.subject}",
        f"*** {what.upper()} ***" + (f" ({explanation}" if explanation else ""),
        fill(f"{(given.heading or TONES[given.tone]).upper().rstrip('.')}. {given.sentence}"),
        bullets(answers),
        *([f"Warnings{page.warned}:\n{bullets(page.warnings)}"] if page.warnings else []),
    ]


def _numbers(known: Sequence[Known]) -> str:
    """Return numbers a line each, and what the words for their origin mean."""
    lines = []
    for one in known:
        interval = f"(95 % {one.interval})" if one.interval else ""
        number = " ".join(part for part in (one.value, interval) if part)
        remark = f"; {one.remark}" if one.remark else ""
        lines.append(f"{one.name}: {number}; {one.provenance}, {one.source}{remark}")
    used = dict.fromkeys(one.provenance for one in known)
    legend = "; ".join(f"{name}: {PROVENANCE[name]}" for name in used)
    return f"{bullets(lines)}\n\n{fill(f'({legend}.)')}" if lines else ""


def _chapter(chapter: Chapter) -> str:
    return "\n\n".join(text for block in chapter.blocks if (text := _block(block)))


def _block(block: Block) -> str:
    match block:
        case Prose():
            return fill(block.text)
        case Bullets():
            return bullets(block.items)
        case WebTable() | SortableTable() | Bars():
            return f"{fill(block.caption)}:\n{table(block.header, block.rows)}"
        case ResponseSurface():
            return f"{fill(block.header[0].capitalize())}:\n{table(block.header, block.rows)}"
        case Verbatim():
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


def _repeat(page: WebPage) -> str:
    given = page.repeat
    versions = ", ".join(f"{name} {version}" for name, version in given.versions.items())
    numbers = ", ".join(f"{name} {value}" for name, value in given.numbers.items())
    lines = [given.command, *(fill(text) for text in (numbers, versions) if text)]
    return "\n".join(line for line in lines if line) or "From Python."


def listing(files: Sequence[ReportFile]) -> str:
    """Return a report's files and what each shows."""
    return "\n".join(f"{', '.join(path.name for path in entry.paths)}\n{fill(entry.shows, ' ' * 4)}" for entry in files)
