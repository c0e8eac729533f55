"""The numbers of a leg's fit, where each comes from, and how the fit was done."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from legfem.common.numbers import fit_probability
from legfem.common.units import mpa_to_kpa
from legfem.geometry.section import MUSCLE, girth
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.fit import Fit
from legfem.inverse.intervals import NUMERICAL_ERROR
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialEvidence, SpatialSites
from legfem.legs.finite_element_models import tissues_of
from legfem.legs.forward import values_of
from legfem.legs.site import curve_of
from legfem.mechanics.materials import Hyperelastic
from legfem.report.estimates import estimated, held_of, held_text, how_found, wave_rows, words_of
from legfem.report.further_channels import channel_name
from legfem.report.page import Block, Known, Prose, Provenance, WebTable
from legfem.report.words import LAW_NAMES, TOLD, WORDS, region_words

type LegFit = Fit[LegDetails]

_AT = (5.0, 15.0, 25.0)
"""Displacements at which a correction is tabled, mm."""


def known_of(fits: Sequence[LegFit]) -> Iterator[Known]:
    """What was found with each law, what was held, and what was measured at each site."""
    first = fits[0]
    details, subject = first.details, first.details.subject
    regions = region_words(subject.section)
    trials = sum(curve_of(one).n_trials for one in first.tests)
    yield from (
        estimated(f"{words_of(name, regions)}, {LAW_NAMES[fit.law]} law", found, trials, subject.fibres is None)
        for fit in reversed(fits)
        for name, found in fit.estimates.items()
    )
    given = values_of(tissues_of(subject))
    for name, value in held_of(fits).items():
        stated = np.isclose(given.get(name, math.nan), value)
        source = "subject.toml" if stated else "the command, or the law's default"
        # Of what was found off its bounds.
        moved = ", ".join(
            f"{symbol_of(found)} {100 * estimate.moves[name]:+.1f} % ({LAW_NAMES[fit.law]})"
            for fit in reversed(fits)
            for found, estimate in fit.estimates.items()
            if math.isfinite(estimate.moves.get(name, math.nan))
        )
        remark = f"if it were 10 % higher: {moved}" if moved else ""
        yield Known(words_of(name, regions), held_text(name, value), "assumed", source, remark=remark)
    if thickness := subject.section.fascia_thickness:
        yield Known("thickness of the fascia", f"{thickness:g} mm", "assumed", "subject.toml")
    yield from (
        Known(f"{symbol_of(name)} of each site", f"± {sd:.3g} (sd)", "prior", "--prior")
        for name, sd in details.own_errors.items()
    )
    yield from wave_rows(subject)
    if isinstance(details.spatial, SpatialEvidence):
        yield from _confirmed_rows(details.spatial, float(curve_of(first.tests[0]).displacement[-1]))
    numerical = f"{100 * NUMERICAL_ERROR:g} % of the force (sd)"
    yield Known("error of the numerical model", numerical, "prior", "convergence study")
    for number in range(len(first.tests)):
        yield from _site_rows(first, number)


def _site_rows(fit: LegFit, number: int) -> Iterator[Known]:
    """What was measured, stated and corrected at one site."""
    details, one = fit.details, fit.tests[number]
    subject, curve, applied = details.leg.sites[number], curve_of(one), details.corrections[number]
    at, data, depth = f"{one.name}: " if len(fit.tests) > 1 else "", subject.origin, curve.displacement[-1]
    if isinstance(details.spatial, SpatialSites):
        source: Provenance = "assumed" if details.spatial.extruded else "measured"
        yield Known(f"{at}leg in 3D", details.spatial.shapes[number], source, "subject.toml, [section]")
        if applied is not None:
            name, by = f"{at}error of the leg's force in 3D at {depth:.3g} mm", f"{100 * applied.sd[-1]:.2g} % (sd)"
            yield Known(name, by, "prior", "larger elements, a shorter leg, and fibres' part")
    elif applied is not None:
        P, sd = applied.P[-1], applied.sd[-1]
        ends, shared = f"{P - 2 * sd:+.3f} to {P + 2 * sd:+.3f}", "its error is shared by all sites" if at else ""
        name = f"{at}3D correction P at {depth:.3g} mm"
        yield Known(name, f"{P:+.3f}", "prior", applied.name, ends, shared)
    yield Known(f"{at}noise of a force reading", f"{curve.white_sd:.3g} N (sd)", data, "from sample to sample")
    for beside in one.channels[1:]:
        shown, station, count = beside.channel.values, beside.channel.station, len(beside.channel)
        ends = f"{shown[np.argmin(station)]:.3g} and {shown[np.argmax(station)]:.3g} {beside.channel.unit}"
        yield Known(f"{at}{channel_name(beside)}, first and deepest reading", ends, data, f"{count} readings")
    trials = f"{curve.n_trials} recording{'s' * (curve.n_trials > 1)}, from first contact"
    name, value = f"{at}girth of the section", f"{girth(subject.section):.0f} mm"
    yield Known(f"{at}greatest displacement used", f"{depth:.4g} mm", data, trials)
    yield (
        Known(name, value, "assumed", "subject.toml", remark=f"a typical {subject.typical_shape} was scaled to it")
        if subject.typical_shape
        else Known(name, value, subject.origin, "contours of the skin")
    )
    yield Known(f"{at}what presses", f"{subject.indenter}", "assumed", "subject.toml")


def _confirmed_rows(found: SpatialEvidence, depth: float) -> list[Known]:
    """What the leg's own solves in 3D say of its correction."""
    source: Provenance = "assumed" if found.extruded else "measured"
    solves = f"{found.full_solves} on the chosen mesh, {found.rough_solves} on coarser ones"
    errors = ", then ".join(f"{100 * one.error:.2g} %" for one in found.confirmations)
    rows = [
        Known("leg in 3D", f"{found.length:.4g} mm long", source, found.shape),
        Known("full solves in 3D", solves, "computed", f"the force differed from the predicted one by {errors}"),
    ]
    if found.table_P is not None:
        name = f"P at {depth:.3g} mm of the table's idealised legs"
        rows.append(Known(name, f"{found.table_P[-1]:+.3f}", "computed", "for comparison"))
    return rows


def how_done(fits: Sequence[LegFit]) -> list[Block]:
    """What was done: each law's search and fit, the tissues, what corrected the force."""
    first = fits[0]
    statistics = {LAW_NAMES[fit.law]: _statistics(fit) for fit in fits}
    how_well = [{"": name, **{law: each[name] for law, each in statistics.items()}} for name in _statistics(first)]
    blocks: list[Block] = [
        Prose(_procedure(first)),
        *how_found(fits),
        WebTable.of(f"How well each law fits; E is the {first.cost.definition}", how_well),
        _tissues(fits),
    ]
    every = [_tissue(name, fit) for name in fits[0].details.subject.tissues for fit in fits]
    if any(found is not None and found[0].poisson_ratio < 0 for found in every):
        below = "A Poisson's ratio below zero follows from the given C10 and D1, as it does from the published values "
        blocks.append(Prose(f"{below}for fascia."))
    for fit in fits:
        spatial, several = fit.details.spatial, len(fit.tests) > 1
        if isinstance(spatial, SpatialSites):
            continue
        for one, applied in zip(fit.tests, fit.details.corrections, strict=True):
            if applied is not None:
                at = f"{one.name}: " if several else ""
                blocks.append(_correction_table(fit, at, one.force.channel.station, applied))
        if spatial is not None:
            errors = ", ".join(f"{name} {value:.3f}" for name, value in spatial.errors.items())
            blocks += [_confirmed(spatial), Prose(f"Greatest error of P by cause: {errors}.")]
    return blocks


def _procedure(fit: LegFit) -> str:
    """What was done with the recordings, as a paragraph."""
    details, several = fit.details, len(fit.tests) > 1
    curves = [curve_of(one) for one in fit.tests]
    pressed = ", ".join(
        f"{one.name}: {site.indenter}, to {curve.displacement[-1]:.4g} mm"
        if several
        else f"a rigid {site.indenter}, pressed into the leg to {curve.displacement[-1]:.4g} mm after first contact"
        for one, site, curve in zip(fit.tests, details.leg.sites, curves, strict=True)
    )
    trials = sum(curve.n_trials for curve in curves)
    weighed = "the loading of" if fit.weighting == "paper" else "loading, hold and unloading of"
    own = ""
    if details.own_errors:
        sizes = ", ".join(f"{symbol_of(name)} {sd:.3g} (sd)" for name, sd in details.own_errors.items())
        own = f" Errors of the sites' instruments are independent: {sizes}."
    together = "All sites were fitted together by one set of tissues. " if several else ""
    minimiser = fit.settings.get("genetic", {}).get("minimiser")
    searcher = "A genetic algorithm (pygad)" if minimiser is None else f"A search of the user's ({minimiser})"
    deep = all(name.startswith("deep.") for name in fit.estimates)
    weights = WORDS["weightings"][fit.weighting]
    sought = "the tissue's parameters" if deep else ", ".join(fit.estimates)
    many = f"{trials} trial{'s' * (trials > 1)}"
    how = {"pressed": pressed, "weighed": weighed, "together": together, "model": _model(fit), "searcher": searcher}
    return TOLD["of_stations"].format(trials=many, sought=sought, weights=weights, own=own, **how)


def _model(fit: LegFit) -> str:
    spatial = fit.details.spatial
    if isinstance(spatial, SpatialSites):
        left = ", ".join(f"{name} {100 * value:.2g} %" for name, value in spatial.errors.items())
        return TOLD["spatial_sites"].format(full=spatial.full_solves, rough=spatial.rough_solves, left=left)
    applied = fit.details.corrections[0]
    if isinstance(spatial, SpatialEvidence):
        full = f"{spatial.full_solves} full solve{'s' * (spatial.full_solves > 1)}"
        return TOLD["spatial_evidence"].format(full=full, rough=spatial.rough_solves)
    correction = f"with the 3D correction {applied.name}" if applied else "without a correction for 3D effects"
    alike = ", whose errors are taken to be alike at all sites" if applied and len(fit.tests) > 1 else ""
    return TOLD["plane_model"].format(correction=correction + alike)


def _statistics(fit: LegFit) -> dict[str, str]:
    cost, good, error = fit.cost, fit.goodness, fit.log.emulator_error
    return {
        "E (N²)": f"{cost.value:.3g}",
        "E per length ((N/mm)²)": f"{cost.per_length:.3g}",
        "mean of squares (N²)": f"{cost.mean_square:.3g}",
        "minimised": f"{cost.minimised}; {cost.minimised_value:.3g} at the optimum",
        "rms difference (N)": f"{cost.rms:.3g}",
        "R²": f"{cost.r_squared:.4f}",
        "chi-square": f"{good.chi_square:.4g} on {good.degrees_of_freedom} degrees of freedom; "
        f"{fit_probability(good.p_value)}",
        "factorisations": f"{fit.log.factorisations}",
        "emulator's error, against the last full solve (N)": "no emulator" if math.isnan(error) else f"{error:.3g}",
    }


def _tissues(fits: Sequence[LegFit]) -> WebTable:
    rows: list[dict[str, str]] = []
    section = fits[0].details.subject.section
    groups, words = section.groups, region_words(section) if MUSCLE in section.lacks else {}
    for name in fits[0].details.subject.tissues:
        for fit in fits:
            if (found := _tissue(name, fit)) is None:
                continue
            tissue, known = found
            law = fit.details.subject.tissues[name].law if name in ("superficial", "fascia") else fit.law
            row = {
                "tissue": f"{name}: {', '.join(groups[name])}" if name in groups else words.get(name, name),
                "law": LAW_NAMES[law],
                "C10 (kPa)": f"{mpa_to_kpa(tissue.C10):.3g}",
                "C10 is": known,
                "D1 (1/MPa)": f"{tissue.D1:.4g}",
                "bulk over shear modulus": f"{tissue.bulk_modulus / tissue.shear_modulus:.3g}",
                "Poisson's ratio": f"{tissue.poisson_ratio:.2f}",
            }
            rows += [row] if row not in rows else []
    return WebTable.of("Tissues at the optimum", rows)


def _tissue(name: str, fit: LegFit) -> tuple[Hyperelastic, str] | None:
    """A tissue's compressible part at the optimum, and how its C10 is known; None of one that the model hasn't."""
    every: Mapping[str, float] = {**fit.assumed, **fit.values}
    if not {f"{name}.C10", f"{name}.D1"} <= every.keys():
        return None
    found = fit.estimates.get(f"{name}.C10")
    known = "assumed" if found is None else found.parameter.role
    return Hyperelastic(C10=every[f"{name}.C10"], D1=every[f"{name}.D1"]), known


def _correction_table(fit: LegFit, at: str, grid: np.ndarray, applied: AppliedCorrection) -> WebTable:
    spatial, rows = fit.details.spatial, []
    for d in [d for d in _AT if grid[0] <= d <= grid[-1]] or [float(grid[-1])]:
        P = f"{np.interp(d, grid, applied.P):+.2f} ± {np.interp(d, grid, applied.sd):.2f}"
        rows.append({"at (mm)": f"{d:.3g}", "P, with the sd that the intervals carry": P})
        if isinstance(spatial, SpatialEvidence) and spatial.table_P is not None:
            rows[-1]["P of the table of idealised legs"] = f"{np.interp(d, grid, spatial.table_P):+.2f}"
    caption = f"{at}3D correction {applied.name}, {LAW_NAMES[fit.law]} law: force = (1 - P) x plane strain"
    return WebTable.of(caption, rows)


def _confirmed(found: SpatialEvidence) -> WebTable:
    """What the leg's own solves in 3D say."""
    rows = [
        {
            "C10 (kPa)": f"{mpa_to_kpa(one.c10):.3g}",
            "C20 (kPa)": f"{mpa_to_kpa(one.c20):.3g}",
            "difference from the predicted force (%)": f"{100 * one.error:.2g}",
            "change of C10 afterwards (%)": f"{100 * one.moved:.2g}",
            "time (s)": f"{one.seconds:.0f}",
        }
        for one in found.confirmations
    ]
    return WebTable.of(f"Full solves of the leg in 3D ({found.shape}{', assumed' if found.extruded else ''})", rows)
