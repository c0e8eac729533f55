"""Forces and the moment of the cylinder on the skin beside that along its travel, by a load cell of several axes."""

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from legfem.channels.kind import (
    ChannelAccuracy,
    ChannelFile,
    ChannelKind,
    ChannelPlan,
    Channels,
    Impossible,
    ReadingsAtSite,
)
from legfem.common.units import FloatArray

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_SIX_AXES = ChannelAccuracy(reading=0.02, bias=0.05, gain=0.02, slow=0.03, lag=0.01)
"""Crosstalk of a six-axis cell is a per cent or two of the force along the travel."""
LATERAL = ChannelKind(
    "lateral_force",
    "N",
    "force of the cylinder on the skin across the travel, to its left",
    _SIX_AXES,
    models=frozenset({"2d", "3d"}),
)
AXIAL = replace(
    LATERAL,
    name="axial_force",
    words="force of the cylinder on the skin along the leg, towards greater z",
    models=frozenset({"3d"}),
)
MOMENT = ChannelKind(
    "axis_moment",
    "Nmm",
    "moment of the cylinder on the skin about the cylinder's axis, counterclockwise in the section",
    ChannelAccuracy(reading=0.3, bias=1.0, gain=0.02, slow=0.5, lag=0.01),
)
_PRESSED = 0.2
"""Of the largest force along the travel, from which on another is compared with it."""


class ContactForces(ChannelFile):
    """Forces across the travel, to its left, and along the leg; and what friction turns the cylinder by."""

    kinds: ClassVar = (LATERAL, AXIAL, MOMENT)
    plans: ClassVar = (
        ChannelPlan(
            "record the lateral force too", (LATERAL.name,), "a load cell of two or more axes, and no more time"
        ),
        ChannelPlan(
            "record the lateral force and the moment about the cylinder's axis too",
            (LATERAL.name, MOMENT.name),
            "a six-axis load cell, and no more time",
        ),
    )

    def read(self, seen: "Seen") -> Channels:
        """Return the force to the left; of a leg in 3D that along it, of a section the moment."""
        found = {LATERAL.name: seen.force(seen.left)}
        if len(seen.left) == 3:
            return found | {AXIAL.name: seen.force(np.array([0.0, 0.0, 1.0]))}
        return found | {MOMENT.name: seen.moment()}

    def check(self, kind: ChannelKind, recorded: ReadingsAtSite) -> Impossible | None:
        """Refuse a lateral force that exceeds the force along the travel, and a moment that friction can't make."""
        force, values = recorded.force, recorded.values
        pressed = force > _PRESSED * force.max()
        if kind == MOMENT:
            return _checked_moment(values[pressed], force[pressed], recorded.site.indenter.radius)
        if kind != LATERAL or not pressed.any() or np.median(np.abs(values[pressed]) / force[pressed]) <= 1.0:
            return None
        worst = float(np.abs(values[pressed]).max())
        return Impossible(
            f"it is up to {worst:.3g} N, more than the force along the travel ({force.max():.3g} N)",
            "check which of the load cell's axes is which, and its zero",
        )


def _checked_moment(values: FloatArray, force: FloatArray, radius: float) -> Impossible | None:
    """Return why moments (k,), N mm, can't be about the axis of a cylinder that forces (k,) press, N."""
    if not len(values) or np.median(np.abs(values) / force) <= radius:
        return None
    return Impossible(
        f"it is up to {np.abs(values).max():.3g} N mm, and friction of {force.max():.3g} N on the face makes less",
        "give it about the cylinder's axis, not about the load cell's origin, and check its unit",
    )
