r"""Kinematics of finite strain in UFL: the deformation gradient is 3x3 in every dimension.

Plane strain keeps the out-of-plane stretch (equal to one), so that the isochoric split divides by
:math:`J^{2/3}` and not by the two-dimensional :math:`J`. Axial symmetry has coordinates
:math:`(r, z, \theta)` and the hoop stretch :math:`1 + u_r / r`.
"""

from collections.abc import Callable
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
    return ufl.Identity(3) + gradient if gradient.ufl_shape == (3, 3) else _in_space(u, radius, 1)


def displacement_gradient(u: Expr, radius: Expr | None = None) -> Expr:
    r"""Return :math:`F - I` as a 3x3 tensor; arguments as those of `deformation_gradient`."""
    gradient = ufl.grad(u)
    return gradient if gradient.ufl_shape == (3, 3) else _in_space(u, radius, 0)


def _in_space(u: Expr, radius: Expr | None, diagonal: int) -> Expr:
    """Return a plane's gradient as a 3x3 tensor, with what is added on its diagonal."""
    gradient, hoop = ufl.grad(u), 0 if radius is None else u[0] / radius
    return ufl.as_tensor(
        [
            [diagonal + gradient[0, 0], gradient[0, 1], 0],
            [gradient[1, 0], diagonal + gradient[1, 1], 0],
            [0, 0, diagonal + hoop],
        ]
    )


def surface_vector(position: Expr, displacement: Expr) -> Expr:
    r"""Return the normal of a surface in its own orientation, times the change of its area.

    With the tangents :math:`T_\alpha` of the facet's own coordinates and
    :math:`t_\alpha = T_\alpha + \nabla_s u\, T_\alpha`, in 3D
    :math:`t_1 \times t_2 / |T_1 \times T_2|` (Nanson's formula), in 2D the tangent turned by a
    right angle, clockwise, over :math:`|T_1|`.

    Parameters
    ----------
    position
        Spatial coordinate of the surface's mesh (mm).
    displacement
        On that mesh (mm).

    Returns
    -------
    ufl.core.expr.Expr
        Shape (2,) or (3,), dimensionless.
    """
    reference = ufl.Jacobian(ufl.domain.extract_unique_domain(position))
    tangents = reference + ufl.dot(ufl.grad(displacement), reference)
    if reference.ufl_shape == (2, 1):
        length = ufl.sqrt(reference[0, 0] ** 2 + reference[1, 0] ** 2)
        return ufl.as_vector([tangents[1, 0], -tangents[0, 0]]) / length

    def crossed(columns: Expr) -> Expr:
        return ufl.cross(*(ufl.as_vector([columns[i, k] for i in range(3)]) for k in range(2)))

    before = crossed(reference)
    return crossed(tangents) / ufl.sqrt(ufl.dot(before, before))


def sheet_invariants(position: Expr, displacement: Expr, radius: Expr | None = None) -> tuple[Expr, Expr]:
    r"""Return trace and determinant of a surface's own right Cauchy-Green tensor :math:`C_s`.

    With the tangents of the facet's own coordinates before and after, :math:`T` and
    :math:`t = T + \nabla_s u\, T`, it is :math:`(T^T T)^{-1} t^T t`. A line in a section is a sheet
    whose second stretch is 1, or :math:`1 + u_r / r` round an axis.

    Parameters
    ----------
    position
        Spatial coordinate of the surface's mesh (mm).
    displacement
        On that mesh (mm).
    radius
        Reference distance from the axis of symmetry (mm), if there is one.
    """
    before = ufl.Jacobian(ufl.domain.extract_unique_domain(position))
    after = before + ufl.dot(ufl.grad(displacement), before)
    if before.ufl_shape == (2, 1):
        along = ufl.inner(after, after) / ufl.inner(before, before)
        across = 1 if radius is None else (1 + displacement[0] / radius) ** 2
        return along + across, along * across
    first, now = before.T * before, after.T * after
    return ufl.tr(ufl.inv(first) * now), ufl.det(now) / ufl.det(first)


def nominal_stress(energy_density: Callable[[Expr], Expr], F: Expr) -> Expr:
    r"""Return the first Piola-Kirchhoff stress :math:`\partial U / \partial F` (MPa), (3, 3).

    Parameters
    ----------
    energy_density
        :math:`U` (MPa) of a deformation gradient.
    F
        Deformation gradient, (3, 3).
    """
    gradient = ufl.variable(F)
    return ufl.diff(energy_density(gradient), gradient)


def volume_ratio(F: Expr) -> Expr:
    """Return J = det F."""
    return ufl.det(F)


def isochoric_first_invariant(F: Expr) -> Expr:
    r"""Return :math:`\bar I_1 = J^{-2/3}\,\mathrm{tr}(F^T F)` with the 3x3 tensor."""
    return ufl.det(F) ** (-2 / 3) * ufl.inner(F, F)
