"""Normal force on the plates of a rheometer: its load cell's second axis, beside the torque.

What is twisted pushes its plates apart (J. H. Poynting, Proc. R. Soc. A 82 (1909) 546): by half the twist per height
times the torque for any law of the first invariant (R. S. Rivlin, Phil. Trans. R. Soc. A 242 (1949) 173-195).
"""

from typing import ClassVar

from legfem.channels.kind import ChannelAccuracy, ChannelFile, ChannelKind

_RHEOMETER = ChannelAccuracy(reading=0.01, bias=0.02, gain=0.05, slow=0.02)
"""Thermal drift of the gap and what the specimen was laid in with are hundredths of a newton."""
NORMAL_FORCE = ChannelKind(
    "normal_force", "N", "force that pushes the plates apart", _RHEOMETER, models=frozenset({"specimen"}), presses=True
)


class NormalForces(ChannelFile):
    """The normal force of tests in closed form; no mesh is twisted."""

    kinds: ClassVar = (NORMAL_FORCE,)
