"""A page as Markdown, for notes, issues and electronic lab books."""

import re
from collections.abc import Sequence

from legfem.report.curves import Curves
from legfem.report.many import SortableTable
from legfem.report.page import (
    PROVENANCE,
    TONES,
    Bars,
    Block,
    Bullets,
    Chapter,
    PressedSection,
    Prose,
    ResponseSurface,
    TurnedLeg,
    Verbatim,
    WebPage,
    WebTable,
)
from legfem.report.words import ORIGINS

MARKDOWN = "report.md"
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>|#~])")


def markdown_page(page: WebPage) -> str:
    """All that a page says, as Markdown (CommonMark with GitHub's tables)."""
    given = page.headline
    parts = [
        f"# {_text(page.title)}",
        f"{_text(page.subject)}. **{_text(page.data or ORIGINS[page.origin])}**",
        f"**{_text((given.heading or TONES[given.tone]).rstrip('.'))}.** {_text(given.sentence)}",
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
            _bullets([f"{name}: {PROVENANCE[name]}" for name in used]),
        ]
    parts += markdown_chapters(page.chapters)
    versions = ", ".join(f"{name} {version}" for name, version in page.repeat.versions.items())
    command = [_code(page.repeat.command)] if page.repeat.command else []
    return "\n\n".join([*parts, "## How to repeat it", *command, _text(versions)]) + "\n"


def markdown_chapters(chapters: Sequence[Chapter]) -> list[str]:
    """Headings and blocks of the chapters that have anything to be read."""
    parts = []
    for chapter in chapters:
        blocks = [text for block in chapter.blocks if (text := _block(block))]
        parts += [f"## {_text(chapter.title)}", *blocks] if blocks else []
    return parts


def _block(block: Block) -> str:
    """A block; nothing of one that is only to be looked at."""
    match block:
        case Prose():
            return _text(block.text)
        case Bullets():
            return _bullets(block.items)
        case WebTable() | SortableTable() | Bars() | Curves() | PressedSection() | TurnedLeg() | ResponseSurface():
            return f"{_text(block.caption)}\n\n{_table(block.header, block.rows)}"
        case Verbatim():
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
