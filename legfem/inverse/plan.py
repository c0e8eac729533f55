r"""The probability that a further test would distinguish explanations.

Data of one explanation are predicted by another with its parameters' posterior of today. With :math:`\Delta` the
difference of both predictions, :math:`S` the errors of the new test and :math:`J \Sigma J^T` what the other's
parameters may still take up,

.. math:: m = \tfrac12 \Delta^T (S + J \Sigma J^T)^{-1} \Delta

is the expected logarithm of the Bayes factor; it scatters with variance :math:`2 m`, so that a factor of :math:`e^3` is
reached with probability :math:`\Phi((m - 3) / \sqrt{2 m})`. No effect has quite its model's form: with the probability
that a form leaves something, what it may leave of both is among the errors. Compare D. V. Lindley, Ann. Math. Statist.
27 (1956) 986-1005.

How much better C10 is known afterwards by one explanation follows from the information of both tests together on its
parameters and on what isn't known exactly of the body, which errs alike in both.

A direct reading of an effect's strength, without the indenter, is an observation of one of the explanations'
parameters: the strength that the recordings gave it, or its null where an explanation hasn't that effect.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, permutations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, inv
from scipy.stats import norm

from legfem.common.units import FloatArray
from legfem.inverse.accuracy import Accuracy, measured_strength
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.channel_readings import PlannedChannel
from legfem.inverse.errors import ErrorModel, NuisanceEffect, error_model
from legfem.inverse.evidence import discrepancy_scales, possible_discrepancies
from legfem.inverse.explanation import INEXACT
from legfem.inverse.linearised import INEXACT_SHARE, LinearisedFit
from legfem.inverse.mechanism import Mechanism, null_of, prior_of
from legfem.inverse.observations import Observations, blank_observations
from legfem.inverse.predictor import Predictor, onset_name, values_of
from legfem.inverse.trial_noise import Noise
from legfem.solve.protocol import Protocol


@dataclass(frozen=True)
class Design:
    """One test, as a lab would make it.

    Parameters
    ----------
    name
        What to do, in words.
    protocols
        One a trial.
    outlines_known
        Whether the leg's outlines are measured at the indenter (ultrasound, labels on the skin).
    contact_known
        Whether first contact is seen: the recording begins in air, slowly.
    length_factor
        Of the cylinder, over that of the test that was made.
    channels
        What is recorded beside the force.
    effort
        What it takes beyond the test that was made, in words.
    """

    name: str
    protocols: tuple[Protocol, ...]
    outlines_known: bool = False
    contact_known: bool = False
    length_factor: float = 1.0
    channels: tuple[PlannedChannel, ...] = ()
    effort: str = ""


@dataclass(frozen=True)
class DirectReadings:
    """Effects that are measured by themselves, by other instruments than the indenter.

    Parameters
    ----------
    mechanisms
        Each with a `measured_sd`.
    """

    mechanisms: tuple[Mechanism, ...]

    effort: ClassVar[str] = "a measurement of its own"

    @property
    def name(self) -> str:
        """What to do, in words."""
        return "; and ".join(m.next_experiment for m in self.mechanisms)


DISTINGUISHED = 3.0
"""ln of the Bayes factor: twenty to one."""
_STEP = 1e-3
_SEEN_ONSET_SD_MM = 0.05
_ONSET_STEP_MM = 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """An explanation as it is known before the new test.

    Parameters
    ----------
    name
        For people.
    fit
        Its mechanisms and values; its parameters with their priors.
    mean, covariance
        (p,), (p, p): departures of its parameters from their priors.
    probability
        Today.
    """

    name: str
    fit: LinearisedFit
    mean: FloatArray
    covariance: FloatArray
    probability: float

    @property
    def lasting(self) -> list[int]:
        """Places of its parameters but for first contacts, which are of the trials that were made."""
        return [k for k, one in enumerate(self.fit.parameters) if one.role != "nuisance"]

    @cached_property
    def information(self) -> FloatArray:
        """What was recorded tells of its parameters and of the effects that its errors know, (p + k, p + k)."""
        return _information(self.fit.sensitivities, self.fit.problem.errors)


@dataclass(frozen=True)
class DesignValue:
    """What a test is worth."""

    design: Design | DirectReadings
    chances: Mapping[tuple[str, str], float]
    """Chance that data of the first explanation favour it over the second."""
    chance: float
    """Chance that whichever explanation holds is told from all others."""
    narrows: tuple[float, ...] = ()
    """By each explanation, the standard error of C10 after the test over that before."""


type DesignedNuisances = Callable[[Design, Observations, FloatArray], Sequence[NuisanceEffect]]
"""What isn't known exactly does to a test's readings (N,)."""


def evaluate_design(
    design: Design,
    candidates: Sequence[Candidate],
    predictor: Predictor,
    nuisances: DesignedNuisances,
    noise: Noise,
    gain_sd: float,
) -> DesignValue | None:
    """Return what a test is worth; None where a response to it isn't known.

    Parameters
    ----------
    design
        The test.
    candidates
        Explanations that are open.
    predictor
        Of the test that was made: its leg, law and ends.
    nuisances
        Effects of what isn't known exactly.
    noise, gain_sd
        Of the instruments and from trial to trial.
    """
    blank = blank_observations(design.protocols, design.channels)
    new = replace(predictor, observed=blank, offset=0.0)
    readings = [_readings(new, c.fit.mechanisms, c.fit.moved(c.mean), design) for c in candidates]
    if any(np.isnan(own).any() for own in readings):
        return None
    told = [_told(new, c, own, design) for c, own in zip(candidates, readings, strict=True)]
    kept = np.all([_above_threshold(blank.with_values(own)) for own in readings], axis=0)
    chances, narrows = {}, []
    for one, mine in zip(candidates, told, strict=True):
        effects = nuisances(design, blank, mine.readings)
        images = new.images_elsewhere(one.fit.moved(one.mean), one.fit.mechanisms)
        errors = error_model(blank.with_values(mine.readings), noise, mine.readings, effects, images=images)
        errors = replace(errors, gain_sd=gain_sd)
        known = errors.covariance
        narrows.append(_narrowed(one, mine, errors, kept))
        for other, its in zip(candidates, told, strict=True):
            if other is one:
                continue
            apart, total = mine.readings - its.readings, known + its.taken
            exact = chance_to_distinguish(apart[kept], total[np.ix_(kept, kept)])
            inexact = total + mine.inexact + its.inexact
            left = chance_to_distinguish(apart[kept], inexact[np.ix_(kept, kept)])
            chances[one.name, other.name] = (1 - INEXACT) * exact + INEXACT * left
    return replace(design_value(design, chances, candidates), narrows=tuple(narrows))


def _narrowed(candidate: Candidate, told: "_Told", errors: ErrorModel, kept: NDArray[np.bool_]) -> float:
    """Return the standard error of a candidate's C10 after a test over that before it.

    What isn't known exactly of the body errs alike in what was recorded and in what is to be.
    """
    fitted, before = candidate.fit, candidate.fit.problem.errors
    own = len(fitted.parameters)
    size = own + len(told.onset_sds)
    place = {name: size + k for k, name in enumerate(dict.fromkeys((*before.names, *errors.names)))}
    old = [*range(own), *(place[name] for name in before.names)]
    new = [*candidate.lasting, *range(own, size), *(place[name] for name in errors.names)]
    now = np.diag([*np.ones(own), *told.onset_sds**-2, *np.ones(len(place))])
    now[np.ix_(old, old)] += candidate.information
    then = now.copy()
    then[np.ix_(new, new)] += _information(told.slopes[kept], errors.part(kept))
    at = fitted.free.index(DEEP_C10)
    return float(np.sqrt(inv(then)[at, at] / inv(now)[at, at]))


def _information(slopes: FloatArray, errors: ErrorModel) -> FloatArray:
    """Return what readings tell of the p numbers by which they have slopes (N, p), then of the k known effects."""
    white = replace(errors, known=errors.known[:, :0]).whitened(np.column_stack([slopes, errors.known]))
    return white.T @ white


def _above_threshold(observed: Observations) -> NDArray[np.bool_]:
    """Return which readings (N,) say anything: those that reach their instrument's threshold."""
    least = [-np.inf if one.accuracy.threshold is None else one.accuracy.threshold for one in observed.channels]
    above = [one.values >= low for one, low in zip(observed.channels, least, strict=True)]
    return np.concatenate([np.ones(len(observed.force), dtype=bool), *above])


def chance_to_distinguish(apart: FloatArray, total: FloatArray) -> float:
    """Return the chance that data tell two explanations apart.

    Parameters
    ----------
    apart
        (n,): difference of what both predict.
    total
        (n, n): covariance of all that the data and the second may be off by.
    """
    m = 0.5 * float(apart @ np.linalg.solve(total, apart))
    return float(norm.cdf((m - DISTINGUISHED) / np.sqrt(2 * m + 1e-9)))


def expected_log_factor(chance: FloatArray) -> FloatArray:
    """Return the expected logarithm m of the Bayes factor that is behind a `chance_to_distinguish`."""
    at = np.sqrt(2.0) * norm.ppf(np.clip(chance, 1e-9, 1.0 - 1e-9))
    return np.asarray((0.5 * (at + np.sqrt(at**2 + 4.0 * DISTINGUISHED))) ** 2)


def design_value(
    design: Design | DirectReadings, chances: Mapping[tuple[str, str], float], candidates: Sequence[Candidate]
) -> DesignValue:
    """Return what a test is worth, from the chances that it tells each from each."""
    weights = np.array([c.probability for c in candidates])
    each = [min((chances[c.name, o.name] for o in candidates if o is not c), default=1.0) for c in candidates]
    return DesignValue(design, chances, float(weights @ each / weights.sum()))


def ranked(found: Sequence[DesignValue]) -> list[DesignValue]:
    """Return tests, the most telling first."""
    return sorted(found, key=lambda one: -one.chance)


@dataclass(frozen=True, eq=False)
class _Told:
    """What a candidate says of a test."""

    readings: FloatArray
    """(N,)."""
    slopes: FloatArray
    """(N, p): what its lasting parameters and the new first contacts may change."""
    onset_sds: FloatArray
    """(r,): of these contacts, mm."""
    taken: FloatArray
    """(N, N): what its parameters and first contacts may still take up."""
    inexact: FloatArray
    """(N, N): what its form may leave, that is never quite the effect's."""


def _told(new: Predictor, candidate: Candidate, readings: FloatArray, design: Design) -> _Told:
    blank, fitted = new.observed, candidate.fit
    slopes, onset_sds = _slopes(new, candidate, readings, design), _onset_sds(candidate, design)
    lasting = np.ix_(candidate.lasting, candidate.lasting)
    known = block_diag(candidate.covariance[lasting], np.diag(onset_sds**2))
    own = len(fitted.stiffness)
    refit = np.column_stack([slopes[:, :own], slopes[:, -len(design.protocols) :]])
    shown = readings - _readings(new, (), fitted.moved(candidate.mean), design)
    shown = shown - refit @ np.linalg.lstsq(refit, shown)[0]
    return _Told(readings, slopes, onset_sds, slopes @ known @ slopes.T, _inexact(blank, readings, shown))


def _inexact(blank: Observations, readings: FloatArray, shown: FloatArray) -> FloatArray:
    """Return the covariance of what a form leaves of what shows of it (N,), channel by channel.

    As an explanation is weighed: an error of unknown shape, of a share of what shows at most.
    """
    total = np.zeros((len(readings), len(readings)))
    if not shown.any():
        return total
    unknowns = [u for u in possible_discrepancies(blank, readings)[1:] if all(u.by_channel)]
    for span, scale in zip(blank.data.spans, discrepancy_scales(blank, readings), strict=True):
        size = INEXACT_SHARE * float(np.sqrt(np.mean(shown[span] ** 2)) / scale)
        most = max(size, unknowns[0].size)
        largest = max((u for u in unknowns if u.size <= most), key=lambda u: u.size)
        assert largest.covariance is not None
        total[span, span] = largest.covariance[span, span]
    return total


def _readings(
    new: Predictor,
    mechanisms: Sequence[Mechanism],
    values: Mapping[str, float],
    design: Design,
    onsets: Mapping[str, float] | None = None,
) -> FloatArray:
    """Return the readings (N,), first contacts (mm) where they are counted from; of a longer cylinder more force."""
    # New trials are touched where they are touched: what was fitted before was the old ones'.
    given = {**values, **dict.fromkeys(map(onset_name, range(len(new.observed.trials))), 0.0)}
    for one in mechanisms:
        given |= one.by_full_name(one.for_length(values_of(given, one), design.length_factor))
    found = new({**given, **(onsets or {})}, mechanisms)
    are_forces = [True, *(one.kind.is_force for one in new.observed.channels)]
    for is_force, span in zip(are_forces, new.observed.data.spans, strict=True):
        found[span] *= design.length_factor if is_force else 1.0
    return found


def _slopes(new: Predictor, candidate: Candidate, here: FloatArray, design: Design) -> FloatArray:
    """Return what the parameters, and the new trials' first contacts, may change."""
    blank, fitted = new.observed, candidate.fit
    columns = []
    for k in candidate.lasting:
        moved = candidate.mean.copy()
        moved[k] += _STEP
        there = _readings(new, fitted.mechanisms, fitted.moved(moved), design)
        columns.append((there - here) / _STEP)
    slope = blank.with_values(here).stiffness
    for k in range(len(blank.trials)):
        column = np.zeros(len(here))
        column[: len(slope)] = np.where(blank.trial == k, -slope, 0.0)
        if blank.channels:
            later = _readings(
                new, fitted.mechanisms, fitted.moved(candidate.mean), design, {onset_name(k): _ONSET_STEP_MM}
            )
            column[len(slope) :] = (later - here)[len(slope) :] / _ONSET_STEP_MM
        columns.append(column)
    return np.column_stack(columns)


def _onset_sds(candidate: Candidate, design: Design) -> FloatArray:
    """Return the standard deviations (r,) of a test's first contacts, mm: as in the test that was made, or if seen."""
    made = [] if design.contact_known else [p for p in candidate.fit.parameters if p.role == "nuisance"]
    return np.full(len(design.protocols), prior_of(made[0]).sd if made else _SEEN_ONSET_SD_MM)


def prior_candidates(base: LinearisedFit, mechanisms: Sequence[Mechanism]) -> list[Candidate]:
    """Return nothing and every mechanism at a usual strength, all as probable.

    Parameters
    ----------
    base
        The base model at the stiffness that is expected, of blank observations of the leg.
    mechanisms
        Those that are to be told.
    """
    found = [Candidate("nothing", base, base.prior_z, np.eye(len(base.free)), 1.0)]
    for mechanism in mechanisms:
        parameters = base.problem.parameters([mechanism])
        departure = np.zeros(len(parameters))
        departure[: len(base.free)] = base.prior_z
        departure[len(base.free)] = 0.7
        # Nothing was recorded that tells of its strength.
        slopes = np.pad(base.sensitivities, ((0, 0), (0, len(parameters) - len(base.free))))
        fitted = replace(base, mechanisms=(mechanism,), parameters=parameters, prior_z=departure, sensitivities=slopes)
        found.append(Candidate(mechanism.name, fitted, departure, np.eye(len(parameters)), 1.0))
    return found


_WORTH = 0.1
"""Of a chance, by which a second reading has to better the first one's."""


def evaluate_readings(
    mechanisms: Sequence[Mechanism], candidates: Sequence[Candidate], accuracy: Accuracy
) -> list[DesignValue]:
    """Return what it is worth to measure effects by themselves: each, and the best two if better.

    Parameters
    ----------
    mechanisms
        That are in doubt; those that can't be measured by themselves are passed over.
    candidates
        Explanations that are open.
    accuracy
        Of what is assumed of the leg.
    """
    able = [m for m in mechanisms if m.measured_sd is not None]
    single = [_worth((m,), candidates, accuracy) for m in able]
    double = [_worth(pair, candidates, accuracy) for pair in combinations(able, 2)]
    best = max((one.chance for one in single), default=0.0)
    most = max(double, key=lambda one: one.chance, default=None)
    return [*single, most] if most is not None and most.chance > best + _WORTH else single


def _worth(mechanisms: tuple[Mechanism, ...], candidates: Sequence[Candidate], accuracy: Accuracy) -> DesignValue:
    errors = np.diag([_error(m, accuracy) ** 2 for m in mechanisms])
    means, spreads = zip(*(_strengths(c, mechanisms) for c in candidates), strict=True)
    chances = {
        (one.name, other.name): chance_to_distinguish(means[i] - means[j], errors + spreads[j])
        for (i, one), (j, other) in permutations(enumerate(candidates), 2)
    }
    return design_value(DirectReadings(mechanisms), chances, candidates)


def _error(mechanism: Mechanism, accuracy: Accuracy) -> float:
    """Return a reading's standard deviation, over that of what is known beforehand."""
    assert mechanism.measured_sd is not None
    null = null_of(mechanism.parameters[0])
    return measured_strength(mechanism, null, mechanism.measured_sd, accuracy).sd


def _strengths(candidate: Candidate, mechanisms: Sequence[Mechanism]) -> tuple[FloatArray, FloatArray]:
    """Return mean (k,) and covariance (k, k) of departures: none of effects that it hasn't."""
    free = candidate.fit.free
    pick = np.zeros((len(mechanisms), len(free)))
    for row, mechanism in enumerate(mechanisms):
        if mechanism.strength_name in free:
            pick[row, free.index(mechanism.strength_name)] = 1.0
    return pick @ candidate.mean, pick @ candidate.covariance @ pick.T
