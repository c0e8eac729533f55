"""Points that a search solves beside its proposals: where it begins, and where intervals end far from all solves."""

from collections.abc import Sequence

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C20, IdentifiedLaw, usual_range
from legfem.inverse.parameter import Domain
from legfem.inverse.readings import READINGS
from legfem.inverse.trial import Coordinates, Linearised, Trial

# In shares of the usual ranges.
_LINE = np.array([[0.5]])
_SQUARE = np.array([[0.5, 0.15]])
# How far from all solves, in the coordinates, the emulator may draw an interval's end; beyond it is
# solved there too, up to the greatest distance from the optimum.
_FAR, _FARTHEST = 0.2, 1.2
_HALF_INTERVAL = 2.0


def design(law: IdentifiedLaw, seed: int) -> FloatArray:
    """Return the points (n, p) to solve first.

    One place for one and two parameters of the model, from where exact derivatives lead on; a Latin
    hypercube of 2 q + 1 for q of them above; the instrument's numbers stand at their nulls. The law's own starts, where
    it has any.
    """
    if law.starts:
        return np.array([law.point(values) for values in law.starts])
    nulls = [p.inside(READINGS[p.name].null) if p.name in READINGS else 0.0 for p in law.parameters]
    points = np.array([nulls])
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
        parameter, share = law.parameters[k], shares[:, column]
        low, high = law.usual.get(parameter.name) or usual_range(parameter, law.nominal)
        if parameter.scale == "log" and low > 0:
            points[:, k] = np.exp(np.log(low) + share * (np.log(high) - np.log(low)))
        else:
            points[:, k] = low + share * (high - low)
    return points


def half_way(coordinates: Coordinates, points: FloatArray, known: FloatArray) -> FloatArray:
    """Return points (n, p) half-way, in the coordinates, to the nearest of known ones (m, p)."""
    at, solved = coordinates.of(points), coordinates.of(known)
    nearest = np.argmin(np.linalg.norm(at[:, None] - solved[None], axis=-1), axis=1)
    middle = 0.5 * (at + solved[nearest])
    return Domain(coordinates.law.parameters).inside(coordinates.points(middle, known[nearest]))


def stiffer(law: IdentifiedLaw, points: FloatArray) -> FloatArray | None:
    """Return a tissue (p,) stiffer than all points (n, p): it deforms less; none at the bound."""
    first = next((k for k, name in enumerate(law.names) if name.endswith(".C10")), None)
    if first is None:
        return None
    stiffest, limit = int(np.argmax(points[:, first])), law.parameters[first].bounds[1]
    point = points[stiffest].copy()
    if point[first] >= limit:
        return None
    point[first] = min(2 * point[first], limit)
    if (stiffening := law.index(DEEP_C20)) is not None:
        point[stiffening] = law.parameters[stiffening].bounds[0]
    return np.asarray(point)


def far_ends(best: Linearised, trials: Sequence[Trial]) -> FloatArray:
    """Return the intervals' ends (n, p) that are far from all solves of up to three parameters.

    Intervals and maps of the cost are drawn by the emulator, and none of them is drawn far from
    what was solved.

    Parameters
    ----------
    best : Linearised
        The best full solve.
    trials : sequence of Trial
        All of them.
    """
    law = best.law
    coordinates, model = Coordinates(law), np.array(law.of_model, dtype=int)
    if not 0 < len(model) <= 3:
        return np.zeros((0, len(law.parameters)))
    by_point = np.linalg.inv(coordinates.derivatives(best.point[None])[0])
    errors = best.errors(best.misfit.covariance_at(law.values(best.point)))
    spread = by_point @ errors[np.ix_(model, model)] @ by_point.T
    ways = _HALF_INTERVAL * spread / np.sqrt(np.maximum(np.diag(spread), 1e-300))
    lengths = np.linalg.norm(ways, axis=0)
    ways = (ways * np.minimum(1.0, _FARTHEST / np.maximum(lengths, 1e-300))).T
    at = coordinates.of(best.point) + np.concatenate([ways, -ways])
    tiled = np.tile(best.point, (len(at), 1))
    ends = Domain(law.parameters).inside(coordinates.points(at, tiled))
    solved = [coordinates.of(trial.point) for trial in trials]
    far: list[FloatArray] = []
    for end in ends:
        place = coordinates.of(end)
        if min(np.linalg.norm(place - other) for other in solved) > _FAR:
            solved.append(place)
            far.append(end)
    return np.array(far).reshape(-1, len(best.point))
