"""Probabilities of all explanations of the recordings.

An explanation is the base model alone, one mechanism, two, or a discrepancy of no known form. Its weight is its prior
times its evidence. Beside a mechanism a discrepancy may be left: then it is named in part. Leading explanations are
refitted about full finite-element solutions, which show the emulator's error there, until the refits stay.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.special import softmax

from legfem.common.progress import NEVER, Deadline, TimeIsUpError
from legfem.inverse.evidence import Evidence, discrepancy_scales, possible_discrepancies, with_discrepancy
from legfem.inverse.explanation import (
    ADDS_FROM,
    INEXACT,
    Explained,
    Explanation,
    better_of,
    counts_for,
    log_bayes_factor,
    singles_of,
)
from legfem.inverse.laplace import gain_of_widths, integrate_strength, laplace_posterior
from legfem.inverse.library import Library
from legfem.inverse.linearised import INEXACT_SHARE, LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import fit, refitted_beside
from legfem.inverse.mechanism import Mechanism, null_of
from legfem.inverse.posterior import Posterior
from legfem.inverse.screening import Complete, may_move, rests_on

FORM_SHARE = 0.1
"""Of all that a mechanism changes, what its form may leave at most: a law, a place or a mesh is off by some per cent of
the whole effect, of which a refit of the stiffness hides most."""


@dataclass(frozen=True, eq=False)
class Weighing:
    """What explanations of the same recordings are weighed by.

    Parameters
    ----------
    base
        The base model's fit.
    evidence
        With the errors, and those of no known form that there may be.
    """

    base: LinearisedFit
    evidence: Evidence

    @classmethod
    def about(cls, base: LinearisedFit) -> "Weighing":
        """Return the weighing of explanations about a base model's fit."""
        unknowns = possible_discrepancies(base.problem.predictor.observed, base.prediction)
        return cls(base, Evidence(base.problem.errors, unknowns))

    def base_model(self, unknown: bool) -> Explanation:
        """Return the base model alone, or with something unknown."""
        shares = [
            (-np.inf if unknown else 0.0) if u.covariance is None else (u.log_prior if unknown else -np.inf)
            for u in self.evidence.unknowns
        ]
        posterior = laplace_posterior(self.evidence, self.base, shares)
        log_prior = float(np.log(PRIOR_UNKNOWN if unknown else PRIOR_NONE))
        return Explanation(self.base, posterior, log_prior, unknown, False)

    def of(self, fitted: LinearisedFit, log_prior: float, confirmed: bool = False) -> Explanation:
        """Return a fit with mechanisms as an explanation, beside what their forms may leave."""
        problem, plain, shares = fitted.problem, fitted, self._shares_beside(fitted)
        posterior = laplace_posterior(self.evidence, fitted, shares)
        if posterior.discrepancy_probability > 0.5:
            # Beside something unknown the parameters are elsewhere than a fit without it finds them,
            # and the evidence is linear about where they are.
            refit = fit(self.aware(problem, posterior), fitted.mechanisms, fitted.values)
            # Its misfit is told by the errors alone.
            white, slopes = problem.whitened(refit.residual), problem.whitened(refit.sensitivities)
            aware = replace(refit, problem=problem, whitened=white, jacobian=slopes)
            again = laplace_posterior(self.evidence, aware, shares)
            if again.log_evidence > posterior.log_evidence:
                fitted, posterior = aware, again
        of_any_width = posterior.log_evidence + gain_of_widths(fitted, posterior)
        return Explanation(
            fitted,
            replace(posterior, log_evidence=of_any_width),
            log_prior,
            False,
            confirmed,
            log_discrepancy_weights=tuple(shares),
            fit_without_discrepancy=None if fitted is plain else plain,
        )

    def by(self, library: Library, one: Explanation) -> Explanation:
        """Return an explanation by a library in which more is solved, refitted where that is what it rests on."""

        def told(fitted: LinearisedFit) -> LinearisedFit:
            predictor = replace(fitted.problem.predictor, responses=library)
            return replace(fitted, problem=replace(fitted.problem, predictor=predictor))

        plain = one.fit_without_discrepancy
        if library.knows_no_more(one.problem.predictor.library, one.names):
            return replace(one, fit=told(one.fit), fit_without_discrepancy=None if plain is None else told(plain))
        begun = told(plain or one.fit)
        return self.of(refitted_beside(fit(begun.problem, begun.mechanisms, begun.values)), one.log_prior)

    def with_strength_held(self, one: Explanation, hides: bool, held: LinearisedFit) -> Posterior:
        """Return what the data say of a fit with its strength held, beside what so strong an effect's form may leave.

        Parameters
        ----------
        one
            Explanation that the fit is of.
        hides
            Whether it explains no more than nothing does.
        held
            The fit.
        """
        held = replace(held, problem=one.problem)
        shares = self._shares_beside(held, True) if hides else one.log_discrepancy_weights
        return laplace_posterior(self.evidence, held, shares)

    def aware(self, problem: LinearisedProblem, posterior: Posterior) -> LinearisedProblem:
        """Return the problem with the most probable of the unknown errors among its own."""
        most = self.evidence.unknowns[int(np.argmax(posterior.discrepancy_weights))]
        return replace(problem, errors=with_discrepancy(problem.errors, most))

    def _shares_beside(self, fitted: LinearisedFit, hides: bool = False) -> list[float]:
        """Return the logarithms of the shares of unknown errors beside a model with mechanisms, or one that hides."""
        scales = discrepancy_scales(fitted.problem.predictor.observed, self.base.prediction)
        # In a channel that a mechanism doesn't change its form leaves nothing either.
        shown = shown_effects(fitted, self.base)
        whole = _whole_effects(fitted) if hides else [0.0] * len(shown)
        most = [
            max(INEXACT_SHARE * effect / scale, FORM_SHARE * all_of_it / scale, self.evidence.unknowns[1].size)
            for effect, all_of_it, scale in zip(shown, whole, scales, strict=True)
        ]
        fits = [
            u.covariance is not None and all(size <= own for size, own in zip(u.by_channel, most, strict=True))
            for u in self.evidence.unknowns
        ]
        share = np.log(INEXACT / max(sum(fits), 1))
        return [
            float(np.log(1 - INEXACT)) if u.covariance is None else (float(share) if small else -np.inf)
            for u, small in zip(self.evidence.unknowns, fits, strict=True)
        ]


def shown_effects(fitted: LinearisedFit, base: LinearisedFit) -> list[float]:
    """Return the root mean square of what a mechanism changes that the base model can't, by channel in its unit."""
    problem, change = fitted.problem, fitted.prediction - base.prediction
    basis = np.linalg.qr(base.jacobian)[0]
    white = problem.whitened(change)
    rest = problem.errors.lower @ (white - basis @ (basis.T @ white)) if problem.kept is None else change
    return [float(np.sqrt(np.mean(rest[span] ** 2))) for span in problem.predictor.observed.data.spans]


def _whole_effects(fitted: LinearisedFit) -> list[float]:
    """Return the root mean square of all that mechanisms change at the fitted stiffness, by channel in its unit."""
    nulls = {m.strength_name: null_of(m.parameters[0]) for m in fitted.mechanisms}
    predictor = fitted.problem.predictor
    change = fitted.prediction - predictor({**fitted.values, **nulls}, fitted.mechanisms)
    return [float(np.sqrt(np.mean(change[span] ** 2))) for span in predictor.observed.data.spans]


PRIOR_NONE, PRIOR_SINGLE, PRIOR_PAIR, PRIOR_UNKNOWN = 0.37, 0.37, 0.18, 0.08
"""Of all explanations of a kind together: one effect is expected in a test, by Poisson's
distribution none, one or two; what is left is more than two, or what no mechanism describes."""


def log_prior_of(names: Sequence[str], expected: Mapping[str, float]) -> float:
    """Return the logarithm of the prior of one mechanism or of two.

    Parameters
    ----------
    names
        Of the mechanisms.
    expected
        By name, how often each that recordings can show is there, over the others; see `Mechanism.expected`.
    """
    each = np.array(list(expected.values()))
    own = np.prod([expected[name] for name in names])
    if len(names) == 1:
        return float(np.log(PRIOR_SINGLE * own / each.sum()))
    return float(np.log(PRIOR_PAIR * own / (0.5 * (each.sum() ** 2 - each @ each))))


def with_probabilities(found: Sequence[Explanation]) -> list[Explanation]:
    """Return explanations with their probabilities, the most probable first."""
    shares = softmax([e.log_weight for e in found])
    each = [replace(e, probability=float(p)) for e, p in zip(found, shares, strict=True)]
    return sorted(each, key=lambda e: -e.probability)


CONFIRMED_FROM, CONFIRMED_MOST = 0.02, 5
MOVED = 3.0
"""ln of the evidence by which a full solution may move a mechanism's before its pairs are fitted about it, too."""
ANEW = 3.0
"""Cost by which another minimum has to be lower, which isn't solved in full yet."""
PAIRS_OF, PAIRS_WITH = 3, 7
"""The best single mechanisms are tried in pairs with more of them, the first with all; so are those
that may be what was left out once full solutions stand behind them."""
type Confirm = Callable[[LinearisedFit], LinearisedFit | None]
"""Refits about a full solution, its problem shifted to that; None where none was made."""


def explain(
    base: LinearisedFit,
    mechanisms: Sequence[Mechanism],
    confirm: Confirm | None = None,
    start: Mapping[str, float] | None = None,
    complete: Complete | None = None,
    deadline: Deadline = NEVER,
) -> Explained:
    """Return how probable every explanation is.

    Parameters
    ----------
    base
        The base model's fit.
    mechanisms
        Those that the recordings can show.
    confirm
        Refits about a full solution; emulated ones stand without it.
    start
        Base parameters that searches begin with; the base model's fit without it.
    complete
        Solves what the library lacks that the leading explanations rest on; they stand as they are without it.
    deadline
        After which nothing is completed or confirmed.
    """
    weighing = Weighing.about(base)
    sought = _Sought(weighing, confirm, complete, deadline)
    found = [weighing.base_model(unknown) for unknown in (False, True)]
    expected = {m.name: m.expected for m in (*mechanisms, *base.problem.unweighed)}
    left = sum(m.expected for m in base.problem.unweighed) / max(sum(expected.values()), 1e-300)
    share = 1.0 - PRIOR_SINGLE * left - PRIOR_PAIR * (1.0 - (1.0 - left) ** 2)
    found += [
        weighing.of(refitted_beside(fit(base.problem, [m], start or base.values)), log_prior_of([m.name], expected))
        for m in mechanisms
    ]
    found, cut = sought.completed(with_probabilities(found))
    pairs = _untried(found, begins=True)
    while True:
        found += [
            weighing.of(_joint(one, other), log_prior_of([*one.names, *other.names], expected)) for one, other in pairs
        ]
        found, again = sought.completed(sought.begun_anew(with_probabilities(found)))
        cut = cut or again
        found = sought.confirmed(found)
        pairs = _untried(found)
        if not pairs:
            found = _integrated(found, weighing)
            return Explained(tuple(found), _nothing(found), share, cut)


def tolerantly(explained: Explained, mechanisms: Sequence[Mechanism]) -> Explained:
    """Return explanations by errors as large as what nothing explains, so that its form refutes none of them."""
    base, unknown = explained.base.fit, next(one for one in explained.every if one.unnamed)
    problem = Weighing.about(base).aware(base.problem, unknown.posterior)
    return explain(fit(problem, (), base.values), mechanisms)


@dataclass(frozen=True, eq=False)
class _Sought:
    """What explanations are sought with; see `explain`."""

    weighing: Weighing
    confirm: Confirm | None
    complete: Complete | None
    deadline: Deadline
    tried: set[tuple[str, LinearisedFit]] = field(default_factory=set)
    """Mechanisms that were fitted anew, and the pairs' fits from which."""

    def completed(self, found: list[Explanation]) -> tuple[list[Explanation], bool]:
        """Solve in full what explanations rest on, and refit those that it changes, until nothing more could matter.

        Returned is, too, whether the deadline came before.
        """
        while self.complete is not None:
            known = _nothing(found).problem.predictor.library.detail
            wanted = rests_on(found, known)
            if wanted == known or self.deadline.passed:
                return found, wanted != known
            try:
                library = self.complete(wanted)
            except TimeIsUpError:
                return found, True
            found = self.begun_anew(with_probabilities([self.weighing.by(library, one) for one in found]))
        return found, False

    def begun_anew(self, found: list[Explanation]) -> list[Explanation]:
        """Fit mechanisms anew alone from where the leading pairs have them, which may be at another minimum.

        A stiff region lies on one side or on the other: beside a tilt of nothing a search may find the right one, and
        the tilt would be what explains so much more.
        """
        leading = [e for e in found[:CONFIRMED_MOST] if len(e.names) == 2 and e.probability >= CONFIRMED_FROM]
        for pair in leading:
            for single in [e for e in found if len(e.names) == 1 and e.names[0] in pair.names]:
                if (single.names[0], pair.fit) in self.tried:
                    continue
                self.tried.add((single.names[0], pair.fit))
                start = {k: v for k, v in pair.fit.values.items() if k in single.fit.values}
                again = refitted_beside(fit(pair.problem, single.fit.mechanisms, start))
                if again.cost < single.fit.cost - ANEW:
                    found[found.index(single)] = self.weighing.of(again, single.log_prior)
        return with_probabilities(found)

    def confirmed(self, found: list[Explanation]) -> list[Explanation]:
        """Refit the leading explanations about full solutions, until none of them is emulated.

        Those that explain no more than nothing does, by any solution, stay emulated: they change no verdict. With a
        pair goes the better one of its mechanisms, beside which it has to explain more.
        """
        nothing = _nothing(found)
        for _ in range(3):
            singles = singles_of(found)
            leading = [
                e
                for e in found[:CONFIRMED_MOST]
                if e.names
                and e.probability >= CONFIRMED_FROM
                and log_bayes_factor(e, nothing) + may_move(e, found) > ADDS_FROM
                and counts_for(e, singles) is e
            ]
            alone = [better_of(e, singles) for e in leading]
            waiting = dict.fromkeys(e.names for e in (*alone, *leading) if not e.confirmed)
            if self.confirm is None or not waiting or self.deadline.passed:
                break
            for names in waiting:
                # Pairs may have been fitted anew, about the solution of one of their mechanisms.
                one = next(e for e in found if e.names == names)
                refit = self.confirm(one.fit)
                if refit is None:
                    # One whose solution stopped can't be confirmed, and is less probable for it.
                    found[found.index(one)] = replace(one, confirmed=True, log_prior=one.log_prior - 3.0)
                    continue
                again = self.weighing.of(refit, one.log_prior, True)
                moved = abs(again.posterior.log_evidence - one.posterior.log_evidence)
                for pair in _led_by(one, found, moved > MOVED):
                    # Its second effect hardly matters: the first one's solution serves both.
                    about = fit(refit.problem, pair.fit.mechanisms, pair.fit.values)
                    found[found.index(pair)] = self.weighing.of(about, pair.log_prior)
                found[found.index(one)] = again
            found = self.begun_anew(with_probabilities(found))
        return found


def _nothing(found: Sequence[Explanation]) -> Explanation:
    return next(e for e in found if e.is_base)


HIDDEN_FROM = 1e-3
"""Probability of a single mechanism from which it may hide: its strength is integrated out, for the stiffness."""


def _integrated(found: list[Explanation], weighing: Weighing) -> list[Explanation]:
    """Integrate out the strength of every explanation that may be what was left out, or may hide."""

    def matters(one: Explanation) -> bool:
        return one.probability >= (HIDDEN_FROM if len(one.names) == 1 else CONFIRMED_FROM)

    while waiting := [e for e in found if e.names and not e.strength_integrated and matters(e)]:
        for one in waiting:
            # Steps are fitted as the fit itself was, or they begin at another minimum.
            plain = one.fit_without_discrepancy is None
            begun = one.fit if plain else replace(one.fit, problem=weighing.aware(one.problem, one.posterior))
            hides = log_bayes_factor(one, _nothing(found)) < ADDS_FROM
            of = partial(weighing.with_strength_held, one, hides)
            posterior = integrate_strength(begun, one.posterior, of)
            found[found.index(one)] = replace(one, posterior=posterior, strength_integrated=True)
        found = with_probabilities(found)
    return found


def _untried(found: Sequence[Explanation], begins: bool = False) -> list[tuple[Explanation, Explanation]]:
    """Return the pairs that weren't tried of mechanisms that may be what was left out; none where nothing may be.

    Each of these, the best at least, is tried with all others: pairs that explain no more count for their mechanism, so
    one with fewer of them would seem less probable. Full solutions may change which these are. To begin with
    (``begins``) the next ones are tried with the better ones, too.
    """
    if with_probabilities(found)[0].is_base:
        return []
    singles = sorted(singles_of(found).values(), key=lambda e: -e.log_weight)
    tried = {frozenset(e.names) for e in found}
    missing: dict[frozenset[str], tuple[Explanation, Explanation]] = {}
    for place, one in enumerate(singles):
        partners = singles[:PAIRS_WITH] if begins and place < PAIRS_OF else []
        for other in singles if place == 0 or one.probability >= CONFIRMED_FROM else partners:
            key = frozenset([*one.names, *other.names])
            if len(key) == 2 and key not in tried:
                missing.setdefault(key, (one, other))
    return list(missing.values())


def _joint(one: Explanation, other: Explanation) -> LinearisedFit:
    """Return the fit of two mechanisms, begun from what each explained."""
    shapes = {k: v for k, v in other.fit.values.items() if k.split(".")[0] in other.names}
    return fit(one.problem, [*one.fit.mechanisms, *other.fit.mechanisms], {**one.fit.values, **shapes})


def _led_by(one: Explanation, found: Sequence[Explanation], every: bool) -> list[Explanation]:
    """Return the pairs without a full solution that explain no more than a single mechanism.

    Where its full solution moved the evidence by much (``every``) also those that explain more, and not less than
    their other one: beside what was emulated they would all seem worse, or better, by as much.
    """
    singles = singles_of(found)
    pairs = [e for e in found if len(e.names) > 1 and not e.confirmed and e is not one]
    led_by = better_of if every else counts_for
    return [pair for pair in pairs if led_by(pair, singles) is one]
