r"""Whether the form of what is named is met: how much of it is there in each part of the recordings.

An explanation may fit better than all others and still be a name for something else: a frame that meets the leg at some
depth is, over all, much like a support that gives way. What is named acts everywhere by its own law; so with
:math:`e` what a mechanism adds to the prediction at the fit, and :math:`e_p` that in part :math:`p` of the readings and
nothing elsewhere, the residual :math:`r` of the fit is

.. math:: r = J \delta + \sum_p b_p e_p + \epsilon

with the derivatives :math:`J` by all that is fitted but the strength, their departures :math:`\delta` with their
priors, and errors :math:`\epsilon` of the observations' whole covariance. The share of the mechanism that is there in a
part is :math:`1 + b_p`; by generalised least squares it has a standard deviation, which is large where the part tells
nothing. It is missing from a part that surely has less of it than the others by more than forms are inexact. Parts are
trials, phases, thirds of the depth, and channels, each by themselves.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, takewhile

import numpy as np
from numpy.typing import NDArray

from legfem.channels.kinds import FILE_OF
from legfem.common.units import FloatArray
from legfem.inverse.intervals import THIRDS, third_of
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.mechanism import Mechanism, null_of

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
    """Return by mechanism how much of it is there in each part of the readings.

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
    missing = short @ shares + _SURELY * np.sqrt(short @ covariance @ short) < 0.0
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
