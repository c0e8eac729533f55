"""Curves of a page: two panels over one abscissa, as a script, a figure and a table show them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, Literal

import numpy as np

from legfem.common.units import FloatArray
from legfem.report.style import DATA_COLOUR

Dash = Literal["solid", "dashed", "dotted", "dotdash"]
_MOST_ROWS = 25


@dataclass(frozen=True, eq=False)
class Line:
    """One curve in both panels."""

    name: str
    above: FloatArray | None
    """(n,)."""
    below: FloatArray | None
    """(n,): the difference; None where it has none."""
    colour: str = DATA_COLOUR
    dash: Dash = "solid"
    points: bool = False
    """Whether it is drawn as points, not as a line."""
    faint: bool = False
    """Whether it is one of many, drawn thin."""
    tabled: bool = True
    """Whether it stands in the table behind the plot and under the cursor."""


@dataclass(frozen=True, eq=False)
class Curves:
    """Two panels over one abscissa, or one."""

    kind: ClassVar[str] = "curves"
    name: str
    """Short, without spaces; one of its own in a page."""
    caption: str
    """What is seen, in words: also for those who can't see it."""
    x: FloatArray
    """(n,)."""
    x_label: str
    above_label: str
    below_label: str
    """Empty for no lower panel."""
    lines: Sequence[Line]
    band: FloatArray | None = None
    """(n,): half the width of a band: about zero in the lower panel, else about the first line."""
    band_name: str = ""
    located: Sequence[tuple[float, float]] = ()
    """Stretches of the abscissa that are marked in the lower panel."""
    located_name: str = ""

    @property
    def header(self) -> list[str]:
        """Return that of the table behind the plot."""
        names = [line.name for line in self.lines if line.tabled]
        return [self.x_label, *(f"{name}: {self.above_label}" for name in names)]

    @property
    def rows(self) -> list[list[str]]:
        """Return the rows of the table behind the plot."""
        picked = np.unique(np.linspace(0, len(self.x) - 1, _MOST_ROWS).round().astype(int))
        tabled = [line.above for line in self.lines if line.tabled and line.above is not None]
        return [
            [f"{self.x[k]:.2f}", *(f"{a[k]:.3f}" if np.isfinite(a[k]) else "–" for a in tabled)]
            for k in picked.tolist()
        ]

    @property
    def data(self) -> dict[str, Any]:
        """What ``plots.js`` reads."""
        band = []
        if self.band is not None:
            about = None if self.below_label else self.lines[0].above
            middle = np.zeros(len(self.x)) if about is None else about
            band = [
                [_listed(values[way]) for values in (self.x, middle - self.band, middle + self.band)]
                for way in ways(self.x)
            ]
        return {
            "x": _listed(self.x),
            "label": self.x_label,
            "labels": [self.above_label, self.below_label],
            "lines": [
                {
                    "name": line.name,
                    "values": [_listed(line.above), _listed(line.below)],
                    "colour": line.colour,
                    "dash": line.dash,
                    "points": line.points,
                    "faint": line.faint,
                    "read": line.tabled,
                }
                for line in self.lines
            ],
            "band": band,
            "located": joined(self.located),
        }


def _listed(values: FloatArray | None) -> list[float | None] | None:
    """Return numbers as JSON has them, of six digits; None where there is none."""
    if values is None:
        return None
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in map(float, values)]


def ways(x: FloatArray) -> list[slice]:
    """Return where an abscissa goes on one way: a band that turns back on itself isn't filled."""
    signs = np.sign(np.diff(x))
    moving = np.flatnonzero(signs)
    turns = moving[1:][np.diff(signs[moving]) != 0]
    return [slice(a, b + 1) for a, b in pairwise([0, *turns.tolist(), len(x) - 1])]


def joined(stretches: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stretches in their order, those that overlap as one."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(stretches):
        if joined and low <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((float(low), float(high)))
    return joined
