"""What a term of a model sees of the domain where it acts: the body, or its skin."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from legfem.mechanics.kinematics import (
    Expr,
    deformation_gradient,
    displacement_gradient,
    sheet_invariants,
    surface_vector,
)


class SymbolTable(Protocol):
    """The numbers of a model as UFL symbols."""

    def of(self, prefix: str, given: Any) -> Any:
        """Return a frozen dataclass with its numbers replaced by symbols ``prefix.field``."""

    def scalar(self, name: str, value: float) -> Any:
        """Return the symbol of that name, made on first use."""

    @property
    def zeros(self) -> frozenset[str]:
        """Names of the numbers that are zero now."""

    def __contains__(self, name: str) -> bool:
        """Return whether there is a number of that name."""

    def __getitem__(self, name: str) -> Any:
        """Return the symbol of that name."""


def named_parameters(prefix: str, given: Any) -> dict[str, float]:
    """Return the fields of a dataclass of numbers by full name, ``prefix.field``."""
    return {f"{prefix}.{field.name}": getattr(given, field.name) for field in dataclasses.fields(given)}


@dataclass(frozen=True, eq=False)
class IntegrationDomain:
    """A mesh with the unknown on it, as UFL.

    ``displacement_before`` is the converged one of the last step: a term with memory uses it.
    """

    symbols: SymbolTable
    unknown: Any
    """Unknown on this mesh, a `dolfinx.fem.Function`."""
    test: Expr
    """Test function of the unknown."""
    displacement: Expr
    """Displacement, mm: the unknown or a part of it."""
    displacement_before: Expr
    variation: Expr
    """Test function of the displacement."""
    quadrature_degree: int
    time: Expr
    """Time at the end of the step, s."""
    time_step: Expr
    """Duration of the step, s."""


@dataclass(frozen=True, eq=False)
class Swept:
    """A measure of the meridional half plane, swept round the axis of symmetry."""

    measure: Any
    radius: Expr
    """Reference distance from the axis (mm)."""

    def __rmul__(self, integrand: Expr) -> Expr:
        r"""Return the integral with the weight :math:`2 \pi r`."""
        return 2 * math.pi * self.radius * integrand * self.measure


@dataclass(frozen=True, eq=False)
class Body(IntegrationDomain):
    """The tissues' volume."""

    regions: dict[str, Any]
    """Measure of every region."""
    pressures: Mapping[str, Expr] = field(default_factory=dict)
    """Pressure that is an unknown (MPa), positive in tension, by region."""
    pressure_variations: Mapping[str, Expr] = field(default_factory=dict)
    """Their test functions."""
    porous: bool = False
    """Whether the pressures let fluid flow from element to element."""
    radius: Expr | None = None
    """Reference distance from the axis of symmetry (mm); None without one."""
    hull: Any = None
    """Measure of the deep tissue's face towards the superficial one, seen from within; None where
    the mesh doesn't tag it."""

    @property
    def deformation_gradient(self) -> Expr:
        """Deformation gradient F, (3, 3)."""
        return deformation_gradient(self.displacement, self.radius)

    @property
    def varied_gradient(self) -> Expr:
        """Variation of F, (3, 3)."""
        return displacement_gradient(self.variation, self.radius)

    @property
    def working(self) -> tuple[tuple[int, int], ...]:
        """Indices of the components of a symmetric tensor that do work."""
        d = self.displacement.ufl_shape[0]
        hoop = ((2, 2),) if self.radius is not None else ()
        return (*((i, j) for i in range(d) for j in range(i, d)), *hoop)


@dataclass(frozen=True, eq=False)
class Skin(IntegrationDomain):
    """The outer surface, with the rigid indenter's position."""

    measure: Any
    position: Expr
    """Reference position of the skin's points (mm)."""
    centre: Expr
    """Centre of the indenter at the end of the step, mm."""
    centre_before: Expr
    dimension: int
    """2 or 3."""
    outward: Expr
    """Sign (1 or -1) that turns the normal of a facet's own orientation out of the body."""
    applied_pressure: Expr
    """Given pressure on the skin (MPa), positive inwards."""
    radius: Expr | None = None
    """Reference distance from the axis of symmetry (mm); None without one."""
    rounding: Expr | None = None
    """Vector from the mesh's flat facets to the rounded skin that an indenter meets (mm); None where
    facets are the skin."""

    @property
    def relative_position(self) -> Expr:
        """Position of the skin's points relative to the indenter at the end of the step, mm."""
        return self._met + self.displacement - self.centre

    @property
    def relative_position_before(self) -> Expr:
        """Position of the skin's points relative to the indenter at the end of the last step, mm."""
        return self._met + self.displacement_before - self.centre_before

    @property
    def _met(self) -> Expr:
        return self.position if self.rounding is None else self.position + self.rounding

    @property
    def sheet_invariants(self) -> tuple[Expr, Expr]:
        r"""Trace and determinant of the surface's right Cauchy-Green tensor :math:`C_s`.

        It is that of a sheet of two dimensions: in a section the second stretch is that out of the
        plane, in axial symmetry the hoop's. The square root of the determinant is the change of
        area.
        """
        return sheet_invariants(self.position, self.displacement, self.radius)

    def area_vector(self, deformed: bool = True) -> Expr:
        """Return the outward normal times deformed area per reference area, (dimension,)."""
        if not deformed:
            return self.outward * surface_vector(self.position)
        swept = 1.0 if self.radius is None else 1.0 + self.displacement[0] / self.radius
        return self.outward * swept * surface_vector(self.position, self.displacement)
