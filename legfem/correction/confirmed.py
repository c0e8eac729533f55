r"""P(d) of one leg, from full solves of that leg in 3D at its own stiffness.

.. math:: P(d; m) = P_1(d; m_1) + P_0(d; m) - P_0(d; m_1)

with :math:`P_1` solved in full at the stiffness :math:`m_1`, and the trend of a table :math:`P_0`
of idealised legs between there and :math:`m`; without a table P is the same at any stiffness. The
trend is small where :math:`m_1` is near what is identified, and each further solve measures what is
wrong with it. Its error replaces that of the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.correction.tabulated import TabulatedCorrection


def confirmed_correction(
    name: str,
    trend: TabulatedCorrection | None,
    stiffness: tuple[float, float],
    displacement: FloatArray,
    P: FloatArray,
    errors: Mapping[str, FloatArray],
) -> TabulatedCorrection:
    """Return the correction of a leg that was solved in 3D.

    Parameters
    ----------
    name
        What reports call it.
    trend
        How P changes with the stiffness; not at all without one.
    stiffness
        C10 and C20 of the deep tissue (kPa) that it was solved with.
    displacement, P
        (n,), mm and what was found there.
    errors
        Modes of P's error, (n,) each, by what causes them.
    """
    c10, c20 = stiffness
    if trend is None:
        return TabulatedCorrection(
            name, displacement, np.array([c10]), np.array([c20 / (c10 + c20)]), P[None, None, :], errors
        )
    across, q = trend.c10[:, None], trend.stiffening[None, :]
    table = trend.correction(displacement, across + 0 * q, across * q / (1 - q))
    there = trend.correction(displacement, np.asarray(c10), np.asarray(c20))
    return replace(trend, name=name, displacement=displacement, values=P + table - there, errors=errors, given={})
