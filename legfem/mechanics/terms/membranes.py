"""Fascia and dermis as thin sheets, the tension of the fascia in the imaged state, and the face on which fat slides."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
import ufl
from dolfinx import fem
from dolfinx import mesh as dolfinx_mesh

from legfem.common.errors import AboveZero, InputError, ZeroOrMore
from legfem.common.units import FloatArray, frozen_array
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Body, Memoryless, NumberedTerm, RegionTerm, Skin

_ITERATIONS = 5
"""Steps of Newton's method for J, from 1: its error is below 3e-10 up to stretches of 0.7 and 1.3."""


@dataclass(frozen=True)
class Fascia(NumberedTerm, Memoryless):
    r"""A neo-Hookean membrane on the face between deep and superficial tissue.

    .. math:: \frac{k}{2} \left(J^{-2/3} \left(\operatorname{tr} C_s + J^2 / J_s^2\right) - 3
              + (J - 1)^2 / c\right)

    a reference area, with the deformation :math:`C_s` of the face in itself, the change
    :math:`J_s` of its area, and the volume ratio J at which nothing presses on the membrane across
    its thickness; k is the shear modulus times the thickness (2 C10 h) and c is D1 C10 of
    `legfem.mechanics.materials.NeoHookean`. It does nothing at ``stiffness = 0``.

    Parameters
    ----------
    stiffness : float
        k (N/mm).
    compressibility : float
        c, dimensionless; 0 is incompressible, J = 1.
    """

    stiffness: ZeroOrMore[float] = 0.0
    compressibility: ZeroOrMore[float] = 0.0
    name = "fascia.membrane"
    domain: ClassVar[Literal["body"]] = "body"
    numbers = ("stiffness", "compressibility")

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the membrane's energy."""
        if body.hull is None:
            problem = "the mesh has no named face of the deep tissue"
            raise InputError("mesh", self.name, problem, "mesh the leg with legfem.meshing.solid_leg")
        k, c = self.scalars(body)
        trace, area2 = face_strain(body)
        J = free_volume_ratio(trace, area2, c)

        def varied(value: Expr) -> Expr:
            return ufl.derivative(value, body.unknown, body.test)

        # At J the energy is stationary: only the face's own strain varies.
        rate = varied(trace) - (J / area2) ** 2 * varied(area2)
        return 0.5 * k * J ** (-2 / 3) * rate * body.hull


def face_strain(body: Body) -> tuple[Expr, Expr]:
    """Return tr C of a face's deformation in itself, and its area's change squared."""
    F = body.deformation_gradient
    normal = ufl.FacetNormal(ufl.domain.extract_unique_domain(body.displacement))
    across = F * normal
    area = ufl.det(F) * ufl.inv(F).T * normal
    return ufl.inner(F, F) - ufl.dot(across, across), ufl.dot(area, area)


def free_volume_ratio(trace: Expr, area2: Expr, compressibility: Expr) -> Expr:
    r"""Return J of a sheet that nothing presses on, by Newton's method.

    .. math:: \tfrac{c}{3} \left(2 J^2 / J_s^2 - \operatorname{tr} C_s\right)
              + (J - 1) J^{5/3} = 0

    Parameters
    ----------
    trace, area2
        See `face_strain`; numbers serve, too.
    compressibility
        c.
    """
    third = compressibility / 3
    J: Expr = 1.0
    for _ in range(_ITERATIONS):
        power = J ** (2 / 3)
        off = third * (2 * J**2 / area2 - trace) + (J - 1) * J * power
        slope = 4 * third * J / area2 + (8 * J - 5) / 3 * power
        J = J - off / slope
    return J


@dataclass(frozen=True, eq=False)
class Prestress(RegionTerm, Memoryless):
    r"""The fascia is under tension when the leg is imaged, and like a string it resists deflection.

    The tension :math:`\sigma_0` along the fascia's contour, of unit tangent :math:`t`, is in
    equilibrium with the tissues in the imaged state; what both do to first order of the
    displacement cancels, and the tension's work of second order stays:

    .. math:: \frac{\sigma_0}{2} |\nabla u \cdot t|^2.

    It is that of a stress :math:`\sigma_0\, t \otimes t` over the quadratic part of Green's strain
    (the geometric stiffness of K. Washizu, Variational Methods in Elasticity and Plasticity, 1968,
    chapter 5). Nothing happens at ``tension = 0``. For a section; a 3D leg has no contour.

    Parameters
    ----------
    contour : (n, 2) array
        Closed contour of the fascia, for example ``section.fascia`` (mm).
    tension : float
        :math:`\sigma_0` (MPa); below zero the fascia is compressed.
    region : str
        Region of the body; the parameter is named ``<region>.prestress.tension``.
    """

    contour: FloatArray
    tension: float = 0.0
    region: str = field(default="fascia", kw_only=True)
    effect = "prestress"
    numbers = ("tension",)

    def __post_init__(self) -> None:
        """Copy the contour, and check both."""
        contour = frozen_array(self.contour)
        if contour.ndim != 2 or contour.shape[1] != 2 or len(contour) < 3:
            raise InputError("Prestress", "contour", f"is of shape {contour.shape}", "give three points or more")
        object.__setattr__(self, "contour", contour)
        if not np.isfinite(self.tension):
            raise InputError("Prestress", "tension", "is not finite", "give a finite number")

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the tension's work of second order."""
        (tension,) = self.scalars(body)
        tangent = tangent_field(self.contour, body.unknown.function_space.mesh)
        turn = ufl.dot(ufl.grad(body.displacement), tangent)
        varied = ufl.dot(ufl.grad(body.variation), tangent)
        return tension * ufl.dot(turn, varied) * body.regions[self.region]


def contour_tangents(contour: FloatArray, points: FloatArray) -> FloatArray:
    """Return the unit tangents (n, 2) of a closed contour (m, 2) nearest to points (n, 2)."""
    ends = np.roll(contour, -1, axis=0)
    along = ends - contour
    sides = shapely.STRtree(shapely.linestrings(np.stack([contour, ends], axis=1)))
    nearest = sides.nearest(shapely.points(points))
    return np.asarray((along / np.linalg.norm(along, axis=1)[:, None])[nearest])


def tangent_field(contour: FloatArray, mesh: Any) -> Any:
    """Return a contour's unit tangents as a field that is constant in every cell.

    Raises
    ------
    InputError
        If the mesh isn't a section's.
    """
    if mesh.geometry.dim != 2:
        raise InputError("model", "fascia", "a contour's terms need a section", "leave them out in 3D")
    tangents = fem.Function(fem.functionspace(mesh, ("DG", 0, (2,))))
    cells = mesh.topology.index_map(2)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    middle = dolfinx_mesh.compute_midpoints(mesh, 2, every)[:, :2]
    dofs = tangents.function_space.dofmap.list[:, 0]
    tangents.x.array.reshape(-1, 2)[dofs] = contour_tangents(contour, middle)
    return tangents


@dataclass(frozen=True)
class Dermis(NumberedTerm, Memoryless):
    r"""An incompressible neo-Hookean membrane on the skin, which both papers leave out.

    .. math:: W = \frac{k}{2} \left(\operatorname{tr} C_s + \frac{1}{\det C_s} - 3\right)

    a reference area, with the right Cauchy-Green tensor :math:`C_s` of the skin in itself and
    :math:`k = 2 C_{10} h`, shear modulus times thickness. Stretched by :math:`\lambda` in plane
    strain it bears the tension :math:`k (\lambda - \lambda^{-3})` a unit length; it doesn't resist
    bending, and being attached it bears compression too, without wrinkles. Nothing happens at
    ``stiffness = 0``.

    R. W. Ogden, Non-linear Elastic Deformations (1984), section 7.3. At 1.5 mm of dermis whose C10
    is 10 kPa, k is 0.03 N/mm.

    Parameters
    ----------
    stiffness : float
        :math:`k` (N/mm).
    """

    stiffness: ZeroOrMore[float] = 0.0
    name = "dermis"
    domain: ClassVar[Literal["skin"]] = "skin"
    numbers = ("stiffness",)

    def energy_density(self, skin: Skin) -> Expr:
        """Return the energy a reference area (N/mm)."""
        (stiffness,) = self.scalars(skin)
        trace, determinant = skin.sheet_invariants
        return 0.5 * stiffness * (trace + 1 / determinant - 3)

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the energy."""
        energy = self.energy_density(skin) * skin.measure
        return ufl.derivative(energy, skin.unknown, skin.test)


CLOSED = 1.0
"""MPa/mm: with 20 kPa on it a face closes by 0.02 mm."""


@dataclass(frozen=True)
class SlidingFace(NumberedTerm, Memoryless):
    r"""Two tissues slide along each other on a face, and can't part.

    .. math:: W = \frac{k_n}{2} g^2 + \frac{k_t}{2} |x_1 - x_2|^2

    a reference area of the face, with the distance :math:`g` of a point of the one from the deformed face of the
    other, where it is nearest however far the point has slid, and the vector :math:`x_1 - x_2` between two points
    that lay at one place at first. Nothing resists sliding at ``shear = 0``, and with a great one the two are grown
    together. For a section whose mesh is split there (`legfem.meshing.section.mesh_section`).

    Parameters
    ----------
    shear : float
        k_t (MPa/mm): what a face that sticks like a layer of soft tissue bears along it.
    normal : float
        k_n (MPa/mm), so large that the face stays closed.
    """

    shear: ZeroOrMore[float] = 0.0
    normal: AboveZero[float] = CLOSED
    name = "sliding"
    domain: ClassVar[Literal["face"]] = "face"
    numbers = ("shear", "normal")

    def residual(self, domain: Any, history: Mapping[str, Any]) -> Any:
        """Return nothing: points far from each other meet, which a form can't say; see `legfem.fem.sliding`."""
        return None
