"""Kinematics of finite strain in UFL: the deformation gradient is 3x3 in every dimension.

Plane strain keeps the out-of-plane stretch (equal to one), so that the isochoric split divides by
:math:`J^{2/3}` and not by the two-dimensional :math:`J`.
"""

from __future__ import annotations

from typing import Any

import ufl

Expr = Any


def deformation_gradient(u: Expr) -> Expr:
    r"""Return :math:`F = I + \partial u / \partial X` as a 3x3 tensor.

    Parameters
    ----------
    u
        Displacement (mm), a vector of 2 components (plane strain) or 3.

    Returns
    -------
    ufl.core.expr.Expr
        Shape (3, 3), dimensionless.
    """
    gradient = ufl.grad(u)
    if gradient.ufl_shape == (3, 3):
        return ufl.Identity(3) + gradient
    return ufl.as_tensor(
        [
            [1 + gradient[0, 0], gradient[0, 1], 0],
            [gradient[1, 0], 1 + gradient[1, 1], 0],
            [0, 0, 1],
        ]
    )


def volume_ratio(F: Expr) -> Expr:
    """Return J = det F."""
    return ufl.det(F)


def isochoric_first_invariant(F: Expr) -> Expr:
    r"""Return :math:`\bar I_1 = J^{-2/3}\,\mathrm{tr}(F^T F)` with the 3x3 tensor."""
    return ufl.det(F) ** (-2 / 3) * ufl.inner(F, F)
