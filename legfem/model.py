"""A leg's model: a frozen sum of swappable terms.

A mechanism is a term: it adds to the residual of the place where it acts, and may carry history at
the quadrature points. What it needs is this protocol and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol

from legfem.kinematics import Expr
from legfem.spaces import Formulation


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
