"""What others would do first: the base model fitted by least squares, with the interval that the Jacobian gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.stats import t

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.data.phases import LOADING
from legfem.inverse.observations import Observations, observe
from legfem.inverse.responses import ELASTIC_DERIVATIVES
from legfem.legs.finite_element_models import solved_responses
from legfem.legs.subject import Subject
from studies.cases.outcomes import Interval
from studies.making.plane_leg import OtherCase, OtherCode

COARSER, STEP_MM = 0.6, 1.0
"""Of the other code's mesh, over its default, and its largest step: a curve then takes a sixth of the time."""
_BESIDE = 1.2
"""A stiffness that secants begin at, over the first one."""
_ONSET_MM = (-1.0, 3.0)


@dataclass(frozen=True)
class Answer:
    """What one way says of a case."""

    c10: Interval
    solves: int
    """Curves of the model."""
    named: list[str] = field(default_factory=list)
    seconds: float = float("nan")
    """Of the processor."""
    tried: list[float] = field(default_factory=list)
    """Where it learned from simulations, of others: the share whose C10 it holds, and whose causes it names."""


@dataclass(frozen=True, eq=False)
class Loading:
    """The loadings of all trials, at stations (n,)."""

    displacement: FloatArray
    """mm, from where the trial's force was seen to rise."""
    force: FloatArray
    """N."""
    trial: NDArray[np.int_]
    depth: float
    stiffnesses: int
    """How many are unknown: C10, or C20 beside it."""

    @classmethod
    def of(cls, leg: Subject, observed: Observations) -> Loading:
        """Return what was recorded of a leg."""
        there = observed.phase == LOADING
        seen = np.array([one.estimate - one.displacement for one in observed.contacts])[observed.trial]
        unknown = 1 if leg.tissues["deep"].law == "neo-hookean" else 2
        at, force, trial = (observed.displacement - seen)[there], observed.force[there], observed.trial[there]
        return cls(at, force, trial, observed.depth + 0.3, unknown)


@dataclass(frozen=True, eq=False)
class Course:
    """The model's force (N) at displacements from zero (mm), (m,), and its derivatives (p, m) by stiffnesses in kPa."""

    at: FloatArray
    force: FloatArray
    slopes: FloatArray


class OtherCurves:
    """The other code's curves, each solved once; derivatives are secants through what was solved.

    M. L. Ralston, R. I. Jennrich, Technometrics 20 (1978) 7-14.

    Parameters
    ----------
    force
        Solves a curve (m,) for stiffnesses (p,).
    at
        (m,), mm.
    """

    def __init__(self, force: Callable[[FloatArray], FloatArray], at: FloatArray) -> None:
        self._force, self._at = force, at
        self.known: list[tuple[FloatArray, FloatArray]] = []

    def __call__(self, stiffness: FloatArray) -> Course:
        """Return the curve of stiffnesses, about which as many others are solved the first time."""
        begins = not self.known
        here = self._solved(stiffness)
        for k in range(len(stiffness) if begins else 0):
            self._solved(np.where(np.arange(len(stiffness)) == k, _BESIDE * stiffness, stiffness))
        others = [(x - stiffness, f - here) for x, f in self.known if not np.array_equal(x, stiffness)]
        near = np.array([1.0 / (away @ away) for away, _ in others])[:, None]
        away, change = (np.array(one) for one in zip(*others, strict=True))
        return Course(self._at, here, np.linalg.lstsq(near * away, near * change)[0])

    def _solved(self, stiffness: FloatArray) -> FloatArray:
        self.known.append((stiffness.copy(), self._force(stiffness)))
        return self.known[-1][1]


def fitted(curve: Callable[[FloatArray], Course], loading: Loading) -> Interval:
    """Fit stiffnesses and every trial's first contact by equal weights; return C10 with its 95 % interval.

    By the Jacobian and the residual's variance, in Student's distribution.
    """
    unknown, trials = loading.stiffnesses, int(loading.trial.max()) + 1
    known: dict[bytes, Course] = {}

    def parts(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        stiffness = x[:unknown]
        if stiffness.tobytes() not in known:
            known[stiffness.tobytes()] = curve(stiffness)
        course, since = known[stiffness.tobytes()], loading.displacement - x[unknown:][loading.trial]
        inside, there = np.maximum(since, 0.0), since > 0
        spline = CubicSpline(course.at, np.vstack([course.force, course.slopes]), axis=1)
        force, *slopes = spline(inside) * there
        by_onset = -np.where(there, spline(inside, 1)[0], 0.0)
        jacobian = np.column_stack([*slopes, by_onset[:, None] * (loading.trial[:, None] == np.arange(trials))])
        return force - loading.force, jacobian

    low = np.concatenate([[1e-2, 0.0][:unknown], np.full(trials, _ONSET_MM[0])])
    high = np.concatenate([np.full(unknown, 30.0), np.full(trials, _ONSET_MM[1])])
    start = np.concatenate([np.ones(unknown), np.zeros(trials)])
    found = least_squares(
        lambda x: parts(x)[0], start, lambda x: parts(x)[1], (low, high), x_scale="jac", xtol=1e-3, ftol=1e-5
    )
    freedom = len(loading.force) - len(start)
    covariance = 2 * found.cost / freedom * np.linalg.pinv(found.jac.T @ found.jac)
    half = float(t.ppf(0.975, freedom) * np.sqrt(covariance[0, 0]))
    return Interval(float(found.x[0]), float(found.x[0] - half), float(found.x[0] + half))


def by_other_code(leg: Subject, _: Path) -> Answer:
    """Fit the base model of felupe's elements."""
    loading = Loading.of(leg, observe(leg.trials))
    at = np.linspace(0.0, loading.depth, 60)

    def force(stiffness: FloatArray) -> FloatArray:
        found = OtherCode(leg, OtherCase(float(stiffness[0]), float(sum(stiffness[1:]))), COARSER).solve(
            loading.depth, STEP_MM
        )
        return np.asarray(CubicSpline(found.displacement, found.force)(at))

    curves = OtherCurves(force, at)
    return Answer(fitted(curves, loading), len(curves.known))


def by_own_code(leg: Subject, _: Path) -> Answer:
    """Fit legfem's base model, whose derivatives are exact."""
    observed = observe(leg.trials)
    loading = Loading.of(leg, observed)
    solved = solved_responses(leg, observed, None)[0]

    def curve(stiffness: FloatArray) -> Course:
        found = solved.elastic((kpa_to_mpa(stiffness[0]), kpa_to_mpa(sum(stiffness[1:]))))
        slopes = [kpa_to_mpa(1.0) * found[name] for name in ELASTIC_DERIVATIVES[: loading.stiffnesses]]
        at, *rows = (np.concatenate([[0.0], one]) for one in (solved.grid, found["force"], *slopes))
        return Course(at, rows[0], np.array(rows[1:]))

    return Answer(fitted(curve, loading), solved.solutions)
