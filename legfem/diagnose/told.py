r"""What the recordings, and what else was measured, say of a model.

A reading :math:`m` of a mechanism's strength with standard deviation :math:`\sigma` multiplies the
evidence of every explanation by

.. math:: N(m;\ \mu,\ \sigma^2 + s^2)

with the strength's mean :math:`\mu` and standard deviation s by the recordings, which are its null
and nought where the explanation hasn't that mechanism, and moves an explanation's parameters as an
observation of one of them does (R. E. Kalman, J. Basic Eng. 82 (1960) 35).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from legfem.diagnose.fit import Fit, Problem
from legfem.diagnose.mechanisms.base import MeasuredStrength, prior_of
from legfem.diagnose.touch import posterior_of
from legfem.inverse.evidence import Evidence
from legfem.inverse.posterior import Posterior


def told_of(problem: Problem, evidence: Evidence, fitted: Fit, shares: Sequence[float]) -> Posterior:
    """Return what the recordings and all readings of strengths say of a model.

    Parameters
    ----------
    problem
        The observations, and what else was measured.
    evidence
        Of the observations.
    fitted
        The model.
    shares
        Logarithms of the shares of unknown errors beside it.
    """
    posterior = posterior_of(evidence, fitted, problem.predictor.observed, shares)
    for reading in problem.measured:
        posterior = _told(reading, fitted, posterior)
    return posterior


def _told(reading: MeasuredStrength, fitted: Fit, posterior: Posterior) -> Posterior:
    if reading.name not in fitted.free:
        strength = reading.mechanism.parameters[0]
        held = reading.mechanism.name in fitted.names
        at = prior_of(strength).departure(fitted.values[reading.name]) if held else 0.0
        return _likelier(posterior, float(norm.logpdf(reading.departure, at, reading.sd)))
    k = fitted.free.index(reading.name)
    along = posterior.covariance[:, k]
    variance = float(along[k]) + reading.sd**2
    away = reading.departure - float(posterior.mean[k])
    moved = replace(
        posterior,
        mean=posterior.mean + along * away / variance,
        covariance=posterior.covariance - np.outer(along, along) / variance,
    )
    return _likelier(moved, float(norm.logpdf(away, 0.0, np.sqrt(variance))))


def _likelier(posterior: Posterior, log_likelihood: float) -> Posterior:
    return replace(posterior, log_evidence=posterior.log_evidence + log_likelihood)
