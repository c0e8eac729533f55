"""A leg in 3D on a page: its surfaces as grids, which a reader turns, and loads with a slider.

Drawn on a canvas by a script of the page's own: the grids are a few thousand facets, and a library
for it (three.js in trimesh's viewer: 0.7 MB, k3d: 2.6 MB, Plotly: 4.8 MB) would outweigh all else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.report.page import Slider, TurnedLeg, View
from legfem.report.style import BONE_COLOUR, REGION_COLOURS, TOOL_COLOUR
from legfem.report.web.packed import packed

_TOOL = "tool"
_POINTS = 120
"""Of a contour, at most."""
_PLACE, _MOVE, _VALUE = 0.02, 1 / 800, 1 / 10_000
"""mm, mm, and share of a field's range a count: what whole numbers of 16 bits hold of them."""


type Told = Literal["mean", "most"]


@dataclass(frozen=True, eq=False)
class SkinField:
    """Numbers on the skin that colour it."""

    name: str
    unit: str
    values: FloatArray
    """(n_states, n_levels, n_points)."""
    told: Told = "mean"
    """What is said of it beside the slider."""


@dataclass(frozen=True, eq=False)
class Marked:
    """A point inside the leg that is named."""

    name: str
    position: FloatArray
    """(3,), mm."""


@dataclass(frozen=True, eq=False)
class Tool:
    """A rigid grid of points that touches the leg, drawn so that the leg is seen through it."""

    points: FloatArray
    """(n_levels, n_points, 3), mm, in the first state."""
    moves: FloatArray
    """(n_states, 3), mm."""


def turned_leg(
    shape: LegShape,
    moved: Mapping[str, FloatArray],
    fields: Sequence[SkinField],
    slider: Slider,
    view: View,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    caption: str,
    marked: Sequence[Marked] = (),
    tool: Tool | None = None,
) -> TurnedLeg:
    """Return a leg for a page.

    Parameters
    ----------
    shape
        Without load; its front is at -y.
    moved
        Displacement (mm) of skin's and hull's points, (n_states, n_levels, n_points, 3) each.
    fields
        Of the skin.
    slider, view
        What is moved, and how it is looked at.
    header, rows
        The same as a table.
    caption
        What is seen, in words.
    marked
        Points that are named, of the leg without load.
    tool
        What touches it.
    """
    middle = shape.contours[SKIN].mean(axis=(0, 1))
    centre = np.array([*middle, shape.levels.mean()])
    parts = []
    for part in shape.parts:
        step = max(1, -(-shape.contours[part].shape[1] // _POINTS))
        entry = _part(part, shape.points(part)[:, ::step] - centre)
        if part in moved:
            entry["moves"] = packed(moved[part][:, :, ::step] / _MOVE, "<i2")
        if part == SKIN:
            entry["fields"] = [_field(field, step) for field in fields]
        parts.append(entry)
    if tool is not None:
        entry = _part(_TOOL, tool.points - centre)
        moves = np.broadcast_to(tool.moves[:, None, None], (len(tool.moves), *tool.points.shape))
        parts.append({**entry, "moves": packed(moves / _MOVE, "<i2")})
    reach = max(float(np.abs(shape.points(SKIN) - centre)[..., :2].max()), _reach(tool, centre))
    content = {
        "parts": parts,
        "mm_a_count": [_PLACE, _MOVE],
        "share_a_count": _VALUE,
        "marked": [{"name": m.name, "at": (m.position - centre).round(2).tolist()} for m in marked],
        "stops": list(slider.stops),
        "force": list(slider.force),
        "unit": slider.unit,
        "digits": slider.digits,
        "views": list(view.names),
        "height": shape.length,
        "reach": reach,
    }
    return TurnedLeg(caption, content, slider, view, [f.name for f in fields], header, rows)


def _part(name: str, points: FloatArray) -> dict[str, object]:
    colours = {HULL: REGION_COLOURS["deep"], _TOOL: TOOL_COLOUR}
    return {
        "name": name,
        "shape": points.shape[:2],
        "at": packed(points / _PLACE, "<i2"),
        "moves": None,
        "colour": colours.get(name, BONE_COLOUR),
    }


def _reach(tool: Tool | None, centre: FloatArray) -> float:
    """Return how far to the side a tool is seen in its last state, at most (mm)."""
    if tool is None:
        return 0.0
    there = tool.points + tool.moves[-1] - centre
    return float(np.linalg.norm(there[..., :2], axis=-1).max())


def _field(field: SkinField, step: int) -> dict[str, object]:
    low, high = float(field.values.min()), float(field.values.max())
    high = max(high, low + 1e-9)
    shares = (field.values[:, :, ::step] - low) / (high - low)
    return {
        "name": field.name,
        "unit": field.unit,
        "range": [low, high],
        "told": field.told,
        "values": packed(shares / _VALUE, "<u2"),
    }
