"""Whether trials begin at the skin: two readings of recordings that show no air.

Most labs start at first touch, and then first contact is known to a twentieth of a millimetre; some
start above the skin by less than a recording shows. Where no trial shows air both are possible, and
the evidence is that of both together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.diagnose.fit import LinearisedFit
from legfem.diagnose.mechanisms.base import prior_of
from legfem.diagnose.observations import Observations
from legfem.diagnose.predict import detected_onset
from legfem.inverse.evidence import Evidence, Linearisation
from legfem.inverse.posterior import Posterior, mixed

STARTS_AT_CONTACT = 0.5
"""Prior probability that trials which show no air begin at first touch."""


def contact_posterior(
    evidence: Evidence, fitted: LinearisedFit, observed: Observations, shares: Sequence[float]
) -> Posterior:
    """Return what the data say of a model, whether its trials begin at the skin or not.

    Parameters
    ----------
    evidence
        Of the observations.
    fitted
        The model.
    observed
        The recordings.
    shares
        Logarithms of the shares of unknown errors beside it.
    """
    touching = evidence.of(fitted.linearised, shares)
    if observed.starts_at_contact or observed.shows_air:
        return touching
    scale, shift = _to_detected(fitted, observed)
    free = evidence.of(_rescaled(fitted.linearised, scale, shift), shares)
    logs = np.array([free.log_evidence, touching.log_evidence])
    logs += np.log([1 - STARTS_AT_CONTACT, STARTS_AT_CONTACT])
    total = float(np.logaddexp(*logs))
    weights = np.exp(logs - total)
    back = replace(free, mean=scale * free.mean + shift, covariance=np.outer(scale, scale) * free.covariance)
    return mixed(total, weights, (back, touching))


def _to_detected(fitted: LinearisedFit, observed: Observations) -> tuple[FloatArray, FloatArray]:
    """Return what takes departures from detected contacts to those from first touch at zero."""
    scale, shift = np.ones(len(fitted.parameters)), np.zeros(len(fitted.parameters))
    onsets = [k for k, p in enumerate(fitted.parameters) if p.role == "nuisance"]
    for trial, k in enumerate(onsets):
        found, here = detected_onset(observed, trial), prior_of(fitted.parameters[k])
        scale[k] = found.sd / here.sd
        shift[k] = (found.centre - here.centre) / here.sd
    return scale, shift


def _rescaled(about: Linearisation, scale: FloatArray, shift: FloatArray) -> Linearisation:
    return Linearisation(
        about.residual,
        about.jacobian * scale,
        (about.departure - shift) / scale,
        (about.low - shift) / scale,
        (about.high - shift) / scale,
    )
