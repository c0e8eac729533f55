"""Names of a model's numbers, and what terms see of them as UFL symbols."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol


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


def named(prefix: str, given: Any) -> dict[str, float]:
    """Return the fields of a dataclass of numbers by full name, ``prefix.field``."""
    return {f"{prefix}.{field.name}": getattr(given, field.name) for field in dataclasses.fields(given)}
