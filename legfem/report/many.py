"""Blocks of a page that show thousands of things at once: tables that sort, intervals, and curves by group."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray


def packed(values: NDArray[Any], kind: str) -> str:
    """Return counts as text; what a whole number can't hold becomes the nearest that it can.

    Parameters
    ----------
    values
        Counts, in C order.
    kind
        NumPy's name of the type: ``<i2`` or ``<u2``.
    """
    limits = np.iinfo(np.dtype(kind))
    whole = np.clip(np.round(values), limits.min, limits.max).astype(kind)
    return base64.b64encode(whole.tobytes()).decode()


type Cell = str | float | tuple[float, str] | None
"""A text, a number, or a number (by which rows are sorted) with the text that is shown for it."""
_MOST_IN_TEXT = 60
_FINEST = 32000
"""Counts in the greatest value of a curve."""


def shown(cell: Cell) -> str:
    """Return what a reader sees of a cell."""
    if cell is None:
        return "–"
    if isinstance(cell, tuple):
        return cell[1]
    return cell if isinstance(cell, str) else f"{cell:.3g}"


@dataclass(frozen=True)
class Group:
    """Members that are drawn in one colour."""

    name: str
    colour: str


@dataclass(frozen=True)
class SortableTable:
    """A table that a reader sorts by any column and searches; only rows in view are drawn."""

    kind: ClassVar[str] = "sortable"
    name: str
    """Short, without spaces; one of its own in a page."""
    caption: str
    header: Sequence[str]
    cells: Sequence[Sequence[Cell]]
    links: Sequence[str] = ()
    """Of the rows' first cells; empty for none."""
    notes: Mapping[str, str] | None = None
    """What a column's short name means."""

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads."""
        return {"rows": self.cells, "links": self.links}

    @property
    def rows(self) -> list[list[str]]:
        """Return the first rows as texts, and how many more there are."""
        texts = [list(map(shown, row)) for row in self.cells[:_MOST_IN_TEXT]]
        left = len(self.cells) - len(texts)
        return [*texts, [f"and {left} more", *[""] * (len(self.header) - 1)]] if left else texts


@dataclass(frozen=True)
class ForestMetric:
    """One parameter of all members."""

    label: str
    unit: str
    values: Sequence[float | None]
    low: Sequence[float | None]
    high: Sequence[float | None]


@dataclass(frozen=True)
class Forest:
    """Values with their intervals, one line a member, sorted."""

    kind: ClassVar[str] = "forest"
    caption: str
    names: Sequence[str]
    groups: Sequence[Group]
    group: Sequence[int]
    """Number of each member's."""
    metrics: Sequence[ForestMetric]

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads."""
        return {
            "names": self.names,
            "colours": [one.colour for one in self.groups],
            "group": self.group,
            "metrics": [vars(one) for one in self.metrics],
        }


@dataclass(frozen=True, eq=False)
class Bundle:
    """Curves of all members over one abscissa, coloured by group."""

    kind: ClassVar[str] = "bundle"
    caption: str
    names: Sequence[str]
    groups: Sequence[Group]
    group: Sequence[int]
    x: FloatArray
    """(n,)."""
    x_label: str
    y_label: str
    values: FloatArray
    """(members, n); NaN where there is none."""

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads."""
        most = float(np.nanmax(np.abs(self.values), initial=0.0)) or 1.0
        counts = np.where(np.isfinite(self.values), self.values * (_FINEST / most), -_FINEST - 1)
        return {
            "names": self.names,
            "colours": [one.colour for one in self.groups],
            "group": self.group,
            "x": np.round(self.x, 3).tolist(),
            "labels": [self.x_label, self.y_label],
            "most": most,
            "finest": _FINEST,
            "counts": packed(counts, "<i2"),
        }
