"""The tissues' relaxation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.kinematics import Expr
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

    region: str
    law: Hyperelastic
    ratio: float = 0.0
    relaxation_time: float = 10.0
    branch: str = ""
    domain: Literal["body"] = "body"
    numbers = ("ratio", "relaxation_time")

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "ratio", zero_allowed=True)
        check_positive(self, "relaxation_time")

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
