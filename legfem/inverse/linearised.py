"""Observations with their errors and a tabulated model, and a model fitted to them with its derivatives there.

The effect of what isn't known exactly is the relative change of the force by one standard deviation of it, from a
solution with another geometry, or from the exact derivative by an assumed number; of the correction for ends it is the
error that comes with it. Of a mechanism that was named, `shares_by_part` says whether its form is met.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise, takewhile

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from legfem.channels.kinds import FILE_OF
from legfem.common.units import FloatArray
from legfem.inverse.accuracy import GEOMETRY_DOF, MATERIAL_DOF, SIZE, Accuracy, Cause, MeasuredStrength, word_of
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.errors import ErrorModel, NuisanceEffect, error_model
from legfem.inverse.evidence import Linearisation
from legfem.inverse.intervals import THIRDS, effective_degrees, third_of
from legfem.inverse.library import NuisanceChanges
from legfem.inverse.mechanism import Mechanism, Occurrence, Stiffness, Unseen, null_of, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.inverse.predictor import Predictor, contact_sd_alike
from legfem.inverse.trial_noise import Noise


def variance_degrees(covariance: FloatArray, estimator: FloatArray, errors: ErrorModel) -> FloatArray:
    """Return the degrees of freedom (p,) of the variances of estimates, by Welch and Satterthwaite.

    Parameters
    ----------
    covariance
        Of the estimates, (p, p).
    estimator
        (p, n), 1/N: what an error of the observations adds to them.
    errors
        Of the observations.

    See `legfem.inverse.intervals.effective_degrees`.
    """
    by_cause: dict[Cause, FloatArray] = {}
    for one, effect in zip(errors.stated.values(), errors.known.T, strict=True):
        by_cause[one.cause] = by_cause.get(one.cause, np.zeros(len(covariance))) + (estimator @ effect) ** 2
    return np.array(
        [
            effective_degrees(whole, [(part[k], cause.degrees_of_freedom) for cause, part in by_cause.items()])
            for k, whole in enumerate(np.diag(covariance))
        ]
    )


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """A model fitted to the observations, or to a part of them."""

    problem: "LinearisedProblem"
    """What it was fitted to, with the errors by which it was."""
    mechanisms: tuple[Mechanism, ...]
    values: Mapping[str, float]
    """All parameters: MPa, mm and the mechanisms' units."""
    parameters: tuple[Parameter, ...]
    """Those that were fitted, by full name."""
    prior_z: FloatArray
    """(p,): of those from what was known, in its standard deviations."""
    prediction: FloatArray
    """(N,): all readings, fitted or not: the forces first."""
    residual: FloatArray
    """(N,): observed less predicted."""
    sensitivities: FloatArray
    """(N, p): of the prediction by one standard deviation of each parameter."""
    whitened: FloatArray
    """(k,): the fitted part's residual over its errors' Cholesky factor."""
    jacobian: FloatArray
    """(k, p): ``change`` of the fitted part, whitened."""
    converged: bool = True
    """Whether the search ended by itself."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the mechanisms."""
        return tuple(m.name for m in self.mechanisms)

    @property
    def stiffness(self) -> tuple[str, ...]:
        """Names of the stiffnesses that it has: a neo-Hookean tissue has no C20."""
        return tuple(name for name in (DEEP_C10, DEEP_C20) if name in self.free)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that were fitted."""
        return tuple(p.name for p in self.parameters)

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual."""
        return float(self.whitened @ self.whitened)

    @property
    def cost(self) -> float:
        """The same with the departures from what was known: what a fit minimises."""
        return self.chi2 + float(self.prior_z @ self.prior_z)

    @property
    def excess_misfit(self) -> float:
        """What is more in the cost than noise makes, which is one a value."""
        return max(self.cost - len(self.residual), 0.0)

    @property
    def augmented_residual(self) -> FloatArray:
        """What is left (k + p,): the whitened residual, and departures from what was known."""
        return np.concatenate([self.whitened, -self.prior_z])

    @property
    def augmented_jacobian(self) -> FloatArray:
        """What the parameters move of that, (k + p, p)."""
        return np.vstack([self.jacobian, np.eye(len(self.free))])

    @property
    def lack_of_fit(self) -> float:
        """Probability of so much misfit by errors alone."""
        return float(chi2.sf(self.cost, len(self.whitened)))

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters at the ends of what they may be, their nulls excepted."""
        found = []
        for p in self.parameters:
            low, high = p.bounds
            value, close = self.values[p.name], 1e-4 * (high - low)
            at_null = p.prior is not None and abs(value - p.prior.centre) < close
            if not at_null and not low + close < value < high - close:
                found.append(p.name)
        return tuple(found)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (p, p) of the departures."""
        information = self.jacobian.T @ self.jacobian + np.eye(len(self.free))
        return np.asarray(np.linalg.inv(information))

    def sd(self, name: str) -> float:
        """Return the standard error of a parameter in its unit; NaN if it wasn't fitted."""
        if name not in self.free:
            return float("nan")
        k = self.free.index(name)
        prior, sd = prior_of(self.parameters[k]), float(np.sqrt(self.covariance[k, k]))
        low, high = (prior.value_at(self.prior_z[k] + side * sd) for side in (-1.0, 1.0))
        return 0.5 * abs(high - low)

    @property
    def linearised(self) -> Linearisation:
        """The fit as the evidence sees it."""
        ends = np.array([[prior_of(p).departure(end) for end in p.bounds] for p in self.parameters])
        return Linearisation(self.residual, self.sensitivities, self.prior_z, ends[:, 0], ends[:, 1])

    def moved(self, departure: FloatArray) -> dict[str, float]:
        """Return all values with the fitted ones at other departures."""
        at = zip(self.parameters, departure, strict=True)
        return {**self.values, **{p.name: p.inside(prior_of(p).value_at(z)) for p, z in at}}


type Nuisances = Callable[[LinearisedFit], Sequence[NuisanceEffect]]
"""Effects of uncertain inputs on the prediction of a fit."""


@dataclass(frozen=True, eq=False)
class LinearisedProblem:
    """Observations with their errors and the model's predictions: what fits need."""

    predictor: Predictor
    errors: ErrorModel
    kept: NDArray[np.bool_] | None = None
    """(n,): the observations that are fitted; all without it."""
    measured: tuple[MeasuredStrength, ...] = ()
    """Strengths that were measured by themselves: they count in a fit's posterior."""
    possible: Mapping[str, Occurrence] = field(default_factory=dict)
    """Which strengths mechanisms may have, by their names; within their bounds without it."""
    unseen: tuple[Unseen, ...] = ()
    """What is always there and the recordings don't show."""
    unweighed: tuple[Mechanism, ...] = ()
    """What they may show, and there was no time to solve."""
    aside: NDArray[np.bool_] | None = None
    """(N,): readings that are set aside, whose errors have no bounds; none without it."""
    nuisances: Nuisances | None = None
    """Recomputes nuisances for a fit with mechanisms; they are the same with all mechanisms without it."""

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Which readings (N,) aren't set aside."""
        return np.ones(len(self.errors.trial_sd), dtype=bool) if self.aside is None else ~self.aside

    def without(self, left_out: NDArray[np.bool_]) -> "LinearisedProblem":
        """Return the problem with observations left out."""
        return replace(self, kept=~left_out)

    def setting_aside(self, readings: NDArray[np.bool_]) -> "LinearisedProblem":
        """Return the problem with readings (N,) set aside: their errors are a thousand times as large."""
        return replace(self, errors=self.errors.without_bounds(readings), aside=readings)

    def corrected(self, offset: FloatArray) -> "LinearisedProblem":
        """Return the problem with the predictor shifted to a full solution."""
        return replace(self, predictor=replace(self.predictor, offset=offset))

    def errors_about(self, noise: Noise, about: LinearisedFit, effects: Sequence[NuisanceEffect]) -> ErrorModel:
        """Return the errors by noise, nuisance parameters and images' places about a fit."""
        images = self.predictor.images_elsewhere(about.values, about.mechanisms)
        return error_model(self.predictor.observed, noise, about.prediction, effects, images=images)

    def beside(self, fitted: LinearisedFit) -> "LinearisedProblem":
        """Return the problem with what nuisances and images' places do to a fit, beside its mechanisms."""
        if self.nuisances is None or not fitted.mechanisms:
            return self
        made = self.errors_about(self.errors.noise, fitted, self.nuisances(fitted))
        # Errors of the readings themselves are one for all explanations.
        return replace(self, errors=replace(made, dense=self.errors.dense, trial_sd=self.errors.trial_sd))

    @cached_property
    def _part(self) -> ErrorModel:
        return self.errors if self.kept is None else self.errors.part(self.kept)

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return the kept part of vectors (n,) or (n, k), whitened."""
        return self._part.whitened(values if self.kept is None else values[self.kept])

    def parameters(self, mechanisms: Sequence[Mechanism]) -> tuple[Parameter, ...]:
        """Return what is fitted: the base model's parameters and the mechanisms'."""
        own = [replace(p, name=f"{mechanism.name}.{p.name}") for mechanism in mechanisms for p in mechanism.parameters]
        return (*self.predictor.parameters, *own)


def nuisance_effects(
    changes: NuisanceChanges,
    observed: Observations,
    prediction: FloatArray,
    accuracy: Accuracy,
    ends: TabulatedCorrection | None = None,
    stiffness: Stiffness = (1e-3, 0.0),
) -> list[NuisanceEffect]:
    """Return what one standard deviation of each thing that isn't known exactly does to the readings.

    Parameters
    ----------
    changes
        Of the body's elastic courses.
    observed
        The recordings.
    prediction
        (N,): by the model.
    accuracy
        Of what is known of the body.
    ends
        The correction for the cylinder's ends, whose errors count where it is applied.
    stiffness
        C10 and C20, MPa: of the correction.
    """
    d, force = observed.displacement, prediction[: len(observed.force)]

    every = {**changes.geometric, **changes.material}

    @cache
    def along(course: str) -> dict[str, FloatArray]:
        grid = changes.grid if course == "force" else np.concatenate([[0.0], changes.grid])
        rows = {name: columns[course] for name, columns in every.items() if course in columns}
        there = CubicSpline(grid, np.array(list(rows.values())), axis=1)(np.maximum(d, grid[0]))
        return dict(zip(rows, there, strict=True))

    @cache
    def effect(name: str) -> FloatArray:
        further = [one.read(lambda course: along(course)[name]) for one in observed.channels]
        return np.concatenate([force * along("force")[name], *further])

    found: list[NuisanceEffect] = []
    for name in changes.material:
        if (sd := accuracy.log_sd(name)) > 0:
            word = word_of(name)
            degrees = GEOMETRY_DOF if name.startswith(SIZE) else MATERIAL_DOF
            found.append(NuisanceEffect(word, sd * effect(name), Cause(word, degrees)))
    for error in accuracy.shape_errors:
        if error.weights.keys() <= changes.geometric.keys():
            moved = np.array(list(error.weights.values())) @ np.array([effect(name) for name in error.weights])
            found.append(NuisanceEffect(error.name, moved, error.cause))
    if ends is not None:
        for mode_name, mode in ends.relative_errors(d, *stiffness).items():
            name = f"3D correction: {mode_name}"
            found.append(NuisanceEffect(name, prediction * observed.following_force(mode), Cause(name)))
    return [*found, *of_recording(observed.with_values(prediction), accuracy)]


_OF_STEP = ("step of the force", "reading before the step", "reading after the step")


def of_recording(predicted: Observations, accuracy: Accuracy) -> Iterator[NuisanceEffect]:
    """Yield what a step of the force does that trials show, and first contact that lies before all trials' starts.

    A touch counts as far as trials don't begin in air, by a standard deviation; the readings are a model's, whose slope
    has no noise. What a step was of isn't known, and an effect of the tissue that resembles it isn't seen beside it.
    """
    for trial in predicted.steps:
        for which, effect in zip(_OF_STEP, predicted.stepped(trial), strict=True):
            yield NuisanceEffect(f"{which} in {trial}", effect, Cause(which), "recordings")
    if not predicted.shows_air and accuracy.contact_sd != 0.0:
        sd = contact_sd_alike(predicted) if accuracy.contact_sd is None else accuracy.contact_sd
        slope = predicted.by_displacement.copy()
        if accuracy.tared:
            _, first, of = np.unique(predicted.trial, return_index=True, return_inverse=True)
            slope[: len(of)] -= slope[first[of]]
        effect = math.sqrt(1.0 - predicted.chance_of_air) * sd * slope
        yield NuisanceEffect("first contact", effect, Cause("first contact"), "contact")


_WIDE = 3.0
"""Standard deviation of a part's share beforehand: as good as none."""
INEXACT_SHARE = 0.4
"""Largest share of a visible effect that the form may miss."""
_SURELY = 2.0
"""Standard deviations."""


@dataclass(frozen=True)
class ShareOfPart:
    """How much of what is named is there in a part of the recordings."""

    part: str
    share: float
    sd: float
    others: float
    """Share in the others, by how well each tells it."""
    missing: bool
    """Whether surely less of it is there than in the others, by more than forms are inexact."""


def shares_by_part(fitted: LinearisedFit) -> dict[str, tuple[ShareOfPart, ...]]:
    r"""Return by mechanism how much of it is there in each part of the readings.

    It tells whether the form of what is named is met. An explanation may fit better than all others and still be a name
    for something else: a frame that meets the leg at some depth is, over all, much like a support that gives way. What
    is named acts everywhere by its own law; so with :math:`e` what a mechanism adds to the prediction at the fit, and
    :math:`e_p` that in part :math:`p` of the readings and nothing elsewhere, the residual :math:`r` of the fit is

    .. math:: r = J \delta + \sum_p b_p e_p + \epsilon

    with the derivatives :math:`J` by all that is fitted but the strength, their departures :math:`\delta` with their
    priors, and errors :math:`\epsilon` of the observations' whole covariance. The share of the mechanism that is there
    in a part is :math:`1 + b_p`; by generalised least squares it has a standard deviation, which is large where the
    part tells nothing. It is missing from a part that surely has less of it than the others by more than forms are
    inexact; where those have none either, none is missing. Parts are trials, phases, thirds of the depth, and channels,
    each by themselves.

    Parameters
    ----------
    fitted
        With the mechanisms.
    """
    families = list(_families(fitted.problem))
    return {
        m.name: tuple(share for names, parts in families for share in _shares(fitted, m, names, parts))
        for m in fitted.mechanisms
    }


def _shares(
    fitted: LinearisedFit, mechanism: Mechanism, names: list[str], parts: list[NDArray[np.bool_]]
) -> list[ShareOfPart]:
    problem, strength = fitted.problem, mechanism.strength_name
    without = {**fitted.values, strength: null_of(mechanism.parameters[0])}
    effect = problem.predictor(fitted.values, fitted.mechanisms) - problem.predictor(without, fitted.mechanisms)
    acts = [(name, part) for name, part in zip(names, parts, strict=True) if np.any(effect[part])]
    if len(acts) < 2:
        return []
    others = [k for k, name in enumerate(fitted.free) if name != strength]
    columns = np.column_stack([fitted.sensitivities[:, others], *(effect * part for _, part in acts)])
    white, left = problem.errors.whitened(columns), problem.errors.whitened(fitted.residual)
    known = np.concatenate([np.ones(len(others)), np.full(len(acts), _WIDE**-2)])
    from_prior = np.concatenate([fitted.prior_z[others], np.zeros(len(acts))])
    covariance = np.linalg.inv(white.T @ white + np.diag(known))
    found = covariance @ (white.T @ left - known * from_prior)
    own = slice(len(others), None)
    return [_of_part(k, name, 1.0 + found[own], covariance[own, own]) for k, (name, _) in enumerate(acts)]


def _of_part(k: int, name: str, shares: FloatArray, covariance: FloatArray) -> ShareOfPart:
    weights = 1.0 / np.diag(covariance)
    weights[k] = 0.0
    weights /= weights.sum()
    short = -(1.0 - INEXACT_SHARE) * weights
    short[k] = 1.0
    missing = min(weights @ shares, -short @ shares - _SURELY * np.sqrt(short @ covariance @ short)) > 0.0
    return ShareOfPart(name, float(shares[k]), float(np.sqrt(covariance[k, k])), float(weights @ shares), bool(missing))


def _families(problem: LinearisedProblem) -> Iterator[tuple[list[str], list[NDArray[np.bool_]]]]:
    """Yield names and readings (N,) of parts: of each family every reading has one."""
    observed = problem.predictor.observed
    at, kept = observed.nearest, problem.counted
    trials = [observed.trial[at] == k for k in range(len(observed.trials))]
    yield list(observed.trials), [kept & one for one in trials]
    phases = list(dict.fromkeys(map(str, observed.phase)))
    yield phases, [kept & (observed.phase[at] == phase) for phase in phases]
    third = third_of(observed.displacement[at], observed.depth)
    ends = [observed.depth * k / len(THIRDS) for k in range(len(THIRDS) + 1)]
    yield ([f"{a:.0f} to {b:.0f} mm" for a, b in pairwise(ends)], [kept & (third == k) for k in range(len(THIRDS))])
    if observed.channels:
        force = np.arange(len(at)) < len(observed.force)
        yield ["force", "all but the force"], [kept & force, kept & ~force]
        yield _channels(problem, kept)


def _channels(problem: LinearisedProblem, kept: NDArray[np.bool_]) -> tuple[list[str], list[NDArray[np.bool_]]]:
    """Return channels that are read in one way, together."""
    observed = problem.predictor.observed
    number = np.zeros(len(observed.values), dtype=int)
    titles: dict[object, list[str]] = {None: ["force"]}
    for one, span in zip(observed.channels, observed.data.spans[1:], strict=True):
        titles.setdefault(FILE_OF[one.name], []).append(one.kind.title)
        number[span] = list(titles).index(FILE_OF[one.name])
    return [_shared_words(own) for own in titles.values()], [kept & (number == k) for k in range(len(titles))]


def _shared_words(titles: list[str]) -> str:
    """Return the words that titles begin with alike; all of them where they don't."""
    alike = takewhile(lambda words: len(set(words)) == 1, zip(*(one.split() for one in titles), strict=False))
    return " ".join(words[0] for words in alike) or ", ".join(titles)
