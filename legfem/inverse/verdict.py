"""What is found in recordings: the verdict, explanations, what may hide, where the base model errs; and its answer."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from legfem.common.numbers import decimals, is_determined
from legfem.common.units import mpa_to_kpa
from legfem.inverse.answer import Answer, Finding, FitNotice, LikelyCause, Notice, Tone, Value
from legfem.inverse.averaging import POWER, as_seen, robust_interval
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName
from legfem.inverse.diagnosed_fit import cost_of_model, fits_of_trials, log_of_solutions
from legfem.inverse.errors import ErrorModel
from legfem.inverse.estimates import Estimate, correlations_of
from legfem.inverse.evidence import possible_discrepancies
from legfem.inverse.explanation import Explained, Explanation, unknown_course
from legfem.inverse.fit import Fit, Goodness, Identity, KindDetails, versions
from legfem.inverse.hidden import HiddenEnd, Limit, profile_of
from legfem.inverse.intervals import with_further
from legfem.inverse.library import UNTRIED
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.location import MisfitAssessment, SetAside, runs_within
from legfem.inverse.observations import Observations
from legfem.inverse.predictive import HeldOut, Misfit
from legfem.inverse.predictor import onset_name


def limits_of(explained: Explained) -> tuple[Limit, ...]:
    """Return every single mechanism's limits, those first that may move C10 most; see `legfem.inverse.hidden`."""
    base = explained.base.fit
    singles = [one for one in explained.every if len(one.names) == 1]
    found = [profile_of(one, base, one.problem.possible.get(one.names[0])).limit(base) for one in singles]
    return tuple(sorted(found, key=lambda limit: (-shift_of(limit, base), limit.name)))


def shift_of(limit: Limit, base: LinearisedFit) -> float:
    """Return how far an effect within its limits may have moved C10, over the base model's; nothing without C10."""
    if DEEP_C10 not in limit.stiffness:
        return 0.0
    return max(abs(value / base.values[DEEP_C10] - 1.0) for value in limit.stiffness[DEEP_C10])


Verdict = Literal["consistent", "named", "ambiguous", "unexplained"]
SMALL = 0.01
"""Share of the largest force: a root mean square misfit that is less may be good enough."""
LARGE = Misfit(0.03, 0.25)
"""A misfit that nothing explains, with which C10 isn't given."""
TRUSTED = 0.15
"""Share of C10: where all that may hide moves it by less, with 95 %, a model that fits is trusted."""
ADEQUATE = 0.5
"""Probability of the base model alone, of all that was weighed, from which the recordings are called consistent."""
DIFFER = 0.01
"""Probability of so large differences of recordings below which they are said to differ."""
IMPROBABLE = 0.01
"""Probability of a law up to which its C10 doesn't count."""
SHOWN_MOST = 6


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found in a leg's recordings."""

    verdict: Verdict
    law: LawName
    observed: Observations
    explained: Explained
    base_model: Explanation
    """The base model: by its errors, or as near to the data as equal weights bring it where these miss."""
    identified: Fit[Any] | None
    """Its fit to all that was recorded, where that was identified before."""
    models: tuple[Explanation, ...]
    """Explanations that are listed, the most probable first; none if consistent."""
    assessment: MisfitAssessment
    """What the base model's residual says: windows, and signs of mechanisms."""
    base_held_out: HeldOut
    held_out: tuple[HeldOut, ...]
    """Held-out predictions of the models."""
    untested: Mapping[str, str]
    """Mechanisms that the recordings can't show, and why."""
    limits: tuple[Limit, ...]
    """How strong each mechanism may be unseen, those first that may move C10 most; where the model fits."""
    with_ends: bool
    """Whether the base model has the cylinder's ends."""
    solutions: int
    """Finite-element solutions made for it, the library's included."""
    emulator_error: float
    """Greatest difference of the base model's emulated and full forces, over the largest force; NaN
    without a full solution."""
    misfit: Misfit
    """Misfit of the base model, by its size."""
    subject: Identity
    kind: str
    """``leg`` or ``specimens``."""
    seed: int
    """Of its draws."""
    aside: SetAside | None
    """A part of a trial that something unknown touched: all else is said of the rest."""
    provisional: bool = False
    """Whether the time that it was given was over before all was solved that it rests on."""
    other_laws: tuple["Diagnosis", ...] = ()
    """Of the same recordings by other laws, where they were tried."""
    tolerant: Explained | None = None
    """Explanations by errors as large as what nothing explains, where that is the verdict."""

    @cached_property
    def by_law(self) -> "list[tuple[Diagnosis, float]]":
        """Diagnoses by all laws that were tried, and how probable they are."""
        every = [self, *self.other_laws]
        chances = softmax([POWER * logsumexp([e.log_weight for e in one.explained.every]) for one in every])
        return list(zip(every, map(float, chances), strict=True))

    def told(self, notices: Sequence[Notice]) -> "Diagnosis":
        """Return the diagnosis with notices before its own."""
        return replace(self, observed=replace(self.observed, notices=(*notices, *self.observed.notices)))

    def over_laws(self, others: "Sequence[Diagnosis]") -> "Diagnosis":
        """Return this diagnosis beside those by other laws; a more probable one where this one's law does in part."""
        beside = replace(self, other_laws=tuple(others))
        if beside.by_law[0][1] > IMPROBABLE and not self.in_part:
            return beside
        best, _ = max(beside.by_law, key=lambda one: one[1])
        return replace(best, other_laws=tuple(one for one in (self, *others) if one is not best))

    @property
    def in_part(self) -> bool:
        """Whether what is named isn't all that was left out."""
        return self.verdict == "named" and self.models[0].in_part

    @property
    def equally(self) -> bool:
        """Whether the base model is that of equal weights."""
        return self.base_model.fit is not self.weighted_base.fit

    @cached_property
    def base(self) -> Fit[Any]:
        """The base model's fit, each recording a test: what was identified; to the rest where a part is set aside."""
        if self.identified is None:
            return self._fit_of(self.base_model, False)
        tests, agreement = fits_of_trials(self.base_model, self.weighted_base)
        return replace(self.identified, tests=tests, agreement=agreement)

    @cached_property
    def best_fit(self) -> Fit[Any]:
        """Fit of the best model, the stiffness with its interval over all explanations."""
        return self._fit_of(self.best, True)

    def _fit_of(self, model: Explanation, over_all: bool) -> Fit[KindDetails]:
        fitted, estimates = model.fit, self._estimates(model, over_all)
        # Recordings are fitted one by one with the base model by its errors alone.
        weighted = None if model.names else self.weighted_base
        equal = weighted is not None and fitted is not weighted.fit
        of_estimates = [fitted.free.index(name) for name in estimates]
        tests, agreement = fits_of_trials(model, weighted)
        return Fit(
            kind=self.kind,
            subject=self.subject,
            law=self.law,
            estimates=estimates,
            correlations=correlations_of(model.posterior.covariance[np.ix_(of_estimates, of_estimates)]),
            values=dict(fitted.values),
            assumed={},
            goodness=Goodness(fitted.cost, len(fitted.whitened), fitted.lack_of_fit),
            cost=cost_of_model(model, equal),
            agreement=agreement,
            tests=tests,
            log=log_of_solutions(model, self.seed, self.emulator_error, self.solutions),
            neo_hookean_limit=DEEP_C20 in estimates and estimates[DEEP_C20].at_bound == "lower",
            weighting="equal" if equal else "covariance",
            settings={"mechanisms": list(model.names), "cylinder_ends": self.with_ends},
            versions=versions(),
            details=KindDetails(),
        )

    @property
    def weighed(self) -> tuple[int, int]:
        """How many of the effects that the recordings can show were weighed, and how many there are."""
        weighed = len({name for one in self.explained.every for name in one.names})
        return weighed, weighed + sum(why == UNTRIED for why in self.untested.values())

    @property
    def weighted_base(self) -> Explanation:
        """The base model by its errors: what evidence and signs are reckoned about."""
        return self.explained.base

    @property
    def errors(self) -> ErrorModel:
        """Errors of the observations about the base model."""
        return self.weighted_base.problem.errors

    @cached_property
    def located(self) -> NDArray[np.bool_]:
        """Forces (n,) at which the base model is wrong by more than a trial's noise.

        Where a model suits, it tells what the base model misses without the noise; else the windows do.
        """
        windows, forces = self.assessment.windows, self.observed.data.spans[0]
        elsewhere = self.observed.channels and not any(window.channel == "force" for window in windows)
        if self.explained.adequacy >= ADEQUATE * self.explained.share or elsewhere:
            return np.zeros(forces.stop, dtype=bool)
        if self.models:
            missed = self.models[0].fit.prediction - self.base_model.fit.prediction
            return np.asarray(np.abs(missed) > self.errors.trial_sd)[forces]
        return np.isin(np.arange(forces.stop), [place for window in windows for place in window.stations])

    @property
    def best(self) -> Explanation:
        """What the parameters are given with: the first that is named, else the base model."""
        named = [model for model in self.models if model.names]
        if named:
            return named[0]
        return self.weighted_base if self.verdict == "consistent" and self.equally else self.base_model

    def first_contact(self, trial: int) -> tuple[float, tuple[float, float]]:
        """Return where a trial was touched, and its 95 % interval; mm of its recording."""
        found, name = self.observed.contacts[trial].displacement, onset_name(trial)
        low, high = self.best.interval(name)
        return found + self.best.value(name), (found + low, found + high)

    @cached_property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Those of `own_intervals`, of C10 over all laws that are not improbable."""
        ends = [one.own_intervals[DEEP_C10] for one, _ in probable_laws(self) if DEEP_C10 in one.own_intervals]
        if self.withheld or not ends:
            return self.own_intervals
        return {**self.own_intervals, DEEP_C10: (min(low for low, _ in ends), max(high for _, high in ends))}

    @cached_property
    def own_intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals of C10 and C20 (MPa), by full name, over all explanations by this law, by their probability.

        Of unexplained recordings over what explains them by errors as large as the misfit, and beside how far that
        moves C10; or all that was searched.
        """
        if self.withheld:
            fitted = self.base_model.fit
            return {p.name: p.bounds for p in fitted.parameters if p.name in fitted.stiffness}
        found = {name: robust_interval(self.tolerant or self.explained, name) for name in (DEEP_C10, DEEP_C20)}
        free = self.best.fit.free
        known = [(n, *ends, self.best.value(n) if n in free else ends[0]) for n, ends in found.items() if ends]
        by, within = self.misfit.moves * (self.tolerant is not None), (0.0, np.inf)
        return {n: with_further(at, (min(low, at), max(high, at)), by * at, within) for n, low, high, at in known}

    def shown_interval(self, name: str) -> tuple[float, float]:
        """Return one of the intervals as people read it, in kPa."""
        low, high = self.intervals[name]
        return mpa_to_kpa(low), mpa_to_kpa(high)

    @cached_property
    def interval_as_seen(self) -> tuple[float, float] | None:
        """The interval of C10 without what recordings don't show; None where it isn't fitted."""
        return robust_interval(as_seen(self.explained), DEEP_C10)

    @cached_property
    def withheld(self) -> bool:
        """Whether no stiffness is given: nothing explains the misfit, and it is `LARGE`, or C10 isn't fitted."""
        large = self.misfit.size >= LARGE.size or self.misfit.moves >= LARGE.moves
        return self.tolerant is not None and (large or DEEP_C10 not in self.base_model.fit.free)

    @cached_property
    def may_be_off(self) -> float:
        """How far C10 may be from the value given by all that may hide, with 95 %: a share of that value."""
        if DEEP_C10 not in self.intervals or DEEP_C10 not in self.best.fit.free:
            return 0.0
        return max(abs(end / self.best.value(DEEP_C10) - 1.0) for end in self.intervals[DEEP_C10])

    def _estimates(self, model: Explanation, over_all: bool) -> dict[str, Estimate]:
        ends = self.intervals if over_all else {}
        fits = not self.withheld if over_all else self.verdict == "consistent" or model is not self.base_model
        own = [f"{m.name}.{p.name}" for m in model.fit.mechanisms for p in m.parameters]
        return {name: model.estimate(name, ends.get(name), fits) for name in (*model.fit.stiffness, *own)}

    @property
    def estimates(self) -> dict[str, Estimate]:
        """What was fitted in the best model: the stiffness with its interval over all explanations."""
        return self._estimates(self.best, True)

    @property
    def hidden(self) -> tuple[tuple[Limit, HiddenEnd], ...]:
        """Effects that may be there unseen and would move C10 by more than `TRUSTED`, the greatest first."""
        c10 = self.weighted_base.fit.values[DEEP_C10]
        each = [(abs(end.c10 / c10 - 1.0), limit, end) for limit in self.limits for end in limit.ends]
        far = sorted((one for one in each if one[0] > TRUSTED), key=lambda one: -one[0])
        return tuple((limit, end) for _, limit, end in far)


_LEAST_OF_NOISE = 1.0
"""What remains is told where it is more than this share of a trial's noise, ..."""
_LEAST_OF_FORCE = 0.002
"""... and of the largest force."""


@dataclass(frozen=True)
class ResidualInterval:
    """An interval in which something is left over."""

    trial: str
    phase: str
    displacement_mm: tuple[float, float]
    size_N: float
    """Greatest of the expected course."""


def probable_laws(found: Diagnosis) -> "list[tuple[Diagnosis, float]]":
    """Return diagnoses by laws that aren't improbable and give a stiffness, and how probable they are."""
    return [(one, chance) for one, chance in found.by_law if chance > IMPROBABLE and not one.withheld]


def explained_share(found: Diagnosis, model: Explanation) -> float:
    """Return the share of the base model's misfit beyond noise that an explanation takes up.

    Misfits are sums of squares over the errors', less as many as there are observations.
    """
    before, after = found.weighted_base.excess_misfit, model.excess_misfit
    return 1.0 - min(after / before, 1.0) if before > 0 else 0.0


def residual_intervals(found: Diagnosis, model: Explanation) -> list[ResidualInterval]:
    """Return where something unknown is left beside an explanation, the greatest first."""
    if not (model.unnamed or model.in_part):
        return []
    observed, base = found.observed, found.weighted_base.fit
    course = unknown_course(model, possible_discrepancies(observed, base.prediction))
    forces = observed.data.spans[0]
    noise, largest = found.errors.trial_sd[forces], np.abs(base.prediction[forces]).max()
    least = np.maximum(_LEAST_OF_NOISE * noise, _LEAST_OF_FORCE * largest)
    marked = np.where(np.abs(course[forces]) > least, np.sign(course[forces]), 0).astype(int)
    result = []
    for k, run in runs_within(observed, marked):
        d, largest = observed.displacement[run], run[int(np.argmax(np.abs(course[run])))]
        ends = float(d.min()), float(d.max())
        result.append(ResidualInterval(observed.trials[k], str(observed.phase[run[0]]), ends, float(course[largest])))
    return sorted(result, key=lambda one: -abs(one.size_N))


def solution_notices(found: Diagnosis) -> Iterator[Notice]:
    """Yield which parameters stand at the ends of what was searched, and whether no solution confirmed the forces."""
    for model in (found.base_model, *found.models):
        for name in model.fit.at_bound:
            shown = model.shown(name)
            value = (shown.value, (shown.ci95[1] - shown.ci95[0]) / 4)
            yield Notice.of(FitNotice.MODEL_AT_BOUND, name=name, value=value, mechanisms=model.names)
    if found.provisional:
        weighed, every = found.weighed
        yield Notice.of(FitNotice.PROVISIONAL, weighed=weighed, every=every)
    if not found.solutions and not found.emulator_error > 0:
        yield Notice.of(FitNotice.UNCONFIRMED)


def answer_of(found: Diagnosis, doubts: int = 0) -> Answer:
    """Return whether the stiffness can be used, as a number or as a range, and what was left out."""
    finding, tone = _finding(found)
    values, why_none = reported(found)
    told = {
        "verdict": found.verdict,
        "why_none": why_none,
        "misfit": found.misfit.size,
        "may_be_off": found.may_be_off,
        "aside": "" if found.aside is None else found.aside.described,
        "fits_in_part": found.in_part,
        "missing_in_parts": bool(found.models) and bool(found.models[0].missing),
        "weighed": list(found.weighed),
    }
    causes = tuple(LikelyCause(tuple(one.names), one.probability, one.in_part) for one in found.models)
    return Answer("diagnosis", finding, tone, values, causes, doubts, told)


def _finding(found: Diagnosis) -> tuple[Finding, Tone]:
    if found.provisional:
        return Finding.PROVISIONAL, "open"
    if found.withheld:
        return Finding.MISFIT, "wrong"
    if found.verdict == "unexplained":
        return (Finding.UNEXPLAINED, "open") if wide(found) else (Finding.SMALL_MISFIT, "caution")
    if wide(found):
        return Finding.HIDDEN_EFFECTS, "caution"
    if found.verdict == "consistent" and found.aside is None:
        return Finding.FITS, "caution" if found.base.agreement.p_value < DIFFER else "sound"
    if found.verdict == "consistent":
        return Finding.FITS_WITHOUT_PART, "caution"
    if found.in_part:
        return Finding.CORRECTED_IN_PART, "caution"
    if not causes_differ(found):
        return Finding.CORRECTED, "caution"
    return Finding.CAUSES_DIFFER, "open"


def reported(found: Diagnosis) -> tuple[dict[str, Value], str]:
    """Return C10, or why there is none."""
    if found.withheld:
        return {}, "model_wrong"
    if DEEP_C10 not in found.base_model.fit.free:
        return {}, "given"
    model, differ = found.best, causes_differ(found)
    low, high = map(mpa_to_kpa, ends_of_c10(found))
    value = None if differ else mpa_to_kpa(model.value(DEEP_C10))
    if not is_determined(value or low, (low, high)) or not (differ or model.determined(DEEP_C10)):
        return {}, "undetermined"
    known = Value((low, high), "kPa", value, widest_error(found), range_only=differ or wide(found))
    return {DEEP_C10: known}, ""


def widest_error(found: Diagnosis) -> float:
    """Return the widest of the explanations' standard errors of C10 (kPa), by which its digits are chosen."""
    each = [one.shown(DEEP_C10).ci95 for one in (found.base_model, *found.models)]
    return max(high - low for low, high in each) / 4


def ends_of_c10(found: Diagnosis) -> tuple[float, float]:
    """Return between which values C10 lies (MPa), over all explanations."""
    return found.intervals.get(DEEP_C10) or found.best.interval(DEEP_C10)


def same_value(found: Diagnosis) -> bool:
    """Return whether C10 is the same for all causes, as far as it is known."""
    if DEEP_C10 not in found.base_model.fit.free:
        return False
    digits = decimals(widest_error(found))
    return len({round(mpa_to_kpa(one.value(DEEP_C10)), digits) for one in found.models}) == 1


def causes_differ(found: Diagnosis) -> bool:
    """Return whether C10 depends on which of several causes it is."""
    return found.verdict == "ambiguous" and not same_value(found)


def wide(found: Diagnosis) -> bool:
    """Return whether C10 is known as a range alone: what is hidden, or what nothing explains, may move it."""
    may_move = found.may_be_off > TRUSTED or (found.tolerant is not None and found.misfit.size >= SMALL)
    return not found.withheld and not causes_differ(found) and may_move
