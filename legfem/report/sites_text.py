"""What is said of a leg's sites in words: ``report.txt``, and a few lines for the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from legfem.common.doubts import doubt_lines
from legfem.common.units import readable_unit
from legfem.identify.catalogue import symbol_of, unit_of
from legfem.report.page import ReportFile, headline, listing
from legfem.report.style import LAW_NAMES
from legfem.report.text import ENERGIES, ORIGINS, WIDTH, prior_text, probability, variables, wrapped
from legfem.sites.result import Chance, SitesResult


def sites_text(results: Sequence[SitesResult]) -> str:
    """Return a few lines for the terminal: values, fits, whether the sites agree."""
    leg = results[0].leg
    lines = [
        f"Leg {leg.id} ({leg.title}), {len(leg.sites)} sites together",
        f"DATA: {ORIGINS[leg.origin]}",
        *doubt_lines(dict.fromkeys(doubt for result in results for doubt in result.doubts)),
        "",
    ]
    for result in results:
        lines.append(
            f"  {LAW_NAMES[result.law]}: {result.forward_solves} solves of all sites, "
            f"{result.wall_s:.1f} s"
        )
        for name, found in result.parameters.items():
            low, high = found.shown.ci95
            lines.append(
                f"    {symbol_of(name):<18} {found.shown.value:.4g} [{low:.4g}, {high:.4g}] "
                f"{found.shown.unit}, {found.identifiability}"
            )
        lines += [f"    {line}" for line in (*by_site(result), agreement(result))]
    lines.append("  (brackets: 95 % confidence intervals; ±: one standard error)")
    for result in results:
        lines += [f"  Warning ({LAW_NAMES[result.law]}): {text}" for text in result.warnings]
    return wrapped(lines)


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


def sites_page(results: Sequence[SitesResult], files: Sequence[ReportFile]) -> str:
    """Return the text of ``report.txt``."""
    leg = results[0].leg
    heading = f"Tissues of leg {leg.id} from {len(leg.sites)} sites"
    blocks = [
        f"{heading}\n{'=' * len(heading)}",
        f"*** {ORIGINS[leg.origin].upper()} ***",
        headline("Summary") + sites_text(results).rstrip(),
        headline("What was done") + procedure(results[0]),
        *(headline(f"Result: {LAW_NAMES[r.law]}") + _result(r).rstrip() for r in results),
        headline("Files") + listing(files),
    ]
    return "\n\n".join(blocks) + "\n"


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
    return textwrap.fill(
        f"Mean loading curves of {len(result.sites)} sites were fitted together by one set of "
        "tissues, each site with its own section, indenter, zero, gain and first contact, and "
        f"weighed by the inverse covariance of its curve.{own} {ends}A genetic algorithm (pygad) "
        "searched on an emulator of all sites, which full solves refined and confirmed. What a "
        "site says by itself is read off the same solves, without further ones.",
        WIDTH,
    )


def _result(result: SitesResult) -> str:
    priors = [
        f"{name:<19}{prior_text(one.parameter)}"
        for name, one in result.parameters.items()
        if one.parameter.prior is not None
    ]
    sections: dict[str, Iterable[str]] = {
        "Model": [ENERGIES[result.law]],
        "Fit Statistics": [
            f"chi-square           = {of(result.misfit)}",
            f"agreement of sites   = {of(result.agreement)}",
            f"full forward solves  = {result.forward_solves} of all sites "
            f"({result.failed_solves} failed, {result.reused_solves} from an earlier run)",
            f"converged            = {'yes' if result.converged else 'NO'} (seed {result.seed})",
        ],
        "Sites": _sites(result),
        "Variables": variables(result.parameters),
        "Correlations": _correlations(result) or ["none: there is one parameter"],
        "Assumed": [*priors, *held(result)],
        "Warnings": result.warnings or ["none"],
    }
    lines = [*doubt_lines(result.doubts)]
    for name, body in sections.items():
        lines += [f"[[{name}]]", *(f"    {line}" for line in body)]
    return wrapped(lines)


def _sites(result: SitesResult) -> list[str]:
    lines = []
    for one, said in zip(result.sites, by_site(result), strict=True):
        curve = one.measured
        trials = f"{curve.n_trials} trial{'s' * (curve.n_trials > 1)}"
        lines.append(f"{said}; {trials} to {curve.displacement[-1]:.2f} mm")
        if one.correction is not None:
            lines.append(
                f"    P at {curve.displacement[-1]:.3g} mm {one.correction.P[-1]:+.3f} ± "
                f"{one.correction.sd[-1]:.3f}: {one.correction.name}"
            )
    return lines


def held(result: SitesResult) -> list[str]:
    """Return what was held."""
    lines = []
    for name, value in result.assumed.items():
        unit, factor = readable_unit(unit_of(name))
        lines.append(f"{name:<19}{factor * value:.4g} {unit}, held")
    return lines


def _correlations(result: SitesResult) -> list[str]:
    names = list(result.parameters)
    return [
        f"C({symbol_of(names[i])}, {symbol_of(names[j])}) = {result.correlations[i, j]:+.3f}"
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True)
    ]
