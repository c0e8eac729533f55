"""Lateral stretch of a specimen half-way along it, as a video of its side shows.

Where ends stick to the plates the side bulges: its middle is wider than volume alone asks for. Where they slide, it is
as wide as the tissue's compressibility has it.
"""

from typing import TYPE_CHECKING, ClassVar

from legfem.channels.kind import ChannelAccuracy, ChannelFile, ChannelKind, Channels, Impossible
from legfem.common.units import FloatArray

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_VIDEO = ChannelAccuracy(reading=0.005, bias=0.003, gain=0.03, slow=0.002, lag=0.1)
"""A pixel or two of some hundred across the specimen; the scale and the plane of focus."""
LATERAL_STRETCH = ChannelKind(
    "lateral_stretch",
    "-",
    "width half-way along the specimen over that at first touch",
    _VIDEO,
    models=frozenset({"specimen"}),
    at_rest=1.0,
)
_FIRST, _WIDEST = 0.2, 3.0


class LateralStretches(ChannelFile):
    """The deformed over the undeformed radius at half the height, of a body with axial symmetry and a mirror there."""

    kinds: ClassVar = (LATERAL_STRETCH,)

    def read(self, seen: "Seen") -> Channels:
        """Return the stretch of the side's lowest node: the mirror is at height 0."""
        if seen.model.specimen is None or not seen.model.specimen.side:
            return {}
        radius = float(seen.model.places[:, 0].max())
        outwards, rates = seen.move((radius, 0.0), 0)
        return {LATERAL_STRETCH.name: (1 + outwards / radius, rates / radius)}


def not_a_stretch(values: FloatArray) -> Impossible | None:
    """Return why values (k,), from first touch on, aren't stretches: a diameter in mm, per cent, a strain."""
    first, low, high = float(values[0]), float(values.min()), float(values.max())
    if abs(first - 1) < _FIRST and 1 / _WIDEST < low and high < _WIDEST:
        return None
    problem = f"begins with {first:.3g}, and lies between {low:.3g} and {high:.3g}"
    return Impossible(problem, "give the diameter over that at first touch: 1 to begin with")
