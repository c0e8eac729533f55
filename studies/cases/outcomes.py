"""How outcomes are counted: shares with their intervals, and intervals beside truths."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.stats import binomtest

from legfem.inverse.estimates import Estimate


@dataclass(frozen=True)
class Rate:
    """A share with its 95 % interval (Clopper and Pearson)."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """The share; NaN of nothing."""
        return self.count / self.total if self.total else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share."""
        low, high = binomtest(self.count, self.total).proportion_ci(0.95)
        return float(low), float(high)

    def __str__(self) -> str:
        """Return it as text."""
        if not self.total:
            return "no case"
        low, high = self.interval
        return f"{self.count}/{self.total} = {self.share:.0%} ({low:.0%} to {high:.0%})"


@dataclass(frozen=True)
class Interval:
    """What was found of one parameter, kPa; of a ratio, without a unit."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, one: Estimate) -> Interval:
        """Return an estimate as people read it."""
        return cls(one.shown.value, *one.shown.ci95)

    @property
    def width(self) -> float:
        """Of the interval."""
        return self.high - self.low

    def covers(self, truth: float) -> bool:
        """Tell whether the interval holds a truth."""
        return self.low <= truth <= self.high

    def ends(self, truth: float) -> str:
        """Return both ends, with a star where they don't hold a truth."""
        return f"{self.low:.3f} to {self.high:.3f}{'' if self.covers(truth) else ' *'}"
