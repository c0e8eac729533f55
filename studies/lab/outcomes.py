"""What was said of drawn recordings: in a line, in a study's table, and counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import binomtest


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


def said_line(task: str, verdict: str, models: Sequence[Sequence[str]], seconds: float) -> str:
    """Return a line for progress: the verdict with its explanations, and the processor's s."""
    said = verdict + "".join(" " + "+".join(names) for names in models)
    return f"{task}: {said} ({seconds:.0f} s)"
