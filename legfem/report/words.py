"""Numbers as words and cells of a diagnosis' page."""

from __future__ import annotations

import math


def probability(p: float | None) -> str:
    """Return a p-value as people write it; draws tell none below 0.0005."""
    if p is None or math.isnan(p):
        return "p unknown"
    return "p < 0.001" if p < 1e-3 else f"p = {p:.2g}"


def short_probability(p: float | None) -> str:
    """Return a p-value as a table's cell."""
    return probability(p).removeprefix("p = ").removeprefix("p ")


def number(value: float, spread: float = math.nan) -> str:
    """Return a number with the digits that its uncertainty leaves, three without one.

    Parameters
    ----------
    value
        The number.
    spread
        Its standard error.
    """
    if not math.isfinite(value):
        return "-"
    if value == 0 and not (math.isfinite(spread) and spread > 0):
        return "0"
    if math.isfinite(spread) and spread > 0:
        digits = -math.floor(math.log10(0.65 * spread))
        return f"{value:.{min(max(digits, 0), 6)}f}"
    return f"{value:.3g}"
