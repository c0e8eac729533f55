"""Text in lines of a page's width."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

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
