"""A recording's rows among other tables in one file: results above it, a calibration, statistics below."""

from collections.abc import Sequence

from legfem.data.formats.headings import Cell, names_something, quantities_of, text_of

_FEWEST = 3
"""Rows of numbers that are a table of their own."""


def only_block(rows: Sequence[Sequence[Cell]]) -> tuple[Sequence[Sequence[Cell]], tuple[str, ...]]:
    """Return rows in which other tables than the longest one are empty, and a remark on each of them.

    A table begins with a row of names; above the first that names quantities another may stand, with any names. One
    that has the longest one's names, or all quantities of it, may be another trial: it stays, and is refused as one.
    """
    heads = [k for k, row in enumerate(rows) if _is_heading(row)]
    if not heads:
        return rows, ()
    begins = [k for i, k in enumerate(heads) if _count(rows[k : (heads[i + 1 :] or [len(rows)])[0]]) >= _FEWEST]
    if begins and (first := next((k for k in range(begins[0]) if _texts(rows[k]) > 1), None)) is not None:
        begins = [first, *begins] if _count(rows[first : begins[0]]) >= _FEWEST else begins
    if len(begins) < 2:
        return rows, ()
    spans = list(zip(begins, [*begins[1:], len(rows)], strict=True))
    longest = max(spans, key=lambda span: _count(rows[slice(*span)]))
    names = _names(rows[longest[0]])
    needed = quantities_of(names)
    kept, told = list(rows), []
    for begin, end in spans:
        labels = _names(rows[begin])
        if (begin, end) == longest or labels == names or needed <= quantities_of(labels):
            continue
        # The next heading's own lines stand above it.
        last = max(k for k in range(begin, end) if _numbers(rows[k]) > 1) + 1
        kept[begin:last] = [[]] * (last - begin)
        told.append(f"another table is passed over: lines {begin + 1} to {last}, of {', '.join(map(repr, labels[:4]))}")
    return kept, tuple(told)


def _is_heading(row: Sequence[Cell]) -> bool:
    return _texts(row) > 1 and sum(map(names_something, _names(row))) > 1


def _texts(row: Sequence[Cell]) -> int:
    """Return how many texts a row without a number has."""
    return 0 if _numbers(row) else sum(bool(text_of(cell)) for cell in row)


def _names(row: Sequence[Cell]) -> list[str]:
    return [text_of(cell) for cell in row if text_of(cell)]


def _numbers(row: Sequence[Cell]) -> int:
    return sum(isinstance(cell, float) for cell in row)


def _count(rows: Sequence[Sequence[Cell]]) -> int:
    return sum(_numbers(row) > 1 for row in rows)
