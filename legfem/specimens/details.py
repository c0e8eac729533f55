"""What a fit of specimens has beside that of any test: what isn't known of a test, weighed.

Alternatives are as probable beforehand. Intervals are those of the mixture, each counting by its evidence beside a
smooth error of unknown form (`legfem.specimens.model_discrepancy`), alike in all recordings, and summed over the laws
that are fitted: a law that bends a curve as ends do leaves them open. Where even the best law misses, its evidence
counts the less by Birge's ratio squared: a form that is wrong tells little of another. Lateral stretches and strains of
the face, where a camera sees the side, weigh the alternatives beside the forces (`legfem.specimens.side`).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp, softmax
from scipy.stats import norm

from legfem.common.errors import Doubt
from legfem.common.numbers import number, percent, share
from legfem.inverse.answer import Answer, Notice, doubted
from legfem.inverse.catalogue import DEEP_C10, key_of, symbol_of
from legfem.inverse.channel_readings import not_read
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import (
    Fit,
    KindDetails,
    TestFit,
    answer_of,
    at_limits,
    far_from_priors,
    least_akaike,
    of_compromise,
    of_failed_solves,
    of_search,
    r_squared,
)
from legfem.inverse.intervals import VERDICTS, identifiability
from legfem.specimens.course import Course
from legfem.specimens.folder import FILE, SpecimenFolder
from legfem.specimens.model_discrepancy import LawMisfit, TestsAgreement
from legfem.specimens.side import FaceFit, LateralFit
from legfem.specimens.sizes import LeftOut, SpecimenRecording
from legfem.specimens.thickness import SizeDependence, YieldingRig, widened

type _Fit = Fit[SpecimenDetails]


class SpecimenNotice(StrEnum):
    """Codes that only specimens have."""

    MISFIT = "specimens_misfit"
    BEGUN_IN_AIR = "specimens_begun_in_air"
    GOES_WITH_THICKNESS = "constant_goes_with_thickness"
    ALTERNATIVES = "test_not_stated"
    TESTS_DISAGREE = "tests_disagree"
    USED_IN_PART = "recording_used_in_part"
    NOT_MODELLED = "left_out_not_modelled"
    NOT_PREDICTED = "left_out_not_predicted"
    RATIO_UNDETERMINED = "fibre_ratio_undetermined"
    SIDE_SEEN = "side_seen"
    NOT_USED = "recording_not_used"
    UNTIMED = "recordings_untimed"
    KIND = "kind_of_test"
    ALTERNATIVE_ASSUMED = "alternative_assumed"
    LAYER_ASKED = "layer_asked_for"
    TORN = "recording_torn"
    RETURN_LEFT_OUT = "return_left_out"
    RIG_YIELDS = "rig_yields"
    MAY_BE_STIFFER = "may_be_stiffer"
    LAW_DECIDES = "law_decides"


def cut_short(recordings: Sequence[SpecimenRecording]) -> Iterator[Notice]:
    """Yield which recordings count only in part."""
    for one in recordings:
        if one.recording.torn:
            yield Notice.of(SpecimenNotice.TORN, name=one.name, used=float(one.recording.displacement[-1]))
        if np.isfinite(one.recording.hysteresis):
            yield Notice.of(SpecimenNotice.RETURN_LEFT_OUT, name=one.name, lost=one.recording.hysteresis)
    yield from not_read([one.recording for one in recordings])


def probabilities(each: Mapping[str, Sequence[_Fit]]) -> dict[str, float]:
    """Return how probable alternatives are, by the fits of some laws to each."""
    every = [fit for fits in each.values() for fit in fits]
    # Contacts differ between alternatives, and so the number of readings by some; one law is no better beside another.
    readings = min(fit.details.misfit.readings for fit in every)
    least = max(min(fit.details.misfit.rms for fit in every), 1e-6)
    dispersion = max(1.0, min(fit.goodness.chi_square / max(fit.goodness.degrees_of_freedom, 1) for fit in every))
    evidence = []
    for fits in each.values():
        # What the side showed counts beside the law that meets it best.
        side = max(sum(s.log_density for s in (fit.details.lateral, fit.details.face) if s) for fit in fits)
        forces = logsumexp([readings * fit.details.misfit.log_evidence(least) for fit in fits])
        evidence.append(forces / dispersion + side)
    return dict(zip(each, map(float, softmax(evidence)), strict=True))


def weighed(fits: Mapping[str, _Fit], chances: Mapping[str, float], words: Mapping[str, str], to_know: str) -> _Fit:
    """Return the fit of the most probable alternative, its intervals over all.

    Parameters
    ----------
    fits
        By alternative, of one law.
    chances
        Probabilities of the alternatives.
    words
        What each is.
    to_know
        How it could be known, as a sentence without its end.
    """
    every = sorted(
        (Weighed(name, words[name], chances[name], fit.estimates) for name, fit in fits.items()),
        key=lambda one: -one.probability,
    )
    best = fits[every[0].name]
    details = replace(best.details, alternatives=tuple(every))
    found = replace(best, estimates=_over_all(best, every, "ends"), details=details)
    said = Notice.of(SpecimenNotice.ALTERNATIVES, text=alternatives_text(every, to_know))
    return replace(found, notices=(said, *found.notices))


def across_tests(
    joint: _Fit, agreement: TestsAgreement, without: Callable[[Sequence[str]], _Fit], leaves_out: bool
) -> _Fit:
    """Return a law's fit of the tests that are of one material's constants, its intervals over all that these may be.

    Parameters
    ----------
    joint
        Of all tests.
    agreement
        Of the tests.
    without
        Fits the same law but for some tests, which it predicts.
    leaves_out
        Whether the test that stands apart is predicted, and not fitted.
    """
    likely = {away: chance for away, chance in agreement.left_out.items() if chance > _UNLIKELY}
    fits = {away: without(away) if away else joint for away in likely}
    every = [Weighed("", "", chance / sum(likely.values()), fits[away].estimates) for away, chance in likely.items()]
    apart = agreement.apart if leaves_out else None
    best = joint if apart is None else fits[(apart.name,)]
    said = f"{agreement.text} It is predicted here, and not fitted." if apart else agreement.text
    estimates = _over_all(best, every, "differences")
    details = replace(best.details, agreement=agreement)
    told = (Notice.of(SpecimenNotice.TESTS_DISAGREE, text=said),) if agreement.disagree else ()
    estimates = estimates if len(every) > 1 else best.estimates
    return replace(best, estimates=estimates, details=details, notices=(*told, *best.notices))


def taken_off(found: _Fit, rig: YieldingRig) -> _Fit:
    """Return the fit of specimens whose rig's yielding is taken off, with what isn't known of that in its intervals."""
    more = 1.96 * abs(rig.moves), 1.96 * abs(rig.moves), found.goodness.fits
    over = {name: widened(one, *more) if ".C" in name else one for name, one in found.estimates.items()}
    told = Notice.of(SpecimenNotice.RIG_YIELDS, text=rig.text)
    details = replace(found.details, rig=rig)
    return replace(found, estimates=MappingProxyType(over), details=details, notices=(told, *found.notices))


_UNLIKELY = 0.02
"""Probability of tests that differ, or of one that does, below which no fit is made of it."""


def _over_all(best: _Fit, every: "Sequence[Weighed]", source: ErrorSource) -> Mapping[str, Estimate]:
    """Return the most probable fit's estimates with the mixture's intervals."""
    fits = best.goodness.fits
    found = {name: _mixed_estimate(name, one, every, fits, source) for name, one in best.estimates.items()}
    return MappingProxyType(found)


def _mixed_estimate(name: str, best: Estimate, every: "Sequence[Weighed]", fits: bool, source: ErrorSource) -> Estimate:
    known = [(one.probability, one.estimates[name]) for one in every if name in one.estimates]
    low, high = (float(np.clip(_mixed(known, level), *best.parameter.bounds)) for level in (0.025, 0.975))
    if len(known) < len(every) or not low < high:
        return best
    widened = replace(best, ci95=(min(low, best.value), max(high, best.value)))
    word = widened.verdict(fits)
    if identifiability(widened.relative_half_width) == identifiability(best.relative_half_width):
        word = max(word, best.identifiability, key=VERDICTS.index)
    variance = sum(p * (e.standard_error**2 + (e.value - best.value) ** 2) for p, e in known)
    left = min(1.0, best.standard_error**2 / variance) if variance > 0 else 1.0
    shares: dict[ErrorSource, float] = {one: left * share for one, share in best.error_shares.items()}
    shares[source] = shares.get(source, 0.0) + 1 - left
    return replace(
        widened, standard_error=float(np.sqrt(variance)), identifiability=word, error_shares=MappingProxyType(shares)
    )


def _mixed(known: Sequence[tuple[float, Estimate]], level: float) -> float:
    """Return a quantile of a mixture; each side of an interval is half of a normal distribution."""

    def below(value: float) -> float:
        total = 0.0
        for probability, one in known:
            low, high = one.ci95
            side = one.value - low if value < one.value else high - one.value
            total += probability * norm.cdf(1.96 * (value - one.value) / max(side, 1e-12 * abs(one.value) + 1e-300))
        return total - level

    ends = [end for _, one in known for end in (2 * one.ci95[0] - one.value, 2 * one.ci95[1] - one.value)]
    low, high = min(ends), max(ends)
    if below(low) > 0 or below(high) < 0:
        return low if below(low) > 0 else high
    return float(brentq(below, low, high))


def alternatives_text(every: "Sequence[Weighed]", to_know: str) -> str:
    """Return what the recordings say of a test's alternatives, what that costs, and how to narrow it."""
    name = DEEP_C10 if DEEP_C10 in every[0].estimates else next(iter(every[0].estimates))
    each = []
    for one, shown in ((one, one.estimates[name].shown) for one in every if name in one.estimates):
        value = f"{symbol_of(name)} {number(shown.value, shown.standard_error)} {shown.unit}"
        each.append(f"{one.words} ({percent(one.probability)}: {value})")
    return (
        f"The folder does not state how the test was done. Judging by the recordings: {', '.join(each)}. The interval "
        f"weighs them by these chances. {to_know}."
    )


@dataclass(frozen=True, eq=False)
class SpecimenDetails(KindDetails):
    """Folder, and how its specimens differ."""

    folder: SpecimenFolder
    left_out: tuple[LeftOut, ...]
    """Recordings that couldn't be used."""
    gain_sd: float
    """Factor by which recordings differ, one standard deviation."""
    stiffness: Mapping[str, float]
    """Stiffness of every fitted specimen over the typical one that the estimates are of; empty where all are alike."""
    stiffness_spread: float
    """Standard deviation of its logarithm, among specimens of a kind."""
    misfit: LawMisfit
    ratio_undetermined: str
    """Why the fibres' ratio can't be determined, as a sentence, where it was looked for in vain."""
    thickness: SizeDependence | None = None
    """How specimens' stiffness goes with their thickness, where it does."""
    lateral: LateralFit | None = None
    """Lateral stretches beside the fit, where a video showed them."""
    face: FaceFit | None = None
    """Strains of the face beside the fit, where points were tracked on it."""
    alternatives: "tuple[Weighed, ...]" = ()
    """Alternatives of what isn't known of the test, the most probable first; the fit is that of the first."""
    agreement: TestsAgreement | None = None
    """How several tests agree on one set of constants."""
    rig: YieldingRig | None = None
    """What the rig yields by which specimens of all thicknesses have one constant; in the estimates unless these differ
    by their thickness."""

    def answer(self, fit: Fit["SpecimenDetails"]) -> Answer:
        """Return what the specimens' fit says; what wasn't used, or tests that disagree, limit it."""
        differ = self.agreement is not None and self.agreement.differ
        limited = bool(self.left_out or self.thickness or self.rig or differ)
        return answer_of(fit, limited, rms_percent=rms_percent(fit))

    def chosen(self, fits: Sequence[Fit[Any]]) -> Fit[Any]:
        """Return the law that fits best for the number of its parameters."""
        return least_akaike(fits)

    def members(self, fit: Any) -> dict[str, Any]:
        """How recordings and specimens differ."""
        return {
            "not_used": {one.name: one.reason for one in self.left_out},
            "gain_sd_between_recordings": self.gain_sd,
            "stiffness_over_typical": dict(self.stiffness),
            "stiffness_log_sd": self.stiffness_spread,
            "misfit_rms_over_peak": self.misfit.rms,
            "agreement_of_tests": self.agreement,
            "alternatives": [
                {
                    "name": one.name,
                    "probability": one.probability,
                    "parameters": {
                        key_of(name): {"value": shown.value, "unit": shown.unit, "ci95": list(shown.ci95)}
                        for name, shown in ((name, found.shown) for name, found in one.estimates.items())
                    },
                }
                for one in self.alternatives
            ],
        }

    def members_of_test(self, fit: Any, number: int) -> dict[str, Any]:
        """How a recording was driven, and its own samples beside the prediction."""
        one = compared(fit)[number]
        recording, course = one.recording, one.course
        return {
            "specimen": recording.specimen,
            "rate_mm_per_s": course.rate if course.samples.timed else None,
            "depth_mm": course.depth,
            "displacement_mm": course.displacement,
            "rmse_N": one.force.rms,
            "scale": one.scale,
            "r_squared_at_that_scale": one.shape_r_squared,
        }


@dataclass(frozen=True)
class Weighed:
    """One of the alternatives of a test, as the recordings weigh it."""

    name: str
    words: str
    probability: float
    estimates: Mapping[str, Estimate]
    """Its own."""


def notices_about(
    fit: Fit[SpecimenDetails], in_air: Sequence[str], of_recordings: Sequence[Notice]
) -> tuple[Notice, ...]:
    """Notices about a fit, the gravest first: of names that seem to begin in air, and those of single recordings."""
    log, thickness = fit.log, fit.details.thickness
    found = [*doubted(_doubts_about_accuracy(fit))]
    found += [Notice.of(SpecimenNotice.GOES_WITH_THICKNESS, text=thickness.text)] if thickness else []
    found += [*of_search(log), *of_compromise(log), *at_limits(fit)]
    if not fit.goodness.fits:
        found.append(Notice.of(SpecimenNotice.MISFIT))
    if in_air:
        found.append(Notice.of(SpecimenNotice.BEGUN_IN_AIR, count=len(in_air), names=tuple(in_air)))
    return (*found, *of_failed_solves(log), *far_from_priors(fit.estimates), *of_recordings)


_COARSE, _QUIET = 0.05, 10.0
"""Stated error of force or displacement over the greatest and over the noise, from which it may be another rig's."""


def _doubts_about_accuracy(fit: Fit[SpecimenDetails]) -> Iterator[Doubt]:
    """Yield a doubt about a stated accuracy by which any law would fit."""
    folder, every = fit.details.folder, compared(fit)
    if (stated := folder.instrument) is None:
        return
    trials = [one.recording.trial for one in every]
    peak, depth = (min(getattr(one.course, name) for one in every) for name in ("peak", "depth"))
    noise, jitter = (max(getattr(one, f"{name}_noise") for one in trials) for name in ("force", "displacement"))
    for what, unit, sd, greatest, scatter in (
        ("force", "N", stated.force_sd, peak, noise),
        ("displacement", "mm", stated.displacement_sd, depth, jitter),
    ):
        if sd > max(_COARSE * greatest, _QUIET * scatter):
            of = f"{share(sd / greatest)} of the greatest {what}"
            problem = f"{sd:g} {unit} is {of}, where readings scatter by {number(scatter)} {unit}"
            remedy = "state that of the sensor that was used: one in lab.toml may be another rig's"
            yield Doubt(str(folder.directory / FILE), f"instrument.{what}_sd_{unit}", problem, remedy)


@dataclass(frozen=True, eq=False)
class RecordingFit(TestFit):
    """A recording beside the fit."""

    recording: SpecimenRecording = field(kw_only=True)

    @property
    def course(self) -> Course:
        """The recording's stations and samples after first contact."""
        return self.recording.course

    @property
    def scale(self) -> float:
        """Factor on the prediction that would fit best."""
        force, predicted = self.course.force, self.force.predicted
        return float(force @ predicted / (predicted @ predicted))

    @property
    def shape_r_squared(self) -> float:
        """Share of the variance that is predicted with the stiffness that fits best."""
        missed = self.scale * self.force.predicted - self.course.force
        return r_squared(float(missed @ missed), self.course.force)


def compared(fit: Fit[SpecimenDetails]) -> list[RecordingFit]:
    """All recordings beside the fit: those that were fitted, then those left out."""
    return [one for one in fit.tests if isinstance(one, RecordingFit)]


def rms_percent(fit: Fit[SpecimenDetails]) -> float:
    """Root mean square of the fit's differences over each recording's greatest force, %."""
    shares = [(one.force.rms / one.course.peak) ** 2 for one in compared(fit) if one.fitted]
    return 100 * float(np.sqrt(np.mean(shares)))
