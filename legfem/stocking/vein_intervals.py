r"""How well the pressures at the veins are known.

To first order, in equilibrium with the stocking, the pressure at a vein errs by

.. math:: \sigma^2 = g^T \Sigma g + \sigma_p^2 \sum_s h_s^2 + (\sigma_m p)^2,

with :math:`g` its derivatives by the logarithms of the stiffnesses, :math:`\Sigma` their
covariance, :math:`h_s` those by the stocking's pressure in each sector of the girth, relative,
and :math:`\sigma_p` that pressure's error (`legfem.stocking.accuracy`). The mesh's
error :math:`\sigma_m` is a share of the pressure. All are added as independent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.stocking.leg_model import PARAMETERS
from legfem.stocking.nuisance import sectors
from legfem.stocking.pressures import PressureProbe
from legfem.stocking.veins import Vein
from legfem.stocking.worn import RATE_TOLERANCE, Feedback, Worn, WornLeg

MESH_ERROR = 0.015
"""Standard deviation of the pressure at a vein by the mesh, relative: on the default mesh it is up
to 3 % from that of 30 times as many tetrahedra (`studies/stockings/README.md`)."""


def vein_pressure_sd(
    leg: WornLeg,
    worn: Worn,
    probe: PressureProbe,
    veins: Sequence[Vein],
    parameters: Mapping[str, float],
    log_covariance: FloatArray | None,
    pressure_sd: float,
    error: float = 0.0,
) -> FloatArray:
    """Return the standard deviations of the pressures at the veins, (n_veins,), MPa.

    Parameters
    ----------
    leg
        The leg.
    worn
        Its equilibrium, which is found again with derivatives.
    probe
        Of the leg's mesh.
    veins
        Where.
    parameters
        C10 of muscle and fat by name (MPa).
    log_covariance : (2, 2) or (3, 3) array or None
        Of their logarithms, and of the error of the fabric's tension; None where they were given,
        and count as exact.
    pressure_sd
        Of the stocking's pressure in a sector of the girth, relative.
    error
        By which share the fabric's tension exceeds what was given.

    Returns
    -------
    ndarray
        NaN where the state can't be differentiated, or a vein isn't in the tissues.
    """
    if not veins:
        return np.empty(0)
    near = leg.find(parameters, PARAMETERS, worn, error)
    if not near.state.report.complete or set(near.state.sensitivities) != set(PARAMETERS):
        return np.full(len(veins), np.nan)
    points = np.array([vein.position for vein in veins])
    feedback, model = Feedback(leg, near), leg.model

    def slope(rate: FloatArray) -> FloatArray:
        # Pressures are unknowns: what is read from a derivative of them is the pressure's own.
        return probe.at(points, replace(near.state, unknown=feedback.to_rate(rate)))

    bumps = [near.pressure * bump for bump in sectors(model.shape)]
    rates = model.pressure_rates(near.state, bumps, RATE_TOLERANCE)
    by_sector = np.array([slope(rate) for rate in rates])
    variance = pressure_sd**2 * np.sum(by_sector**2, axis=0)
    variance = variance + (MESH_ERROR * probe.at(points, near.state)) ** 2
    if log_covariance is not None:
        slopes = [parameters[name] * slope(near.state.sensitivities[name]) for name in PARAMETERS]
        if len(log_covariance) > len(slopes):
            # Bumps are of the pressure with the error in it.
            slopes.append(by_sector.sum(axis=0) / (1 + error))
        by_stiffness = np.array(slopes)
        variance = variance + np.einsum("iv,ij,jv->v", by_stiffness, log_covariance, by_stiffness)
    return np.asarray(np.sqrt(variance))
