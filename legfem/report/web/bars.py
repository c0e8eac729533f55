"""Numbers as bars in a table, with their intervals: readable without colours and without bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class LabelledBar:
    """One number."""

    name: str
    value: float
    text: str
    """Value and interval as people read them."""
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class DrawnBar:
    """A bar in per cent of the width."""

    name: str
    text: str
    width: float
    interval: tuple[float, float] | None


@dataclass(frozen=True)
class Bars:
    """Numbers of one unit beside each other."""

    kind: ClassVar[str] = "bars"
    caption: str
    header: tuple[str, str]
    """Of names and of values."""
    bars: Sequence[LabelledBar]
    least: float = 0.0
    """Where bars begin."""
    greatest: float | None = None
    """Where they may end; the greatest value's or interval's end by default."""

    @property
    def drawn(self) -> list[DrawnBar]:
        """Return the bars as they are drawn."""
        ends = [max(b.value, b.interval[1] if b.interval else b.value) for b in self.bars]
        greatest = max(ends, default=1.0) if self.greatest is None else self.greatest
        span = greatest - self.least

        def at(value: float) -> float:
            share = (value - self.least) / span if span > 0 else 0.0
            return round(100 * min(max(share, 0.0), 1.0), 2)

        return [
            DrawnBar(b.name, b.text, at(b.value), (at(b.interval[0]), at(b.interval[1])) if b.interval else None)
            for b in self.bars
        ]
