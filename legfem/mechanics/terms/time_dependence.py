"""What tissues do in time: they relax, and their fluid drains."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import ufl

from legfem.common.errors import AboveZero, InputError, ZeroOrMore
from legfem.mechanics.kinematics import Expr, nominal_stress, volume_ratio
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Body, RegionTerm


@dataclass(frozen=True)
class Viscoelasticity(RegionTerm):
    r"""A Prony branch of finite-strain viscoelasticity: the tissue's distortion stress relaxes.

    The tissue resists fast deformation with more stress than slow deformation, and the surplus
    fades while the deformation is held. The law of the region, as it is, is what lasts.

    The branch adds the overstress :math:`\beta H` to the second Piola-Kirchhoff stress, with the
    elastic stress of distortion :math:`S = F^{-1} \partial U_\text{distortion} / \partial F`:

    .. math:: \dot H + H / \tau = \dot S.

    The update is exact for a stress that changes linearly over the step of duration :math:`h`,

    .. math:: H_{n+1} = e^{-h/\tau} H_n + \frac{1 - e^{-h/\tau}}{h/\tau} (S_{n+1} - S_n),

    and the virtual work is :math:`\beta H_{n+1} : \delta E`. Nothing happens at ``ratio = 0``.
    Sources: J. C. Simo, Comput. Methods Appl. Mech. Engrg. 60 (1987) 153-173; G. A. Holzapfel,
    Nonlinear Solid Mechanics (2000), section 6.10; the update: R. L. Taylor, K. S. Pister, G. L.
    Goudreau, Int. J. Numer. Methods Engrg. 2 (1970) 45-59.

    Parameters
    ----------
    region : str
        Region of the body; parameters are named ``<region>.viscoelasticity<branch>.ratio`` and so on.
    law : Hyperelastic
        The region's law, whose symbols are shared: the overstress follows ``<region>.C10``.
    ratio : float
        :math:`\beta`, the stress that relaxes over the one that lasts, after a sudden strain.
    relaxation_time : float
        :math:`\tau` (s).
    branch : str
        Tells several branches of a region apart.
    """

    law: Hyperelastic
    ratio: ZeroOrMore[float] = 0.0
    relaxation_time: AboveZero[float] = 10.0
    branch: str = ""
    numbers = ("ratio", "relaxation_time")

    @property
    def name(self) -> str:
        """For example ``deep.viscoelasticity``."""
        return f"{self.region}.viscoelasticity{self.branch}"

    @property
    def strength(self) -> str:
        """The number at whose zero nothing happens: see `legfem.fem.forms.DomainForms`."""
        return f"{self.name}.ratio"

    def history(self, body: Body) -> dict[str, tuple[int, ...]]:
        """Return overstress and elastic stress (MPa): their components that do work."""
        size = (len(body.working),)
        return {"overstress": size, "elastic": size}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the virtual work of the overstress."""
        ratio = body.symbols.scalar(f"{self.name}.ratio", self.ratio)
        strain = ufl.sym(ufl.dot(ufl.transpose(body.deformation_gradient), body.varied_gradient))
        twice = ufl.as_vector([(1 if i == j else 2) * strain[i, j] for i, j in body.working])
        work = ratio * ufl.dot(self._overstress(body, history), twice)
        return work * body.regions[self.region]

    def updated(self, body: Body, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return both stresses at the end of the step."""
        return {"overstress": self._overstress(body, history), "elastic": self._elastic(body)}

    def _overstress(self, body: Body, history: Mapping[str, Any]) -> Expr:
        time = body.symbols.scalar(f"{self.name}.relaxation_time", self.relaxation_time)
        share = body.time_step / time
        decay = ufl.exp(-share)
        change = self._elastic(body) - history["elastic"]
        # In short steps the quotient would lose digits.
        series = 1 - share / 2 + share**2 / 6
        mean = ufl.conditional(ufl.lt(share, 1e-4), series, (1 - decay) / share)
        return decay * history["overstress"] + mean * change

    def _elastic(self, body: Body) -> Expr:
        law = body.symbols.of(self.region, self.law)
        F = ufl.variable(body.deformation_gradient)
        stress = ufl.dot(ufl.inv(F), ufl.diff(law.distortion_energy(F), F))
        return ufl.as_vector([stress[i, j] for i, j in body.working])


@dataclass(frozen=True)
class Drainage(RegionTerm):
    r"""Poroelastic drainage: fluid is squeezed through the tissue, which loses volume where it was.

    Pressed quickly, the tissue keeps its fluid and is as stiff in volume as its law says; held, the
    fluid flows to where the pressure is lower, and the force fades with the square of the distance
    it has to go. With the fluid pressure :math:`-p` (the unknown of the mixed form is positive in
    tension), the fluid's displacement relative to the tissue :math:`w` (volume through unit
    reference area) and Darcy's law in the reference configuration,

    .. math:: \dot w = k\, \nabla p, \qquad
              J - 1 + \nabla \cdot w = \frac{D_1}{2 (1 - s)}\, p,

    weakly, with the test function :math:`q` of the pressure and after a backward Euler step,
    :math:`-\int \nabla q \cdot w_{n+1}` beside :math:`\int q (J - 1)`. A share :math:`s` of the
    bulk stiffness is the skeleton's, which doesn't drain: :math:`s (J - 1)^2 / D_1`; what is left
    when all fluid can go is this and the distortion energy. The sum is the undrained law, so that
    nothing happens at ``permeability = 0`` (exactly for ``skeleton = 0``; else the volumetric
    energy is discretised in another way, and the solution the same up to that).
    The surface, the bones and the region's borders are sealed, but for what
    `legfem.fem.spaces.build_spaces` is told to drain. Needs the formulation ``"porous"``.

    M. A. Biot, J. Appl. Phys. 12 (1941) 155-164, with incompressible grains; O. Coussy,
    Poromechanics (2004), chapter 4.

    Parameters
    ----------
    region : str
        Region of the body; parameters are named ``<region>.drainage.permeability`` and so on.
    law : Hyperelastic
        The region's law, whose symbol ``<region>.D1`` is shared.
    permeability : float
        :math:`k`, Darcy's over the fluid's viscosity (mm4/(N s)).
    skeleton : float
        :math:`s`, dimensionless, below 1.
    """

    law: Hyperelastic
    permeability: ZeroOrMore[float] = 0.0
    skeleton: ZeroOrMore[float] = 0.0
    effect = "drainage"
    numbers = ("permeability", "skeleton")

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        if self.skeleton >= 1:
            raise InputError("Drainage", "skeleton", f"is {self.skeleton:g}", "give a share of less than one")

    def history(self, body: Body) -> dict[str, tuple[int, ...]]:
        """Return the displacement of the fluid (mm)."""
        return {"seepage": (body.displacement.ufl_shape[0],)}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the change of volume by seepage, and the part of the energy that is moved."""
        self._pressure(body)
        q, region = body.pressure_variations[self.region], body.regions[self.region]
        moved = self.energy_density(body, body.deformation_gradient)
        seepage = ufl.dot(ufl.grad(q), self._seepage(body, history))
        return ufl.derivative(moved * region, body.unknown, body.test) - seepage * region

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the part of the energy (MPa) that is moved, at a deformation gradient."""
        law = body.symbols.of(self.region, self.law)
        s = body.symbols.scalar(f"{self.name}.skeleton", self.skeleton)
        fluid = s / (1 - s) * law.D1 * self._pressure(body) ** 2 / 4
        return s * (volume_ratio(F) - 1) ** 2 / law.D1 - fluid

    def nominal_stress(self, body: Body) -> Expr:
        """Return the first Piola-Kirchhoff stress (MPa) of the part that is moved."""
        return nominal_stress(partial(self.energy_density, body), body.deformation_gradient)

    def updated(self, body: Body, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return the fluid's displacement at the end of the step."""
        return {"seepage": self._seepage(body, history)}

    def _seepage(self, body: Body, history: Mapping[str, Any]) -> Expr:
        k = body.symbols.scalar(f"{self.name}.permeability", self.permeability)
        return history["seepage"] + body.time_step * k * ufl.grad(self._pressure(body))

    def _pressure(self, body: Body) -> Expr:
        if not body.porous or self.region not in body.pressures:
            problem = "fluid flows between elements, which needs a continuous pressure"
            remedy = 'choose the formulation "porous", and superficial or deep'
            raise InputError("formulation", self.name, problem, remedy)
        return body.pressures[self.region]
