"""What a column's label says: the quantity that it names, and the unit."""

import re
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

from legfem.common.resources import resource

Quantity = Literal["time", "displacement", "force", "pressure", "angle", "torque"]


class Unit(NamedTuple):
    """A unit as a multiple of legfem's own: s, mm, N, MPa, rad, N mm; others measure something else."""

    quantity: Quantity | None
    factor: float


_TABLES = resource("labels", dict[str, Any])
_KNOWN = {
    name: Unit(quantity, factor)
    for quantity, factors in _TABLES["units"].items()
    for names, factor in factors.items()
    for name in names.split()
} | {name: Unit(None, 1.0) for name in _TABLES["others"]["names"].split()}
UNIT_OF: dict[Quantity, str] = dict(zip(get_args(Quantity), ("s", "mm", "N", "kPa", "rad", "N.mm"), strict=True))
"""legfem's unit of each quantity."""


FORCE_OF: dict[str, str] = _TABLES["of_force"]
"""What a scale's unit of mass means where a force is measured in it."""
_WRONG_MICRO = re.compile(r"^(?:Â[µμ]|æ)(?=[mNs]$)")
"""A micro sign of UTF-8 read as cp1252, and one of cp437."""


def unit_named(name: str) -> Unit | None:
    """Return a unit by its name; None for one that isn't known.

    Capitals count in mN and MN, nm and Nm: nobody measures soft tissue in meganewtons, so that
    isn't known, and a newton metre is no length. A micro sign that was decoded by another code page is one.
    """
    # As in ``seconds since 2024-05-03``, of NetCDF.
    plain = name.partition(" since ")[0].strip(" ()[]<>").removeprefix("in ").rstrip(".").replace("μ", "µ")
    plain = _WRONG_MICRO.sub("µ", plain)
    if plain in ("Nm", "NM"):
        return Unit("torque", 1e3)
    return None if plain == "MN" else _KNOWN.get(plain.lower())


WORDS: dict[Quantity, str] = {quantity: "|".join(words) for quantity, words in _TABLES["words"].items()}
"""By which columns are named."""
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[(\[<{]\s*(?P<unit>[^)\]>}]*?)\s*[)\]>}]\s*$")
_AT_THE_END = re.compile(r"^(?P<name>.+?)(?:_|[,;:]\s*|\s*/\s*|\s+-\s+|\s+(?:in|en)\s+|\s+)(?P<unit>[^\W\d_]+\.?|%)$")

_BY_PROGRAMS = re.compile(r"^(?P<name>.+?)(?:\.\.(?P<unit_r>[^\W\d_]+)\.|_(?P<unit>[^\W\d_]+)_)$")
"""``Load..N.`` and ``Load_N_``: R and MATLAB write points and lines for all that can't be in their names."""
_BEFORE_A_RUN = re.compile(r"^(?P<name>[^(\[]+?)\s*[(\[](?P<unit>[^)\]]+)[)\]]\s*(?P<run>(?:#|[^\W\d_]{2,})[\w #.-]*)$")
"""``Force (N) Run #1``; what may be a factor is no run's name."""
_TIME_ALONE = re.compile(r"(?:millis|micros)(?:\(\))?|m?sec|ms|us|µs|seconds", re.IGNORECASE)
"""What a column of time is called by its unit alone."""


def name_and_unit(label: str) -> tuple[str, str | None]:
    """Part a column's label, such as ``Load (N)``, ``Kraft [N]`` or ``force_N``."""
    label = " ".join(label.split())
    label = label[1:-1].strip() if len(label) > 2 and label[0] == label[-1] == "'" else label
    bracketed = _IN_BRACKETS.match(label)
    before = _IN_BRACKETS.match(bracketed["name"]) if bracketed else None
    if bracketed and before and unit_named(bracketed["unit"]) is None and unit_named(before["unit"]):
        return f"{before['name']} ({bracketed['unit']})", before["unit"]
    if bracketed:
        return bracketed["name"].rstrip(" ,;:"), bracketed["unit"].removeprefix("in ") or None
    run = _BEFORE_A_RUN.match(label)
    if run and unit_named(run["unit"]) is not None:
        return f"{run['name']} {run['run']}", run["unit"]
    if _TIME_ALONE.fullmatch(label):
        return label, label.lower().removesuffix("()")
    ended = _AT_THE_END.match(label) or _BY_PROGRAMS.match(label)
    found = next((text for text in ended.groups()[1:] if text), "") if ended else ""
    return (ended["name"], found) if ended and unit_named(found) is not None else (label, None)


def one_unit(named: str | None, stated: str | None) -> str | None:
    """Return the unit that a column's name states, or what stands beside it; both where they differ, which is none."""
    if named and stated and (one := unit_named(named)) and (other := unit_named(stated)) and one != other:
        return f"{named} or {stated}"
    return stated or named


def names_quantity(label: str, quantity: Quantity) -> bool:
    """Tell whether a column is called like a quantity."""
    return re.search(WORDS[quantity], label, re.IGNORECASE) is not None


_SIZE = re.compile(
    r"(?i)(?:specimen|sample|test ?piece|(?:gau?ge|grip) (?=length)|initial|original|proben(?=\w)|anfangs|ausgangs|mess"
    rf"|einspann|[\W_])*(?:{'|'.join(f'(?P<{name}>{words})' for name, words in _TABLES['sizes'].items())})"
    r"(?:[\W_]|\b(?:[abdhls]0|of|the|de|della?|la|[ld]|specimen|sample|test ?piece|éprouvette|probeta|provino)\b)*"
)
"""A specimen's size alone: an indenter's diameter and a cable's length have another word."""
_LONGEST = 200
"""Characters of a line that states a size."""
_VALUED = re.compile(
    r"(?P<label>[^-]*?[^\W\d][^-]*?)[^\w-]*?(?:[(\[](?P<unit>[^)\]]+)[)\]])?[\s:=;,]*(?<![\w.,])(?P<value>\d+(?:[.,]\d+)?)\W*?"
    r"(?P<behind>[^\W\d]\S*)?\W*"
)


def sizes_in(rows: Sequence[Sequence[str | float | None]]) -> dict[str, float]:
    """Return a specimen's sizes by name (mm, mm²), as a heading states them: ``Diameter: 12.0 mm``, or above a number.

    What has no unit, or several values, isn't there.
    """
    found = []
    for k, row in enumerate(rows):
        line = _VALUED.fullmatch(" ".join(str(cell).strip() for cell in row if cell not in (None, ""))[:_LONGEST])
        if line is not None:
            found.append((line["label"], line["unit"] or line["behind"], float(line["value"].replace(",", "."))))
        for c, cell in enumerate(row):
            below = [other[c] for other in rows[k + 1 : k + 4] if c < len(other)]
            name, unit = name_and_unit(cell[:_LONGEST]) if isinstance(cell, str) else ("", None)
            units, numbers = [one for one in below[:1] if isinstance(one, str)], [*map(type, below)].count(float)
            if numbers == 1 and isinstance(number := below[len(units)], float):
                found.append((name, unit or "".join(units), number))
    told: dict[str, set[float]] = {}
    for label, unit, value in found:
        size = named.lastgroup if (named := _SIZE.fullmatch(label.replace(":", ""))) else None
        known = unit_named((unit or "").rstrip("²2^") if size == "area" else unit or "")
        if size and value > 0 and known and known.quantity == "displacement":
            told.setdefault(size, set()).add(value * known.factor ** (2 if size == "area" else 1))
    return {size: values.pop() for size, values in told.items() if len(values) == 1}
