"""What is said of a leg's sites in sentences."""

from __future__ import annotations

from legfem.common.units import readable_unit
from legfem.identify.catalogue import symbol_of, unit_of
from legfem.report.text import probability
from legfem.sites.result import Chance, SitesResult


def by_site(result: SitesResult) -> list[str]:
    """Return a line a site: how far the joint fit is from it, and what it says by itself."""
    return [
        f"{one.name}: rms {one.rms:.3g} N, {of(one.misfit)}; by itself "
        + ", ".join(own_value(result, one.name, name) for name in one.by_itself)
        for one in result.sites
    ]


def own_value(result: SitesResult, site: str, name: str) -> str:
    """Return a parameter as one site says it."""
    unit, factor = readable_unit(unit_of(name))
    found = next(one for one in result.sites if one.name == site).by_itself[name]
    return (
        f"{symbol_of(name)} {factor * found.value:.3g} ± {factor * found.standard_error:.2g} {unit}"
    )


def agreement(result: SitesResult) -> str:
    """Return whether the sites agree, as a sentence."""
    far = {name: result.farthest(name) for name in result.parameters}
    most = max(far, key=lambda name: abs(far[name].by_itself[name].departure))
    departure = far[most].by_itself[most].departure
    return (
        f"The sites' own values differ by chi-square {of(result.agreement)}; {far[most].name} "
        f"departs most, in {symbol_of(most)} by {departure:+.1f} standard errors."
    )


def of(chance: Chance) -> str:
    """Return a sum of squares beside its degrees of freedom."""
    return (
        f"{chance.chi_square:.3g} for {chance.degrees_of_freedom} degrees of freedom "
        f"({probability(chance.p_value)})"
    )


def procedure(result: SitesResult) -> str:
    """Return what was done with the recordings, as a paragraph."""
    ends = (
        "The correction for the cylinder's ends is each site's own, its errors are taken to be "
        "alike at all sites, so that they don't average out. "
        if any(one.correction is not None for one in result.sites)
        else ""
    )
    own = (
        " Each site's instrument errs of its own: "
        + ", ".join(f"{symbol_of(name)} {sd:.3g} (sd)" for name, sd in result.own_errors.items())
        + "."
        if result.own_errors
        else ""
    )
    return (
        f"Mean loading curves of {len(result.sites)} sites were fitted together by one set of "
        "tissues, each site with its own section, indenter, zero, gain and first contact, and "
        f"weighed by the inverse covariance of its curve.{own} {ends}A genetic algorithm (pygad) "
        "searched on an emulator of all sites, which full solves refined and confirmed. What a "
        "site says by itself is read off the same solves, without further ones."
    )
