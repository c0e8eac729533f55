"""Compliance of people left out, from thicknesses and the others' stiffness, beside springs in a row and no model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.optimize import nnls

from legfem.common.units import FloatArray
from studies.people.data import Indentations
from studies.people.population import Drawn, State, draw_population
from studies.people.probe import Losses

Fit = Callable[[FloatArray, FloatArray], FloatArray]


def least_squares(layers: FloatArray, compliance: FloatArray) -> FloatArray:
    """Return the softnesses (2,) of least squared error; neither is negative."""
    return np.asarray(nnls(layers, compliance)[0])


def least_share(layers: FloatArray, compliance: FloatArray) -> FloatArray:
    """Return the softnesses (2,) of least absolute error relative to the compliance.

    By least squares, weighted anew by the error's size until that stays (E. J. Schlossmacher, J.
    Am. Stat. Assoc. 68 (1973) 857-859).
    """
    relative = layers / compliance[:, None]
    weights = np.ones(len(compliance))
    for _ in range(60):
        found = nnls(relative * weights[:, None], weights)[0]
        weights = 1 / np.sqrt(np.maximum(np.abs(relative @ found - 1), 1e-4))
    return np.asarray(found)


def left_out(rows: Indentations, compliance: FloatArray, fit: Fit) -> FloatArray:
    """Return the compliance (n,) of every person by springs fitted to the others at the site."""
    return _left_out(rows, compliance, np.stack([rows.superficial, rows.deep], axis=1), fit)


def constant_left_out(rows: Indentations, compliance: FloatArray) -> FloatArray:
    """Return the one number (n,) with the least relative error for the others at the site."""
    return _left_out(rows, compliance, np.ones((len(rows), 1)), lambda _, others: np.array([least_share_value(others)]))


def _left_out(rows: Indentations, compliance: FloatArray, layers: FloatArray, fit: Fit) -> FloatArray:
    predicted = np.empty(len(rows))
    for k in range(len(rows)):
        others = (rows.site == rows.site[k]) & (rows.person != rows.person[k])
        predicted[k] = layers[k] @ fit(layers[others], compliance[others])
    return predicted


def least_share_value(values: FloatArray) -> float:
    r"""Return the number of least mean :math:`|x - v| / v`: the median, weighted by 1 / v."""
    order = np.argsort(values)
    weight = np.cumsum(1 / values[order])
    return float(values[order][np.searchsorted(weight, 0.5 * weight[-1])])


def mean_error(rows: Indentations, compliance: FloatArray, predicted: FloatArray) -> NDArray[np.float64]:
    """Return the mean absolute error (sites,), relative to the person's own compliance."""
    off = np.abs(predicted / compliance - 1)
    return np.array([off[rows.site == k].mean() for k in range(len(rows.sites))])


WARM_UP, KEPT, PER_DRAW = 40, 80, 12
"""Sweeps of a chain without some people, from where all people's ended; of a person by sweep."""
GROUP = 4
"""People who are left out together: a chain each would take four times as long."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """Compliances predicted for everyone, without the person's own rows; mm/MPa, (n,)."""

    best: FloatArray
    """Of least expected relative error."""
    low: FloatArray
    """Of the 90 % interval."""
    high: FloatArray
    """Of the 90 % interval."""
    expected_error: FloatArray
    """Mean relative error that the population's own spread leads one to expect."""
    without_site: FloatArray
    """The best of the population over all sites, of which none was told."""


def predict_left_out(
    losses: Losses,
    compliance: FloatArray,
    start: State,
    seed: int,
    done: Callable[[str], None] = lambda _: None,
    with_thickness: bool = True,
) -> Predicted:
    """Predict every person's compliance (n,), as it is measured, from the other people.

    How hard a person was pressed isn't used, since it tells of the stiffness: the median force of
    the others at the site is. The compliance along the whole press differs from that at its end
    by a ratio that is the others' too. The best guess is the compliance of the middle stiffness,
    times what makes that of the others at the site least wrong. ``with_thickness`` is that of
    `draw_population`, as it was for ``start``.
    """
    rows = losses.rows
    found = Predicted(*(np.full(len(rows), np.nan) for _ in range(5)))
    for first in range(0, len(rows.people), GROUP):
        rng = np.random.default_rng([seed, first])
        others = (rows.person < first) | (rows.person >= first + GROUP)
        own = np.flatnonzero(~others)
        drawn = draw_population(losses.where(others), KEPT, WARM_UP, rng, start, with_thickness=with_thickness)
        left = rows.where(others)
        ratio = float(np.median(compliance[others] / left.secant_compliance))
        force = np.array([np.median(left.force[left.site == rows.site[k]]) for k in own])
        asked = losses.where(~others)
        known = _compliances(asked, force, _people_of(drawn, asked.rows, rng)) * ratio
        whole = _compliances(asked, force, _anyone_of(drawn, len(own), rng)) * ratio
        middle = _of_the_middle(losses, drawn, left)
        for place, k in enumerate(own):
            alike = others & (rows.site == rows.site[k])
            found.best[k] = middle[k] * least_share_value(compliance[alike] / middle[alike])
            found.low[k], found.high[k] = np.quantile(known[:, place], (0.05, 0.95))
            found.expected_error[k] = np.mean(np.abs(found.best[k] / known[:, place] - 1))
            found.without_site[k] = least_share_value(whole[:, place])
        done(rows.people[first])
    return found


def _compliances(asked: Losses, force: FloatArray, log_C10: FloatArray) -> FloatArray:
    """Return the compliance (draws, n), mm/MPa."""
    _, total = asked(log_C10, force)
    return total * asked.rows.area / force


def _of_the_middle(losses: Losses, drawn: Drawn, left: Indentations) -> FloatArray:
    """Return the compliance (n,), mm/MPa, of everyone with the middle stiffness of the site."""
    rows = losses.rows
    force = np.array([np.median(left.force[left.site == k]) for k in range(len(rows.sites))])
    centre = np.array([state.centre(rows) for state in drawn.states])
    each = _compliances(losses, force[rows.site], centre)
    return np.asarray(np.exp(np.log(each).mean(axis=0)))


def _people_of(drawn: Drawn, rows: Indentations, rng: Generator) -> FloatArray:
    """Return stiffnesses (draws, n, 2) of new people at the rows' sites."""
    centre = np.array([state.centre(rows) for state in drawn.states])
    spread = drawn["spread"]
    return _scattered(np.repeat(centre, PER_DRAW, 0), np.repeat(spread, PER_DRAW, 0), rng)


def _anyone_of(drawn: Drawn, count: int, rng: Generator) -> FloatArray:
    """Return stiffnesses (draws, n, 2) of new people at new sites."""
    centre = np.repeat(drawn["mean"][:, None, :], count, axis=1)
    spread = drawn["spread"] + drawn["between_sites"]
    return _scattered(np.repeat(centre, PER_DRAW, 0), np.repeat(spread, PER_DRAW, 0), rng)


def _scattered(centre: FloatArray, covariance: FloatArray, rng: Generator) -> FloatArray:
    root = np.linalg.cholesky(covariance)
    return centre + np.einsum("kij,knj->kni", root, rng.standard_normal(centre.shape))
