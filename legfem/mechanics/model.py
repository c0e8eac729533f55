"""A leg's model: a frozen sum of swappable terms.

A mechanism is a term: it adds to the residual of the domain where it acts, and may carry history at
the quadrature points. What it needs is this protocol and nothing else.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

from legfem.mechanics.kinematics import Expr

Formulation = Literal["displacement", "mixed", "continuous", "porous"]
"""Unknowns: displacements; and pressures by element; and continuous ones; and those of a fluid."""


class Term(Protocol):
    """One physical effect."""

    @property
    def name(self) -> str:
        """Prefix of its parameters' names."""

    @property
    def domain(self) -> Literal["body", "skin"]:
        """Where it acts."""

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


class RegionTerm:
    """A term of one region, whose parameters are fields, named ``<region>.<effect>.<field>``."""

    region: str
    effect: ClassVar[str]
    numbers: ClassVar[tuple[str, ...]]
    """Fields that are parameters."""

    @property
    def name(self) -> str:
        """Prefix of its parameters' names, for example ``deep.fibres``."""
        return f"{self.region}.{self.effect}"

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by full name; units as in the term's own list."""
        return {f"{self.name}.{number}": getattr(self, number) for number in self.numbers}


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
        own = self.parameters
        for name in given or {}:
            if name not in own:
                raise KeyError(f"the model has no parameter {name!r}")
        return {**own, **(given or {})}

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
