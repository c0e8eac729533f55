r"""What could hide: a mechanism's strength stepped from nothing to all that is possible, everything else refitted.

A refit of the stiffness can hide an effect of any size, so no line about a fit says how strong it may be. At strengths
:math:`z_k` between the ends of what is possible all else is fitted anew, and

.. math:: r(z) = \min_{\theta} \left( -2 \ln L(z, \theta) \right) - \min_{z, \theta} \left( -2 \ln L(z, \theta) \right)

is the profile likelihood. Strengths with r below the 95 % quantile of chi-square with one degree of freedom are not
contradicted (S. A. Murphy, A. W. van der Vaart, J. Am. Stat. Assoc. 95 (2000) 449). Where r stays below it up to an end
of what is possible, the recordings leave the strength **open** on that side. Between steps the signed root of r is
taken as straight: of a linear problem it is. Of an effect whose place or time is open, too, the chi-square has as many
degrees as the effect has parameters: without it they are nowhere (R. B. Davies, Biometrika 74 (1987) 33).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.explanation import Explanation
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import Mechanism, Occurrence, Values, null_of, prior_of
from legfem.inverse.predictor import values_of

_FAR = 25.0
"""Rise from which a side isn't followed further."""
_SHARES = (0.12, 0.35, 0.65, 1.0)
"""Of the way from the null to an end."""
_REFINED = 2
"""Steps that are set where an end of the limits seems to lie."""
_SHAPES = 3
"""Values of a mechanism's other parameters that a side begins from, beside the fit's own."""


@dataclass(frozen=True, eq=False)
class HiddenStep:
    """All else fitted with a strength held."""

    z: float
    """Strength, in standard deviations of what is known beforehand."""
    fit: LinearisedFit

    cost: float
    """-2 ln of the likelihood, but for a constant: what a fit minimises without the strength's own prior."""


@dataclass(frozen=True)
class HiddenEnd:
    """To one side of a mechanism's null what moves C10 furthest and isn't contradicted."""

    values: Mapping[str, float]
    """Values of the mechanism's parameters, by their short names."""
    open: bool
    """Whether the recordings don't close that side."""
    c10: float
    """MPa: C10 then; NaN where it isn't fitted."""


@dataclass(frozen=True)
class Limit:
    """How strong a mechanism may be unseen, and what the stiffness would then be."""

    name: str
    parameter: str
    unit: str
    low: float
    high: float
    """95 % interval (one-sided where only one sign is possible)."""
    open_low: bool
    open_high: bool
    """Whether that end is only where what is possible ends: the recordings don't close it."""
    effect: float
    """N: greatest change of the force by the strongest of them, the stiffness as it is then."""
    stiffness: Mapping[str, tuple[float, float]]
    """MPa: between which C10 and C20 then are, by full name."""
    ends: tuple[HiddenEnd, ...]
    """Ends on the sides of the null that it has."""

    @property
    def open(self) -> bool:
        """Whether the recordings leave an end open."""
        return self.open_low or self.open_high


@dataclass(frozen=True, eq=False)
class Profile:
    """A mechanism's profile likelihood, steps in the order of their strength."""

    mechanism: Mechanism
    steps: tuple[HiddenStep, ...]
    ends: tuple[float, float]
    """Of what is possible, as departures."""

    @property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return np.array([s.z for s in self.steps]), np.array([s.cost for s in self.steps])

    @property
    def vertex(self) -> tuple[float, float]:
        """Strength and cost where the cost is least: of the parabola through the lowest step and its neighbours."""
        z, cost = self._arrays
        k = int(np.argmin(cost))
        if 0 < k < len(z) - 1:
            a, b, c = np.polyfit(z[k - 1 : k + 2] - z[k], cost[k - 1 : k + 2] - cost[k], 2)
            at = z[k] - b / (2 * a) if a > 0 else np.inf
            if z[k - 1] < at < z[k + 1]:
                return float(at), float(cost[k] + c - b**2 / (4 * a))
        return float(z[k]), float(cost[k])

    @property
    def highest(self) -> float:
        """Rise up to which a strength isn't contradicted, with 95 %."""
        return float(chi2.ppf(0.95, len(self.mechanism.parameters)))

    @property
    def rises(self) -> FloatArray:
        """Rise of every step, (k,)."""
        return np.asarray(np.maximum(self._arrays[1] - self.vertex[1], 0.0))

    @property
    def _inside(self) -> NDArray[np.bool_]:
        """Which steps aren't contradicted; the lowest at least."""
        rises = self.rises
        return np.asarray(rises <= max(self.highest, float(rises.min())))

    def crossings(self) -> tuple[float, float]:
        """Return the outermost strengths (departures) at which the rise is `highest`, or the ends that are open."""
        z, rises = self._arrays[0], self.rises
        roots = np.sign(z - self.vertex[0]) * np.sqrt(rises)
        inside = np.flatnonzero(self._inside)

        def end(last: int, side: int) -> float:
            beyond = last + side
            if not 0 <= beyond < len(z):
                return float(z[last])
            near, far = side * roots[last], np.sqrt(rises[beyond])
            share = np.clip((np.sqrt(self.highest) - near) / (far - near), 0.0, 1.0)
            return float(z[last] + share * (z[beyond] - z[last]))

        return end(int(inside[0]), -1), end(int(inside[-1]), 1)

    def limit(self, base: LinearisedFit) -> Limit:
        """Return the limits of the strength, and the stiffness within them."""
        mechanism, first = self.mechanism, self.mechanism.parameters[0]
        prior, full = prior_of(first), mechanism.strength_name
        low, high = self.crossings()
        edge = 1e-6 * (self.ends[1] - self.ends[0])
        open_low, open_high = low <= self.ends[0] + edge, high >= self.ends[1] - edge
        null = null_of(first)
        sided = null <= first.bounds[0]
        z = self._arrays[0]
        inside = [step for step, kept in zip(self.steps, self._inside, strict=True) if kept]
        stiffness = {}
        for name in base.stiffness:
            course = np.array([step.fit.values[name] for step in self.steps])
            within = [float(np.interp(at, z, course)) for at in (low, high)]
            within += [step.fit.values[name] for step in inside]
            stiffness[name] = min(within), max(within)
        at, stronger = max((low, inside[0]), (high, inside[-1]), key=lambda one: abs(one[0]))
        predict = stronger.fit.problem.predictor
        values = {**stronger.fit.values, full: first.inside(prior.value_at(at))}
        change = predict(values, [mechanism]) - predict({**values, full: null}, [mechanism])
        change = change[predict.observed.data.spans[0]]
        return Limit(
            mechanism.name,
            first.name,
            first.unit,
            null if sided else first.inside(prior.value_at(low)),
            first.inside(prior.value_at(high)),
            open_low and not sided,
            open_high,
            float(np.abs(change).max()),
            stiffness,
            tuple(self._ends(inside, base, {-1: open_low, 1: open_high})),
        )

    def _ends(
        self, inside: Sequence[HiddenStep], base: LinearisedFit, opened: Mapping[int, bool]
    ) -> Iterator[HiddenEnd]:
        for side, is_open in opened.items():
            beyond = [step for step in inside if side * step.z > 0.0]
            if not beyond:
                continue
            furthest = max(beyond, key=lambda step: abs(step.z))
            if DEEP_C10 in base.free:
                furthest = max(beyond, key=lambda step: abs(np.log(step.fit.values[DEEP_C10] / base.values[DEEP_C10])))
            values = values_of(furthest.fit.values, self.mechanism)
            yield HiddenEnd(values, is_open, furthest.fit.values[DEEP_C10] if DEEP_C10 in base.free else float("nan"))


def profile_of(one: Explanation, base: LinearisedFit, possible: Occurrence | None = None) -> Profile:
    """Return the profile likelihood of a single mechanism's strength.

    Parameters
    ----------
    one
        Its explanation.
    base
        The base model's fit, from which steps begin.
    possible
        Which strengths are; its parameter's bounds without it.
    """
    mechanism = one.fit.mechanisms[0]
    prior, (low, high) = prior_of(mechanism.parameters[0]), mechanism.parameters[0].bounds
    if possible is not None:
        low, high = max(low, possible.low), min(high, possible.high)
    ends = prior.departure(low), prior.departure(high)
    own = one.fit_without_discrepancy or one.fit
    held = partial(_held, one.problem, mechanism)
    begun = [{**base.values, **shape} for shape in _shapes(own)]
    null = held(float(np.clip(0.0, *ends)), begun[0])
    steps = [null, *(step for end in ends for step in _side(held, end, begun, null.cost + _FAR))]
    at = prior.departure(own.values[mechanism.strength_name])
    if ends[0] < at < ends[1] and min(abs(at - step.z) for step in steps) > 1e-3:
        steps.append(held(at, own.values))
    found = Profile(mechanism, _sorted(steps), ends)
    for _ in range(_REFINED):
        found = _refined(found)
    return found


def _sorted(steps: Sequence[HiddenStep]) -> tuple[HiddenStep, ...]:
    return tuple(sorted(steps, key=lambda step: step.z))


def _shapes(fitted: LinearisedFit) -> list[Values]:
    """Return values of a mechanism's other parameters that a side begins from, the fit's first; one where it has none.

    Names are full.
    """
    (mechanism,) = fitted.mechanisms
    names = [f"{mechanism.name}.{p.name}" for p in mechanism.parameters[1:]]
    own = {name: fitted.values[name] for name in names}
    if not names:
        return [own]
    starts = map(mechanism.by_full_name, mechanism.starts(fitted.problem.predictor.observed))
    distinct = list({tuple(s[name] for name in names): {name: s[name] for name in names} for s in starts}.values())
    return [own, *(distinct[k] for k in np.unique(np.linspace(0, len(distinct) - 1, _SHAPES).astype(int)))]


def _side(held: Callable[..., HiddenStep], end: float, begun: Sequence[Values], highest: float) -> Iterator[HiddenStep]:
    """Yield steps from the null to an end, or until the recordings contradict the strength by far."""
    # The first step begins at the best of several shapes of the effect.
    for share in _SHARES if abs(end) >= 1e-9 else ():
        step = held(share * end, *begun)
        yield step
        if step.cost > highest:
            break
        begun = [step.fit.values]


def _held(problem: LinearisedProblem, mechanism: Mechanism, z: float, *starts: Values) -> HiddenStep:
    first, full = mechanism.parameters[0], mechanism.strength_name
    value = first.inside(prior_of(first).value_at(z))
    found = fit(problem, [mechanism], [{**start, full: value} for start in starts], (full,))
    readings = (((one.prior_z - z) / one.sd) ** 2 for one in problem.measured if one.name == full)
    return HiddenStep(z, found, found.cost + sum(readings))


def _refined(found: Profile) -> Profile:
    """Return the profile with steps where its least and the ends of its limits seem to lie."""
    z = np.array([step.z for step in found.steps])
    more = []
    for at in (found.vertex[0], *found.crossings()):
        apart = np.abs(z - at)
        near = found.steps[int(np.argmin(apart))]
        if apart.min() > 1e-3 and found.ends[0] < at < found.ends[1]:
            more.append(_held(near.fit.problem, found.mechanism, at, near.fit.values))
    return replace(found, steps=_sorted([*found.steps, *more]))
