"""Identification of a leg's tissues from all its sites together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.correction.tabulated import TabulatedCorrection
from legfem.data import LoadingCurve
from legfem.identify.assess import applied_correction, assumed_stiffness, held_values, versions
from legfem.identify.identification import measured_curve
from legfem.identify.misfit import Misfit
from legfem.identify.run import laws_of
from legfem.identify.warnings import LEAST_CHANCE
from legfem.inverse.catalogue import Values
from legfem.inverse.comparison import Covariances, ErrorSource, total_of
from legfem.inverse.estimates import Optimum, correlations_of, estimates
from legfem.inverse.instrument import INSTRUMENT
from legfem.inverse.intervals import quantile
from legfem.inverse.laws import IdentifiedLaw, LawName
from legfem.inverse.parameter import Parameter
from legfem.inverse.searches import Found, Searches
from legfem.inverse.settings import SearchRequest
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.subject import SitedLeg
from legfem.sites.by_itself import Apart
from legfem.sites.forward import SitesForward
from legfem.sites.misfit import SitesMisfit, with_own_errors
from legfem.sites.result import Chance, SiteFit, SitesResult, SpatialSites
from legfem.sites.warnings import doubts_of, warnings_about

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainSettings

ALIKE: frozenset[ErrorSource] = frozenset({"ends", "fibres"})
"""Errors that all sites of a leg have alike: they make none differ from another."""


@dataclass(frozen=True, eq=False)
class Asked:
    """What is to be found of a leg.

    Parameters
    ----------
    parameters : tuple of Parameter
        Of the tissues, free.
    fixed : Mapping[str, float]
        Held, in place of what the folder gives.
    own_errors : Mapping[str, float]
        Standard deviations by which each site's instrument errs, see
        `legfem.sites.misfit.with_own_errors`.
    """

    parameters: tuple[Parameter, ...] | None
    fixed: Values
    own_errors: Values


def asked_of(parameters: Sequence[Parameter] | None, fixed: Values) -> Asked:
    """Return what is to be found, the instruments' numbers as errors that each site has of its own.

    Raises
    ------
    InputError
        If one of these is to be identified or held: each site has its own.
    """
    remedy = (
        "each site has its own: let it err by --prior, as in 'instrument.gain=1±0.01', or "
        "identify a site by itself with --site"
    )
    for name in fixed:
        if name in INSTRUMENT:
            raise InputError("--fix", name, "is not one for all sites", remedy)
    own = {}
    for one in parameters or ():
        if one.name not in INSTRUMENT:
            continue
        if one.role != "nuisance" or one.prior is None:
            raise InputError("--identify", one.name, "is not one for all sites", remedy)
        null, prior = INSTRUMENT[one.name].null, one.prior
        if not np.isclose(prior.centre, null):
            raise InputError(
                "--prior",
                one.name,
                f"is not about {null:g}",
                "correct the recordings, or identify a site by itself with --site",
            )
        own[one.name] = prior.sd
    free = None
    if parameters is not None:
        free = tuple(one for one in parameters if one.name not in INSTRUMENT)
    return Asked(free, fixed, own)


def identify_sites(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    corrections: Sequence[TabulatedCorrection | None] | None = None,
    model: SitesForward[PlaneStrainForward] | None = None,
) -> list[SitesResult]:
    """Identify tissues that all sites of a leg share.

    Parameters
    ----------
    leg : SitedLeg
        With recordings at every site.
    laws : sequence of str
        Of the deep tissue: ``neo-hookean``, ``reduced-polynomial``.
    request : SearchRequest, optional
        What to identify, and with what means. The search goes on an emulator and weighs every site
        by its errors; the instrument's numbers, with a prior, are each site's own.
    corrections : sequence of TabulatedCorrection, optional
        For 3D effects, one a site.
    model : SitesForward, optional
        The leg's; see `sites_model`.

    Raises
    ------
    InputError
        If a site can't be meshed or its recordings can't be used, or there is no parameter of a
        name.
    SearchError
        If too few full solves reach the measured depths.
    """
    request = request or SearchRequest()
    asked, depth = asked_of(request.parameters, request.fixed), request.depth
    curves = curves_of(leg, asked, depth)
    model = model or sites_model(leg, depth)
    chosen = laws_of(leg.sites[0], laws, model.nominal, asked.parameters, asked.fixed)
    parts = tuple(
        Misfit(curve, "covariance", correction)
        for curve, correction in zip(curves, corrections or [None] * len(curves), strict=True)
    )
    misfit = SitesMisfit(parts)
    known = any(len(law.priors) for law in chosen.values())
    with request.solver(model, chosen) as solver:
        searches = Searches(chosen, solver, request.settings, lambda law: misfit)
        # The correction's error is weighed against what was known beforehand.
        if known and any(part.correction for part in parts):
            weighed = misfit.near(*searches.nearest(laws))
            searches = Searches(chosen, solver, request.settings, lambda law: weighed)
        return [assessed(leg, asked, found) for found in searches.find(laws)]


def curves_of(leg: SitedLeg, asked: Asked, depth: float | None) -> list[LoadingCurve]:
    """Return the mean loading curves of a leg's sites, with errors that each has of its own."""
    return [with_own_errors(measured_curve(site, depth), asked.own_errors) for site in leg.sites]


def sites_model(
    leg: SitedLeg, depth: float | None = None, settings: PlaneStrainSettings | None = None
) -> SitesForward[PlaneStrainForward]:
    """Return a leg's forward model, every site pressed as deep as its recordings ask."""
    return SitesForward(
        tuple(
            PlaneStrainForward.of_subject(site, float(measured_curve(site, depth).displacement[-1]), settings)
            for site in leg.sites
        )
    )


def assessed(
    leg: SitedLeg, asked: Asked, found: Found[SitesMisfit], spatial: SpatialSites | None = None
) -> SitesResult:
    """Return what a finished search says of a leg; in 3D with what is known of its solves."""
    search, best, linear = found.search, found.best, found.linear
    law, misfit = search.law, search.misfit
    covariances = misfit.covariances_at(best.values)
    covariance = total_of(covariances)
    whole = _chance(linear.prediction.force - misfit.measured_force, covariance, law, best.point)
    # The sites' repeats tell of their errors; the fewest are taken.
    repeats = min(part.measured.noise.repeat_dof for part in misfit.parts)
    apart = Apart(found, covariance)
    agreement = apart.agreement
    optimum = Optimum(
        linear,
        found.residual,
        _widened(covariances, agreement.birge_ratio),
        quantile(repeats),
        whole.p_value >= LEAST_CHANCE,
        assumed_stiffness(law),
        plane=spatial is None,
    )
    outcomes = found.outcomes
    result = SitesResult(
        leg=leg,
        law=law.name,
        parameters=MappingProxyType(estimates(optimum)),
        correlations=correlations_of(optimum.spread),
        values=MappingProxyType(dict(best.values)),
        assumed=MappingProxyType(held_values(law)),
        own_errors=asked.own_errors,
        sites=tuple(_fits(leg, found, apart)),
        misfit=whole,
        agreement=agreement,
        neo_hookean_limit=found.neo_hookean_limit,
        converged=search.converged,
        forward_solves=len(outcomes),
        failed_solves=sum(not one.complete for one in outcomes),
        compromise=best.outcome.compromise,
        reused_solves=found.reused_solves,
        emulator_error=search.emulator_error,
        seed=search.settings.seed,
        wall_s=found.wall_s,
        warnings=(),
        versions=versions(),
        spatial=spatial,
    )
    return replace(result, warnings=warnings_about(result), doubts=doubts_of(result))


def _widened(covariances: Covariances, ratio: float) -> Covariances:
    """Return larger errors, but for those that all sites have alike."""
    return {source: part if source in ALIKE else ratio**2 * part for source, part in covariances.items()}


def _chance(left: FloatArray, covariance: FloatArray, law: IdentifiedLaw, point: FloatArray) -> Chance:
    departures = law.priors.residual(point)
    statistic = float(left @ np.linalg.solve(covariance, left) + departures @ departures)
    degrees = len(left) + len(departures) - len(law.parameters)
    return Chance(statistic, degrees, float(chi2.sf(statistic, degrees)))


def _fits(leg: SitedLeg, found: Found[SitesMisfit], apart: Apart) -> list[SiteFit]:
    """Return every site beside the joint fit."""
    force, misfit = found.linear.prediction.force, found.search.misfit
    fits = []
    every = zip(leg.sites, misfit.parts, misfit.spans, apart.misfits(), apart.by_itself(), strict=True)
    for site, part, span, chance, by_itself in every:
        correction = applied_correction(part.correction, part.displacement, found.best.values)
        fits.append(SiteFit(site, part.measured, force[span], correction, chance, MappingProxyType(by_itself)))
    return fits
