"""What a reader of a leg's fit must know: one sentence a warning, the gravest first."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from legfem.common.errors import Doubt
from legfem.data import LoadingCurve
from legfem.inverse.catalogue import DEEP_RATIO, key_of
from legfem.inverse.elastography import disagreement, elastography_priors
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import LAW_MISSES, Fit, at_limits, far_from_priors, of_compromise, of_failed_solves, of_search
from legfem.legs.correction_of_leg import why_uncorrected, why_without_fibres
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialEvidence, SpatialSites
from legfem.legs.plausibility import doubts_about, doubts_about_stiffness, poisson_ratio
from legfem.legs.site_test import curve_of
from legfem.legs.subject import TYPICAL_FORCE_SD, Subject

_EXTRUDED = (
    "The leg in 3D is the section, extruded: how the leg's girth changes along {what} is left out. Give a "
    "scan, surfaces or contours at several levels as [section]."
)
_TYPICAL = (
    "The leg's outlines are a typical calf's of the measured girth and fat thickness: the intervals include "
    f"{100 * TYPICAL_FORCE_SD:g} % of the force (one standard deviation) for its shape. Outlines of this leg from MRI, "
    "CT or ultrasound remove that error."
)
_NO_FIBRES = (
    "The 3D correction takes muscle to be equally stiff in all directions. Where its shear modulus along "
    "the leg is three times that across, a cylinder of 50 mm meets 13 to 27 % more force "
    "(studies/fibres), and C10 is about as much too high. State fibre_ratio under [tissues.deep], "
    "or [[elastography]] along and across."
)


def warnings_about(fit: Fit[LegDetails]) -> tuple[str, ...]:
    """Warnings about a leg's fit, the gravest first."""
    details, log = fit.details, fit.log
    several = len(fit.tests) > 1
    texts = [*of_search(log)]
    if not fit.goodness.fits:
        texts.append(_misfit_of_sites(fit) if several else _misfit(fit))
    if not fit.agreement.fits:
        texts.append(_disagreement_of_sites(fit))
    texts += of_compromise(log.compromise)
    for one in fit.tests:
        texts += [f"Site {one.name}: {text}" if several else text for text in begun_in_air(curve_of(one))]
    texts += at_limits(fit)
    reach = "" if several else f"{curve_of(fit.tests[0]).displacement[-1]:g} mm"
    texts += of_failed_solves(log, reach)
    texts += far_from_priors(fit.estimates)
    if details.subject.typical_shape:
        texts.append(_TYPICAL)
    texts += _left_out(fit)
    if isinstance(details.spatial, SpatialSites):
        texts += of_elastography(details.subject, fit.estimates)
        return (*texts, *_in_3d(fit, details.spatial))
    texts += dict.fromkeys(
        text
        for one, correction in zip(details.leg.sites, details.corrections, strict=True)
        for text in of_ends(one, correction)
    )
    texts += of_elastography(details.subject, fit.estimates)
    if several and sum(one is not None for one in details.corrections) > 1:
        texts.append(
            "The error of the 3D correction is taken to be the same at all sites. It does not average "
            "out, so more sites do not narrow that part of the intervals."
        )
    for name, tissue in details.subject.tissues.items():
        if name != "deep" and (ratio := poisson_ratio(tissue)) is not None and ratio < 0:
            texts.append(
                f"The {name}'s Poisson's ratio is {ratio:.2f} with its C10 and D1 as given: its "
                "bulk modulus lies below 2/3 of its shear modulus."
            )
    return tuple(texts)


def _left_out(fit: Fit[LegDetails]) -> Iterator[str]:
    """Say which channels aren't used, since the model doesn't give them."""
    in_3d = isinstance(fit.details.spatial, SpatialSites)
    model, own, other = ("in 3D", "3d", "2d") if in_3d else ("of the section", "2d", "3d")
    every = (one.kind for site in fit.details.leg.sites for trial in site.recordings for one in trial.channels)
    unlike = dict.fromkeys(one.name for one in every if other in one.models and own not in one.models)
    names = " and ".join(name.replace("_", " ") for name in unlike)
    if names:
        yield f"What was recorded of {names} is not used: the model {model} has no such reading (--model {other} has)."


def of_two_fidelities(evidence: SpatialEvidence, most_solves: int) -> Iterator[str]:
    """Warnings about a correction that the leg's own solves in 3D confirm."""
    if not evidence.converged:
        yield (
            f"The correction in 3D has not settled within {most_solves} solves: its interval "
            "carries what its last prediction missed."
        )
    if evidence.extruded:
        yield _EXTRUDED.format(what="the cylinder")


def doubts_of(fit: Fit[LegDetails]) -> tuple[Doubt, ...]:
    """What is unlikely at any site, and in stiffnesses that nobody has found so."""
    several = len(fit.tests) > 1
    own = [
        replace(doubt, field=f"site {site.site or 'leg'}, {doubt.field}") if several else doubt
        for site in fit.details.leg.sites
        for doubt in doubts_about(site)
    ]
    return (*own, *doubts_about_stiffness(fit.details.subject, fit.estimates))


def _misfit(fit: Fit[LegDetails]) -> str:
    (one,) = fit.tests
    noise = float(curve_of(one).force_sd.mean())
    return (
        "The law does not describe these recordings: the fit misses by "
        f"{fit.cost.rms:.2g} N rms where their mean is known to {noise:.2g} N "
        f"(chi-square {fit.goodness.chi_square:.4g} for {fit.goodness.degrees_of_freedom} degrees "
        f"of freedom). {LAW_MISSES}"
    )


def _misfit_of_sites(fit: Fit[LegDetails]) -> str:
    worst = min(fit.tests, key=lambda one: one.goodness.p_value)
    return (
        "The law does not describe these sites together (chi-square "
        f"{fit.goodness.chi_square:.4g} for {fit.goodness.degrees_of_freedom} degrees of "
        f"freedom), {worst.name} least (misses by {worst.force.rms:.2g} N rms). {LAW_MISSES}"
    )


def _disagreement_of_sites(fit: Fit[LegDetails]) -> str:
    departures = []
    for name in fit.estimates:
        far = fit.farthest(name)
        departures.append(
            f"{key_of(name)} departs most at {far.name}, by {far.by_itself[name].departure:+.1f} standard errors"
        )
    return (
        "The sites do not agree on the parameters (chi-square "
        f"{fit.agreement.chi_square:.3g} for {fit.agreement.degrees_of_freedom} degrees "
        f"of freedom): {'; '.join(departures)}. That site differs, was stated wrongly, "
        "or has physics that the law leaves out: diagnose it alone. The intervals are widened until such "
        "a disagreement would be usual, and assume no particular cause."
    )


def begun_in_air(measured: LoadingCurve) -> Iterator[str]:
    """Say that first contact was looked for, where it was."""
    in_air = [contact.displacement for contact in measured.contacts if contact.in_air]
    if in_air:
        at = ", ".join(f"{displacement:.2f}" for displacement in in_air)
        yield (
            f"{len(in_air)} of {measured.n_trials} recordings seem to begin in air: "
            f"first contact is put at {at} mm. Very soft tissue that stiffens looks the same; if "
            "displacement counts from first touch, say so in subject.toml: [recordings] "
            "starts_at_contact = true."
        )


def of_ends(subject: Subject, correction: AppliedCorrection | None) -> Iterator[str]:
    """What is to be known of the cylinder's ends, and of fibres under them."""
    if correction is None:
        yield f"No 3D correction is applied: {_without_correction(subject)}"
    elif not subject.plane_strain:
        yield from _of_fibres(subject, correction.with_fibres)


def of_elastography(subject: Subject, estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Say where elastography and indentation disagree."""
    for name, prior in elastography_priors(subject.elastography).items():
        one = estimates.get(name)
        if one is not None and one.parameter.prior == prior:
            yield from disagreement(name, prior, one.value, one.standard_error)


def _in_3d(fit: Fit[LegDetails], spatial: SpatialSites) -> Iterator[str]:
    """What is to be known of a leg whose search went on solves in 3D."""
    if spatial.untold:
        yield spatial.untold
    if DEEP_RATIO in fit.estimates or DEEP_RATIO in fit.values:
        yield (
            "Fibres are taken to run along the leg, and to be as stiff in tension as their ratio "
            "in shear has it, to a factor of 2: the intervals have the error of that, at the "
            "optimum."
        )
    elif (fibres := fit.details.subject.fibres) is None:
        yield (
            "Muscle is taken to be equally stiff in all directions. Give --identify deep.fibre_ratio where "
            "the leg is pressed in two ways, or state fibre_ratio under [tissues.deep]."
        )
    else:
        yield (
            f"Muscle is taken to be {fibres} times as stiff in shear along the leg as across "
            f"({fibres.provenance}: {fibres.source})."
        )
    if spatial.extruded:
        yield _EXTRUDED.format(what="it")


def _of_fibres(subject: Subject, in_correction: bool) -> Iterator[str]:
    if subject.fibres is None:
        yield _NO_FIBRES
        return
    known = (
        f"Muscle is taken to be {subject.fibres} times as stiff in shear along the leg as across "
        f"({subject.fibres.provenance}: {subject.fibres.source})"
    )
    if not in_correction:
        why = why_without_fibres(subject) or "it was given by itself"
        yield f"{known}, but the 3D correction has no fibres: {why}. --model 3d has them."
        return
    error = "and C10's interval has the error of that"
    if not subject.fibres.sd:
        error += ", but none of the ratio, which is stated without (fibre_ratio_sd)"
    yield f"{known}: the 3D correction has what fibres do, {error}."


def _without_correction(subject: Subject) -> str:
    if subject.plane_strain:
        return (
            "these recordings were simulated in plane strain and so contain no end effects. Recordings of "
            "a real leg are corrected by default."
        )
    other = why_uncorrected(subject)
    return (
        "a constant factor on the force cannot be distinguished from C10, so end effects are part of the "
        f"stiffness given here.{'' if other is None else f' There is none by default: {other}.'}"
    )
