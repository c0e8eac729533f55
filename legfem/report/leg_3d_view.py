"""A leg in 3D on a page, pressed with a slider, and what colours its skin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.indenter_pose import LegIndenter, Pose
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.legs.details import PressedLeg
from legfem.report.curves import packed
from legfem.report.page import Slider, TurnedLeg, View
from legfem.report.style import BONE_COLOUR, REGION_COLOURS, TOOL_COLOUR
from legfem.report.words import WORDS

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


def turned_leg(
    shape: LegShape,
    moved: Mapping[str, FloatArray],
    fields: Sequence[SkinField],
    slider: Slider,
    view: View,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    caption: str,
    marked: Sequence[tuple[str, FloatArray]] = (),
    tool: tuple[FloatArray, FloatArray] | None = None,
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
        Names and places (3,), mm, of points inside the leg without load.
    tool
        A rigid grid that touches it, which is seen through: its points in the first state, (n_levels, n_points, 3), and
        their movement in all, (n_states, 3), mm.
    """
    centre = np.array([*shape.contours[SKIN].mean(axis=(0, 1)), shape.levels.mean()])
    parts = []
    for part in shape.parts:
        step = max(1, -(-shape.contours[part].shape[1] // _POINTS))
        entry = _part(part, shape.points(part)[:, ::step] - centre)
        if part in moved:
            entry["moves"] = packed(moved[part][:, :, ::step] / _MOVE, "<i2")
        if part == SKIN:
            entry["fields"] = [_field(field, step) for field in fields]
        parts.append(entry)
    reach = float(np.abs(shape.points(SKIN) - centre)[..., :2].max())
    if tool is not None:
        points, way = tool
        entry = _part(_TOOL, points - centre)
        moves = np.broadcast_to(way[:, None, None], (len(way), *points.shape))
        parts.append({**entry, "moves": packed(moves / _MOVE, "<i2")})
        # How far to the side it is seen in its last state, at most (mm).
        last = points + way[-1] - centre
        reach = max(reach, float(np.linalg.norm(last[..., :2], axis=-1).max()))
    content = {
        "parts": parts,
        "mm_a_count": [_PLACE, _MOVE],
        "share_a_count": _VALUE,
        "marked": [{"name": name, "at": (place - centre).round(2).tolist()} for name, place in marked],
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


_ROUND = 36
"""Points of a ring of an indenter's grid."""


def pressed_leg(pressed: PressedLeg, caption: str) -> TurnedLeg:
    """Return a leg that is pressed, with what presses it in front.

    Parameters
    ----------
    pressed
        The leg's solve.
    caption
        Begins what is said of it.
    """
    direction = pressed.pose.direction
    # About z, so that the travel is +y, from the front.
    x, y, _ = direction
    turn = np.array([[y, -x, 0.0], [x, y, 0.0], [0.0, 0.0, 1.0]])
    bare = pressed.shape
    shape = LegShape(bare.levels, {part: xy @ turn[:2, :2].T for part, xy in bare.contours.items()})
    stops = np.array([0.0, *(state.displacement for state in pressed.states)])
    moved = {
        SKIN: from_none([state.skin @ turn.T for state in pressed.states]),
        HULL: from_none([state.hull @ turn.T for state in pressed.states]),
    }
    pressure = from_none([state.pressure for state in pressed.states])
    movement = np.linalg.norm(moved[SKIN], axis=-1)
    grid = (_outline(pressed.indenter, pressed.pose) + pressed.touch) @ turn.T
    tool = grid, stops[:, None] * (turn @ direction)
    force = pressed.curve(stops)
    rows = [
        [f"{at:.1f}", f"{force[k]:.2f}", f"{pressure[k].max():.1f}", f"{movement[k].max():.1f}"]
        for k, at in enumerate(stops)
    ]
    return turned_leg(
        shape,
        moved,
        [
            SkinField("pressure on the skin", "kPa", pressure, "most"),
            SkinField("movement of the skin", "mm", movement, "most"),
        ],
        Slider("Press the leg in 3D", tuple(stops), " mm", 0.1, 1, tuple(force)),
        View(WORDS["sides"], -50.0, exaggerates=False),
        ("displacement (mm)", "force (N)", "highest pressure on the skin (kPa)", "greatest movement of the skin (mm)"),
        rows,
        f"{caption} Its skin is coloured by the pressure on it or by how far it moved; the indenter is drawn "
        f"see-through. {len(pressed.states)} states were computed; what lies between is drawn in proportion.",
        tool=tool,
    )


def from_none(states: Sequence[FloatArray]) -> FloatArray:
    """Return the zeros of a leg that nothing touches, and the values of the states."""
    return np.stack([np.zeros_like(states[0]), *states])


def _outline(indenter: LegIndenter, pose: Pose) -> FloatArray:
    """Return an indenter's surface about its middle as a grid (n, m, 3) of rings."""
    heights, radii = indenter.profile().T
    # Square to the axis of any of them, and turned with the leg.
    axis, first = indenter.axis(pose), pose.frame[1]
    angle = np.linspace(0.0, 2 * np.pi, _ROUND, endpoint=False)[:, None]
    ring = np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)
    return np.asarray(heights[:, None, None] * axis + radii[:, None, None] * ring)
