"""A leg's model: a frozen sum of swappable terms.

A mechanism is a term: it adds to the residual of the place where it acts, and may carry history at
the quadrature points. What it needs is this protocol and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Protocol

import ufl

from legfem.contact import PressureLaw, RigidIndenter, TangentialLaw
from legfem.kinematics import Expr, deformation_gradient, volume_ratio
from legfem.materials import Hyperelastic
from legfem.places import Body, Place, Skin


class Term(Protocol):
    """One physical effect."""

    @property
    def name(self) -> str:
        """Prefix of its parameters' names."""

    @property
    def place(self) -> Literal["body", "skin"]:
        """Where it acts."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values by full name, for example ``deep.C10``."""

    def history(self, place: Any) -> Mapping[str, tuple[int, ...]]:
        """Return the shape of every history variable it keeps at quadrature points."""

    def residual(self, place: Any, history: Mapping[str, Any]) -> Expr:
        """Return its virtual work, a UFL form linear in the place's variation."""

    def updated(self, place: Any, history: Mapping[str, Any]) -> Mapping[str, Expr]:
        """Return the history at the end of a step as expressions of the state."""


@dataclass(frozen=True)
class Tissue:
    """A hyperelastic region of the body."""

    region: str
    law: Hyperelastic
    place: Literal["body"] = "body"

    @property
    def name(self) -> str:
        """The region's name."""
        return self.region

    @property
    def parameters(self) -> dict[str, float]:
        """The law's parameters."""
        return {f"{self.region}.{key}": value for key, value in self.law.parameters.items()}

    def energy_density(self, body: Body) -> Expr:
        r"""Return the strain energy (MPa), in a mixed form with the quadratic part by Legendre.

        .. math:: (J - 1)^2 / D_1 \to p (J - 1) - D_1 p^2 / 4
        """
        law = body.symbols.of(self.region, self.law)
        F = deformation_gradient(body.displacement)
        if body.pressure is None:
            return law.strain_energy(F)
        J = volume_ratio(F)
        dual = body.pressure * (J - 1) - law.D1 * body.pressure**2 / 4
        return law.distortion_energy(F) + dual + law.volumetric_remainder(J)

    def history(self, place: Place) -> dict[str, tuple[int, ...]]:
        """Return nothing: an elastic tissue has no memory."""
        return {}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the strain energy."""
        energy = self.energy_density(body) * body.regions[self.region]
        return ufl.derivative(energy, body.unknown, body.test)

    def updated(self, body: Body, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return nothing."""
        return {}


@dataclass(frozen=True)
class NormalContact:
    """Pressure of the rigid indenter on the skin."""

    indenter: RigidIndenter
    law: PressureLaw
    name: str = "contact"
    place: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the indenter and of the law."""
        return {
            **_numbers("indenter", self.indenter),
            **_numbers(self.name, self.law),
        }

    def history(self, place: Place) -> dict[str, tuple[int, ...]]:
        """Return nothing."""
        return {}

    def pressure(self, skin: Skin) -> Expr:
        """Return the pressure (MPa)."""
        indenter = skin.symbols.of("indenter", self.indenter)
        law = skin.symbols.of(self.name, self.law)
        return law.pressure(-indenter.gap(skin.relative_position))

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the work of the pressure along the indenter's normal."""
        indenter = skin.symbols.of("indenter", self.indenter)
        normal = indenter.normal(skin.relative_position)
        return -self.pressure(skin) * ufl.dot(normal, skin.variation) * skin.measure

    def updated(self, skin: Skin, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return nothing."""
        return {}


@dataclass(frozen=True)
class TangentialContact:
    r"""Traction along the indenter's surface, from the slip since a point touched.

    The history of a skin point is its anchor :math:`a`, the place on the indenter where it touched,
    and whether it touches. A point that comes into contact within a step is anchored where its gap
    passed the onset, by linear interpolation over the step: the traction grows from zero and F(d)
    is smooth. What the point slides between its touch and the end of that step isn't held: an error
    of first order in the step, about 1e-4 of a leg's force at steps of 1 mm.
    """

    normal: NormalContact
    law: TangentialLaw
    name: str = "friction"
    place: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the law."""
        return _numbers(self.name, self.law)

    def history(self, skin: Skin) -> dict[str, tuple[int, ...]]:
        """Return the anchor (mm, relative to the indenter) and the mark of contact."""
        return {"anchor": (skin.dimension,), "touching": ()}

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the work of the tangential traction."""
        return ufl.dot(self._traction(skin, history), skin.variation) * skin.measure

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

    def _traction(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        law = skin.symbols.of(self.name, self.law)
        return law.traction(self.slip(skin, history), self.normal.pressure(skin))

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
class LegModel:
    """The sum of the terms, and which displacements are pinned."""

    terms: tuple[Term, ...]
    formulation: Literal["displacement", "mixed"] = "displacement"

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters by full name."""
        return {k: v for term in self.terms for k, v in term.parameters.items()}

    def at(self, place: str) -> tuple[Term, ...]:
        """Return the terms that act at a place."""
        return tuple(term for term in self.terms if term.place == place)

    def term(self, name: str) -> Term:
        """Return the term of that name."""
        return next(term for term in self.terms if term.name == name)

    def with_term(self, term: Term) -> LegModel:
        """Return the model with a term swapped by name, or added."""
        if any(other.name == term.name for other in self.terms):
            swapped = tuple(term if other.name == term.name else other for other in self.terms)
            return replace(self, terms=swapped)
        return replace(self, terms=(*self.terms, term))


def _numbers(prefix: str, given: Any) -> dict[str, float]:
    return {f"{prefix}.{field.name}": getattr(given, field.name) for field in fields(given)}
