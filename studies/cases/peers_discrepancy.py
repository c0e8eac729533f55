"""Kennedy and O'Hagan's way: base model, a Gaussian process for what it misses, and C10 integrated over both.

M. C. Kennedy, A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425-464.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.inverse.emulator import Emulator
from legfem.inverse.library import coordinates
from legfem.inverse.library_tasks import STIFFENING, middle_of, stiffness_at
from legfem.inverse.observations import observe
from legfem.inverse.responses import ELASTIC_DERIVATIVES
from legfem.legs.finite_element_models import solved_responses
from legfem.legs.subject import Subject
from studies.cases.outcomes import Interval
from studies.cases.peers_fitted import Answer, Loading

SIZES, LENGTHS_MM = tuple(np.geomspace(0.002, 0.3, 9)), (2.0, 4.0, 8.0, 16.0)
"""Of the process, as shares of the greatest force, and over which it changes: all equally probable beforehand."""
NOISES = tuple(np.geomspace(5e-4, 0.05, 7))
"""White, as shares of the greatest force."""
ONSET_SD_MM = 0.5
"""Of every trial's first contact, about where its force was seen to rise."""


def calibrated(c10: FloatArray, curves: FloatArray, slope: FloatArray, loading: Loading) -> Interval:
    """Return C10's median and 95 % interval, integrated over the discrepancy's size, its length and the noise.

    Parameters
    ----------
    c10
        (k,), kPa, of curves that are equally probable beforehand.
    curves
        (k, n): the base model's forces at the readings.
    slope
        (n,), N/mm: by which a first contact that is off moves them.
    loading
        What was recorded.
    """
    largest, rest = float(loading.force.max()), (loading.force - curves).T
    same = np.equal.outer(loading.trial, loading.trial)
    onset = ONSET_SD_MM**2 * np.outer(slope, slope) * same
    apart = np.subtract.outer(loading.displacement, loading.displacement)
    logs = []
    for size, length, noise in product(SIZES, LENGTHS_MM, NOISES):
        process = (size * largest) ** 2 * np.exp(-0.5 * (apart / length) ** 2)
        factor = cho_factor(process + onset + (noise * largest) ** 2 * np.eye(len(apart)), lower=True)
        squares = np.einsum("nk,nk->k", rest, cho_solve(factor, rest))
        logs.append(-0.5 * squares - np.log(np.diag(factor[0])).sum())
    weights = np.exp(np.array(logs) - np.max(logs)).sum(axis=0)
    order = np.argsort(c10)
    share = np.cumsum(weights[order]) - 0.5 * weights[order]
    low, middle, high = np.interp([0.025, 0.5, 0.975], share / weights.sum(), c10[order])
    return Interval(float(middle), float(low), float(high))


def by_discrepancy(leg: Subject, _: Path) -> Answer:
    """Calibrate legfem's base curve, emulated between solves over C10 and C20 by their values and derivatives."""
    observed = observe(leg.trials)
    loading, solved = Loading.of(leg, observed), solved_responses(leg, observed, None)[0]
    stiffening = STIFFENING[leg.tissues["deep"].law]
    middle = middle_of(observed, solved, stiffening)
    apart = product((-0.4, 0.4), (0.3, 1.3) if stiffening else (0.0,))
    points = [stiffness_at(middle * float(np.exp(log)), q) for log, q in apart]
    force, by_c10, by_c20 = (
        np.array([solved.elastic(point)[name] for point in points]) for name in ("force", *ELASTIC_DERIVATIVES)
    )
    at = np.array(points).T[:, :, None]
    slopes = np.stack([at[0] * by_c10 + at[1] * by_c20, at.sum(axis=0) * by_c20], axis=1)
    emulated = Emulator(coordinates(*at[:, :, 0]), force, slopes)
    places = np.meshgrid(np.linspace(-1.2, 1.2, 121), np.linspace(0.0, 2.0, 31) if stiffening else [0.0])
    every = np.column_stack([np.log(middle) + places[0].ravel(), places[1].ravel()])
    spline = CubicSpline(np.concatenate([[0.0], solved.grid]), np.pad(emulated(every), [(0, 0), (1, 0)]), axis=1)
    since = np.maximum(loading.displacement, 0.0)
    curves = spline(since)
    best = int(np.argmin(((loading.force - curves) ** 2).sum(axis=1)))
    found = calibrated(mpa_to_kpa(np.exp(every[:, 0])), curves, spline(since, 1)[best], loading)
    return Answer(found, solved.solutions)
