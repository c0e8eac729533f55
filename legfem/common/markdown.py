"""Tables in Markdown, which also read as plain text."""

from __future__ import annotations

from collections.abc import Sequence


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], aligned: bool = False) -> str:
    """Return a table, its columns aligned if asked for; a bar within a cell becomes "or"."""
    lines = [[cell.replace("|", "or") for cell in line] for line in (header, *rows)]
    widths = [max(map(len, column)) if aligned else 0 for column in zip(*lines, strict=True)]

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(c.ljust(w) for c, w in zip(cells, widths, strict=True)) + " |"

    rule = "|" + "|".join("-" * max(width + 2, 3) for width in widths) + "|"
    return "\n".join([line(lines[0]), rule, *map(line, lines[1:])]) + "\n"
