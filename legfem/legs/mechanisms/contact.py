"""The skin slips along the cylinder, or the cylinder is tilted."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from legfem.inverse.mechanism import Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter

if TYPE_CHECKING:
    from legfem.mechanics.contact import TangentialName


@dataclass(frozen=True)
class ContactSlip(TissueMechanism):
    """Slip between none (the tape holds) and free.

    The force is taken in proportion between that of a skin that sticks and that of one that slides
    without friction, the two ends of Coulomb's law.
    """

    name: ClassVar[str] = "contact-slip"
    statement: ClassVar[str] = "the skin slipped along the cylinder: the tape did not hold"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("slip", "-", "share of the way from sticking to free", 0.6, (0.0, 1.0)),
    )
    would_be: ClassVar[str] = "a skin that slips along the cylinder, {} of the way to no friction"
    next_experiment: ClassVar[str] = "mark the skin at the cylinder's edge and film it, or repeat with fresh tape"
    measured_sd: ClassVar[float | None] = 0.15
    """An estimate: marks are read to 0.5 mm beside ways of some mm."""
    variant: ClassVar[str] = "frictionless"
    tangential: "ClassVar[TangentialName | None]" = "frictionless"
    null_variant: ClassVar[str] = "sticking"
    # Fat that slides folds more often under a contact as stiff and as sharp as the tape's. Compared
    # with a skin that sticks to this one, the change is the same within 0.1 % of the greatest
    # force.
    contact_softness: ClassVar[float] = 0.4
    contact_onset: ClassVar[float | None] = 0.03
    strengths: ClassVar[tuple[float, ...]] = (1.0,)

    def solution(self, values: Values) -> Solution:
        """Return the model without friction; only a whole slip is solved."""
        return Solution(self.variant, null=self.null_variant)

    def tabulated(self, values: Values) -> float:
        """Return a whole slip."""
        return self.strengths[0]

    def share(self, values: Values) -> float:
        """Return the share of the way to sliding."""
        return values["slip"]


@dataclass(frozen=True)
class IndenterTilt(TissueMechanism):
    """The line of travel, turned about the point of first touch."""

    name: ClassVar[str] = "indenter-tilt"
    statement: ClassVar[str] = "the cylinder did not travel in the direction stated"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("angle", "degrees", "of the travel from the one stated", 8.0, (-20.0, 20.0)),
    )
    would_be: ClassVar[str] = "a travel turned by {} from the one stated"
    next_experiment: ClassVar[str] = "photograph the cylinder against the leg at both ends of the travel"
    measured_sd: ClassVar[float | None] = 1.5
    """An estimate."""
    strengths: ClassVar[tuple[float, ...]] = (-8.0, 8.0)

    def solution(self, values: Values) -> Solution:
        """Return the model pressed along the turned line."""
        return Solution(tilt_deg=values["angle"])
