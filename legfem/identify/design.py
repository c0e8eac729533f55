"""What is solved first."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray
from legfem.identify.catalogue import usual_range
from legfem.identify.coordinates import Coordinates
from legfem.identify.laws import IdentifiedLaw
from legfem.identify.reading import READINGS
from legfem.inference.domain import Domain
from legfem.inference.parameter import Parameter

# In shares of the usual ranges.
_LINE = np.array([[0.5]])
_SQUARE = np.array([[0.5, 0.15]])


def design(law: IdentifiedLaw, seed: int) -> FloatArray:
    """Return the points (n, p) to solve first.

    One place for one and two parameters of the model, from where exact derivatives lead on; a Latin
    hypercube of 2 q + 1 for q of them above; the instrument's numbers stand at their nulls.
    """
    points = np.tile([_null(one) for one in law.parameters], (1, 1))
    q = len(law.of_model)
    if q == 0:
        return points
    if q == 1:
        shares = _LINE
    elif q == 2:
        shares = _SQUARE
    else:
        from scipy.stats import qmc

        sampler = qmc.LatinHypercube(q, rng=np.random.default_rng(seed), optimization="random-cd")
        shares = sampler.random(2 * q + 1)
    points = np.repeat(points, len(shares), axis=0)
    for column, k in enumerate(law.of_model):
        points[:, k] = _within(law, k, shares[:, column])
    return points


def half_way(coordinates: Coordinates, points: FloatArray, known: FloatArray) -> FloatArray:
    """Return points (n, p) half-way, in the coordinates, to the nearest of known ones (m, p)."""
    at, solved = coordinates.of(points), coordinates.of(known)
    nearest = np.argmin(np.linalg.norm(at[:, None] - solved[None], axis=-1), axis=1)
    middle = 0.5 * (at + solved[nearest])
    domain = Domain(coordinates.law.parameters)
    return domain.inside(coordinates.points(middle, known[nearest]))


def _within(law: IdentifiedLaw, k: int, share: FloatArray) -> FloatArray:
    parameter = law.parameters[k]
    low, high = law.usual.get(parameter.name) or usual_range(parameter, law.nominal)
    if parameter.scale == "log" and low > 0:
        return np.asarray(np.exp(np.log(low) + share * (np.log(high) - np.log(low))))
    return low + share * (high - low)


def _null(parameter: Parameter) -> float:
    known = READINGS.get(parameter.name)
    return 0.0 if known is None else parameter.inside(known.null)
