"""What a reader of a leg's joint result must be told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from legfem.common.doubts import Doubt
from legfem.identify.usual_stiffness import doubts_about_stiffness
from legfem.identify.warnings import (
    LEAST_CHANCE,
    UNCONVERGED,
    at_limits,
    begun_in_air,
    far_from_priors,
    of_compromise,
    of_elastography,
    of_ends,
)
from legfem.inverse.catalogue import DEEP_RATIO, key_of
from legfem.legs.plausibility import doubts_about
from legfem.sites.result import SiteFit, SitesResult, SpatialSites


def warnings_about(result: SitesResult) -> tuple[str, ...]:
    """Return one sentence a warning, the gravest first."""
    texts = [*(() if result.converged else (UNCONVERGED,))]
    if result.misfit.p_value < LEAST_CHANCE:
        worst = min(result.sites, key=lambda one: one.misfit.p_value)
        texts.append(
            f"The {result.law} law does not describe these sites together (chi-square "
            f"{result.misfit.chi_square:.4g} for {result.misfit.degrees_of_freedom} degrees of "
            f"freedom), {worst.name} least (misses by {worst.rms:.2g} N rms). The intervals hold "
            "for the law as fitted and understate what is unknown."
        )
    if result.agreement.p_value < LEAST_CHANCE:
        texts.append(
            "The sites do not ask for the same parameters (chi-square "
            f"{result.agreement.chi_square:.3g} for {result.agreement.degrees_of_freedom} degrees "
            f"of freedom): {'; '.join(_departures(result))}. Something is otherwise there, wrongly "
            "given, or left out by the law: diagnose that site by itself. Intervals are as wide as "
            "if recordings erred by enough to make that usual, and hold for no cause in particular."
        )
    for one in result.sites:
        texts += [_at(one, text) for text in begun_in_air(one.measured)]
    texts += [
        *of_compromise(result.compromise),
        *at_limits(result.law, result.parameters, result.neo_hookean_limit),
        *far_from_priors(result.parameters),
        *of_elastography(result.sites[0].subject, result.parameters),
    ]
    if result.failed_solves:
        texts.append(
            f"{result.failed_solves} of {result.forward_solves} full solves stopped short at one "
            "of the sites; the search kept away from them."
        )
    if result.spatial is not None:
        return (*texts, *_in_3d(result, result.spatial))
    applied = [one for one in result.sites if one.correction is not None]
    texts += dict.fromkeys(text for one in result.sites for text in of_ends(one.subject, one.correction))
    if len(applied) > 1:
        texts.append(
            "What is wrong with the 3D correction is taken to be wrong alike at all sites: it "
            "doesn't average out, and more sites don't narrow that part of the intervals."
        )
    return tuple(texts)


def _in_3d(result: SitesResult, spatial: SpatialSites) -> Iterator[str]:
    """Yield what is to be known of a leg that was solved in 3D."""
    if spatial.untold:
        yield spatial.untold
    if DEEP_RATIO in result.parameters or DEEP_RATIO in result.values:
        yield (
            "Fibres are taken to run along the leg, and to be as stiff in tension as their ratio "
            "in shear has it, to a factor of 2: the intervals have the error of that, at the "
            "optimum."
        )
    elif (fibres := result.sites[0].subject.fibres) is None:
        yield (
            "Muscle is taken to be alike in all directions. Give --identify deep.fibre_ratio where "
            "the leg is pressed in two ways, or state fibre_ratio under [tissues.deep]."
        )
    else:
        yield (
            f"Muscle is taken to be {fibres} times as stiff in shear along the leg as across "
            f"({fibres.provenance}: {fibres.source})."
        )
    if spatial.extruded:
        yield (
            "The leg in 3D is the measured section, extruded: how the leg's girth changes along it "
            "is left out. Give a scan, surfaces or contours at several levels as [section]."
        )


def doubts_of(result: SitesResult) -> tuple[Doubt, ...]:
    """Return what is unlikely at any site, and in stiffnesses that nobody has found so."""
    own = [
        replace(doubt, field=f"site {one.name}, {doubt.field}")
        for one in result.sites
        for doubt in doubts_about(one.subject)
    ]
    return (*own, *doubts_about_stiffness(result.sites[0].subject, result.parameters))


def _departures(result: SitesResult) -> list[str]:
    found = []
    for name in result.parameters:
        far = result.farthest(name)
        found.append(
            f"{key_of(name)} departs most at {far.name}, by {far.by_itself[name].departure:+.1f} standard errors"
        )
    return found


def _at(one: SiteFit, text: str) -> str:
    return f"Site {one.name}: {text}"
