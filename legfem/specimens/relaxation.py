r"""Relaxation of a whole specimen, quasi-linear: what its past makes of the elastic force.

.. math:: F(t) = F_e(t) + \sum_k \beta_k \int_0^t e^{-(t - s) / \tau_k} \dot F_e(s)\, ds

with the elastic force :math:`F_e` of the same motion (Y. C. Fung, Biomechanics (1993), section
7.6). Exact where all of the specimen is strained alike, and at small strain under an indenter whose
contact grows (E. H. Lee, J. R. M. Radok, J. Appl. Mech. 27 (1960) 438-444). The branches are those
of `legfem.diagnose.mechanisms.viscoelasticity`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.diagnose.mechanisms.viscoelasticity import TIMES_S, Viscoelasticity, spectrum
from legfem.inference.parameter import Parameter


def relaxation_parameters() -> tuple[Parameter, ...]:
    """Return ratio, middle and spread of the spectrum by full name, within bounds alone."""
    return tuple(
        replace(one, name=f"viscoelasticity.{one.name}", prior=None, role="identified")
        for one in Viscoelasticity.parameters
    )


def memory(time: FloatArray) -> FloatArray:
    """Return the share of each step's rise that each branch bears at each time.

    Parameters
    ----------
    time
        (n,) s after first contact, increasing; the force is straight from each to the next, and
        from nothing at 0 to the first.

    Returns
    -------
    ndarray
        (branches, n, n): at a time, of the step that ends at a time.
    """
    start, end = np.concatenate([[0.0], time[:-1]]), time
    until = np.clip(time[:, None], start, end)
    tau = np.array(TIMES_S)[:, None, None]

    def faded(since: FloatArray) -> FloatArray:
        return np.exp(-np.maximum(time[:, None] - since, 0.0) / tau)

    return np.asarray(tau * (faded(until) - faded(start)) / (end - start))


def branch_ratios(numbers: FloatArray) -> FloatArray:
    """Return the ratio of every branch (..., branches) of ratio, middle and spread (..., 3)."""
    flat = numbers.reshape(-1, 3)
    ratios = [ratio * np.array(spectrum(time, spread)) for ratio, time, spread in flat.tolist()]
    return np.array(ratios).reshape(*numbers.shape[:-1], len(TIMES_S))
