"""A parameter's interval over all explanations of the recordings.

"Nothing was left out" isn't among them. It says of every effect that it is exactly nought, which
no leg and no rig is; where effects are too small to show, the explanations by each of them say so,
and how far what is hidden may have moved the parameter. Two may be hidden at once: where pairs
weren't tried, each is the sum of its parts, about the base model's fit.

No explanation has exactly the form of what is there, and what is off by a few per cent in form is off everywhere alike:
readings say less of which one it is than their number tells. Their evidence counts with a power (`POWER`), which is
what a posterior is that knows its models as near the truth, not as the truth itself (J. W. Miller, D. B. Dunson, J. Am.
Stat. Assoc. 114 (2019) 1113).

What every body does and recordings don't show divides the stiffness that they give, by whatever explanation leaves it
out: tissue relaxes, and a loading alone gives C10 at its rate; muscle is fibrous, and a refit takes up what its fibres
do to the force. The interval is of C10 with that in it and without, by `WITH_UNSEEN`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import batched, combinations

import numpy as np
from scipy.special import softmax

from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.explain import log_prior_of
from legfem.inverse.explanation import ADDS_FROM, Explained, Explanation, log_bayes_factor, singles_of
from legfem.inverse.library import Detail
from legfem.inverse.mechanism import Mechanism, Occurrence, Unseen, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Prior
from legfem.inverse.posterior import Mixture
from legfem.inverse.screening import lacking, may_move, moves

POWER = 0.5
"""Of the evidence, in the weights of explanations for a parameter's interval."""
WITH_UNSEEN = 0.5
"""Probability that C10 is asked for as such recordings give it, and not without what they don't show: a judgement."""
UNWEIGHED = 0.5
"""Of ln C10 and ln C20, 95 %: what wasn't weighed and may be left out, times the root of its share of all."""
_MOST = 500
"""Distributions that a parameter's is told by: its ends are those of all within a ten thousandth."""
_COUNTS = 1e-4
"""Weight from which an explanation counts."""


@dataclass(frozen=True, eq=False)
class Weighted:
    """What an explanation says of a parameter, or two mechanisms that may be hidden at once, whose model wasn't fitted.

    Parameters
    ----------
    names
        Of the mechanisms.
    weight
        Beside all fitted explanations' sum of one.
    distribution
        Of the parameter.
    """

    names: tuple[str, ...]
    weight: float
    distribution: Mixture


def averaged_intervals(
    explained: Explained, name: str, assumed: Sequence[Mapping[str, float]] = ({},)
) -> Iterator[tuple[float, float]]:
    """Yield a parameter's 95 % interval over all that may be left out, each with its weight.

    Nothing where no explanation that counts has the parameter.

    Parameters
    ----------
    explained
        All explanations.
    name
        Of the parameter.
    assumed
        How many times as common as is assumed mechanisms are, by their names: an interval for each.
    """
    every = weights_of(explained, name)
    each = [Weighted(e.names, weight, e.distribution(name)) for e, weight in every]
    each += untried_pairs(explained, name)
    unseen = explained.base.problem.unseen if name in (DEEP_C10, DEEP_C20) else ()
    for times in assumed if every else ():
        parameter = next(p for p in every[0][0].fit.parameters if p.name == name)
        prior = prior_of(parameter)
        counted = [replace(e, weight=e.weight * math.prod(times.get(one, 1.0) for one in e.names)) for e in each]
        mixture = _beside_unseen(counted, prior, unseen)
        tail = (1 - 0.95) / 2
        low, high = (prior.value_at(mixture.quantile(p)) for p in (tail, 1 - tail))
        if name in (DEEP_C10, DEEP_C20) and explained.share < 1.0 and low > 0.0:
            middle, more = prior.value_at(mixture.quantile(0.5)), UNWEIGHED * math.sqrt(1.0 - explained.share)
            low = middle * math.exp(-math.hypot(math.log(middle / low), more))
            high = middle * math.exp(math.hypot(math.log(high / middle), more))
        yield parameter.inside(low), parameter.inside(high)


def unseen_of(
    mechanisms: Sequence[Mechanism], observed: Observations, possible: Mapping[str, Occurrence]
) -> Iterator[Unseen]:
    """Yield what is always there and recordings don't show."""
    for one in mechanisms:
        always = possible[one.name].always if one.name in possible else None
        if always is not None and (one.hides_in_stiffness or one.untestable(observed) is not None):
            yield Unseen(one, tuple(map(float, one.unseen_factors(always, observed))))


def _beside_unseen(each: Sequence[Weighted], prior: Prior, unseen: Sequence[Unseen]) -> Mixture:
    """Return the distribution of a stiffness, divided by what is unseen where an explanation leaves that out.

    Parameters
    ----------
    each
        Of the explanations.
    prior
        Of the stiffness, in whose standard deviations distributions are.
    unseen
        What they may leave out.
    """
    by_left_out: dict[tuple[Unseen, ...], list[Weighted]] = {}
    for one in each:
        left_out = tuple(u for u in unseen if u.mechanism.name not in one.names)
        by_left_out.setdefault(left_out, []).append(one)
    weights, found = [], []
    for left_out, members in by_left_out.items():
        whole = Mixture.joined([e.weight for e in members], [e.distribution for e in members]).merged(_MOST)
        for unseen_one in left_out:
            parts = [_divided(whole, prior, factor) for factor in unseen_one.factors]
            shares = [WITH_UNSEEN, *[(1.0 - WITH_UNSEEN) / len(parts)] * len(parts)]
            whole = Mixture.joined(shares, [whole, *parts])
        weights.append(sum(e.weight for e in members))
        found.append(whole)
    return Mixture.joined(weights, found)


def variance_beside(explained: Explained, unseen: Sequence[Unseen]) -> float:
    """Return what is unseen, and what wasn't weighed, make of the variance of C10's departure from what was known."""
    of_unseen = sum((1.0 - WITH_UNSEEN) * np.mean(np.log(one.factors) ** 2) for one in unseen)
    of_all = of_unseen + (UNWEIGHED / 1.96) ** 2 * (1.0 - explained.share)
    return float(of_all / prior_of(explained.base.fit.parameters[0]).sd ** 2)


def _divided(given: Mixture, prior: Prior, factor: float) -> Mixture:
    """Return the distribution of a stiffness that is divided by a factor."""
    scale, shift = 1.0, -math.log(factor) / prior.sd
    if prior.scale == "linear":
        scale, shift = 1.0 / factor, prior.centre / prior.sd * (1.0 / factor - 1.0)
    return replace(given, means=scale * given.means + shift, sds=scale * given.sds)


def as_seen(explained: Explained) -> Explained:
    """Return explanations of recordings without what they don't show: C10 is as they give it."""
    base = explained.base
    fitted = replace(base.fit, problem=replace(base.problem, unseen=()))
    return replace(explained, base=replace(base, fit=fitted))


def widened_by(explained: Explained, name: str) -> Explanation | None:
    """Return what takes a parameter's interval furthest beyond the base model's, with mechanisms.

    None where nothing does, or the base model hasn't the parameter.
    """
    if name not in explained.base.fit.free:
        return None
    own = explained.base.distribution(name)
    low, high = own.quantile(0.025), own.quantile(0.975)

    def beyond(one: tuple[Explanation, float]) -> float:
        mixture = one[0].distribution(name)
        return one[1] * (mixture.below(low) + 1.0 - mixture.below(high))

    every = [one for one in weights_of(explained, name) if one[0].names]
    return max(every, key=beyond)[0] if every else None


@dataclass(frozen=True)
class Sensitivity:
    """A parameter's interval where one mechanism is rarer, or more common, than is assumed."""

    mechanism: str
    weight: float
    """Of it alone and in pairs, in the interval."""
    rarer: tuple[float, float]
    commoner: tuple[float, float]


TIMES = 3.0
"""By which a mechanism is made rarer, and more common."""


def sensitivities(explained: Explained, name: str, most: int = 5) -> tuple[Sensitivity, ...]:
    """Return what a parameter's interval owes to how common the mechanisms are taken to be that weigh most."""
    heaviest = _heaviest(explained, name, most)
    assumed = [{mechanism: factor} for mechanism, _ in heaviest for factor in (1 / TIMES, TIMES)]
    ends = averaged_intervals(explained, name, assumed)
    return tuple(
        Sensitivity(*one, rarer, commoner) for one, (rarer, commoner) in zip(heaviest, batched(ends, 2), strict=True)
    )


def _heaviest(explained: Explained, name: str, most: int) -> list[tuple[str, float]]:
    """Return the mechanisms that weigh most in a parameter's interval, with their weights."""
    weights: dict[str, float] = {}
    for one, weight in weights_of(explained, name):
        for mechanism in one.names:
            weights[mechanism] = weights.get(mechanism, 0.0) + weight
    return sorted(weights.items(), key=lambda pair: -pair[1])[:most]


@dataclass(frozen=True)
class LeftOpen:
    """What responses that weren't solved in full may move."""

    in_full: tuple[str, ...]
    """Names of the mechanisms that were, ..."""
    screened: tuple[str, ...]
    """... and of the others."""
    probability: float
    """Most that an explanation's may move by."""
    interval: float
    """Most that an end of the parameter's interval may move by, over that end."""


def left_open(explained: Explained, name: str) -> LeftOpen:
    """Return what the evidence of explanations may move that rest on what was only screened."""
    library = explained.base.problem.predictor.library
    waiting = [one for one in explained.every if one.names and lacking(one, library.detail) != Detail()]
    screened = {one.names[0]: may_move(one, explained.every) for one in waiting if len(one.names) == 1}
    heavy = [(one, screened[one]) for one, _ in _heaviest(explained, name, len(screened)) if one in screened]
    assumed = [{one: math.exp(side * POWER * most)} for one, most in heavy[:_HEAVIEST] for side in (-1.0, 1.0)]
    intervals = [*averaged_intervals(explained, name, [{}, *assumed])]
    ends = ((end, here) for there in intervals for end, here in zip(there, intervals[0], strict=True))
    return LeftOpen(
        tuple(sorted(library.detail.whole)),
        tuple(sorted(screened)),
        max((moves(one, explained.every) for one in waiting), default=0.0),
        max((abs(end / here - 1.0) for end, here in ends), default=0.0),
    )


_HEAVIEST = 3
"""Mechanisms whose weight is varied for `robust_interval`."""


def robust_interval(explained: Explained, name: str) -> tuple[float, float] | None:
    """Return a parameter's interval whichever of the heaviest mechanisms is `TIMES` as common as is assumed.

    How common effects are is mostly a judgement: the widest of the intervals by several of them (J. O. Berger, J. Stat.
    Plan. Inference 25 (1990) 303).
    """
    assumed: list[dict[str, float]] = [{}, *({one: TIMES} for one, _ in _heaviest(explained, name, _HEAVIEST))]
    ends = [*averaged_intervals(explained, name, assumed)]
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None


def weights_of(explained: Explained, name: str) -> list[tuple[Explanation, float]]:
    """Return the explanations that count for a parameter, with their weights."""
    weights = softmax([_log_weight(e) for e in explained.every])
    every = [(e, float(w)) for e, w in zip(explained.every, weights, strict=True) if w > _COUNTS and name in e.fit.free]
    return [one for one in every if not one[0].is_base] or every


def _log_weight(one: Explanation) -> float:
    return one.log_prior + POWER * one.posterior.log_evidence


def untried_pairs(explained: Explained, name: str) -> Iterator[Weighted]:
    """Yield the pairs of mechanisms that weren't tried, for a parameter's interval.

    Linear about the base model's fit, and as if the recordings bound each effect by itself: where
    they bound the sum, this is somewhat too wide.
    """
    base = explained.base
    like = next((one for one in weights_of(explained, name) if not one[0].is_base), None)
    if like is None or name not in base.fit.free:
        return
    alone = singles_of(explained.every).values()
    expected = {e.names[0]: e.fit.mechanisms[0].expected for e in alone}
    # Two that explain the same misfit don't add: those that explain none do.
    singles = [e for e in alone if name in e.fit.free and log_bayes_factor(e, base) < ADDS_FROM]
    each = {e.names[0]: e.distribution(name) for e in singles}
    # What all have in common: the base model's, and what is unknown beside any mechanism.
    mean, variance = base.distribution(name).moments
    common = mean, max(variance, min((one.moments[1] for one in each.values()), default=0.0))
    tried = {frozenset(e.names) for e in explained.every}
    for one, other in combinations(singles, 2):
        names = one.names[0], other.names[0]
        log_evidence = one.posterior.log_evidence + log_bayes_factor(other, base)
        log_weight = log_prior_of(names, expected) + POWER * log_evidence
        probability = like[1] * float(np.exp(log_weight - _log_weight(like[0])))
        if frozenset(names) not in tried and probability > _COUNTS:
            yield Weighted(names, probability, _sum(each[names[0]], each[names[1]], common))


def _sum(one: Mixture, other: Mixture, common: tuple[float, float]) -> Mixture:
    """Return the distribution where two shifts add, each beside a common mean and variance."""
    wider, other = sorted((one, other), key=lambda m: -m.moments[1])
    mean, variance = np.subtract(other.moments, common)
    sds, degrees = np.sqrt(wider.sds**2 + max(variance, 0.0)), np.minimum(wider.degrees, other.degrees.min())
    return Mixture(wider.weights, wider.means + mean, sds, degrees)
