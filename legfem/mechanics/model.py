"""A leg's model, a frozen sum of swappable terms; what a term sees of the domain where it acts: the body, or its skin.

A mechanism is a term: it adds to the residual of the domain where it acts, and may carry history at
the quadrature points. What it needs is this protocol and nothing else.
"""

import dataclasses
import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

from legfem.common.errors import Checked
from legfem.mechanics.kinematics import (
    Expr,
    deformation_gradient,
    displacement_gradient,
    sheet_invariants,
    surface_vector,
)

Formulation = Literal["displacement", "mixed", "continuous", "porous"]
"""Unknowns: displacements; and pressures by element; and continuous ones; and those of a fluid."""


class Term(Protocol):
    """One physical effect."""

    @property
    def name(self) -> str:
        """Prefix of its parameters' names."""

    @property
    def domain(self) -> Literal["body", "skin", "face"]:
        """Where it acts: a face between tissues has forces in place of a form, see `legfem.fem.sliding`."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values by full name, for example ``deep.C10``."""

    def history(self, domain: Any) -> Mapping[str, tuple[int, ...]]:
        """Return the shape of every history variable it keeps at quadrature points."""

    def residual(self, domain: Any, history: Mapping[str, Any]) -> Expr:
        """Return its virtual work, a UFL form linear in the domain's variation."""

    def updated(self, domain: Any, history: Mapping[str, Any]) -> Mapping[str, Expr]:
        """Return the history at the end of a step as expressions of the state."""


class Memoryless:
    """A term that keeps nothing from step to step."""

    def history(self, domain: Any) -> dict[str, tuple[int, ...]]:
        """Return an empty mapping: the term has no history."""
        return {}

    def updated(self, domain: Any, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return an empty mapping: the term has no history."""
        return {}


class NumberedTerm(Checked):
    """A term whose parameters are fields, named ``<name>.<field>``."""

    numbers: ClassVar[tuple[str, ...]] = ()
    """Fields that are parameters."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Prefix of its parameters' names."""

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by full name; units as in the term's list."""
        return {f"{self.name}.{number}": getattr(self, number) for number in self.numbers}

    def scalars(self, domain: "IntegrationDomain") -> list[Expr]:
        """Return the parameters' symbols in a domain, in the order of their names."""
        return [domain.symbols.scalar(name, value) for name, value in self.parameters.items()]


@dataclass(frozen=True, eq=False)
class RegionTerm(NumberedTerm):
    """A term of one region, whose parameters are named ``<region>.<effect>.<field>``."""

    region: str
    effect: ClassVar[str]
    domain: ClassVar[Literal["body"]] = "body"

    @property
    def name(self) -> str:
        """Prefix of its parameters' names, for example ``deep.fibres``."""
        return f"{self.region}.{self.effect}"


@runtime_checkable
class Stressed(Protocol):
    """A term that adds to the stress of a region, and gives its part for output."""

    @property
    def region(self) -> str:
        """Region of the body where it acts."""

    def nominal_stress(self, body: Any) -> Expr:
        """Return its first Piola-Kirchhoff stress (MPa), (3, 3), out of a section's plane too."""


@dataclass(frozen=True)
class LegModel:
    """The sum of the terms, and which displacements are pinned."""

    terms: tuple[Term, ...]
    formulation: Formulation = "displacement"

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters by full name."""
        return {k: v for term in self.terms for k, v in term.parameters.items()}

    def values(self, given: Mapping[str, float] | None) -> dict[str, float]:
        """Return all parameters by full name, those given in the place of the terms' own.

        Raises
        ------
        KeyError
            For a name that the model has not.
        """
        defaults = self.parameters
        for name in given or {}:
            if name not in defaults:
                raise KeyError(f"the model has no parameter {name!r}")
        return {**defaults, **(given or {})}

    def at(self, domain: str) -> tuple[Term, ...]:
        """Return the terms that act on a domain."""
        return tuple(term for term in self.terms if term.domain == domain)

    def term(self, name: str) -> Term:
        """Return the term of that name."""
        return next(term for term in self.terms if term.name == name)

    def with_terms(self, terms: Iterable[Term]) -> "LegModel":
        """Return the model with terms added, each in place of one of its name if there is."""
        return reduce(LegModel.with_term, terms, self)

    def with_term(self, term: Term) -> "LegModel":
        """Return the model with a term swapped by name, or added."""
        if any(other.name == term.name for other in self.terms):
            swapped = tuple(term if other.name == term.name else other for other in self.terms)
            return replace(self, terms=swapped)
        return replace(self, terms=(*self.terms, term))


def named_parameters(prefix: str, given: Any) -> dict[str, float]:
    """Return the fields of a dataclass of numbers by full name, ``prefix.field``."""
    return {f"{prefix}.{field.name}": getattr(given, field.name) for field in dataclasses.fields(given)}


@dataclass(frozen=True, eq=False)
class IntegrationDomain:
    """A mesh with the unknown on it, as UFL.

    ``displacement_before`` is the converged one of the last step: a term with memory uses it.
    """

    symbols: Any
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

    def area_vector(self) -> Expr:
        """Return the outward normal times deformed area per reference area, (dimension,)."""
        swept = 1.0 if self.radius is None else 1.0 + self.displacement[0] / self.radius
        return self.outward * swept * surface_vector(self.position, self.displacement)
