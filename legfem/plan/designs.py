"""Tests that could be made next on a leg."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.diagnose.mechanisms import Mechanism
from legfem.solve.protocol import Protocol

REPEATS = 3
_FASTER = 5.0
_HOLD_S = 60.0
_DEEPER_MM = 5.0


@dataclass(frozen=True)
class Design:
    """One test, as a lab would make it.

    Parameters
    ----------
    name
        What to do, in words.
    protocols
        One a trial.
    outlines_known
        Whether the leg's outlines are measured at the indenter (ultrasound, labels on the skin).
    contact_known
        Whether first contact is seen: the recording begins in air, slowly.
    length_factor
        Of the cylinder, over that of the test that was made.
    """

    name: str
    protocols: tuple[Protocol, ...]
    outlines_known: bool = False
    contact_known: bool = False
    length_factor: float = 1.0


@dataclass(frozen=True)
class Readings:
    """Effects that are measured by themselves, by other instruments than the indenter.

    Parameters
    ----------
    mechanisms
        Each with a `measured_sd`.
    """

    mechanisms: tuple[Mechanism, ...]

    @property
    def name(self) -> str:
        """What to do, in words."""
        return "; and ".join(m.next_experiment for m in self.mechanisms)


def designs(depth: float, rate: float, deepest: float, in_air: bool = False) -> list[Design]:
    """Return the tests that are weighed.

    Parameters
    ----------
    depth, rate
        Of the test that was made, or is meant to be made (mm, mm/s).
    deepest
        That the leg's responses reach (mm).
    in_air
        Whether the recordings of the test that was made begin above the skin: to begin there again
        tells nothing more.
    """
    same = Protocol.ramp(depth, rate)
    held = Protocol.cycle(depth, rate, _HOLD_S)
    fast = Protocol.cycle(depth, _FASTER * rate, _HOLD_S)
    found = [
        Design(f"repeat the same test {REPEATS} times", (same,) * REPEATS),
        Design(f"hold the deepest position for {_HOLD_S:g} s, and record the unloading", (held,) * REPEATS),
        Design(
            f"press at two rates ({rate:.2g} and {_FASTER * rate:.2g} mm/s), each with a hold and unloading",
            (held,) * REPEATS + (fast,) * REPEATS,
        ),
        Design(
            "measure the outlines of skin and fascia under the indenter (ultrasound), and press again",
            (same,) * REPEATS,
            outlines_known=True,
        ),
        Design("press with a cylinder of twice the length", (same,) * REPEATS, length_factor=2.0),
        Design(
            "press half as deep, with the same cylinder and more repeats",
            (Protocol.ramp(0.5 * depth, rate),) * (2 * REPEATS),
        ),
    ]
    if not in_air:
        found.append(
            Design(
                "begin 2 mm above the skin, slowly, so that first contact is seen",
                (same,) * REPEATS,
                contact_known=True,
            )
        )
    deeper = min(depth + _DEEPER_MM, deepest)
    if deeper > depth + 1.0:
        found.append(Design(f"press {deeper:.0f} mm deep", (Protocol.ramp(deeper, rate),) * REPEATS))
    return found
