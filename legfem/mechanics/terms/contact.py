"""What a leg touches: a rigid indenter, a given pressure as a stocking's, and springs that bear its bones."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import ufl

from legfem.common.errors import AboveZero
from legfem.mechanics.contact import PressureLaw, TangentialLaw
from legfem.mechanics.indenters import RigidIndenter
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Body, Memoryless, NumberedTerm, RegionTerm, Skin, named_parameters


@dataclass(frozen=True)
class NormalContact(Memoryless):
    """Pressure of the rigid indenter on the skin."""

    indenter: RigidIndenter
    law: PressureLaw
    name: ClassVar[str] = "contact"
    domain: ClassVar[Literal["skin"]] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the indenter and of the law."""
        return {**named_parameters("indenter", self.indenter), **named_parameters(self.name, self.law)}

    def pressure(self, skin: Skin) -> Expr:
        """Return the pressure (MPa)."""
        indenter = skin.symbols.of("indenter", self.indenter)
        return skin.symbols.of(self.name, self.law).pressure(-indenter.gap(skin.relative_position))

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the work of the pressure along the indenter's normal."""
        normal = skin.symbols.of("indenter", self.indenter).normal(skin.relative_position)
        return -self.pressure(skin) * ufl.dot(normal, skin.variation) * skin.measure


@dataclass(frozen=True)
class TangentialContact:
    r"""Traction along the indenter's surface, from the slip since a point touched.

    The history of a skin point is its anchor :math:`a`, the place on the indenter where it touched,
    and whether it touches. A point that comes into contact within a step is anchored where its gap
    passed the onset, by linear interpolation over the step: the traction grows from zero and F(d)
    is smooth. What the point slides between its touch and the end of that step isn't held: an error
    of first order in the step, about 1e-4 of a leg's force at steps of 1 mm.

    A point that lifts off lets its traction go over the range of gaps from zero to the pressure's
    onset: cut off at once, the traction would jump, and where points lift off under shear (at the
    cylinder's ends) there would be no equilibrium to find.
    """

    normal: NormalContact
    law: TangentialLaw
    name: ClassVar[str] = "friction"
    domain: ClassVar[Literal["skin"]] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the law."""
        return named_parameters(self.name, self.law)

    def history(self, skin: Skin) -> dict[str, tuple[int, ...]]:
        """Return the anchor (mm, relative to the indenter) and the mark of contact."""
        return {"anchor": (skin.dimension,), "touching": ()}

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the work of the tangential traction."""
        law = skin.symbols.of(self.name, self.law)
        _, slip, _ = self._slip(skin, history)
        traction = law.traction(self._hold(skin) * slip, self.normal.pressure(skin))
        return ufl.dot(traction, skin.variation) * skin.measure

    def updated(self, skin: Skin, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return the anchors, moved where the law let them slip, and the marks of contact."""
        law = skin.symbols.of(self.name, self.law)
        touching, slip, anchor = self._slip(skin, history)
        traction = law.traction(slip, self.normal.pressure(skin))
        slipped = slip - traction / law.stiffness if hasattr(law, "stiffness") else slip
        return {"anchor": anchor + slipped, "touching": ufl.conditional(touching, 1.0, 0.0)}

    def slip(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the slip (mm) of touching points, zero elsewhere."""
        touching, slip, _ = self._slip(skin, history)
        return ufl.conditional(touching, 1.0, 0.0) * slip

    def _hold(self, skin: Skin) -> Expr:
        """Return the share of the slip that is held: 0 from the onset outwards, 1 without a gap."""
        indenter = skin.symbols.of("indenter", self.normal.indenter)
        onset = skin.symbols.of(self.normal.name, self.normal.law).onset
        share = 1 - indenter.gap(skin.relative_position) / onset
        return ufl.max_value(0, ufl.min_value(1, share))

    def _slip(self, skin: Skin, history: Mapping[str, Any]) -> tuple[Expr, Expr, Expr]:
        indenter = skin.symbols.of("indenter", self.normal.indenter)
        onset = skin.symbols.of(self.normal.name, self.normal.law).onset
        now, before = skin.relative_position, skin.relative_position_before
        gap, gap_before = indenter.gap(now), indenter.gap(before)
        touching = ufl.lt(gap, onset)
        closing = ufl.max_value(gap_before - gap, 1e-12)
        entry = ufl.max_value(0, ufl.min_value(1, (gap_before - onset) / closing))
        fresh = before + entry * (now - before)
        anchor = ufl.conditional(ufl.gt(history["touching"], 0.5), history["anchor"], fresh)
        slip = now - anchor
        normal = indenter.normal(now)
        return touching, slip - normal * ufl.dot(normal, slip), anchor


@dataclass(frozen=True)
class SkinPressure(NumberedTerm, Memoryless):
    r"""The system's applied pressure :math:`p`, in full at 1 s and in proportion before.

    It follows the skin, along the deformed normal on the deformed area:

    .. math:: \delta W = \int t\, p\, n \cdot \delta u\, da,
              \qquad n\, da = \mathrm{cof}(F)\, N\, dA.
    """

    name = "skin_pressure"
    domain: ClassVar[Literal["skin"]] = "skin"

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the virtual work against the pressure."""
        return skin.time * skin.applied_pressure * ufl.dot(skin.area_vector(), skin.variation) * skin.measure

    def pressure(self, skin: Skin) -> Expr:
        """Return the pressure per deformed area (MPa)."""
        return skin.time * skin.applied_pressure


HELD = 1e5
"""Stiffness (N/mm) at which a bone is as good as held: a leg's own is some newtons a mm."""
_RIGID = 1e3
"""Stiffness of the bone itself (MPa), which neither turns nor changes its shape."""
_PRESSURE = 1.0
"""Any modulus (MPa): a mixed form has pressures in the bone, too, where they are to vanish."""


@dataclass(frozen=True)
class BoneSprings(RegionTerm, Memoryless):
    r"""A bone that its springs let move as a whole, without turning.

    .. math:: W = \frac{k_x u_x^2 + k_y u_y^2}{2 A L} + \frac{B}{2} |\nabla u|^2

    a reference volume over the bone's section :math:`A`, with :math:`B` so large that :math:`u` is
    the same all over it; the springs' force on a length :math:`L` of the bone is then
    :math:`(k_x u_x, k_y u_y)`. Knee and ankle carry the bones, and hardly let them turn about their
    own axis. For a section whose mesh has the bone's inside.

    Parameters
    ----------
    region : str
        Name of the bone; parameters are named ``<region>.springs.x`` and so on.
    area : float
        Area of the bone's section, mm2.
    length : float
        Length of the leg that the springs hold (mm), as that of the cylinder that presses on it.
    x, y : float
        :math:`k_x, k_y` (N/mm).
    """

    area: AboveZero[float]
    length: AboveZero[float]
    x: AboveZero[float] = HELD
    y: AboveZero[float] = HELD
    effect = "springs"
    numbers = ("x", "y")

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the springs' virtual work, that of the rigid bone, and no pressure in it."""
        moved, varied = body.displacement, body.variation
        work = _RIGID * ufl.inner(ufl.grad(moved), ufl.grad(varied))
        for axis, stiffness in enumerate(self.scalars(body)):
            work += stiffness / (self.area * self.length) * moved[axis] * varied[axis]
        if self.region in body.pressures:
            pressure, by = body.pressures[self.region], body.pressure_variations[self.region]
            work -= pressure * by / _PRESSURE
        return work * body.regions[self.region]
