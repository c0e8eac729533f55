"""Estimated and assumed parameters as a page shows them: of a leg's tissues and of specimens."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from legfem.common.units import readable_unit
from legfem.identify.result import IdentificationResult, IdentifiedParameters
from legfem.inverse.catalogue import parameter_of, symbol_of, unit_of
from legfem.inverse.comparison import ErrorSource, main_source
from legfem.inverse.estimates import DISPLACEMENT, FORCE, Estimate
from legfem.inverse.parameter import Parameter
from legfem.report.style import LAW_NAMES, REGION_NAMES
from legfem.report.web.page import Block, Known, WebTable
from legfem.report.words import ENERGIES, number
from legfem.sites.result import SitesResult
from legfem.specimens.result import SpecimenResult


def value_text(found: Estimate) -> str:
    """Return an estimate with the digits that its error leaves, and its unit."""
    shown = found.shown
    return f"{number(shown.value, shown.standard_error)} {shown.unit}".removesuffix(" -")


def held_text(name: str, value: float) -> str:
    """Return a value in the model's unit as people read it."""
    unit, factor = readable_unit(unit_of(name))
    return f"{factor * value:.4g} {unit}".removesuffix(" -")


def interval_text(found: Estimate) -> str:
    """Return an estimate's 95 % interval."""
    shown = found.shown
    return " to ".join(number(end, shown.standard_error) for end in shown.ci95)


def words_of(name: str) -> str:
    """Return a parameter's full name in words."""
    tissue, _, field = name.rpartition(".")
    if tissue not in REGION_NAMES:
        return parameter_of(name, {name: 1.0}).statement
    return f"{field} of the {REGION_NAMES[tissue]}"


def estimated(what: str, found: Estimate, recordings: int) -> Known:
    """Return an estimate's row: what it is, in words, and from how many recordings it comes."""
    bound = f"; at the {found.at_bound} bound of the search" if found.at_bound else ""
    prior = f"; {prior_text(found.parameter)}" if found.parameter.prior else ""
    return Known(
        what,
        value_text(found),
        "estimated" if found.parameter.role == "identified" else "prior",
        f"{recordings} recording{'s' * (recordings > 1)}{prior}",
        interval_text(found),
        f"{found.identifiability}{bound}; ± {found.shown.standard_error:.2g} (sd)",
    )


def prior_text(parameter: Parameter) -> str:
    """Return a parameter's prior in words, in the unit in which people read it."""
    prior = parameter.prior
    assert prior is not None
    unit, factor = readable_unit(parameter.unit)
    if prior.scale == "log":
        width = f"x/ {math.exp(prior.sd):.4g} {unit} (its logarithm is normal)"
    else:
        width = f"± {factor * prior.sd:.4g} {unit} (normal)"
    source = f", from {prior.source}" if prior.source else ""
    return f"prior {factor * prior.centre:.4g} {width}{source}"


def least_akaike[Result: IdentifiedParameters](
    results: Sequence[Result], chi_square: Callable[[Result], float]
) -> Result:
    """Return the law that fits best for the number of its parameters (Akaike)."""
    return min(results, key=lambda r: chi_square(r) + 2 * len(r.parameters))


def how_found(
    results: Sequence[SpecimenResult] | Sequence[SitesResult] | Sequence[IdentificationResult],
) -> list[Block]:
    """Return each law's energy, how its optimum was searched for, and the errors' correlations."""
    blocks: list[Block] = [
        WebTable(
            "Laws, and how each was searched for",
            ["law", "strain energy", "full solves", "failed", "from before", "converged", "s"],
            [
                [
                    LAW_NAMES[r.law],
                    ENERGIES[r.law],
                    f"{r.forward_solves}",
                    f"{r.failed_solves}",
                    f"{r.reused_solves}",
                    "yes" if r.converged else "NO",
                    f"{r.wall_s:.1f}",
                ]
                for r in results
            ],
        )
    ]
    for r in results:
        symbols = [symbol_of(name) for name in r.parameters]
        if len(symbols) > 1:
            rows = [
                [symbol, *("not known" if np.isnan(value) else f"{value:+.3f}" for value in row)]
                for symbol, row in zip(symbols, r.correlations, strict=True)
            ]
            caption = f"Correlations of the errors, {LAW_NAMES[r.law]} law"
            blocks.append(WebTable(caption, ["", *symbols], rows, folded=True))
    return blocks


def how_sure(parameters: Mapping[str, Estimate]) -> str:
    """Return how well parameters are known, for someone who knows no statistics."""
    each = "; ".join(
        f"{symbol_of(name)} is known within {100 * found.relative_half_width:.0f} %"
        f"{' of what was open' if found.parameter.scale == 'linear' else ''} "
        f"({found.identifiability})"
        if np.isfinite(found.relative_half_width)
        else f"{symbol_of(name)} is {found.identifiability}"
        for name, found in parameters.items()
    )
    return f"{each}. If the model is right, 19 of 20 such intervals hold the true value."


def why_identifiable(parameters: Mapping[str, Estimate], law: str) -> list[str]:
    """Return a sentence a parameter: how well it is known, and why it is called that."""
    return [
        f"{symbol_of(name)} of the {LAW_NAMES[law]} law is {found.identifiability}: {found.why}."
        for name, found in parameters.items()
    ]


def rests_on(parameters: Mapping[str, Estimate], likewise: str) -> list[str]:
    """Return a sentence on how far stiffness follows what nothing can check within a factor.

    Parameters
    ----------
    parameters
        By full name.
    likewise
        The sizes that it follows, too, in a sentence's end.
    """
    told = [
        f"{symbol_of(name)} by {100 * found.moves[FORCE]:+.0f} % if all forces were 10 % higher "
        f"and by {100 * found.moves[DISPLACEMENT]:+.0f} % if all displacements were"
        for name, found in parameters.items()
        # What is hardly known changes by any number to first order; nor is time a matter of force.
        if all(abs(found.moves.get(one, np.nan)) < 1 for one in (FORCE, DISPLACEMENT)) and found.unit == "MPa"
    ]
    if not told:
        return []
    return [
        f"Units, the load cell's gain and sizes are as stated. They change {'; '.join(told)}; "
        f"{likewise}. No check sees a factor of less than about ten in them."
    ]


@dataclass(frozen=True)
class Remedies:
    """What would narrow an interval, by what its width comes from."""

    recordings: str
    ends: str = ""
    """Of a cylinder on a leg."""

    def of(self, source: ErrorSource) -> str:
        """Return what to do where most of an error has a source."""
        return {
            "recordings": f"{self.recordings}, or state what is known beforehand (--prior)",
            "differences": "recordings differ from one another by a factor: test more specimens",
            "model": "most of its error is the model's own, which no recording narrows: "
            "state what is known beforehand (--prior)",
            "ends": self.ends,
            "fibres": "most of its error is that of the muscle's fibres: measure them by shear "
            "waves along the leg and across ([[elastography]]), or use --model 3d",
            "priors": "most of its error is that of what was known beforehand: measure that by "
            "itself, and state it (--prior)",
        }[source]


def how_to_narrow(parameters: Mapping[str, Estimate], remedies: Remedies) -> list[str]:
    """Return a sentence for what isn't identifiable, by what rules its interval."""
    groups: dict[ErrorSource, list[str]] = {}
    for name, found in parameters.items():
        if found.identifiability != "identifiable":
            groups.setdefault(main_source(found.error_shares), []).append(symbol_of(name))
    return [
        f"These recordings don't tell {', '.join(names)} well: {remedies.of(source)}."
        for source, names in groups.items()
    ]


def unknown_among(parameters: Mapping[str, Estimate]) -> list[str]:
    """Return the symbols of what isn't identifiable."""
    return [symbol_of(name) for name, found in parameters.items() if found.identifiability != "identifiable"]
