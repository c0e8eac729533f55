"""Numbers of a model as UFL symbols, so that changing one needs no new compilation."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from numbers import Real
from typing import Any

import ufl
from dolfinx import fem


class Symbols:
    """The numbers of a model on one mesh: `dolfinx.fem.Constant` values behind UFL variables.

    A form is differentiated with respect to a parameter through its variable.
    """

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh
        self._constants: dict[str, Any] = {}
        self._variables: dict[str, Any] = {}

    def of(self, prefix: str, given: Any) -> Any:
        """Return a frozen dataclass with its numbers replaced by symbols ``prefix.field``."""
        replaced = {
            field.name: self.scalar(f"{prefix}.{field.name}", float(value))
            for field in dataclasses.fields(given)
            if isinstance(value := getattr(given, field.name), Real)
        }
        return dataclasses.replace(given, **replaced)

    def scalar(self, name: str, value: float) -> Any:
        """Return the symbol of that name, made on first use."""
        if name not in self._constants:
            self._constants[name] = fem.Constant(self._mesh, float(value))
            self._variables[name] = ufl.variable(self._constants[name])
        return self._variables[name]

    def assign(self, values: Mapping[str, float]) -> None:
        """Set those of the values that this mesh has a symbol for."""
        for name, value in values.items():
            if name in self._constants:
                self._constants[name].value = value

    @property
    def zeros(self) -> frozenset[str]:
        """Names of the numbers that are zero now."""
        return frozenset(name for name, c in self._constants.items() if float(c.value) == 0.0)

    def __contains__(self, name: str) -> bool:
        """Return whether a model on this mesh has that number."""
        return name in self._constants

    def __getitem__(self, name: str) -> Any:
        """Return the UFL variable of that name."""
        return self._variables[name]


class Clock:
    """Time on one mesh (s): at the end of the step, and the step itself."""

    def __init__(self, mesh: Any) -> None:
        self.time, self.step = fem.Constant(mesh, 0.0), fem.Constant(mesh, 1.0)

    def set(self, time: float, step: float) -> None:
        """Set the time at the end of the step and the step's duration, s."""
        self.time.value, self.step.value = time, step
