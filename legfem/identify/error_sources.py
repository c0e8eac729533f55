"""Where a parameter's error comes from: what has to be better for the interval to be narrower."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from legfem.common.units import FloatArray
from legfem.correction.fibres import FIBRES
from legfem.inference.least_squares import sandwich

ErrorSource = Literal["recordings", "differences", "model", "ends", "fibres", "priors"]
"""Readings; a factor by which recordings or specimens differ; the model's numerical error; the
correction for the cylinder's ends; muscle fibres' part in it; what was known beforehand."""
OF_MODEL = "in 3D: "
"""What names of modes begin with that are errors of a leg's own model in 3D."""
Covariances = Mapping[ErrorSource, FloatArray]
"""Of forces (n, n), N2, by source; they add up."""


def source_of_mode(name: str) -> ErrorSource:
    """Return the source that a mode of the correction's error counts to, by the mode's name."""
    if name.startswith(OF_MODEL):
        return "model"
    return "fibres" if name.startswith(FIBRES) else "ends"


def covariances_of_modes(modes: Mapping[str, FloatArray]) -> dict[ErrorSource, FloatArray]:
    """Return covariances (n, n), N2, of the correction's errors, each (n,), N, by its name."""
    parts: dict[ErrorSource, FloatArray] = {}
    for name, mode in modes.items():
        source = source_of_mode(name)
        parts[source] = parts.get(source, 0.0) + np.outer(mode, mode)
    return parts


def total_of(covariances: Covariances) -> FloatArray:
    """Return the sum (n, n), N2."""
    return np.asarray(sum(covariances.values()))


def shares_of_error(gain: FloatArray, covariances: Covariances) -> list[dict[ErrorSource, float]]:
    r"""Return each source's share of the variance of each parameter.

    With the gain :math:`G` by which parameters follow forces and priors, the share of a source of
    covariance :math:`\Sigma_s` in parameter k is :math:`(G \Sigma_s G^T)_{kk}` over the sum of
    these; priors have errors of one.

    Parameters
    ----------
    gain : (p, n + k) array
        Of `legfem.identify.trial.Linearised`: p parameters, n forces, k priors.
    covariances : mapping
        Of the forces, by source.
    """
    n = len(total_of(covariances))
    of_forces, of_priors = gain[:, :n], gain[:, n:]
    parts: dict[ErrorSource, FloatArray] = {
        source: np.asarray(np.diag(sandwich(of_forces, covariance))) for source, covariance in covariances.items()
    }
    if of_priors.shape[1]:
        parts["priors"] = np.asarray(np.sum(of_priors**2, axis=1))
    whole = np.sum(list(parts.values()), axis=0)
    return [
        {source: float(part[k] / whole[k]) for source, part in parts.items() if whole[k] > 0} for k in range(len(gain))
    ]


def greatest(shares: Mapping[ErrorSource, float]) -> ErrorSource:
    """Return the source of most of an error; the recordings where nothing is known of it."""
    return max(shares, key=lambda source: shares[source], default="recordings")
