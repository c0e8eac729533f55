r"""Evidence of an explanation: the probability of the data by it, its parameters integrated out.

About its fit a prediction is linear in its parameters, whose priors are normal; so are the effects of nuisance
parameters, gains and zeros. With :math:`r` the residual about the priors' centres and :math:`V` the effects of one
standard deviation of each as columns,

.. math:: \ln Z = -\tfrac12 r^T S^{-1} r - \tfrac12 \ln |2 \pi S|, \quad S = A + V V^T,

summed over what isn't normal: the sizes of gains and zeros, and the model's discrepancy, whose covariance is part of
:math:`A`. :math:`A` is factorised once for all explanations. C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for
Machine Learning (2006), section 2.7; M. A. Woodbury, Princeton Statistical Research Group 42 (1950).

The model's discrepancy is a smooth error of no known form, of several sizes and lengths. It stands for what no
mechanism describes, and beside a mechanism for what that leaves: no real effect has exactly the form of a model. It is
alike in all trials of a protocol, or each trial's own. A Gaussian process, after M. C. Kennedy, A. O'Hagan, J. R. Stat.
Soc. B 63 (2001) 425.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import log_ndtr, logsumexp
from scipy.stats import norm

from legfem.common.units import FloatArray
from legfem.data.phases import HOLD
from legfem.inverse.errors import GAIN_SDS, ErrorModel
from legfem.inverse.observations import Observations
from legfem.inverse.posterior import Posterior, moments_of, within


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """An error of the model that has no name: smooth, of some size and length.

    Parameters
    ----------
    covariance
        (N, N), in the readings' units; None for no such error.
    size
        Its standard deviation over the scale of the channels that it is in; see `discrepancy_scales`.
    log_prior
        Logarithm of its share among all of them, that of none included.
    by_channel
        Its size in each channel, the force first: nothing where it isn't.
    """

    covariance: FloatArray | None
    size: float
    log_prior: float
    by_channel: tuple[float, ...] = ()


SIZES = (0.002, 0.006, 0.02, 0.06)
"""Standard deviations over the largest force, and over the greatest displacement of a length."""
LENGTHS = (0.12, 0.4)
"""Over the greatest depth; of a hold's logarithm of time likewise."""
_LEAST = 0.15
"""Of the size at first touch, over that at the largest force."""


def discrepancy_scales(observed: Observations, prediction: FloatArray) -> tuple[float, ...]:
    """Return what sizes are over in each channel: the largest force, or the greatest displacement.

    Parameters
    ----------
    observed
        The recordings.
    prediction
        (N,): of the base model.
    """
    largest = float(np.abs(prediction[: len(observed.force)]).max())
    lengths = dict.fromkeys((one.name for one in observed.channels), observed.depth)
    for one, span in zip(observed.channels, observed.data.spans[1:], strict=True):
        if one.kind.follows_force:
            # A pressure's own size; another force is small beside that along the travel.
            lengths[one.name] = largest if one.kind.is_force else float(np.abs(prediction[span]).max())
    return largest, *lengths.values()


def possible_discrepancies(observed: Observations, prediction: FloatArray) -> list[Discrepancy]:
    """Return the errors that are possible, none first.

    What is unknown may be in all channels, in the force alone, or in all but the force; from channel to channel it is
    independent.

    Parameters
    ----------
    observed
        The recordings.
    prediction
        (N,): of the base model.
    """
    at, spans = observed.nearest, observed.data.spans
    along = np.concatenate([_along(observed), *(one.weights @ _along(observed) for one in observed.channels)])
    scales = discrepancy_scales(observed, prediction)
    force = prediction[: len(observed.force)]
    loads = np.concatenate([np.abs(force), observed.displacement[at[len(force) :]]])
    greatest = np.repeat([scales[0], observed.depth], [len(force), len(loads) - len(force)])
    envelope = _LEAST + (1 - _LEAST) * loads / greatest
    channel = np.repeat(np.arange(len(spans)), [span.stop - span.start for span in spans])
    same_channel = np.equal.outer(channel, channel)
    same_segment = np.equal.outer(observed.segment[at], observed.segment[at])
    same_programme = np.equal.outer(observed.protocol[at], observed.protocol[at])
    same_trial = np.equal.outer(observed.trial[at], observed.trial[at])
    ways = [np.ones(len(spans))]
    if observed.channels:
        in_force = np.eye(len(spans))[0]
        ways += [in_force, 1 - in_force]
    found = [Discrepancy(None, 0.0, 0.0, (0.0,) * len(spans))]
    share = -float(np.log(len(SIZES) * len(LENGTHS) * 2 * len(ways)))
    for where in ways:
        scale = (where * scales)[channel]
        for length in LENGTHS:
            apart = np.subtract.outer(along, along) / length
            shape = np.exp(-0.5 * apart**2) * same_segment * same_programme * same_channel
            for kernel in (shape, shape * same_trial):
                scaled = kernel * np.outer(envelope, envelope)
                found += [
                    Discrepancy(np.outer(size * scale, size * scale) * scaled, size, share, tuple(size * where))
                    for size in SIZES
                ]
    return found


def _along(observed: Observations) -> FloatArray:
    """Return where observations stand along their segments (n,): depth, or logarithm of time."""
    along = observed.displacement / observed.depth
    for stations, number in zip(observed.protocols, range(len(observed.protocols)), strict=True):
        held = (observed.phase == HOLD) & (observed.protocol == number)
        start = np.array(stations.protocol.time)[observed.segment[held]]
        along[held] = np.log(np.maximum(observed.time[held] - start, 1e-3)) / 6.0
    return np.asarray(along)


def with_discrepancy(errors: ErrorModel, unknown: Discrepancy) -> ErrorModel:
    """Return the errors with an error of unknown shape among them."""
    if unknown.covariance is None:
        return errors
    return replace(errors, dense=errors.dense + unknown.covariance)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """An explanation about its fit; parameters in standard deviations of what is known beforehand.

    Parameters
    ----------
    residual
        (n,), N: observed less predicted at the fit.
    jacobian
        (n, p), N: change of the prediction by one standard deviation of each parameter.
    prior_z
        (p,): of the fit from what was expected.
    low, high
        (p,): between which departures are possible.
    """

    residual: FloatArray
    jacobian: FloatArray
    prior_z: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, eq=False)
class _Factor:
    lower: FloatArray
    log_det: float
    columns: FloatArray
    """(n, k + 2 R), whitened."""


class Evidence:
    """The evidence of explanations of one set of observations.

    Parameters
    ----------
    errors
        Of the observations.
    unknowns
        Errors of unknown shape that are possible, none among them.
    """

    def __init__(self, errors: ErrorModel, unknowns: Sequence[Discrepancy]) -> None:
        self.errors, self.unknowns = errors, tuple(unknowns)
        gains, zeros = np.meshgrid(GAIN_SDS, errors.zero_sds, indexing="ij")
        self._gains, self._zeros = gains.ravel(), zeros.ravel()
        self._log_sizes = np.add.outer(_log_normal(len(GAIN_SDS)), _log_normal(len(errors.zero_sds))).ravel()

    @cached_property
    def _factors(self) -> list[_Factor]:
        shared, found = _shared(self.errors), list[_Factor]()
        for unknown in self.unknowns:
            lower = np.asarray(cholesky(with_discrepancy(self.errors, unknown).dense, lower=True))
            whitened = solve_triangular(lower, shared, lower=True)
            found.append(_Factor(lower, 2 * float(np.sum(np.log(np.diag(lower)))), whitened))
        return found

    def of(
        self, about: Linearisation, log_unknown: Sequence[float] | None = None, errors: ErrorModel | None = None
    ) -> Posterior:
        """Return the evidence of an explanation and what the data say of its parameters.

        Parameters
        ----------
        about
            The explanation about its fit.
        log_unknown
            Logarithms of the shares of the unknown errors beside this explanation; those that they
            were made with by default.
        errors
            With what nuisances, gains and zeros do beside this explanation; those of all explanations by default.
        """
        errors = errors or self.errors
        alike = errors.known is self.errors.known
        shared = _shared(errors)
        n, p = about.jacobian.shape
        k, trials = errors.known.shape[1], errors.gains.shape[1]
        centred = about.residual + about.jacobian @ about.prior_z
        shape = len(self._factors), len(self._log_sizes)
        logs, means, spreads = np.full(shape, -np.inf), np.zeros((*shape, p + k)), np.zeros((*shape, p, p))
        scales = np.repeat(np.column_stack([self._gains, self._zeros]), trials, axis=1)
        for number, (unknown, factor) in enumerate(zip(self.unknowns, self._factors, strict=True)):
            prior = unknown.log_prior if log_unknown is None else log_unknown[number]
            if prior == -np.inf:
                # Its weights are nought, whatever it says: most of the unknown errors beside a small effect.
                continue
            mine = np.column_stack([centred, about.jacobian])
            white = solve_triangular(factor.lower, mine, lower=True, check_finite=False)
            columns = factor.columns if alike else solve_triangular(factor.lower, shared, lower=True)
            fixed, sized = np.hstack([white[:, 1:], columns[:, :k]]), columns[:, k:]
            # What has one size is eliminated once, by its Schur complement; then all sizes of gains and zeros at once.
            lower = factor_of(fixed)
            given = np.column_stack([fixed.T @ white[:, 0], fixed.T @ sized, np.eye(p + k)[:, :p]])
            solved = solve_triangular(lower, solve_triangular(lower, given, lower=True), lower=True, trans="T")
            alone, taken, own = solved[:, 0], solved[:, 1 : 1 + 2 * trials], solved[:p, 1 + 2 * trials :]
            rest = sized.T @ sized - given[:, 1 : 1 + 2 * trials].T @ taken
            inner = np.eye(2 * trials) + scales[:, :, None] * rest * scales[:, None, :]
            inverse = np.linalg.inv(inner)
            along = scales * (sized.T @ white[:, 0] - taken.T @ given[:, 0])
            strength = np.einsum("sij,sj->si", inverse, along)
            log_det = factor.log_det + 2 * np.log(np.diag(lower)).sum() + np.linalg.slogdet(inner)[1]
            squares = white[:, 0] @ white[:, 0] - given[:, 0] @ alone - np.sum(along * strength, axis=1)
            logs[number] = -0.5 * (squares + log_det + n * np.log(2 * np.pi)) + prior + self._log_sizes
            means[number] = alone - (scales * strength) @ taken.T
            each_taken = taken[:p] * scales[:, None, :]
            spreads[number] = own + np.einsum("sia,sab,sjb->sij", each_taken, inverse, each_taken)
        total = float(logsumexp(logs))
        weights = np.exp(logs - total)
        every = weights.size
        mean, spread = moments_of(weights.ravel(), means[..., :p].reshape(every, p), spreads.reshape(every, p, p))
        of_unknown, of_sizes = weights.sum(axis=1), weights.sum(axis=0)
        sizes = np.array([unknown.size for unknown in self.unknowns])
        some = float(of_unknown[sizes > 0].sum())
        inside = _inside(about, mean, spread)
        return Posterior(
            total + inside,
            *within(mean, spread, about.low, about.high),
            some,
            float(of_unknown @ sizes) / some if some > 0 else 0.0,
            float(of_sizes @ self._gains),
            float(of_sizes @ self._zeros),
            np.tensordot(weights, means[..., p:], 2),
            of_unknown,
        )


def _shared(errors: ErrorModel) -> FloatArray:
    """Return what nuisances, gains and zeros do to the readings, (N, k + 2 R)."""
    return np.hstack([errors.known, errors.gains, errors.zeros])


def _log_normal(count: int) -> FloatArray:
    """Return the logarithms of the shares (k,) of steps one standard deviation apart."""
    logs = norm.logpdf(np.arange(count) - (count - 1) / 2)
    return np.asarray(logs - logsumexp(logs))


def _inside(about: Linearisation, mean: FloatArray, spread: FloatArray) -> float:
    """Return how bounds change the evidence: what lies within after, over what did before."""
    sd = np.sqrt(np.diag(spread))
    after = _log_between((about.low - mean) / sd, (about.high - mean) / sd)
    return float(np.sum(after - _log_between(about.low, about.high)))


def _log_between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the logarithm of a standard normal's share between two ends, however far out."""
    beyond = low > 0
    first, last = np.where(beyond, -high, low), np.where(beyond, -low, high)
    more = log_ndtr(last)
    return np.asarray(more + np.log1p(-np.exp(np.minimum(log_ndtr(first) - more, -1e-15))))


def factor_of(effects: FloatArray) -> FloatArray:
    """Return the Cholesky factor of 1 + V^T V (k, k) for effects V (n, k).

    Effects of a model that is wrong by far may be so large that rounding takes the sum's definiteness; the factor then
    comes from V itself.
    """
    count = effects.shape[1]
    try:
        return np.linalg.cholesky(np.eye(count) + effects.T @ effects)
    except np.linalg.LinAlgError:
        upper = np.asarray(np.linalg.qr(np.vstack([np.eye(count), effects]), mode="r"))
        return (upper * np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]).T
