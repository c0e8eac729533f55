"""A leg in 3D on a page, pressed with a slider, and what colours its skin."""

from __future__ import annotations

from typing import Any

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.indenter_pose import IndenterInPose
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.legs.film_3d import PressedLeg
from legfem.report.web.turned import SkinField, Slider, Tool, TurnedLeg, View, turned_leg

_SIDES = (
    "the cylinder's side",
    "the cylinder's side and the right",
    "the right",
    "behind, and the right",
    "behind",
    "behind, and the left",
    "the left",
    "the cylinder's side and the left",
)
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
    direction = pressed.posed.pose.direction
    turn = _to_the_front(direction)
    bare = pressed.shape
    shape = LegShape(bare.levels, {part: xy @ turn[:2, :2].T for part, xy in bare.contours.items()})
    stops = np.array([0.0, *(state.displacement for state in pressed.states)])
    moved = {
        SKIN: _from_none([state.skin @ turn.T for state in pressed.states]),
        HULL: _from_none([state.hull @ turn.T for state in pressed.states]),
    }
    pressure = _from_none([state.pressure for state in pressed.states])
    movement = np.linalg.norm(moved[SKIN], axis=-1)
    grid = (_outline(pressed.posed) + pressed.touch) @ turn.T
    tool = Tool(grid, stops[:, None] * (turn @ direction))
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
        View(_SIDES, -50.0, exaggerates=False),
        ("displacement (mm)", "force (N)", "highest pressure on the skin (kPa)", "greatest movement of the skin (mm)"),
        rows,
        f"{caption} Its skin is coloured by the pressure on it or by how far it moved; the "
        f"indenter is drawn see-through. {len(pressed.states)} states were computed; what lies "
        "between is drawn in proportion.",
        tool=tool,
    )


def _from_none(states: list[FloatArray]) -> FloatArray:
    """Return the unpressed leg's zeros, and the values of the states."""
    return np.stack([np.zeros_like(states[0]), *states])


def _to_the_front(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) about z that turns a travel into +y, from the front."""
    x, y, _ = direction
    return np.array([[y, -x, 0.0], [x, y, 0.0], [0.0, 0.0, 1.0]])


def _outline(posed: IndenterInPose[Any]) -> FloatArray:
    """Return an indenter's surface about its middle as a grid (n, m, 3) of rings."""
    heights, radii = posed.profile().T
    # Square to the axis of any of them, and turned with the leg.
    axis, first = posed.axis, posed.pose.frame[1]
    angle = np.linspace(0.0, 2 * np.pi, _ROUND, endpoint=False)[:, None]
    ring = np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)
    return np.asarray(heights[:, None, None] * axis + radii[:, None, None] * ring)
