"""Factors of a design: a parameter, its range, and how the range is coded to -1..1."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from legfem.common.units import FloatArray

Coding = Literal["linear", "logarithmic"]
Kind = Literal["stiffness", "compressibility", "length"]

UNITS: Mapping[Kind, Mapping[str, float]] = {
    "stiffness": {"kPa": 1e-3, "MPa": 1.0},
    "compressibility": {"per_MPa": 1.0},
    "length": {"mm": 1.0},
}
"""Units that a parameter may be given in, and what one of them is in the model's (MPa, 1/MPa)."""

PARAMETERS: Mapping[str, Kind] = {
    "deep.C10": "stiffness",
    "deep.C20": "stiffness",
    "deep.D1": "compressibility",
    "deep.D2": "compressibility",
    "superficial.C10": "stiffness",
    "superficial.D1": "compressibility",
    "fascia.C10": "stiffness",
    "fascia.D1": "compressibility",
    "fascia.thickness": "length",
    "indenter.diameter": "length",
}
"""Everything that can be a factor."""

OF_THE_GEOMETRY = ("fascia.thickness", "indenter.diameter")
"""Parameters whose change needs another mesh."""

_TISSUES = {"deep": "deep", "superficial": "fat", "fascia": "fascia"}


@dataclass(frozen=True)
class Factor:
    """One parameter that the design varies."""

    name: str
    """One of `PARAMETERS`."""
    low: float
    """In ``unit``; coded -1."""
    high: float
    """In ``unit``; coded +1."""
    unit: str
    coding: Coding

    @property
    def symbol(self) -> str:
        """The name as a formula and a column of a table have it."""
        return symbol_of(self.name)

    @property
    def label(self) -> str:
        """The name as people read it."""
        return label_of(self.name)

    @property
    def unit_text(self) -> str:
        """The unit as people write it."""
        return "1/MPa" if self.unit == "per_MPa" else self.unit

    def value(self, coded: float) -> float:
        """Return the value, in ``unit``, of a coded level."""
        share = (coded + 1) / 2
        if self.coding == "logarithmic":
            return float(self.low ** (1 - share) * self.high**share)
        return float(self.low * (1 - share) + self.high * share)

    def model_value(self, coded: float) -> float:
        """Return the value in the model's units."""
        return self.value(coded) * UNITS[PARAMETERS[self.name]][self.unit]


def symbol_of(name: str) -> str:
    """Return a parameter's name as a formula has it."""
    return name.replace(".", "_")


def label_of(name: str) -> str:
    """Return a parameter's name as people read it."""
    part, _, what = name.partition(".")
    if name in OF_THE_GEOMETRY:
        return f"{part} {what}"
    return f"{what} {_TISSUES[part]}"


def model_values(factors: tuple[Factor, ...], coded: FloatArray) -> dict[str, float]:
    """Return the parameters of one point in the model's units, by name."""
    return {f.name: f.model_value(float(c)) for f, c in zip(factors, coded, strict=True)}
