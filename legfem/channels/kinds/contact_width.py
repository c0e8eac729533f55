r"""Width of the contact along the cylinder's face, by ink, a camera or the edges that a pressure film sees.

The skin is pressed up to where its deformed outline :math:`x(s)`, quadratic along every edge of the mesh, comes to the
face but for the gap :math:`g` at which the contact's pressure begins: :math:`|x(s) - c| = R + g`. The width is the arc
:math:`R\,(\varphi_1 - \varphi_0)` between the outermost of these points; as nodes move at the rates :math:`x'`, a point
slides along the outline so that it stays there.
"""

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
from legfem.channels.site import Site
from legfem.common.units import FloatArray

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_SEEN = ChannelAccuracy(reading=0.7, bias=1.0, gain=0.03, slow=0.3, lag=0.1)
"""Of an edge that fades: skin that is close to the face looks as if it touched."""
WIDTH = ChannelKind("contact_width", "mm", "width of the contact along the cylinder's face", _SEEN, 0.02)


class ContactWidths(ChannelFile):
    """Arc between the outermost points of the skin that touch the cylinder."""

    kinds: ClassVar = (WIDTH,)
    plans: ClassVar = (
        ChannelPlan(
            "read how wide the contact is at {at}",
            (WIDTH.name,),
            "a camera along the cylinder, or ink on it",
            frames=True,
        ),
    )

    def read(self, seen: "Seen") -> Channels:
        """Return the width; nothing before the skin touches."""
        skin, radius = seen.line("skin"), seen.radius
        reach = radius + seen.onset
        away = skin.points - seen.centre
        # Of an edge from 0 to 1: a + b s + c s^2.
        first, last, middle = away.transpose(1, 0, 2)
        bend, rise = 2 * first + 2 * last - 4 * middle, 4 * middle - 3 * first - last
        gaps = np.linalg.norm(away, axis=2) - reach
        length = np.linalg.norm(last - first, axis=1)
        found: list[tuple[float, FloatArray]] = []
        for edge in np.flatnonzero((gaps.min(axis=1) < length) & (gaps.max(axis=1) > -length)):
            a, b, c = first[edge], rise[edge], bend[edge]
            roots = np.roots([c @ c, 2 * b @ c, b @ b + 2 * a @ c, 2 * a @ b, a @ a - reach**2])
            for s in (float(root.real) for root in roots if abs(root.imag) < 1e-9 and -1e-9 <= root.real <= 1 + 1e-9):
                point, along = a + b * s + c * s**2, b + 2 * c * s
                shapes = np.array([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
                rates = np.array([shapes @ one[edge] for one in skin.rates]).reshape(-1, 2)
                moving = rates - np.outer(rates @ point / (along @ point), along)
                turn = np.array([-point[1], point[0]])
                ahead, beside = point @ seen.model.system.direction, point @ seen.left
                found.append((radius * float(np.arctan2(beside, ahead)), moving @ turn * radius / reach**2))
        if len(found) < 2:
            return {WIDTH.name: (0.0, np.zeros(len(skin.rates)))}
        right, left = min(found, key=lambda one: one[0]), max(found, key=lambda one: one[0])
        return {WIDTH.name: (left[0] - right[0], left[1] - right[1])}

    def check(self, kind: ChannelKind, recorded: ReadingsAtSite) -> Impossible | None:
        """Refuse a width of more than half the cylinder's face."""
        half = float(np.pi * recorded.site.indenter.radius)
        widest = float(recorded.values.max())
        if widest <= half:
            return None
        return Impossible(
            f"it is up to {widest:.3g} mm, and half the cylinder's face is {half:.3g} mm",
            "check its unit and the cylinder's diameter",
        )

    def place(self, kind: ChannelKind, site: Site) -> FloatArray:
        """Return the face's deepest point at first touch."""
        return site.deepest
