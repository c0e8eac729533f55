r"""Kinematics of finite strain in UFL: the deformation gradient is 3x3 in every dimension.

Plane strain keeps the out-of-plane stretch (equal to one), so that the isochoric split divides by
:math:`J^{2/3}` and not by the two-dimensional :math:`J`. Axial symmetry has coordinates
:math:`(r, z, \theta)` and the hoop stretch :math:`1 + u_r / r`.
"""

from __future__ import annotations

from typing import Any

import ufl

Expr = Any


def deformation_gradient(u: Expr, radius: Expr | None = None) -> Expr:
    r"""Return :math:`F = I + \partial u / \partial X` as a 3x3 tensor.

    Parameters
    ----------
    u
        Displacement (mm), a vector of 2 components (plane strain, axial symmetry) or 3.
    radius
        Reference distance from the axis of symmetry (mm), if there is one; the displacement's
        components are then radial and axial.

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
            [0, 0, 1 if radius is None else 1 + u[0] / radius],
        ]
    )


def displacement_gradient(u: Expr, radius: Expr | None = None) -> Expr:
    r"""Return :math:`F - I` as a 3x3 tensor; arguments as those of `deformation_gradient`."""
    gradient = ufl.grad(u)
    if gradient.ufl_shape == (3, 3):
        return gradient
    return ufl.as_tensor(
        [
            [gradient[0, 0], gradient[0, 1], 0],
            [gradient[1, 0], gradient[1, 1], 0],
            [0, 0, 0 if radius is None else u[0] / radius],
        ]
    )


def volume_ratio(F: Expr) -> Expr:
    """Return J = det F."""
    return ufl.det(F)


def isochoric_first_invariant(F: Expr) -> Expr:
    r"""Return :math:`\bar I_1 = J^{-2/3}\,\mathrm{tr}(F^T F)` with the 3x3 tensor."""
    return ufl.det(F) ** (-2 / 3) * ufl.inner(F, F)
