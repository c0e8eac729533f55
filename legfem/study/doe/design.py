"""A design of experiments: its factors and their ranges, its TOML, and its points coded to -1..1."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model
from pyDOE3 import ff2n, lhs

from legfem.common.errors import InputError
from legfem.common.input_files import FileTable, Finite, NotNegative, Positive, Trouble, checked, read_toml
from legfem.common.resources import RESOURCES, resource
from legfem.common.units import MPA_PER_KPA, FloatArray
from legfem.report.estimates import words_of

PAPER, IDENTIFIED = (RESOURCES / "frauziols" / name for name in ("doe.toml", "doe-identified.toml"))
MOST_FACTORS = 8

Coding = Literal["linear", "logarithmic"]
UNITS: Mapping[str, str] = resource("parameters", dict[str, dict[str, Any]])["factors"]
"""Everything that can be a factor, and the unit that it is given in."""
OF_THE_GEOMETRY = ("fascia.thickness", "indenter.diameter")
"""Parameters whose change needs another mesh."""

LONGEST_MM = 200.0
"""Largest factor that is a length."""
DEEPEST_MM = 60.0
"""Deepest press that a leg has room for."""

_TISSUES = {"deep": "deep", "superficial": "fat", "fascia": "fascia"}


@dataclass(frozen=True)
class Factor:
    """One parameter that the design varies.

    Attributes
    ----------
    name : str
        One of `UNITS`.
    low, high : float
        Levels coded -1 and +1, in ``unit``.
    """

    name: str
    low: float
    high: float
    unit: str
    coding: Coding

    @property
    def symbol(self) -> str:
        """Name in a formula and as a table's column."""
        return self.name.replace(".", "_")

    @property
    def label(self) -> str:
        """Name as people read it."""
        return label_of(self.name)

    @property
    def unit_text(self) -> str:
        """Unit as people write it."""
        return "1/MPa" if self.unit == "per_MPa" else self.unit

    def value(self, coded: float) -> float:
        """Value of a coded level, in ``unit``."""
        share = (coded + 1) / 2
        if self.coding == "logarithmic":
            return float(self.low ** (1 - share) * self.high**share)
        return float(self.low * (1 - share) + self.high * share)

    def model_value(self, coded: float) -> float:
        """Value of a coded level, in the model's units."""
        return self.value(coded) * _in_model(self.unit)


def label_of(name: str) -> str:
    """Name of a parameter as people read it."""
    part, _, what = name.partition(".")
    return f"{part} {what}" if name in OF_THE_GEOMETRY else f"{what} {_TISSUES[part]}"


def in_words(name: str) -> str:
    """Return a parameter in a sentence, by its full name."""
    return f"the {label_of(name)}" if name in OF_THE_GEOMETRY else words_of(name)


def factorial_design(factors: int) -> FloatArray:
    """All corners, then the centre: (2^k + 1, k)."""
    return np.vstack([np.asarray(ff2n(factors), dtype=float), np.zeros((1, factors))])


def space_filling_design(factors: int, points: int, seed: int) -> FloatArray:
    """Latin hypercube (points, k) whose points keep apart."""
    if points == 1:
        return np.random.default_rng(seed).uniform(-1, 1, (1, factors))
    unit = lhs(factors, samples=points, criterion="maximin", iterations=200, seed=seed)
    return 2 * np.asarray(unit, dtype=float) - 1


@dataclass(frozen=True)
class Definition:
    """What a study varies and what it looks at.

    Attributes
    ----------
    depth : float
        Greatest displacement, mm.
    windows : tuple
        Stretches of displacement (mm) in which the curve's slope and curvature are taken.
    fixed : mapping
        Parameters that differ from the subject's own, in the model's units.
    nominal : mapping
        Point at which the information is taken, in the model's units; the centre where it isn't given.
    training, testing : int
        Simulations that the emulator learns from beside the design's own (0 leaves it out), and is tested on.
    """

    source: Path
    title: str
    depth: float
    windows: tuple[tuple[float, float], ...]
    factors: tuple[Factor, ...]
    fixed: Mapping[str, float]
    nominal: Mapping[str, float]
    training: int = 80
    testing: int = 20

    @property
    def ends(self) -> list[float]:
        """Depths (mm) at which windows end, each once."""
        return sorted({end for _, end in self.windows})


def _in_model(unit: str) -> float:
    """Return what one of a unit is in the model's: MPa, 1/MPa or mm."""
    return MPA_PER_KPA if unit == "kPa" else 1.0


class _Range(FileTable):
    """Levels of a factor as its table gives them, with its unit in their keys."""

    low: float
    high: float
    coding: Coding | None = None

    def troubles(self) -> Iterator[Trouble]:
        """Yield a range without a width, or reversed."""
        key = str(type(self).model_fields["low"].alias)
        if self.low == self.high:
            yield key, f"has one level only ({self.low:g})", "give two different levels, or move it to [fixed]"
        if self.low > self.high:
            problem = f"its range is reversed (low {self.low:g} is above high {self.high:g})"
            yield key, problem, "exchange them"


def _number(name: str) -> Any:
    # A reduced polynomial with C20 = 0 is neo-Hookean; all else must be positive.
    if name in OF_THE_GEOMETRY:
        return Annotated[Positive, Field(le=LONGEST_MM)]
    return NotNegative if name == "deep.C20" else Positive


def _range_of(name: str) -> Any:
    levels: dict[str, Any] = {side: (_number(name), Field(alias=f"{side}_{UNITS[name]}")) for side in ("low", "high")}
    return create_model("_RangeOf", __base__=_Range, **levels)


_RANGES: dict[str, Any] = {name: (_range_of(name) | None, None) for name in UNITS}
_KEYS = {f"{name}_{unit}": name for name, unit in UNITS.items()}
_VALUES: dict[str, Any] = {key: (_number(name) | None, None) for key, name in _KEYS.items()}
_Ranges = create_model("_Ranges", __base__=FileTable, **_RANGES)
_Values = create_model("_Values", __base__=FileTable, **_VALUES)


MOST_RUNS = 100_000
"""Simulations of a design: a cluster's, for months."""


class _Emulator(FileTable):
    training: Annotated[int, Field(ge=0, le=MOST_RUNS)] = 80
    testing: Annotated[int, Field(ge=0, le=MOST_RUNS)] = 20


Window = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class _File(FileTable):
    title: str | None = None
    depth_mm: Annotated[Positive, Field(le=DEEPEST_MM)] = 30.0
    windows_mm: list[Window] = Field(default=[[0, 5], [5, 20], [20, 30]])
    coding: Coding = "linear"
    factors: _Ranges  # type: ignore[valid-type]
    fixed: _Values = _Values()  # type: ignore[valid-type]
    nominal: _Values = _Values()  # type: ignore[valid-type]
    emulator: _Emulator = _Emulator()

    def troubles(self) -> Iterator[Trouble]:
        """Yield windows beyond the depth, reversed or given twice."""
        for number, (start, end) in enumerate(self.windows_mm, 1):
            if not 0 <= start < end <= self.depth_mm + 1e-9:
                problem = f"{start:g} to {end:g} mm is not a part of 0 to {self.depth_mm:g} mm"
                yield f"windows_mm, number {number}", problem, "give start below end, within depth_mm"
        if len({tuple(window) for window in self.windows_mm}) != max(len(self.windows_mm), 1):
            yield "windows_mm", "must be one or more, all different", "correct it"


def read_definition(path: Path) -> Definition:
    """Read and check a definition.

    Raises
    ------
    InputError
        For a missing file, bad TOML, unknown factors, reversed or empty ranges.
    """
    content = read_toml(path, "a design of experiments")
    given = checked(path, content, _File)
    ranges = {name: getattr(given.factors, name) for name in content["factors"]}  # in the file's order
    factors = tuple(
        Factor(name, found.low, found.high, UNITS[name], found.coding or given.coding) for name, found in ranges.items()
    )
    if not 2 <= len(factors) <= MOST_FACTORS:
        remedy = f"give 2 to {MOST_FACTORS}: a full factorial of k factors takes 2^k + 1 simulations"
        raise InputError(path, "factors", f"there are {len(factors)}", remedy)
    for factor in factors:
        if factor.coding == "logarithmic" and factor.low == 0:
            raise InputError(path, f"factors.{factor.name}", "0 has no logarithm", "give a value above 0")
    fixed = _in_model_units(given.fixed)
    for name in fixed:
        if name in ranges:
            raise InputError(path, f"fixed.{name}", "is a factor too", "remove one of them")
    return Definition(
        path,
        given.title or path.stem,
        given.depth_mm,
        tuple((start, end) for start, end in given.windows_mm),
        factors,
        fixed,
        _in_model_units(given.nominal),
        given.emulator.training,
        given.emulator.testing,
    )


def _in_model_units(given: FileTable) -> dict[str, float]:
    """Parameters written as ``"deep.C10_kPa" = 0.7``, in the model's units."""
    values = given.model_dump(exclude_unset=True)
    return {_KEYS[key]: value * _in_model(UNITS[_KEYS[key]]) for key, value in values.items()}
