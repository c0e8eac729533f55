"""The page of a leg's sites: one set of tissues from all of them."""

from __future__ import annotations

from collections.abc import Sequence

from legfem.common.doubts import doubt_lines
from legfem.common.units import readable_unit
from legfem.inverse.catalogue import DEEP_C10, symbol_of, unit_of
from legfem.inverse.fit import LEAST_CHANCE, Goodness
from legfem.legs.subject import SitedLeg
from legfem.report.style import LAW_NAMES
from legfem.report.web import estimates
from legfem.report.web import page as web
from legfem.report.web.elastography import wave_rows
from legfem.report.web.identification import fit_curves, options_of
from legfem.report.web.sites_procedure import procedure
from legfem.report.web.usual import high_or_low
from legfem.report.words import fit_probability
from legfem.sites.result import SitesResult

_LIKEWISE = "cylinders that are 10 % shorter act as such forces do"
_NOT_TESTED = (
    "What the tissues do in time: unloading, holds and other speeds were not used.",
    "Which physics was left out, where a law does not fit: the diagnosis takes one site at a time.",
    "What is wrong alike at all sites (the load cell's calibration, the correction for the "
    "cylinder's ends, the stiffness assumed of fascia) looks like a change of stiffness.",
)


def sites_web_page(results: Sequence[SitesResult], command: str = "") -> web.WebPage:
    """Return the page of a leg's sites.

    Parameters
    ----------
    results
        One a law, of one leg.
    command
        That was given; empty where there was none.
    """
    best = best_law(results)
    leg = best.leg
    return web.WebPage(
        title=f"How stiff is leg {leg.id}{_by_how_much(leg)}?",
        subject=leg.title,
        origin=leg.origin,
        headline=_headline(best),
        warnings=list(
            dict.fromkeys([*(line for r in (best, *results) for line in doubt_lines(r.doubts)), *_warnings(results)])
        ),
        known=_known(results),
        chapters=[
            web.Chapter("Sites and model", [_alone(best)]),
            *_curves(results, best),
            web.Chapter(web.TESTED, [web.Bullets(_tested(results))]),
            web.Chapter(
                "What could not be tested",
                [web.Bullets([*estimates.rests_on(best.parameters, _LIKEWISE), *_NOT_TESTED])],
            ),
            web.Chapter("What to do next", [web.Bullets(_next(best))]),
            web.Chapter("How it was done", [web.Prose(procedure(best)), *estimates.how_found(results)]),
        ],
        repeat=web.Repeat(command, best.versions, {"seed": f"{best.seed}"}),
    )


def _by_how_much(leg: SitedLeg) -> str:
    return f", from {len(leg.sites)} sites together" if len(leg.sites) > 1 else ""


def _warnings(results: Sequence[SitesResult]) -> list[str]:
    """Return the laws' warnings; one that all laws have is no law's own."""
    shared = set.intersection(*(set(r.warnings) for r in results))
    return [line if line in shared else f"{LAW_NAMES[r.law]} law: {line}" for r in results for line in r.warnings]


def best_law(results: Sequence[SitesResult]) -> SitesResult:
    """Return the law's result that the page is about."""
    return estimates.least_akaike(results, lambda r: r.misfit.chi_square)


def _fits(result: SitesResult) -> bool:
    return not result.misfit.p_value < LEAST_CHANCE


def _agree(result: SitesResult) -> bool:
    return not result.agreement.p_value < LEAST_CHANCE


def _headline(best: SitesResult) -> web.Headline:
    law = LAW_NAMES[best.law]
    values = "; ".join(
        f"{estimates.words_of(name)} {estimates.value_text(found)} (95 % {estimates.interval_text(found)})"
        for name, found in best.parameters.items()
        if found.parameter.role == "identified"
    )
    sound, stiffness = _fits(best) and _agree(best), best.parameters.get(DEEP_C10)
    unsure = estimates.unknown_among(best.parameters)
    tone: web.Tone = "wrong" if not sound else "caution" if unsure else "sound"
    if sound:
        where = f"all {len(best.sites)} sites" if len(best.sites) > 1 else "the recordings"
        sentence = f"One {law} tissue describes {where}."
        wrong = "Nothing that the loading of these recordings could show."
    elif _agree(best):
        what = "these sites" if len(best.sites) > 1 else "the recordings"
        sentence = f"The model does not describe {what}: its stiffness is a wrong model's."
        chance = fit_probability(best.misfit.p_value)
        wrong = f"Something that the {law} law leaves out shows ({chance})."
    else:
        sentence = "The sites do not ask for the same stiffness."
        wrong = _agreement(best)
    return web.Headline(
        tone,
        sentence,
        [
            ("What is wrong", wrong),
            ("How stiff", f"{values}."),
            ("How sure", estimates.how_sure(best.parameters)),
            ("What to do", _next(best)[0]),
            *(high_or_low("deep", stiffness.shown.value) if sound and stiffness else ()),
        ],
    )


def _known(results: Sequence[SitesResult]) -> list[web.Known]:
    first = results[0]
    trials = sum(site.measured.n_trials for site in first.sites)
    rows = [
        estimates.estimated(f"{estimates.words_of(name)}, {LAW_NAMES[r.law]} law", found, trials)
        for r in results
        for name, found in r.parameters.items()
    ]
    free = {name for r in results for name in r.parameters}
    held = {n: v for r in results for n, v in r.assumed.items() if n not in free}
    rows += [
        web.Known(
            estimates.words_of(name),
            estimates.held_text(name, value),
            "assumed",
            "subject.toml, the command, or the law's own",
        )
        for name, value in held.items()
    ]
    rows += [
        web.Known(f"{symbol_of(name)} of each site", f"± {sd:.3g} (sd)", "prior", "--prior")
        for name, sd in first.own_errors.items()
    ]
    rows += wave_rows(first.sites[0].subject)
    rows += [
        web.Known(f"{one.name}: what presses", f"{one.subject.indenter}", "assumed", "subject.toml")
        for one in first.sites
    ]
    if first.spatial is not None:
        source: web.Provenance = "assumed" if first.spatial.extruded else "measured"
        rows += [
            web.Known(f"{one.name}: leg in 3D", shape, source, "subject.toml, [section]")
            for one, shape in zip(first.sites, first.spatial.shapes, strict=True)
        ]
    for site in first.sites:
        curve = site.measured
        rows.append(
            web.Known(
                f"{site.name}: greatest displacement used",
                f"{curve.displacement[-1]:.4g} mm",
                first.leg.origin,
                f"{curve.n_trials} recording{'s' * (curve.n_trials > 1)}, from first contact",
            )
        )
        if first.spatial is not None and site.correction is not None:
            rows.append(
                web.Known(
                    f"{site.name}: error of the leg's force in 3D there",
                    f"{100 * site.correction.sd[-1]:.2g} % (sd)",
                    "prior",
                    "larger elements, a shorter leg, and fibres' part",
                )
            )
        elif site.correction is not None:
            P, sd = site.correction.P[-1], site.correction.sd[-1]
            rows.append(
                web.Known(
                    f"{site.name}: 3D correction P there",
                    f"{P:+.3f}",
                    "prior",
                    site.correction.name,
                    f"{P - 2 * sd:+.3f} to {P + 2 * sd:+.3f}",
                    "its error is shared by all sites",
                )
            )
    return rows


def _alone(best: SitesResult) -> web.WebTable:
    if len(best.sites) < 2:
        (one,) = best.sites
        title = f"What the fit leaves, {LAW_NAMES[best.law]} law"
        row = [one.name, f"{one.rms:.3g}", _told(one.misfit)]
        return web.WebTable(title, ["site", "rms (N)", "misfit"], [row])
    names = list(best.parameters)
    return web.WebTable(
        f"What each site says by itself, {LAW_NAMES[best.law]} law (± one standard error; in "
        "brackets how far it departs from the joint value, in standard errors of that difference)",
        ["site", "rms (N)", "misfit", *map(symbol_of, names)],
        [
            [
                one.name,
                f"{one.rms:.3g}",
                _told(one.misfit),
                *(f"{_own_value(best, one.name, name)} ({one.by_itself[name].departure:+.1f})" for name in names),
            ]
            for one in best.sites
        ],
    )


def _curves(results: Sequence[SitesResult], best: SitesResult) -> list[web.Chapter]:
    chapters = []
    for number, site in enumerate(best.sites):
        predicted = {r.law: r.sites[number].predicted for r in results}
        curves = fit_curves(f"site{number}", "", site.measured, predicted, best.law)
        chapters.append(web.Chapter(f"Site: {site.name}", [curves]))
    return chapters


def _tested(results: Sequence[SitesResult]) -> list[str]:
    return [
        line
        for result in results
        for line in (
            f"{_together(result)}: chi-square {_told(result.misfit)}.",
            *([_agreement(result)] if len(result.sites) > 1 else ()),
            *(f"{text}." for text in _by_site(result)),
            *estimates.why_identifiable(result.parameters, result.law),
        )
    ]


def _together(result: SitesResult) -> str:
    law = f"{LAW_NAMES[result.law]} law"
    return f"All sites together, {law}" if len(result.sites) > 1 else law[0].upper() + law[1:]


def _next(best: SitesResult) -> list[str]:
    worst = min(best.sites, key=lambda one: one.misfit.p_value)
    far = max(best.sites, key=lambda one: max((abs(own.departure) for own in one.by_itself.values()), default=0.0))
    suspect = worst if _agree(best) else far
    diagnose = f"python -m legfem.diagnose {options_of(suspect.subject)}"
    # A diagnosis is of a section in plane strain.
    along = suspect.subject.indenter.lies_along
    if not (_fits(best) and _agree(best)):
        how = diagnose if along else "press there with a cylinder along the leg, and diagnose that"
        return [f"Find out what is otherwise at {suspect.name}: {how}"]
    unknown = estimates.unknown_among(best.parameters)
    several = len(best.sites) > 1
    what = "These sites" if several else "The recordings"
    lines = [
        f"{what} don't tell {', '.join(unknown)} well: press deeper, or where the fat is thinner."
        if unknown
        else f"Use these numbers together with the {LAW_NAMES[best.law]} law."
    ]
    if along:
        by_site = ", site by site" if several else ""
        lines.append(f"Have unloading, holds and speeds looked at{by_site}: {diagnose}")
    return lines


def _by_site(result: SitesResult) -> list[str]:
    """Return a line a site: how far the joint fit is from it, and what it says by itself."""
    if len(result.sites) < 2:
        return [f"{one.name}: rms {one.rms:.3g} N, {_told(one.misfit)}" for one in result.sites]
    return [
        f"{one.name}: rms {one.rms:.3g} N, {_told(one.misfit)}; by itself "
        + ", ".join(_own_value(result, one.name, name) for name in one.by_itself)
        for one in result.sites
    ]


def _own_value(result: SitesResult, site: str, name: str) -> str:
    """Return a parameter as one site says it."""
    unit, factor = readable_unit(unit_of(name))
    found = next(one for one in result.sites if one.name == site).by_itself[name]
    return f"{symbol_of(name)} {factor * found.value:.3g} ± {factor * found.standard_error:.2g} {unit}"


def _agreement(result: SitesResult) -> str:
    """Return whether the sites agree, as a sentence."""
    far = {name: result.farthest(name) for name in result.parameters}
    most = max(far, key=lambda name: abs(far[name].by_itself[name].departure))
    departure = far[most].by_itself[most].departure
    text = (
        f"The sites' own values differ by chi-square {_told(result.agreement)}; {far[most].name} "
        f"departs most, in {symbol_of(most)} by {departure:+.1f} standard errors."
    )
    if (ratio := result.agreement.birge_ratio) > 1:
        text += f" Intervals are wider for it by up to {ratio:.3g} (Birge's ratio)."
    return text


def _told(chance: Goodness) -> str:
    """Return a sum of squares beside its degrees of freedom."""
    return (
        f"{chance.chi_square:.3g} for {chance.degrees_of_freedom} degrees of freedom "
        f"({fit_probability(chance.p_value)})"
    )
