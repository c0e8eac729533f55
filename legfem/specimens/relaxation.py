r"""Relaxation of a whole specimen, quasi-linear: what its past makes of the elastic force.

.. math:: F(t) = F_e(t) + \sum_k \beta_k \int_0^t e^{-(t - s) / \tau_k} \dot F_e(s)\, ds

with the elastic force :math:`F_e` of the same motion (Y. C. Fung, Biomechanics (1993), section
7.6). Exact where all of the specimen is strained alike, and at small strain under an indenter whose
contact grows (E. H. Lee, J. R. M. Radok, J. Appl. Mech. 27 (1960) 438-444). The branches are those
of `legfem.legs.mechanisms.viscoelasticity`.

Tissue may relax the faster the more it is strained, which two rates of loading show (a slower one
would take up that no spectrum is quite log-normal). Its clock then
runs ahead of time, by

.. math:: \xi(t) = \int_0^t e^{q\, d(s) / D}\, ds,

with the displacement :math:`d`, the test's greatest one :math:`D`, and the quickening :math:`q`
(strain clock: S. R. Shay, J. M. Caruthers, J. Rheol. 30 (1986) 781-827): :math:`\xi` stands for
:math:`t` and :math:`s` above.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_banded

from legfem.common.units import FloatArray
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.mechanisms.viscoelasticity import SPECTRUM, TIMES_S, spectrum

QUICKENING = "viscoelasticity.quickening"
_MOST = 3.0
# Mean speeds of loading that count as two rates.
_ANOTHER_RATE = 2.0


def relaxation_parameters() -> tuple[Parameter, ...]:
    """Return ratio, middle and spread of the spectrum within bounds alone, and the quickening."""
    spectral = tuple(
        replace(one, name=f"viscoelasticity.{one.name}", prior=None, role="identified") for one in SPECTRUM
    )
    quickening = Parameter(
        QUICKENING,
        "-",
        (0.0, _MOST),
        Prior(0.0, 1.0, "linear", "quasi-linear, unless two rates say otherwise"),
        statement="logarithm of how much faster what is pressed deepest relaxes",
    )
    return (*spectral, quickening)


def shows_quickening(rates: Sequence[float]) -> bool:
    """Tell whether mean speeds of loading (mm/s) differ enough."""
    return max(rates) > _ANOTHER_RATE * min(rates)


def clock(time: FloatArray, share: FloatArray, quickening: FloatArray) -> FloatArray:
    """Return the tissue's own time (..., n), s.

    Parameters
    ----------
    time
        (n,) s after first contact.
    share
        (n,) displacement over the greatest one; straight between times, and from 0 at 0.
    quickening
        (...) logarithm of the clock's speed where the share is 1.
    """
    after = quickening[..., None] * share
    before = quickening[..., None] * np.concatenate([[0.0], share[:-1]])
    # Simpson's mean of the speed over a straight way.
    speed = (np.exp(before) + 4 * np.exp(0.5 * (before + after)) + np.exp(after)) / 6
    return np.cumsum(speed * np.diff(time, prepend=0.0), axis=-1)


def borne(time: FloatArray, force: FloatArray) -> FloatArray:
    """Return what each branch bears (..., branches, n) over its ratio, N.

    Parameters
    ----------
    time
        (..., n) s after first contact on the tissue's own clock, increasing.
    force
        (..., n) elastic force, N; straight from each time to the next, and from nothing at 0.
    """
    tau = np.array(TIMES_S)[:, None]
    step = np.diff(time, axis=-1, prepend=0.0)[..., None, :] / tau
    fading = np.exp(-step)
    rise = -np.expm1(-step) / step * np.diff(force, axis=-1, prepend=0.0)[..., None, :]
    # held_k = fading_k held_(k-1) + rise_k, of all branches in one banded system.
    fading = np.broadcast_to(fading, rise.shape).copy()
    fading[..., 0] = 0.0
    bands = np.stack([np.ones(rise.size), np.append(-fading.ravel()[1:], 0.0)])
    return np.asarray(solve_banded((1, 0), bands, rise.ravel())).reshape(rise.shape)


def branch_ratios(numbers: FloatArray) -> FloatArray:
    """Return the ratio of every branch (..., branches) of ratio, middle and spread (..., 3)."""
    flat = numbers.reshape(-1, 3)
    ratios = [ratio * np.array(spectrum(time, spread)) for ratio, time, spread in flat.tolist()]
    return np.array(ratios).reshape(*numbers.shape[:-1], len(TIMES_S))
