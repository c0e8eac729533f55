"""What a reader of a leg's fit must know: notices, the gravest first."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from enum import StrEnum

from legfem.common.errors import Doubt
from legfem.data import LoadingCurve
from legfem.inverse.answer import Notice, doubted
from legfem.inverse.catalogue import DEEP_RATIO
from legfem.inverse.channel_readings import not_read
from legfem.inverse.elastography import FibreRatio, disagreement, elastography_priors
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit, at_limits, far_from_priors, of_compromise, of_failed_solves, of_search
from legfem.legs.correction_of_leg import why_uncorrected, why_without_fibres
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialEvidence, SpatialSites
from legfem.legs.plausibility import doubts_about, doubts_about_stiffness, poisson_ratio
from legfem.legs.site import curve_of
from legfem.legs.subject import Subject
from legfem.legs.typical import TYPICAL_LIMBS


class LegNotice(StrEnum):
    """Codes that only a leg has."""

    MISFIT = "leg_misfit"
    MISFIT_OF_SITES = "sites_misfit"
    SITES_DISAGREE = "sites_disagree"
    BEGUN_IN_AIR = "recordings_begun_in_air"
    TYPICAL_SHAPE = "typical_shape"
    CHANNELS_UNUSED = "channels_unused"
    NEGATIVE_POISSON_RATIO = "negative_poisson_ratio"
    ENDS_SHARED = "error_of_ends_shared"
    UNCORRECTED_PLANE_STRAIN = "uncorrected_plane_strain"
    UNCORRECTED = "uncorrected"
    CORRECTION_BEYOND = "correction_beyond"
    CORRECTION_UNSETTLED = "correction_unsettled"
    EXTRUDED = "section_extruded"
    NO_FIBRES_IN_CORRECTION = "no_fibres_in_correction"
    FIBRES_IN_CORRECTION = "fibres_in_correction"
    FIBRES_NOT_IN_CORRECTION = "fibres_not_in_correction"
    FIBRES_UNDETERMINED = "fibres_undetermined"
    FIBRES_ALONG = "fibres_along_leg"
    FIBRES_STATED = "fibres_stated"
    NO_FIBRES = "no_fibres"
    ENDS_NOT_STATED = "ends_not_stated"


def notices_about(fit: Fit[LegDetails]) -> tuple[Notice, ...]:
    """Notices about a leg's fit, the gravest first."""
    details, log = fit.details, fit.log
    several = len(fit.tests) > 1
    found = [*doubted(_doubts_of(fit)), *of_search(log)]
    found += (*_misfits(fit), *of_compromise(log))
    for one in fit.tests:
        found += begun_in_air(curve_of(one), one.name if several else "")
    found += at_limits(fit)
    found += of_failed_solves(log, "" if several else f"{curve_of(fit.tests[0]).displacement[-1]:g} mm")
    found += far_from_priors(fit.estimates)
    if limb := details.subject.typical_shape:
        force_percent = 100 * TYPICAL_LIMBS[limb].force_sd
        found.append(Notice.of(LegNotice.TYPICAL_SHAPE, limb=limb, force_percent=force_percent))
    found += _left_out(fit)
    found += dict.fromkeys(notice for site in details.leg.sites for notice in not_read(site.recordings))
    if isinstance(details.spatial, SpatialSites):
        found += of_elastography(details.subject, fit.estimates)
        return (*found, *_in_3d(fit, details.spatial))
    found += dict.fromkeys(
        notice
        for one, correction in zip(details.leg.sites, details.corrections, strict=True)
        for notice in of_ends(one, correction)
    )
    found += of_elastography(details.subject, fit.estimates)
    if several and sum(one is not None for one in details.corrections) > 1:
        found.append(Notice.of(LegNotice.ENDS_SHARED))
    for name, tissue in details.subject.tissues.items():
        if name != "deep" and (ratio := poisson_ratio(tissue)) is not None and ratio < 0:
            found.append(Notice.of(LegNotice.NEGATIVE_POISSON_RATIO, tissue=name, ratio=ratio))
    return tuple(found)


def _left_out(fit: Fit[LegDetails]) -> Iterator[Notice]:
    """Say which channels aren't used, since the model doesn't give them."""
    own, other = ("3d", "2d") if isinstance(fit.details.spatial, SpatialSites) else ("2d", "3d")
    every = (one.kind for site in fit.details.leg.sites for trial in site.recordings for one in trial.channels)
    unlike = dict.fromkeys(one.name for one in every if other in one.models and own not in one.models)
    if unlike:
        yield Notice.of(LegNotice.CHANNELS_UNUSED, channels=tuple(unlike), model=own, other=other)


def of_two_fidelities(evidence: SpatialEvidence, most_solves: int) -> Iterator[Notice]:
    """Notices about a correction that the leg's own solves in 3D confirm."""
    if not evidence.converged:
        yield Notice.of(LegNotice.CORRECTION_UNSETTLED, solves=most_solves)
    if evidence.extruded:
        yield Notice.of(LegNotice.EXTRUDED, under="the cylinder")


def _doubts_of(fit: Fit[LegDetails]) -> tuple[Doubt, ...]:
    """What is unlikely at any site, and in stiffnesses that nobody has found so."""
    several = len(fit.tests) > 1
    own = [
        replace(doubt, field=f"site {site.site or 'leg'}, {doubt.field}") if several else doubt
        for site in fit.details.leg.sites
        for doubt in doubts_about(site)
    ]
    return (*own, *doubts_about_stiffness(fit.details.subject, fit.estimates))


def _misfits(fit: Fit[LegDetails]) -> Iterator[Notice]:
    """Say that the law misses the recordings, and that sites disagree."""
    goodness, worst = asdict(fit.goodness), min(fit.tests, key=lambda one: one.goodness.p_value)
    if not fit.goodness.fits and len(fit.tests) > 1:
        yield Notice.of(LegNotice.MISFIT_OF_SITES, worst=worst.name, rms=worst.force.rms, **goodness)
    elif not fit.goodness.fits:
        noise = float(curve_of(worst).force_sd.mean())
        yield Notice.of(LegNotice.MISFIT, rms=fit.cost.rms, noise=noise, **goodness)
    if not fit.agreement.fits:
        far = [(name, fit.farthest(name)) for name in fit.estimates]
        farthest = tuple((name, one.name, one.by_itself[name].departure) for name, one in far)
        yield Notice.of(LegNotice.SITES_DISAGREE, **asdict(fit.agreement), farthest=farthest)


def begun_in_air(measured: LoadingCurve, site: str = "") -> Iterator[Notice]:
    """Say that first contact was looked for, where it was; ``site`` names one of several."""
    in_air = tuple(contact.displacement for contact in measured.contacts if contact.in_air)
    if in_air:
        trials = len(measured.contacts)
        yield Notice.of(LegNotice.BEGUN_IN_AIR, count=len(in_air), trials=trials, contacts=in_air, site=site)


def of_ends(subject: Subject, correction: AppliedCorrection | None) -> Iterator[Notice]:
    """What is to be known of the cylinder's ends, and of fibres under them."""
    fibres = subject.fibres
    if correction is not None and correction.beyond:
        yield Notice.of(LegNotice.CORRECTION_BEYOND, **correction.beyond)
    if correction is None and subject.plane_strain:
        yield Notice.of(LegNotice.UNCORRECTED_PLANE_STRAIN)
    elif correction is None:
        yield Notice.of(LegNotice.UNCORRECTED, why_none=why_uncorrected(subject) or "")
    elif subject.plane_strain:
        return
    elif fibres is None:
        yield Notice.of(LegNotice.NO_FIBRES_IN_CORRECTION)
    elif correction.with_fibres:
        yield _of_fibres(LegNotice.FIBRES_IN_CORRECTION, fibres, sd_stated=bool(fibres.sd))
    else:
        yield _of_fibres(LegNotice.FIBRES_NOT_IN_CORRECTION, fibres, why=why_without_fibres(subject) or "")


def _of_fibres(code: LegNotice, fibres: FibreRatio, **further: object) -> Notice:
    return Notice.of(code, ratio=str(fibres), provenance=fibres.provenance, source=fibres.source, **further)


def of_elastography(subject: Subject, estimates: Mapping[str, Estimate]) -> Iterator[Notice]:
    """Say where elastography and indentation disagree."""
    for name, prior in elastography_priors(subject.elastography).items():
        one = estimates.get(name)
        if one is not None and one.parameter.prior == prior:
            yield from disagreement(name, prior, one.value, one.standard_error)


def _in_3d(fit: Fit[LegDetails], spatial: SpatialSites) -> Iterator[Notice]:
    """What is to be known of a leg whose search went on solves in 3D."""
    if spatial.untold:
        yield Notice.of(LegNotice.FIBRES_UNDETERMINED, text=spatial.untold)
    if DEEP_RATIO in fit.estimates or DEEP_RATIO in fit.values:
        yield Notice.of(LegNotice.FIBRES_ALONG)
    elif (fibres := fit.details.subject.fibres) is None:
        yield Notice.of(LegNotice.NO_FIBRES)
    else:
        yield _of_fibres(LegNotice.FIBRES_STATED, fibres)
    if spatial.extruded:
        yield Notice.of(LegNotice.EXTRUDED, under="it")
