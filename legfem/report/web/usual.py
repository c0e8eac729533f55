"""Whether a stiffness is high or low, for someone who has seen no other."""

from __future__ import annotations

import math

from legfem.data.ranges import PUBLISHED_C10, Published
from legfem.report.style import REGION_NAMES

QUESTION = "Is that high or low"
_BEYOND = ("Softer than", "Stiffer than")
_END = 0.25
"""Share of a published range, on a logarithmic scale, that is called its end."""


def high_or_low(tissue: str, low: float, high: float | None = None) -> list[tuple[str, str]]:
    """Return a question with its answer; none where nothing was published.

    Parameters
    ----------
    tissue
        Of a leg: ``deep``, ``superficial``.
    low, high
        C10 (kPa), or the range in which it lies.
    """
    known = PUBLISHED_C10.get(tissue)
    if known is None:
        return []
    name = REGION_NAMES[tissue].partition("(")[2].rstrip(")") or REGION_NAMES[tissue]
    place = _place(known, low, low if high is None else high)
    check = " Check the units of force and displacement first." if place in _BEYOND else ""
    return [
        (
            QUESTION,
            f"{place} what was published for {name}: {known.low:g} to {known.high:g} {known.unit} "
            f"({known.source}).{check}",
        )
    ]


def _place(known: Published, low: float, high: float) -> str:
    if high < known.low:
        return _BEYOND[0]
    if low > known.high:
        return _BEYOND[1]
    if low < known.low or high > known.high:
        return "Partly outside of"
    ends = [math.log(v / known.low) / math.log(known.high / known.low) for v in (low, high)]
    if max(ends) < _END:
        return "At the soft end of"
    if min(ends) > 1 - _END:
        return "At the stiff end of"
    return "Within"
