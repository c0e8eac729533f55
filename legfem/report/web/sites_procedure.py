"""What was done with the recordings of a leg's sites, in words."""

from __future__ import annotations

from legfem.inverse.catalogue import symbol_of
from legfem.sites.result import SitesResult


def procedure(result: SitesResult) -> str:
    """Return what was done with the recordings, as a paragraph."""
    ends = (
        ""
        if result.spatial is not None
        else "The correction for the cylinder's ends is each site's own, its errors are taken to "
        "be alike at all sites, so that they don't average out. "
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
    many = (
        f"Mean loading curves of {len(result.sites)} sites were fitted together"
        if len(result.sites) > 1
        else "The mean loading curve was fitted"
    )
    return (
        f"{many} by one set of "
        "tissues, each site with its own section, indenter, zero, gain and first contact, and "
        f"weighed by the inverse covariance of its curve.{own} {ends}A genetic algorithm (pygad) "
        "searched on an emulator of all sites, which full solves refined and confirmed"
        f"{_spatially(result)}. What a "
        "site says by itself is read off the same solves, without further ones."
    )


def _spatially(result: SitesResult) -> str:
    """Return what solves were of, if of the leg in 3D, to go on with."""
    spatial = result.spatial
    if spatial is None:
        return ""
    left = ", ".join(f"{name} {100 * value:.2g} %" for name, value in spatial.errors.items())
    return (
        f"; all of the leg itself in 3D, {spatial.full_solves} of single sites. "
        f"{spatial.rough_solves} more, by larger elements and of a shorter leg, measured what "
        f"errors are left, of the force at most: {left}"
    )
