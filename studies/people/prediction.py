"""The compliance of a person left out, from thicknesses and the others' stiffness alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from legfem.common.units import FloatArray
from studies.people.data import Indentations
from studies.people.losses import Losses
from studies.people.population import Drawn, State, draw_population
from studies.people.springs import least_share_value

WARM_UP, KEPT, PER_DRAW = 40, 80, 12
"""Sweeps of a chain without one person, from where all people's ended; draws of that person."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """Compliances predicted for everyone, each without the person's own rows; mm/MPa, (n,)."""

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
) -> Predicted:
    """Predict every person's compliance (n,), as it is measured, from the other people.

    How hard a person was pressed isn't used, since it tells of the stiffness: the median force of
    the others at the site is. The compliance along the whole press differs from that at its end
    by a ratio that is the others' too.
    """
    rows = losses.rows
    found = Predicted(*(np.full(len(rows), np.nan) for _ in range(5)))
    for person in range(len(rows.people)):
        rng = np.random.default_rng([seed, person])
        own = np.flatnonzero(rows.person == person)
        others = rows.person != person
        drawn = draw_population(losses.where(others), KEPT, WARM_UP, rng, start)
        left = rows.where(others)
        ratio = float(np.median(compliance[others] / left.secant_compliance))
        force = np.array([np.median(left.force[left.site == rows.site[k]]) for k in own])
        asked = losses.where(~others)
        known = _compliances(asked, force, _people_of(drawn, asked.rows, rng)) * ratio
        whole = _compliances(asked, force, _anyone_of(drawn, len(own), rng)) * ratio
        for place, k in enumerate(own):
            found.best[k] = least_share_value(known[:, place])
            found.low[k], found.high[k] = np.quantile(known[:, place], (0.05, 0.95))
            found.expected_error[k] = np.mean(np.abs(found.best[k] / known[:, place] - 1))
            found.without_site[k] = least_share_value(whole[:, place])
        done(rows.people[person])
    return found


def _compliances(asked: Losses, force: FloatArray, log_C10: FloatArray) -> FloatArray:
    """Return the compliance (draws, n), mm/MPa."""
    _, total = asked(log_C10, force)
    return total * asked.rows.area / force


def _people_of(drawn: Drawn, rows: Indentations, rng: Generator) -> FloatArray:
    """Return stiffnesses (draws, n, 2) of new people at the rows' sites."""
    centre, spread = drawn["site"][:, rows.site], drawn["spread"]
    return _scattered(np.repeat(centre, PER_DRAW, 0), np.repeat(spread, PER_DRAW, 0), rng)


def _anyone_of(drawn: Drawn, count: int, rng: Generator) -> FloatArray:
    """Return stiffnesses (draws, n, 2) of new people at new sites."""
    centre = np.repeat(drawn["mean"][:, None, :], count, axis=1)
    spread = drawn["spread"] + drawn["between_sites"]
    return _scattered(np.repeat(centre, PER_DRAW, 0), np.repeat(spread, PER_DRAW, 0), rng)


def _scattered(centre: FloatArray, covariance: FloatArray, rng: Generator) -> FloatArray:
    root = np.linalg.cholesky(covariance)
    return centre + np.einsum("kij,knj->kni", root, rng.standard_normal(centre.shape))
