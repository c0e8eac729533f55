r"""Two linear springs in a row, fitted site by site, and no model at all: what to compare with.

:math:`c = t_{fat} / E_{fat} + t_{muscle} / E_{muscle}` for the compliance c (mm/MPa).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from legfem.common.units import FloatArray
from studies.people.data import Indentations

Fit = Callable[[FloatArray, FloatArray], FloatArray]


def least_squares(layers: FloatArray, compliance: FloatArray) -> FloatArray:
    """Return the softnesses (2,) of least squared error; neither is negative."""
    return np.asarray(nnls(layers, compliance)[0])


def least_share(layers: FloatArray, compliance: FloatArray) -> FloatArray:
    """Return the softnesses (2,) of least absolute error relative to the compliance.

    By least squares, weighted anew by the error's size until that stays (E. J. Schlossmacher, J.
    Am. Stat. Assoc. 68 (1973) 857-859).
    """
    relative = layers / compliance[:, None]
    weights = np.ones(len(compliance))
    for _ in range(60):
        found = nnls(relative * weights[:, None], weights)[0]
        weights = 1 / np.sqrt(np.maximum(np.abs(relative @ found - 1), 1e-4))
    return np.asarray(found)


def left_out(rows: Indentations, compliance: FloatArray, fit: Fit) -> FloatArray:
    """Return the compliance (n,) of every person by springs fitted to the others at the site."""
    layers = np.stack([rows.superficial, rows.deep], axis=1)
    predicted = np.empty(len(rows))
    for k in range(len(rows)):
        others = (rows.site == rows.site[k]) & (rows.person != rows.person[k])
        predicted[k] = layers[k] @ fit(layers[others], compliance[others])
    return predicted


def constant_left_out(rows: Indentations, compliance: FloatArray) -> FloatArray:
    """Return the one number (n,) with the least relative error for the others at the site."""
    return np.array(
        [
            least_share_value(compliance[(rows.site == rows.site[k]) & (rows.person != rows.person[k])])
            for k in range(len(rows))
        ]
    )


def least_share_value(values: FloatArray) -> float:
    r"""Return the number of least mean :math:`|x - v| / v`: the median, weighted by 1 / v."""
    order = np.argsort(values)
    weight = np.cumsum(1 / values[order])
    return float(values[order][np.searchsorted(weight, 0.5 * weight[-1])])


def mean_error(rows: Indentations, compliance: FloatArray, predicted: FloatArray) -> NDArray[np.float64]:
    """Return the mean absolute error (sites,), relative to the person's own compliance."""
    off = np.abs(predicted / compliance - 1)
    return np.array([off[rows.site == k].mean() for k in range(len(rows.sites))])
