"""Forces of the cylinder on the skin beside that along its travel, by a load cell of several axes."""

from __future__ import annotations

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
_PRESSED = 0.2
"""Of the largest force along the travel, from which on another is compared with it."""


class ContactForces(ChannelFile):
    """Forces across the travel, to its left, and along the leg."""

    kinds: ClassVar = (LATERAL, AXIAL)
    plans: ClassVar = (
        ChannelPlan(
            "record the lateral force too", (LATERAL.name,), "a load cell of two or more axes, and no more time"
        ),
    )

    def read(self, seen: Seen) -> Channels:
        """Return the force to the left, and of a leg in 3D that along it."""
        found = {LATERAL.name: seen.force(seen.left)}
        if len(seen.left) == 3:
            found[AXIAL.name] = seen.force(np.array([0.0, 0.0, 1.0]))
        return found

    def check(self, kind: ChannelKind, recorded: ReadingsAtSite) -> Impossible | None:
        """Refuse a lateral force that exceeds the force along the travel."""
        force, values = recorded.force, recorded.values
        pressed = force > _PRESSED * force.max()
        if kind != LATERAL or not pressed.any() or np.median(np.abs(values[pressed]) / force[pressed]) <= 1.0:
            return None
        worst = float(np.abs(values[pressed]).max())
        return Impossible(
            f"it is up to {worst:.3g} N, more than the force along the travel ({force.max():.3g} N)",
            "check which of the load cell's axes is which, and its zero",
        )
