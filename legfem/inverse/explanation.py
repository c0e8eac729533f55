"""An explanation of the recordings, and the probabilities of all explanations together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import expit, logit

from legfem.common.units import FloatArray
from legfem.inverse.estimates import Estimate, Shown
from legfem.inverse.evidence import Discrepancy, discrepancy_scales
from legfem.inverse.intervals import Estimated
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem, ShareOfPart, shares_by_part, variance_degrees
from legfem.inverse.posterior import Mixture, MixtureComponents, Posterior

HELD = 0.9
"""Explanations are listed until they hold this probability."""
ADDS_FROM = 1.0
"""ln of the Bayes factor up to which an explanation is no better than nothing."""
MORE_THAN_ALONE = 3.0
"""ln of the Bayes factor from which a second mechanism counts beside a first."""
INEXACT = 0.5
"""Prior probability that a mechanism's form leaves something."""
_SAID_FROM = 0.05
"""Probability of a statement from which it is asked whether the form of what it names is met."""
_COUNTS = 0.01
"""Share of the most probable unknown error from which another one counts."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A model with mechanisms, or with something unknown, and its probability."""

    fit: LinearisedFit
    posterior: Posterior
    log_prior: float
    unnamed: bool
    """Whether something unknown is all that it adds to the base model."""
    confirmed: bool
    """Whether a full solution stands behind the fit."""
    probability: float = 0.0
    strength_integrated: bool = False
    """Whether its strength is integrated out; see `legfem.inverse.laplace`."""
    degrees: FloatArray | None = None
    """See `degrees_of_freedom`, where the fit isn't weighed by the errors."""
    log_discrepancy_weights: tuple[float, ...] = ()
    """Logarithms of the shares of unknown errors beside its mechanisms."""
    fit_without_discrepancy: LinearisedFit | None = None
    """Its mechanisms' fit with nothing unknown beside them, where that is another one."""
    identified: Mapping[str, Estimate] = field(default_factory=dict)
    """What an identification says of its parameters, which stands before what its posterior does."""

    @cached_property
    def degrees_of_freedom(self) -> FloatArray:
        """Degrees of freedom of the variances of the parameters' departures (p,); see `variance_degrees`."""
        if self.degrees is not None:
            return self.degrees
        spread, gain = self._gain
        # Bounds make a variance smaller, not its parts: their shares are those of the whole.
        whole = np.maximum(np.diag(self.posterior.covariance), np.diag(spread))
        return variance_degrees(np.diag(whole), gain, self.problem.errors)

    @cached_property
    def _gain(self) -> tuple[FloatArray, FloatArray]:
        """Covariance (p, p) of the departures, and what an error of the readings adds to them, (p, N)."""
        errors, change = self.problem.errors, self.fit.sensitivities
        white = errors.whitened(change)
        spread = np.linalg.inv(white.T @ white + np.eye(change.shape[1]))
        return spread, spread @ solve_triangular(errors.lower, white, lower=True, trans="T").T

    def moved_by(self, covariance: FloatArray, name: str) -> float:
        """Return the share of a parameter by which errors of the n forces of a covariance (n, n) move it, with 95 %."""
        k, gain = self.fit.free.index(name), self._gain[1][:, : len(covariance)]
        away = self.posterior.mean.copy()
        away[k] += 1.96 * float(np.sqrt(gain[k] @ covariance @ gain[k]))
        return abs(self.fit.moved(away)[name] / self.value(name) - 1.0)

    @property
    def problem(self) -> LinearisedProblem:
        """The observations, with the errors by which it is weighed."""
        return self.fit.problem

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its mechanisms."""
        return self.fit.names

    @property
    def log_weight(self) -> float:
        """Logarithm of evidence times prior."""
        return self.log_prior + self.posterior.log_evidence

    @property
    def excess_misfit(self) -> float:
        """What its mechanisms leave of the misfit beyond noise at the least."""
        return (self.fit_without_discrepancy or self.fit).excess_misfit

    @cached_property
    def excess_by_channel(self) -> tuple[float, ...]:
        """The same of each channel by itself, of none where the force is all that was recorded."""
        observed = self.problem.predictor.observed
        if not observed.channels:
            return ()
        residual, total = (self.fit_without_discrepancy or self.fit).residual, self.problem.errors.covariance
        found = []
        for span in observed.data.spans:
            white = solve_triangular(cholesky(total[span, span], lower=True), residual[span], lower=True)
            found.append(max(float(white @ white) - len(white), 0.0))
        return tuple(found)

    @property
    def is_base(self) -> bool:
        """Whether it is the base model alone."""
        return not self.unnamed and not self.names

    @property
    def in_part(self) -> bool:
        """Whether the recordings ask for something unknown beside its mechanisms, or their trials do.

        Where they tell nothing of it, its probability is its prior's. A part that lacks a mechanism asks for it, too.
        """
        differs = self.posterior.discrepancy_probability > expit(logit(INEXACT) + ADDS_FROM) or self.trials_differ
        return bool(self.names and (differs or self.missing))

    @cached_property
    def missing(self) -> dict[str, tuple[ShareOfPart, ...]]:
        """Parts of the recordings that a mechanism is missing from, by its name; see `legfem.inverse.linearised`."""
        found = shares_by_part(self.fit_without_discrepancy or self.fit)
        return {name: own for name, parts in found.items() if (own := tuple(one for one in parts if one.missing))}

    @property
    def trials_differ(self) -> bool:
        """Whether repeats differ by more than stated instruments make, and no part of one is set aside for it.

        What is larger than that is taken for no noise, but nothing that acts in all trials alike explains it.
        """
        noise = self.problem.errors.noise
        return self.problem.aside is None and (noise.beyond_force > 0.0 or noise.beyond_way > 0.0)

    def value(self, name: str) -> float:
        """Return a parameter's expected value, in its unit."""
        if name in self.identified:
            return self.identified[name].value
        return self.fit.moved(self.posterior.mean)[name]

    def determined(self, name: str) -> bool:
        """Return whether the data say anything about a parameter beyond what was known of it."""
        k = self.fit.free.index(name)
        return bool(self.posterior.covariance[k, k] < 0.8)

    def interval(self, name: str, tail: float = 0.025) -> tuple[float, float]:
        """Return a parameter's 95 % interval, or that without other tails, in its unit."""
        if name in self.identified and tail == 0.025:
            return self.identified[name].ci95
        k, mixture = self.fit.free.index(name), self.distribution(name)
        ends = []
        for probability in (tail, 1 - tail):
            at = self.posterior.mean.copy()
            at[k] = mixture.quantile(probability)
            ends.append(self.fit.moved(at)[name])
        return min(ends), max(ends)

    def estimate(self, name: str, ci95: tuple[float, float] | None = None, fits: bool = True) -> Estimate:
        """Return a fitted parameter as an identification has it.

        Parameters
        ----------
        name
            Full name.
        ci95
            95 % interval in the parameter's unit; that of this explanation alone without it.
        fits
            Whether the model describes the recordings.
        """
        parameter = self.fit.parameters[self.fit.free.index(name)]
        ends = ci95 or self.interval(name)
        known = Estimated(parameter, self.value(name), (ends[1] - ends[0]) / (2 * 1.96), ends)
        return Estimate(parameter, known.value, known.standard_error, ends, known.verdict(fits))

    def shown(self, name: str) -> Shown:
        """Return a fitted parameter's numbers as people read them: stresses in kPa."""
        return self.estimate(name).shown

    def distribution(self, name: str) -> Mixture:
        """Return a fitted parameter's distribution, as a departure from what was known."""
        k, posterior = self.fit.free.index(name), self.posterior
        strands = posterior.components or MixtureComponents(
            np.ones(1), posterior.mean[None], np.sqrt(np.diag(posterior.covariance))[None]
        )
        degrees = np.full(len(strands.weights), self.degrees_of_freedom[k])
        return Mixture(strands.weights, strands.means[:, k], strands.sds[:, k], degrees)


@dataclass(frozen=True)
class Statement:
    """What is said of recordings, and how probable it is.

    A statement without mechanisms that isn't of something unknown is that nothing was left out
    that shows: the base model alone, or with what the data neither ask for nor exclude.
    """

    names: tuple[str, ...]
    """Names of mechanisms."""
    unnamed: bool
    probability: float
    like: tuple[str, ...] = ()
    """Mechanisms that something unknown is like; it isn't they, whose form isn't met."""

    @property
    def nothing_shows(self) -> bool:
        """Whether it is that nothing was left out that shows."""
        return not self.names and not self.unnamed


@dataclass(frozen=True, eq=False)
class Explained:
    """All explanations, the most probable first."""

    every: tuple[Explanation, ...]
    base: Explanation
    share: float = 1.0
    """Probability of all that was weighed before anything was recorded: nothing is surer than that."""
    cut: bool = False
    """Whether time was over before all was solved in full that it rests on."""

    def listed(self) -> tuple[Explanation, ...]:
        """Return what the base model's failure is put down to, until that holds 90 %.

        Probabilities are those among explanations that leave something out. A pair that explains no
        more than one of its mechanisms does alone counts for that one.
        """
        held = self._held()
        total = sum(held.values())
        shares = {names: probability / total for names, probability in held.items()}
        by_names = {one.names: one for one in self.every if not one.is_base}
        kept: list[Explanation] = []
        for names, share in sorted(shares.items(), key=lambda pair: -pair[1]):
            kept.append(replace(by_names[names], probability=share * self.share))
            if sum(e.probability for e in kept) >= HELD * self.share:
                break
        return tuple(kept)

    def statements(self) -> tuple[Statement, ...]:
        """Return what may be said, the most probable first; probabilities add up to that of all that was weighed.

        "Nothing at all" isn't among them: no data tell it from what is too small to show.
        """
        by_names = {one.names: one for one in self.every if not one.is_base}
        found = [Statement((), False, self.adequacy)]
        for names, held in self._held().items():
            like = names if names and held > _SAID_FROM and by_names[names].missing else ()
            found.append(Statement(() if like else names, not names or bool(like), held * self.share, like))
        return tuple(sorted(found, key=lambda one: -one.probability))

    def _held(self) -> dict[tuple[str, ...], float]:
        """Return the probabilities of what shows, pairs counted for what they add to one.

        Mechanisms that don't describe the recordings count for something unknown: probabilities
        weigh explanations against each other, and all of them may be bad.
        """
        adding = [e for e in self.every if self._adds(e)]
        singles = singles_of(adding)
        held: dict[tuple[str, ...], float] = {}
        for one in adding:
            counted = counts_for(one, singles)
            names = counted.names if self.describes(counted) else ()
            held[names] = held.get(names, 0.0) + one.probability
        return held

    def describes(self, one: Explanation) -> bool:
        """Whether it leaves no more of the base model's misfit than it takes up, or than noise is; in every channel.

        Misfits are sums of squares over the errors', beyond the one that noise makes a value.
        """
        before, after = ([e.excess_misfit, *e.excess_by_channel] for e in (self.base, one))
        channels = one.problem.predictor.observed.data.channels if one.excess_by_channel else ()
        sizes = [len(one.fit.residual), *map(len, channels)]
        return all(left <= max(was - left, float(n)) for was, left, n in zip(before, after, sizes, strict=True))

    @property
    def adequacy(self) -> float:
        """Probability that nothing was left out that shows.

        Of the base model alone, and of explanations that add to it what the data don't ask for.
        """
        return self.share * min(1.0, sum(e.probability for e in self.every if not self._adds(e)))

    @cached_property
    def adequate(self) -> tuple[Explanation, ...]:
        """What leaves nothing out that matters: the base model, or a trifling error beside it.

        An error of unknown shape below a trial's noise is no contradiction: real noise is never
        quite as assumed.
        """
        observed, spread = self.base.problem.predictor.observed, self.base.problem.errors.trial_sd
        scales = discrepancy_scales(observed, self.base.fit.prediction)
        most = min(float(spread[span].max()) / scale for span, scale in zip(observed.data.spans, scales, strict=True))
        return tuple(e for e in self.every if e.is_base or (e.unnamed and e.posterior.discrepancy_size < most))

    def _adds(self, one: Explanation) -> bool:
        most = max(self.adequate, key=lambda e: e.posterior.log_evidence)
        return one not in self.adequate and log_bayes_factor(one, most) > ADDS_FROM


def singles_of(every: Sequence[Explanation]) -> dict[tuple[str, ...], Explanation]:
    """Return the explanations of one mechanism, by its name."""
    return {e.names: e for e in every if len(e.names) == 1}


def counts_for(one: Explanation, singles: Mapping[tuple[str, ...], Explanation]) -> Explanation:
    """Return the better one of a pair's mechanisms, if the pair explains no more; else itself."""
    best = better_of(one, singles)
    return best if log_bayes_factor(one, best) < MORE_THAN_ALONE else one


def better_of(one: Explanation, singles: Mapping[tuple[str, ...], Explanation]) -> Explanation:
    """Return the explanation by the better one of a pair's mechanisms alone; itself of one mechanism."""
    alone = [singles[n,] for n in one.names if (n,) in singles and len(one.names) > 1]
    return max(alone, key=lambda e: e.posterior.log_evidence, default=one)


def log_bayes_factor(one: Explanation, nothing: Explanation) -> float:
    """Return the ln of the Bayes factor over nothing."""
    return one.posterior.log_evidence - nothing.posterior.log_evidence


def unknown_course(explanation: Explanation, unknowns: Sequence[Discrepancy]) -> FloatArray:
    """Return the expected course (N,) of what is unknown beside an explanation, if it is."""
    residual, total = explanation.fit.residual, explanation.problem.errors.covariance
    course = np.zeros_like(residual)
    shares = explanation.posterior.discrepancy_weights
    for unknown, share in zip(unknowns, shares, strict=True):
        if unknown.covariance is not None and share > _COUNTS * shares.max():
            course += share * unknown.covariance @ np.linalg.solve(total + unknown.covariance, residual)
    return np.asarray(course / max(explanation.posterior.discrepancy_probability, _COUNTS))
