"""Tests that could be made next on a leg."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.diagnose.mechanisms import Mechanism
from legfem.solve.protocol import Protocol


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
class DirectReadings:
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
