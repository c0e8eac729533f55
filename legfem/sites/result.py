"""What an identification from several sites of a leg found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from legfem.common.doubts import Doubt
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.identify.result import IdentifiedParameters
from legfem.inverse.catalogue import Values
from legfem.inverse.fit import Fit, Goodness, OwnEstimate
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialSites
from legfem.legs.notices import curve_of
from legfem.legs.subject import SitedLeg, Subject


@dataclass(frozen=True, eq=False)
class SiteFit:
    """One site beside the joint fit."""

    subject: Subject
    measured: LoadingCurve
    predicted: FloatArray
    """Force on the measured curve's grid (n,), N, correction included."""
    correction: AppliedCorrection | None
    misfit: Goodness
    """Of this site's differences alone; as many degrees of freedom as forces."""
    by_itself: Mapping[str, OwnEstimate]
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


@dataclass(frozen=True, eq=False, kw_only=True)
class SitesResult(IdentifiedParameters):
    """One law identified from several sites of a leg together."""

    leg: SitedLeg
    own_errors: Values
    """Standard deviations of what each site's instrument errs by, of its own."""
    sites: tuple[SiteFit, ...]
    misfit: Goodness
    """Of all differences, with their covariance, and of priors."""
    agreement: Goodness
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


def sites_result(fit: Fit[LegDetails]) -> SitesResult:
    """Result of a leg's fit as pages and documents of sites read it."""
    log, details = fit.log, fit.details
    spatial = details.spatial
    assert spatial is None or isinstance(spatial, SpatialSites)
    return SitesResult(
        law=fit.law,
        parameters=fit.estimates,
        correlations=fit.correlations,
        values=fit.values,
        assumed=fit.assumed,
        forward_solves=log.forward_solves,
        reused_solves=log.reused_solves,
        wall_s=log.wall_s,
        seed=log.seed,
        emulator_error=log.emulator_error,
        converged=log.converged,
        warnings=fit.warnings,
        versions=fit.versions,
        leg=details.leg,
        own_errors=details.own_errors,
        sites=tuple(
            SiteFit(site, curve_of(one), one.force.predicted, correction, one.goodness, one.by_itself)
            for site, one, correction in zip(details.leg.sites, fit.tests, details.corrections, strict=True)
        ),
        misfit=fit.goodness,
        agreement=fit.agreement,
        neo_hookean_limit=fit.neo_hookean_limit,
        failed_solves=log.failed_solves,
        compromise=log.compromise,
        doubts=fit.doubts,
        spatial=spatial,
    )
