"""What stands above a table's numbers: the columns' names, perhaps their units, and perhaps other tables."""

import re
from collections.abc import Sequence

import numpy as np

from legfem.data.formats.labels import WORDS, Quantity, name_and_unit, names_quantity, unit_named

type Cell = str | float | None


def cell_at(row: Sequence[Cell], k: int) -> Cell:
    """Return a row's cell; None beyond its end."""
    return row[k] if k < len(row) else None


def text_of(cell: Cell) -> str:
    """Return what a cell says, without spaces around it."""
    return str(cell or "").strip()


def line_of(row: Sequence[Cell]) -> str:
    """Return what a row says as one line of text."""
    return " ".join(f"{cell:g}" if isinstance(cell, float) else text_of(cell) for cell in row)


def width_of(row: Sequence[Cell]) -> int:
    """Return the number of cells without empty ones at the end."""
    filled = [k for k, cell in enumerate(row) if cell not in (None, "")]
    return filled[-1] + 1 if filled else 0


def titles_and_units(
    above: Sequence[Sequence[Cell]], columns: Sequence[int]
) -> tuple[Sequence[Cell] | None, list[str | None] | None]:
    """Return the row of names and, where they have a row of their own, the columns' units.

    Of several rows that are wide enough the names are the one most of whose cells name a quantity or a unit.
    """
    above = [_paired(row, len(columns)) for row in _with_names_of_channels(_without_keys(above))]
    rows: list[Sequence[Cell]] = [*_listed(above, columns)]
    rows = rows or [row for row in above if _says(row, columns)]
    if not rows:
        return None, None
    full = [[text_of(cell_at(row, c)) for c in columns] for row in rows]
    labelled = [sum(map(names_something, cells)) > 1 for cells in full]
    # A clock's, or a count's, unit may be any word.
    # Those of another table, above the names, are none.
    able = [k for k in reversed(range(len(full))) if k == 0 or not any(labelled[k + 1 :])]
    units = next((k for k in able if _are_units(full[k], half=any(labelled[:k]))), None)
    # Above the units, or below where nothing stands above; a row of units alone names the columns too.
    first, last = (0, units or len(full)) if units != 0 else (min(1, len(full) - 1), len(full))
    scores = [sum(map(names_something, cells)) for cells in full[first:last]]
    named = last - 1 - int(np.argmax(scores[::-1]))
    stated = None if units is None else [text.strip("()[]<> ") or None for text in full[units]]
    return rows[named], stated


def _paired(row: Sequence[Cell], count: int) -> Sequence[Cell]:
    """Return a row of names each followed by its unit, as ``Time;s;Force;N`` above two columns, as a row of labels."""
    units = [text_of(cell) for cell in row[1::2]]
    if len(units) != count or width_of(row) != 2 * count or not all(map(unit_named, units)):
        return row
    return [f"{text_of(name)} ({unit})" for name, unit in zip(row[::2], units, strict=True)]


def _are_units(cells: Sequence[str], half: bool = False) -> bool:
    """Tell whether a row holds units: most of what it holds are known, or with ``half`` half of it."""
    bare = [text.strip("()[]<> ") for text in cells if text]
    known = sum(unit_named(text) is not None for text in bare)
    return known > 0.5 * len(bare) or (half and 2 * known == len(bare) > 2)


def _says(row: Sequence[Cell], columns: Sequence[int]) -> bool:
    """Tell whether a row says something of all columns, or the units of those that have one."""
    cells = [cell_at(row, c) for c in columns]
    texts = [text_of(cell) for cell in cells if isinstance(cell, str) and text_of(cell)]
    if 2 * len(texts) < sum(cell not in (None, "") for cell in cells) or not texts:
        return False
    units = len(texts) > 1 and 2 * len(texts) > len(columns) and all(map(unit_named, texts))
    # The last columns may have no names, as flags behind each reading.
    named = len(row) > columns[-1] and len(quantities_of(texts)) == len(_OF_A_PRESS)
    return width_of(row) > columns[-1] or units or named


_LISTED = re.compile(
    r"#?\s*(?:sig|signal|col|column|channel|ch|kanal|spalte|canal|canale|voie|kanał)?\s*\.?\s*"
    r"(?P<number>\d+)(?![\d.,])\s*[:=]?\s*(?P<label>.*)",
    re.IGNORECASE,
)


_VALUED = re.compile(r"[:=]\s*[\d.,]+\s*[^\W\d_]*$")
"""At the end of what is stated of a channel, and is no name."""


def _listed(above: Sequence[Sequence[Cell]], columns: Sequence[int]) -> list[list[Cell]]:
    """Return the names that stand a line each above the numbers, as ``Sig1  Time (min)``, as one row."""
    listed = [one for row in above if (one := _LISTED.fullmatch(line_of(row).strip()))]
    found = [one for one in listed if names_something(one["label"]) and not _VALUED.search(one["label"])]
    labels = {int(one["number"]): one["label"].strip() for one in found}
    if sorted(labels) not in ([c + 1 for c in columns], list(columns)):
        return []
    row: list[Cell] = [None] * (columns[-1] + 1)
    for c, number in zip(columns, sorted(labels), strict=True):
        row[c] = labels[number]
    return [row]


_KEY = re.compile(r"(?P<key>\w+)=")
_NAMES_OF_CHANNELS, _RANGES = "ChannelTitle", "Range"


def _without_keys(above: Sequence[Sequence[Cell]]) -> list[Sequence[Cell]]:
    """Return rows in which LabChart's keys are names and units: ``ChannelTitle=``, and ``Range=`` with ``20.0 N``."""
    keyed = {found["key"]: row for row in above if (found := _KEY.fullmatch(text_of(cell_at(row, 0))))}
    if _NAMES_OF_CHANNELS not in keyed:
        return list(above)
    names = ["Time", *keyed[_NAMES_OF_CHANNELS][1:]]
    units = ["s", *(text_of(cell).rpartition(" ")[2] for cell in keyed.get(_RANGES, ())[1:])]
    stated = any(name_and_unit(text_of(name))[1] for name in names)
    return [["Time (s)", *names[1:]]] if stated or len(units) < len(names) else [names, units]


_COUNT_OF_CHANNELS = re.compile(r"(?P<count>\d+) channels?", re.IGNORECASE)
_CHANNEL = re.compile(r"CH ?\d+", re.IGNORECASE)


def _with_names_of_channels(above: Sequence[Sequence[Cell]]) -> list[Sequence[Cell]]:
    """Return rows in which AcqKnowledge's ``CH1``, ``CH2`` are the names and units that stand a line each above."""
    lines = [" ".join(text_of(cell) for cell in row if cell is not None) for row in above]
    begin, found = next(
        ((k, f) for k, line in enumerate(lines) if (f := _COUNT_OF_CHANNELS.fullmatch(line))), (0, None)
    )
    count = int(found["count"]) if found else 0
    stated = [line for line in lines[begin + 1 :] if line][: 2 * count]
    labels = [f"{name} ({unit})" for name, unit in zip(stated[::2], stated[1::2], strict=False)]
    return [
        _renamed(row, labels) if labels and sum(map(bool, map(_CHANNEL.fullmatch, map(text_of, row)))) == count else row
        for row in above
    ]


def _renamed(row: Sequence[Cell], labels: Sequence[str]) -> list[Cell]:
    """Return a row of names in which the channels' have their labels, in turn."""
    left = iter(labels)
    return [
        next(left, cell)
        if _CHANNEL.fullmatch(text_of(cell))
        else (f"Time ({cell})" if (unit := unit_named(text_of(cell))) and unit.quantity == "time" else cell)
        for cell in row
    ]


_OF_A_PRESS: tuple[Quantity, ...] = ("time", "displacement", "force")


def quantities_of(labels: Sequence[str]) -> set[Quantity]:
    """Return which of a recording's quantities labels name, or state units of."""
    units = [unit_named(unit) for label in labels if (unit := name_and_unit(label)[1])]
    found = {unit.quantity for unit in units if unit is not None}
    return {q for q in _OF_A_PRESS if q in found or any(names_quantity(label, q) for label in labels)}


def names_something(label: str) -> bool:
    """Tell whether a label names a quantity, or a unit that is known."""
    name, unit = name_and_unit(label)
    if unit is not None and name and unit_named(unit) is not None:
        return True
    return any(re.search(words, label, re.IGNORECASE) for words in WORDS.values())


_FEWEST_OF_A_TABLE = 3
"""Rows of numbers that are a table of their own."""


def only_block(rows: Sequence[Sequence[Cell]]) -> tuple[Sequence[Sequence[Cell]], tuple[str, ...]]:
    """Return rows in which other tables than the longest one are empty, and a remark on each of them.

    A table begins with a row of names; above the first that names quantities another may stand, with any names. One
    that has the longest one's names, or all quantities of it, may be another trial: it stays, and is refused as one.
    """
    heads = [k for k, row in enumerate(rows) if _texts(row) > 1 and sum(map(names_something, _names(row))) > 1]
    if not heads:
        return rows, ()
    begins = [
        k for i, k in enumerate(heads) if _count(rows[k : (heads[i + 1 :] or [len(rows)])[0]]) >= _FEWEST_OF_A_TABLE
    ]
    if begins and (first := next((k for k in range(begins[0]) if _texts(rows[k]) > 1), None)) is not None:
        begins = [first, *begins] if _count(rows[first : begins[0]]) >= _FEWEST_OF_A_TABLE else begins
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


def _texts(row: Sequence[Cell]) -> int:
    """Return how many texts a row without a number has."""
    return 0 if _numbers(row) else sum(bool(text_of(cell)) for cell in row)


def _names(row: Sequence[Cell]) -> list[str]:
    return [text_of(cell) for cell in row if text_of(cell)]


def _numbers(row: Sequence[Cell]) -> int:
    return sum(isinstance(cell, float) for cell in row)


def _count(rows: Sequence[Sequence[Cell]]) -> int:
    return sum(_numbers(row) > 1 for row in rows)
