"""What an identification from several sites of a leg found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from legfem.common.doubts import Doubt
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.identify.applied_correction import AppliedCorrection
from legfem.identify.result import IdentifiedParameters
from legfem.inverse.catalogue import Values
from legfem.legs.subject import SitedLeg, Subject


@dataclass(frozen=True)
class ByItself:
    """A parameter as one site alone says it, in the model's unit.

    From the solves of the joint fit, without further ones; `legfem.identify` of that site has an
    interval of its own.
    """

    value: float
    standard_error: float
    departure: float
    """From the joint value, over the standard error of their difference."""


@dataclass(frozen=True)
class Chance:
    """A sum of squares over their errors, and the chance of one as large."""

    chi_square: float
    degrees_of_freedom: int
    p_value: float

    @property
    def birge_ratio(self) -> float:
        """By how much larger errors would have to be to make it usual; 1 at least.

        R. T. Birge, Phys. Rev. 40 (1932) 207; the Particle Data Group's scale factor.
        """
        if self.degrees_of_freedom == 0:
            return 1.0
        return float(np.sqrt(max(self.chi_square / self.degrees_of_freedom, 1.0)))


@dataclass(frozen=True, eq=False)
class SiteFit:
    """One site beside the joint fit."""

    subject: Subject
    measured: LoadingCurve
    predicted: FloatArray
    """Force on the measured curve's grid (n,), N, correction included."""
    correction: AppliedCorrection | None
    misfit: Chance
    """Of this site's differences alone; as many degrees of freedom as forces."""
    by_itself: Mapping[str, ByItself]
    """By full name, what is identified."""

    @property
    def name(self) -> str:
        """Of the site."""
        return self.subject.site or "leg"

    @property
    def residual(self) -> FloatArray:
        """Predicted less measured force (n,), N."""
        return self.predicted - self.measured.force

    @property
    def rms(self) -> float:
        """Root mean square difference, N."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def r_squared(self) -> float:
        """Share of the forces' variance that is predicted."""
        force = self.measured.force
        return 1 - float(np.sum(self.residual**2) / np.sum((force - force.mean()) ** 2))


@dataclass(frozen=True, eq=False)
class SpatialSites:
    """What the solves of a leg in 3D were of, and what errors are left in them."""

    shapes: tuple[str, ...]
    """Where the leg's shape about every site was taken from."""
    extruded: bool
    """Whether one section stands for a site's whole length, which is an assumption."""
    full_solves: int
    """Of single sites, for a law."""
    rough_solves: int
    """By larger elements, or of a shorter leg."""
    errors: Mapping[str, float]
    """Greatest share of a site's force, by cause."""
    untold: str
    """Why the fibres' ratio can't be told from C10, as a sentence; empty if it can, or isn't
    sought."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SitesResult(IdentifiedParameters):
    """One law identified from several sites of a leg together."""

    leg: SitedLeg
    own_errors: Values
    """Standard deviations of what each site's instrument errs by, of its own."""
    sites: tuple[SiteFit, ...]
    misfit: Chance
    """Of all differences, with their covariance, and of priors."""
    agreement: Chance
    """Of what the sites say by themselves, were the parameters the same at all; its Birge ratio
    widens the errors that sites have of their own, and so the intervals."""
    neo_hookean_limit: bool
    """Whether the reduced polynomial's optimum is its neo-Hookean limit."""
    failed_solves: int
    compromise: str
    """Of the best solve; see `legfem.inverse.outcome.Outcome`."""
    doubts: tuple[Doubt, ...] = field(default=())
    spatial: SpatialSites | None = None
    """Of a leg that was solved in 3D."""

    def farthest(self, name: str) -> SiteFit:
        """Return the site that by itself departs most from the joint value of a parameter."""
        return max(self.sites, key=lambda one: abs(one.by_itself[name].departure))
