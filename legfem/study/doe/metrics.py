"""What a study looks at: slope and curvature of the force in windows of displacement."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from legfem.solve.path import ForceCurve


@dataclass(frozen=True)
class Metric:
    """A number taken from a curve of force per unit length of the cylinder."""

    kind: Literal["curvature", "slope"]
    start: float
    """mm."""
    end: float
    """mm."""

    @property
    def name(self) -> str:
        """The name as a formula and a column of a table have it."""
        return f"{self.kind}_{self.start:g}_{self.end:g}".replace(".", "p")

    @property
    def label(self) -> str:
        """The name as people read it."""
        return f"{self.kind} {self.start:g}-{self.end:g} mm"

    @property
    def unit(self) -> str:
        """Of the force per length."""
        return "N/mm2" if self.kind == "slope" else "N/mm3"

    @property
    def typeset_unit(self) -> str:
        """The unit as a figure has it."""
        return self.unit.replace("mm2", "mm²").replace("mm3", "mm³")

    def of(self, curve: ForceCurve) -> float:
        """Return the metric; NaN where the curve ends before the window does."""
        if curve.depth < self.end - 1e-9:
            return math.nan
        mean = curve.mean_slope if self.kind == "slope" else curve.mean_curvature
        return mean(self.start, self.end)


def metrics_in(windows: tuple[tuple[float, float], ...]) -> tuple[Metric, ...]:
    """Return the metrics in the order of the paper's Table 3."""
    return tuple(Metric("curvature", *window) for window in windows) + tuple(
        Metric("slope", *window) for window in windows
    )
