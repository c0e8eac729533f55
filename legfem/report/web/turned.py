"""A leg in 3D on a page: its surfaces as grids, which a reader turns and dresses with a slider.

Drawn on a canvas by a script of the page's own: the grids are a few thousand facets, and a library
for it (three.js in trimesh's viewer: 0.7 MB, k3d: 2.6 MB, Plotly: 4.8 MB) would outweigh all else.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.report.leg_directions import Directions
from legfem.report.style import BONE_COLOUR, REGION_COLOURS
from legfem.report.web.packed import packed

_POINTS = 120
"""Of a contour, at most."""
_PLACE, _MOVE, _VALUE = 0.02, 1 / 1000, 1 / 10_000
"""mm, mm, and share of a field's range a count: what whole numbers of 16 bits hold of them."""


@dataclass(frozen=True, eq=False)
class SkinField:
    """Numbers on the skin that colour it."""

    name: str
    unit: str
    values: FloatArray
    """(n_levels, n_points), of the dressed leg."""
    bare: float = 0.0
    """Of the bare leg."""


@dataclass(frozen=True, eq=False)
class Marked:
    """A point inside the leg that is named."""

    name: str
    position: FloatArray
    """(3,), mm."""


@dataclass(frozen=True)
class TurnedLeg:
    """A leg that is turned, and dressed with a slider."""

    kind: ClassVar[str] = "turned"
    caption: str
    data: str
    """JSON for ``turn.js``."""
    fields: Sequence[str]
    """Names of the skin's colours."""
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """The same as a table: a row a height."""
    tissues: ClassVar[list[tuple[str, str]]] = [
        ("muscle", REGION_COLOURS["deep"]), ("bone (fixed)", BONE_COLOUR)
    ]  # fmt: skip


def turned_leg(
    bare: LegShape,
    moved: Mapping[str, FloatArray],
    fields: Sequence[SkinField],
    marked: Sequence[Marked],
    caption: str,
) -> TurnedLeg:
    """Return a leg for a page.

    Parameters
    ----------
    bare
        Without the stocking.
    moved
        Displacement (mm) of skin's and hull's points, (n_levels, n_points, 3) each.
    fields
        Of the skin.
    marked
        Points that are named, of the bare leg.
    caption
        What is seen, in words.
    """
    directions = Directions.of(bare)
    middle = bare.contours[SKIN].mean(axis=(0, 1))
    centre = np.array([*middle, bare.levels.mean()])
    parts = []
    for part in bare.parts:
        step = max(1, -(-bare.contours[part].shape[1] // _POINTS))
        points = bare.points(part)[:, ::step] - centre
        entry: dict[str, object] = {
            "name": part,
            "shape": points.shape[:2],
            "at": packed(points / _PLACE, "<i2"),
            "moves": packed(moved[part][:, ::step] / _MOVE, "<i2") if part in moved else None,
            "colour": REGION_COLOURS["deep"] if part == HULL else BONE_COLOUR,
        }
        if part == SKIN:
            entry["fields"] = [_field(field, step) for field in fields]
        parts.append(entry)
    content = {
        "parts": parts,
        "mm_a_count": [_PLACE, _MOVE],
        "share_a_count": _VALUE,
        "marked": [{"name": m.name, "at": (m.position - centre).round(2).tolist()} for m in marked],
        "views": [directions.at(45.0 * k) for k in range(8)],
        "height": bare.length,
        "reach": float(np.abs(bare.points(SKIN) - centre)[..., :2].max()),
    }
    return TurnedLeg(
        caption, json.dumps(content), [f.name for f in fields], _header(fields),
        _rows(bare, moved[SKIN], fields),
    )  # fmt: skip


def _field(field: SkinField, step: int) -> dict[str, object]:
    low, high = min(float(field.values.min()), field.bare), float(field.values.max())
    high = max(high, field.bare, low + 1e-9)
    shares = (field.values[:, ::step] - low) / (high - low)
    return {
        "name": field.name, "unit": field.unit, "range": [low, high], "bare": field.bare,
        "values": packed(shares / _VALUE, "<u2"),
    }  # fmt: skip


def _header(fields: Sequence[SkinField]) -> list[str]:
    each = [f"{f.name} ({f.unit}): {which}" for f in fields for which in ("mean", "least", "most")]
    return ["height z (mm)", "girth, bare (mm)", "girth, dressed (mm)", *each]


def _rows(bare: LegShape, moved: FloatArray, fields: Sequence[SkinField]) -> list[list[str]]:
    def girths(points: FloatArray) -> FloatArray:
        return np.linalg.norm(np.diff(points, axis=1, append=points[:, :1]), axis=2).sum(axis=1)

    points = bare.points(SKIN)
    before, after = girths(points), girths(points + moved)
    return [
        [
            f"{level:.0f}", f"{before[k]:.1f}", f"{after[k]:.1f}",
            *(f"{value:.1f}" for f in fields
              for value in (f.values[k].mean(), f.values[k].min(), f.values[k].max())),
        ]
        for k, level in enumerate(bare.levels)
    ]  # fmt: skip
