"""Cells of the studies' tables: texts, from named rows or from columns of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from legfem.common.units import FloatArray

type Cells = tuple[list[str], list[list[str]]]
"""A table's header and rows."""


def row_cells(rows: Iterable[Mapping[str, str]]) -> Cells:
    """Cells of rows that name their columns alike."""
    given = list(rows)
    return list(given[0]) if given else ["nothing to show"], [list(row.values()) for row in given]


def column_cells(columns: Mapping[str, tuple[str, FloatArray]]) -> Cells:
    """Cells of columns (n,), each with its format; a number that isn't known is a dash."""
    texts = [["-" if np.isnan(value) else format(value, form) for value in values] for form, values in columns.values()]
    return list(columns), [list(row) for row in zip(*texts, strict=True)]
