"""Estimates and laws as pages state them: values, intervals, what they rest on, which law the data ask for."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from legfem.common.numbers import NOT_DETERMINED, fit_probability, number, share, span
from legfem.common.units import mpa_to_kpa, readable_unit, spaced_unit
from legfem.data.ranges import RANGES
from legfem.data.recording import Origin
from legfem.inverse.answer import Notice, Value
from legfem.inverse.catalogue import UNITS, key_of, parameter_of, symbol_of, unit_of
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.elastography import ShearModulus
from legfem.inverse.estimates import DISPLACEMENT, FORCE, Estimate, main_source
from legfem.inverse.fit import SIGNIFICANT, Fit, Goodness, TestFit, gain_of, misfit_of, value_of
from legfem.inverse.intervals import WEAKLY_WITHIN
from legfem.legs.subject import Subject
from legfem.report.page import Block, Known, Provenance, WebTable
from legfem.report.words import LAW_NAMES, REGION_NAMES, TOLD, WORDS, capital, moduli_text


def value_text(found: Estimate) -> str:
    """Return an estimate with the digits that its error leaves, and its unit; that it isn't determined else."""
    if found.undetermined:
        return NOT_DETERMINED
    shown = found.shown
    return f"{number(shown.value, shown.standard_error)}{spaced_unit(shown.unit)}"


def held_text(name: str, value: float) -> str:
    """Return a value in the model's unit as people read it."""
    unit, factor = readable_unit(unit_of(name))
    return f"{factor * value:.4g}{spaced_unit(unit)}"


def held_of(fits: Sequence[Fit[Any]]) -> dict[str, float]:
    """Return what was held with each law, by full name, but what was free with another."""
    free = {name for fit in fits for name in fit.estimates}
    return {name: value for fit in fits for name, value in fit.assumed.items() if name not in free}


def interval_text(found: Estimate) -> str:
    """Return an estimate's 95 % interval; nothing of one that isn't determined."""
    return "" if found.undetermined else span(found.shown.ci95, found.shown.standard_error, found.at_bound)


def known_text(known: Value, named: str = "") -> str:
    """Return a value with its interval; at a bound the interval alone, and no number of what is open."""
    if known.ci95 is None:
        return NOT_DETERMINED
    ends, unit = named + span(known.ci95, known.standard_error, known.at_bound), spaced_unit(known.unit)
    value = number(math.nan if known.value is None else known.value, known.standard_error)
    return f"{ends}{unit}" if known.at_bound else f"{value}{unit} ({ends})"


def words_of(name: str, regions: Mapping[str, str] = REGION_NAMES) -> str:
    """Return a parameter's full name in words, by those for a leg's tissues."""
    tissue, _, field = name.rpartition(".")
    if tissue not in regions and field in UNITS:
        return f"{field} of the {tissue.replace('_', ' ')}"
    if tissue not in regions:
        return parameter_of(name, {name: 1.0}).statement
    return f"{field} of the {regions[tissue]}"


def estimated(what: str, found: Estimate, data: int | str, isotropic: bool) -> Known:
    """Return an estimate's row: what it is, in words, and from how many recordings, or what else, it comes.

    Of an isotropic tissue, C10 has the moduli beside it.
    """
    parameter, error, (low, high) = found.parameter, found.shown.standard_error, found.shown.ci95
    source = data if isinstance(data, str) else f"{data} recording{'s' * (data > 1)}"
    remark = str(found.identifiability)
    if (prior := parameter.prior) is not None:
        unit, factor = readable_unit(parameter.unit)
        width = f"± {factor * prior.sd:.4g} {unit} (normal)"
        if prior.scale == "log":
            width = f"x/ {math.exp(prior.sd):.4g} {unit} (its logarithm is normal)"
        source += f"; prior {factor * prior.centre:.4g} {width}{f', from {prior.source}' if prior.source else ''}"
    if found.at_bound:
        remark += f"; at the {found.at_bound} bound of the search"
    if found.departure.by:
        remark += f"; {found.departure.text}"
    # Not beside an interval that was widened by more than noise.
    if found.one_number and not high - low > _WIDENED * error:
        remark += f"; ± {number(error)} (sd)"
    if isotropic and found.one_number and parameter.name.endswith(".C10"):
        remark += f"; {moduli_of(found)}"
    how: Provenance = "estimated" if parameter.role == "identified" else "prior"
    return Known(what, value_text(found), how, source, interval_text(found), remark)


_WIDENED = 8.0
"""Standard errors in a 95 % interval, of which noise alone makes some four."""


def how_found(results: Sequence[Fit[Any]]) -> list[Block]:
    """Tables of each law's energy and search, and of the errors' correlations."""
    rows = [
        {
            "law": LAW_NAMES[r.law],
            "strain energy": WORDS["energies"][r.law],
            "full solves": f"{r.log.forward_solves}",
            "failed": f"{r.log.failed_solves}",
            "reused from earlier runs": f"{r.log.reused_solves}",
            "converged": "yes" if r.log.converged else "NO",
            "time (s)": f"{r.log.wall_s:.1f}",
        }
        for r in results
    ]
    blocks: list[Block] = [WebTable.of("Laws, and how each was searched for", rows)]
    for r in results:
        symbols = [symbol_of(name) for name in r.estimates]
        if len(symbols) > 1:
            cells = [
                [symbol, *("not known" if np.isnan(value) else f"{value:+.3f}" for value in row)]
                for symbol, row in zip(symbols, r.correlations, strict=True)
            ]
            caption = f"Correlations of the errors, {LAW_NAMES[r.law]} law"
            blocks.append(WebTable(caption, ["", *symbols], cells, folded=True))
    return blocks


def moduli_of(found: Estimate) -> str:
    """Return the moduli at small strain that belong to an estimate of C10."""
    return moduli_text(found.shown.value, found.shown.standard_error, found.shown.unit)


def how_sure(parameters: Mapping[str, Estimate], words: Callable[[str], str] = symbol_of, fits: bool = True) -> str:
    """Return how well parameters are known, for someone who knows no statistics.

    Parameters
    ----------
    parameters
        By full name.
    words
        What a parameter is called.
    fits
        Whether the model describes what was measured.
    """
    each = []
    for name, found in parameters.items():
        half, how = found.relative_half_width, found.identifiability
        known = f"is known to within ± {share(half)}"
        if found.undetermined or not half <= 1:
            known = "cannot be determined from this test"
        elif found.at_bound:
            known = f"is {known_text(value_of(found))}, where its search ended"
        elif found.parameter.scale == "linear":
            known = f"is {known_text(value_of(found))}"
        elif half > WEAKLY_WITHIN:
            known = f"is known only to within ± {share(half)}, which is too little to use"
        elif how == "not identifiable":
            known += ", to which this test adds next to nothing"
        each.append(f"{words(name)} {known} ({how})")
    if not fits:
        return f"{capital('; '.join(each))}, were the model right; but it does not fit."
    return f"{capital('; '.join(each))}. If the model is right, 19 of 20 such intervals contain the true value."


def rests_on(parameters: Mapping[str, Estimate], likewise: str) -> list[str]:
    """Return a sentence on how far stiffness follows what nothing can check within a factor.

    Parameters
    ----------
    parameters
        By full name.
    likewise
        The sizes that it follows, too, in a sentence's end.
    """
    changes = [
        f"{symbol_of(name)} by {100 * found.moves[FORCE]:+.0f} % if all forces were 10 % higher "
        f"and by {100 * found.moves[DISPLACEMENT]:+.0f} % if all displacements were"
        for name, found in parameters.items()
        # What is hardly known changes by any number to first order; nor is time a matter of force.
        if all(abs(found.moves.get(one, np.nan)) < 1 for one in (FORCE, DISPLACEMENT)) and found.unit == "MPa"
    ]
    if not changes:
        return []
    return [TOLD["unchecked"].format(changes="; ".join(changes), likewise=likewise)]


_MUCH = 0.25
"""Share of an error's square from which it is worth to be told."""


def how_to_narrow(parameters: Mapping[str, Estimate], steps: Sequence[str], ends: str) -> list[str]:
    """Return a sentence for what isn't identifiable, by what rules its interval.

    Parameters
    ----------
    parameters
        By full name.
    steps
        Recordings that would narrow it and aren't there, in words.
    ends
        What to do where most of an error is that of ends.
    """
    lines, groups, known = list[str](), dict[ErrorSource, list[str]](), "state what you already know of it (--prior)"
    for name, found in parameters.items():
        symbol, half = symbol_of(name), found.relative_half_width
        if found.undetermined:
            law = "the law may have more parameters than they can. Use a law with fewer (--law)"
            if len(parameters) > 1 and all(other.endswith(".C10") for other in parameters):
                law = "ask for fewer stiffnesses at once, press at other places too"
            lines.append(f"These recordings do not determine {symbol}: {law}, or {known}.")
        elif found.at_bound and found.value > 0.0:  # a coefficient may be none, which is no end of a search
            lines.append(f"The search for {symbol} ended at its bound: check units and sizes, or search further.")
        elif found.one_number and found.identifiability != "identifiable":
            better = f"{symbol} better{f' than to ± {share(half)}' if half <= 1 else ''}"
            shares = dict(found.error_shares)
            if not steps and any(one > _MUCH for of, one in shares.items() if of != "recordings"):
                shares["recordings"] = 0.0  # no recording helps: what is next does
            groups.setdefault(main_source(shares), []).append(better)
    recordings = ", or ".join([*steps, known]) if steps else f"recordings have all that would help much; {known}"
    remedies: Mapping[ErrorSource, str] = {"recordings": recordings, "ends": ends}
    for source, names in groups.items():
        remedy = remedies.get(source) or f"much of the uncertainty comes from {WORDS['sources_of_error'][source]}"
        lines.append(f"To know {' and '.join(names)}: {remedy}.")
    return lines


def comparison(results: Sequence[Fit[Any]]) -> Iterator[str]:
    """Yield sentences on how well each law fits, and which is better by how much."""
    for one in results:
        law, probability = f"The {LAW_NAMES[one.law]} law", fit_probability(one.goodness.p_value)
        if math.isnan(one.goodness.p_value):
            yield f"{law} fits with rms {one.cost.rms:.3g} N."
        else:
            said = "fits" if one.goodness.fits else "leaves physics out that the recordings show: it does not fit"
            yield f"{law} {said} within the noise ({probability})."
    if len(results) < 2:
        return
    better, worse = sorted(results, key=misfit_of)[:2]
    if better.neo_hookean_limit or misfit_of(worse) <= misfit_of(better) * (1 + 1e-9):
        yield "Both laws fit equally well: the best reduced polynomial is neo-Hookean (C20 = 0)."
        return
    ratio = number(worse.cost.value / max(better.cost.value, 1e-300))
    costs = (
        f"cost is smaller by a factor of {ratio} ({better.cost.value:.3g} against "
        f"{worse.cost.value:.3g} N2, rms {better.cost.rms:.3g} against {worse.cost.rms:.3g} N)"
    )
    name, further = LAW_NAMES[better.law], len(better.estimates) > len(worse.estimates)
    gain, chance = gain_of(better, worse) if further else (0.0, 0.0)
    if further and chance >= SIGNIFICANT:
        yield TOLD["not_needed"].format(name=name, costs=costs, change=-gain, chance=fit_probability(chance))
        return
    yield f"The {name} law fits better: its {costs}."
    if further:
        lowers = f"it lowers chi-square by {number(gain)} ({fit_probability(chance)})"
        yield f"Its additional parameter is needed: {lowers}."


QUESTION = "Is that high or low"
_PUBLISHED_FOR = {"deep": "muscle", "superficial": "fat"}
_END = 0.25
"""Share of a published range, on a logarithmic scale, that is called its end."""


def high_or_low(
    tissue: str, low: float, high: float | None = None, notices: Sequence[Notice] = ()
) -> list[tuple[str, str]]:
    """Return a question with its answer; none where nothing was published.

    Parameters
    ----------
    tissue
        Of a leg: ``deep``, ``superficial``.
    low, high
        C10 (kPa), or the range in which it lies.
    notices
        What is said beside it, doubts whether people have it so among it.
    """
    known = RANGES.get(f"C10.{tissue}")
    if known is None or known.published is None:
        return []
    least, most = known.published
    high = low if high is None else high
    beyond = high < least or low > most
    if beyond:
        place = "Softer than" if high < least else "Stiffer than"
    elif low < least or high > most:
        place = "Partly outside of"
    else:
        ends = [math.log(v / least) / math.log(most / least) for v in (low, high)]
        soft, stiff = max(ends) < _END, min(ends) > 1 - _END
        place = "At the soft end of" if soft else "At the stiff end of" if stiff else "Within"
    doubted = any(one.parameters.get("field") == key_of(f"{tissue}.C10") for one in notices)
    check = " Few people have it so, as a warning says." if doubted and not beyond else ""
    check = " Check the units of force and displacement first." if beyond else check
    published = f"{least:g} to {most:g} {known.unit} ({known.basis})"
    return [(QUESTION, f"{place} what was published for {_PUBLISHED_FOR[tissue]}: {published}.{check}")]


def wave_rows(subject: Subject) -> list[Known]:
    """Return moduli and the fibres' ratio, each with where it comes from."""
    rows = modulus_rows(subject.elastography, subject.origin)
    if (fibres := subject.fibres) is not None:
        how, name = fibres.provenance, "muscle's shear moduli along the leg over across"
        rows.append(Known(name, str(fibres), subject.origin if how == "measured" else how, fibres.source))
    return rows


def modulus_rows(moduli: Iterable[ShearModulus], origin: Origin) -> list[Known]:
    """Return shear moduli, each with where it comes from."""
    return [
        Known(
            f"shear modulus of the {one.tissue} tissue, {one.plane} the leg",
            f"{mpa_to_kpa(one.value):.3g} ± {mpa_to_kpa(one.sd):.2g} kPa (sd)",
            origin,
            one.source,
        )
        for one in moduli
    ]


def own_value(one: TestFit, name: str) -> str:
    """A parameter's value as one test has it by itself."""
    unit, factor = readable_unit(unit_of(name))
    found = one.by_itself[name]
    value, error = factor * found.value, factor * found.standard_error
    return f"{number(value, error)} ± {number(error)} {unit}"


def chance(goodness: Goodness) -> str:
    """A sum of squares over its errors, in words."""
    plural = "s" * (goodness.degrees_of_freedom != 1)
    return (
        f"{float(f'{goodness.chi_square:.3g}'):g} for {goodness.degrees_of_freedom} degree{plural} of freedom "
        f"({fit_probability(goodness.p_value)})"
    )
