"""Mechanisms of the instruments and the rig."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.diagnose.mechanisms.base import Mechanism, Parameter, Values
from legfem.diagnose.observations import Observations
from legfem.units import FloatArray


@dataclass(frozen=True)
class ContactOnset(Mechanism):
    """Displacement doesn't count from first touch."""

    name: ClassVar[str] = "contact-onset"
    statement: ClassVar[str] = (
        "the displacement was not counted from first contact: the leg was touched later or earlier"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("offset", "mm", "displacement at first contact", -3.0, 5.0, start=0.3),
    )
    next_experiment: ClassVar[str] = (
        "start the recording in air, 2 mm before the skin, so that first contact can be seen"
    )

    def displacement_loss(
        self, values: Values, observed: Observations, force: FloatArray
    ) -> FloatArray:
        """Return the offset."""
        return np.full(len(force), values["offset"])


@dataclass(frozen=True)
class SupportCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`.

    Bones on springs that let the skeleton move along the travel are the same thing as a compliant
    rig: a rigid translation of leg and cylinder together.
    """

    name: ClassVar[str] = "support-compliance"
    statement: ClassVar[str] = (
        "the leg's support or the rig gave way: bones and frame moved with the force"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("compliance", "mm/N", "displacement per force", 0.0, 2.0, start=0.1),
    )
    next_experiment: ClassVar[str] = (
        "measure the shin's displacement during the test, or press a rigid block on the same rig"
    )

    def displacement_loss(
        self, values: Values, observed: Observations, force: FloatArray
    ) -> FloatArray:
        """Return what the springs take up."""
        return values["compliance"] * force


@dataclass(frozen=True)
class ForceDrift(Mechanism):
    """The load cell's zero moves with time, from the start of each trial."""

    name: ClassVar[str] = "force-drift"
    statement: ClassVar[str] = "the load cell's zero drifted in time"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rate", "N/s", "drift of the zero", -0.1, 0.1, start=0.005),
    )
    next_experiment: ClassVar[str] = (
        "record a minute in air before and after each trial, and compare the zeros"
    )

    def added_force(self, values: Values, observed: Observations) -> FloatArray:
        """Return the drift."""
        return values["rate"] * observed.time
