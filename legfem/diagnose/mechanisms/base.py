"""What a mechanism is to the diagnosis.

A mechanism acts in one or several of these ways, each of which vanishes at its parameters' nulls:
it changes the tissue or the contact (then a finite-element solution tells its response), where the
indenter stands, how stiff the deep tissue is at a time or in a trial, or what the load cell says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from legfem.diagnose.observations import Observations
from legfem.units import FloatArray

Values = Mapping[str, float]


@dataclass(frozen=True)
class Parameter:
    """A mechanism's parameter, in the unit people use."""

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    null: float = 0.0
    start: float | None = None
    """Where a search begins; a little off the null without it."""
    known_to: float | None = None
    """Standard deviation about the null of what is known beforehand; nothing is without it."""

    @property
    def typical(self) -> float:
        """A magnitude that matters."""
        return self.start if self.start is not None else self.null + 0.2 * (self.high - self.null)


@dataclass(frozen=True)
class Mechanism:
    """A mechanism that does nothing: what others override.

    The first parameter is the strength; at its null the others have no effect.
    """

    name: ClassVar[str]
    statement: ClassVar[str]
    """What was left out, as a sentence with no formula."""
    parameters: ClassVar[tuple[Parameter, ...]]
    next_experiment: ClassVar[str]
    """The measurement that would settle it."""

    def untestable(self, observed: Observations) -> str | None:
        """Return why such recordings can't show it, or None."""
        return None

    def shape_choices(self, observed: Observations) -> tuple[Values, ...]:
        """Return values of the parameters beyond the first to try."""
        return ({},)

    @property
    def starting_strengths(self) -> tuple[float, ...]:
        """Return strengths that searches begin at: the misfit may have several minima."""
        return (self.parameters[0].typical,)

    def displacement_loss(
        self, values: Values, observed: Observations, force: FloatArray
    ) -> FloatArray:
        """Return what the tissue is pressed less than the sensor says (n,), mm."""
        return np.zeros(len(force))

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the factor on the deep tissue's stiffness (n,)."""
        return np.ones(len(observed.force))

    def force_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the factor on the force (n,)."""
        return np.ones(len(observed.force))

    def added_force(self, values: Values, observed: Observations) -> FloatArray:
        """Return what is added to the force (n,), N."""
        return np.zeros(len(observed.force))


@dataclass(frozen=True)
class Solution:
    """What finite-element solution shows a mechanism at given values."""

    variant: str = "elastic"
    """Which model; see `legfem.diagnose.variants`."""
    parameters: Values = field(default_factory=dict)
    """Changed parameters of that model by full name (MPa, 1/MPa, mm4/(N s), s)."""
    scaled: Values = field(default_factory=dict)
    """Factors on parameters of the base model, by full name."""
    tilt_deg: float = 0.0
    """Of the indenter's travel."""


@dataclass(frozen=True)
class TissueMechanism(Mechanism):
    """A mechanism whose response only a finite-element solution tells."""

    along_path: ClassVar[bool] = False
    """Whether the response depends on time or history, not on displacement alone."""
    proportional: ClassVar[bool] = False
    """Whether the strength is a relative change, from -1 on."""
    costly: ClassVar[bool] = False
    """Whether its solutions take so long that one stiffness stands for all in the table."""
    strengths: ClassVar[tuple[float, ...]] = ()
    """Where the response is tabulated, beside the null."""

    @property
    def starting_strengths(self) -> tuple[float, ...]:
        """Return the usual strength and the ends of the tabulated ones."""
        ends = {min(self.strengths), max(self.strengths)} if self.strengths else set()
        return (*super().starting_strengths, *sorted(ends))

    def solution(self, values: Values) -> Solution:
        """Return the solution that shows the mechanism at values."""
        raise NotImplementedError
