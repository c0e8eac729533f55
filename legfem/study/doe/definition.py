"""The definition of a design of experiments, read from TOML."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from legfem.common.errors import InputError
from legfem.common.input_files import read_toml
from legfem.data.folder import RESOURCES
from legfem.study.doe.factors import PARAMETERS, UNITS, Coding, Factor

PAPER, IDENTIFIED = (RESOURCES / "frauziols" / name for name in ("doe.toml", "doe-identified.toml"))
MOST_FACTORS = 8

_KEYS = ("title", "depth_mm", "windows_mm", "coding", "factors", "fixed", "nominal", "emulator")
_POSITIVE = "give a value above 0"


@dataclass(frozen=True)
class Definition:
    """What a study varies and what it looks at."""

    source: Path
    title: str
    depth: float
    """mm."""
    windows: tuple[tuple[float, float], ...]
    """Of displacement (mm) in which the curve's slope and curvature are taken."""
    factors: tuple[Factor, ...]
    fixed: Mapping[str, float]
    """Parameters that differ from the subject's own, in the model's units."""
    nominal: Mapping[str, float]
    """Where the information is taken, in the model's units; the centre where it isn't given."""
    training: int = 80
    """Simulations that the emulator learns from beside the design's own; 0 leaves it out."""
    testing: int = 20
    """Simulations that it is tested on."""


def read_definition(path: Path) -> Definition:
    """Read and check a definition.

    Raises
    ------
    InputError
        For a missing file, bad TOML, unknown factors, reversed or empty ranges.
    """
    given = read_toml(path, "a design of experiments")
    _check_keys(path, "", given, _KEYS)
    depth = _number(path, "depth_mm", given.get("depth_mm", 30.0))
    coding = _coding(path, "coding", given.get("coding", "linear"))
    entries = _table(path, "factors", given.get("factors"))
    factors = tuple(_factor(path, name, entry, coding) for name, entry in entries.items())
    if not 2 <= len(factors) <= MOST_FACTORS:
        raise InputError(
            path,
            "factors",
            f"there are {len(factors)}",
            f"give 2 to {MOST_FACTORS}: a full factorial of k factors takes 2^k + 1 simulations",
        )
    fixed = _values(path, "fixed", given.get("fixed", {}))
    for name in fixed:
        if name in entries:
            raise InputError(path, f"fixed.{name}", "is a factor too", "remove one of them")
    emulator = _table(path, "emulator", given.get("emulator", {}))
    _check_keys(path, "emulator.", emulator, ("training", "testing"))
    return Definition(
        path,
        str(given.get("title", path.stem)),
        depth,
        _windows(path, given.get("windows_mm", [[0, 5], [5, 20], [20, 30]]), depth),
        factors,
        fixed,
        _values(path, "nominal", given.get("nominal", {})),
        _count(path, "emulator.training", emulator.get("training", 80)),
        _count(path, "emulator.testing", emulator.get("testing", 20)),
    )


def _factor(path: Path, name: str, entry: Any, coding: Coding) -> Factor:
    field = f"factors.{name}"
    _check_name(path, field, name)
    entry = _table(path, field, entry)
    units = UNITS[PARAMETERS[name]]
    known = [f"{side}_{unit}" for unit in units for side in ("low", "high")]
    _check_keys(path, f"{field}.", entry, [*known, "coding"])
    found = [unit for unit in units if f"low_{unit}" in entry or f"high_{unit}" in entry]
    if len(found) != 1:
        raise InputError(path, field, "needs its range in one unit", f"give {' and '.join(known[:2])}")
    unit = found[0]
    for side in ("low", "high"):
        if f"{side}_{unit}" not in entry:
            raise InputError(path, f"{field}.{side}_{unit}", "missing", "a factor has a low and a high level")
    low, high = (_number(path, f"{field}.{s}_{unit}", entry[f"{s}_{unit}"]) for s in ("low", "high"))
    coding = _coding(path, f"{field}.coding", entry.get("coding", coding))
    if low == high:
        raise InputError(
            path, field, f"has one level only ({low:g} {unit})", "give two different levels, or move it to [fixed]"
        )
    if low > high:
        raise InputError(
            path, field, f"its range is reversed (low {low:g} is above high {high:g} {unit})", "exchange them"
        )
    # A reduced polynomial with C20 = 0 is neo-Hookean; all else must be positive.
    if low < 0 or (low == 0 and (name != "deep.C20" or coding == "logarithmic")):
        raise InputError(path, f"{field}.low_{unit}", f"{low:g} is out of range", _POSITIVE)
    return Factor(name, low, high, unit, coding)


def _values(path: Path, field: str, given: Any) -> dict[str, float]:
    """Return parameters written as ``"deep.C10_kPa" = 0.7`` in the model's units."""
    values = {}
    for key, entry in _table(path, field, given).items():
        name, _, unit = key.partition("_")
        _check_name(path, f"{field}.{key}", name)
        units = UNITS[PARAMETERS[name]]
        if unit not in units:
            raise InputError(
                path,
                f"{field}.{key}",
                "has no unit in its name",
                f"write {' or '.join(f'{name}_{unit}' for unit in units)}, in quotes",
            )
        value = _number(path, f"{field}.{key}", entry)
        if value < 0 or (value == 0 and name != "deep.C20"):
            raise InputError(path, f"{field}.{key}", f"{value:g} is out of range", _POSITIVE)
        values[name] = value * units[unit]
    return values


def _windows(path: Path, given: Any, depth: float) -> tuple[tuple[float, float], ...]:
    windows = []
    for number, pair in enumerate(given if isinstance(given, list) else [given], 1):
        field = f"windows_mm, number {number}"
        if not isinstance(pair, list) or len(pair) != 2:
            raise InputError(path, field, f"{pair!r} is no pair", "write [start, end]")
        start, end = (_number(path, field, value) for value in pair)
        if not 0 <= start < end <= depth + 1e-9:
            raise InputError(
                path,
                field,
                f"{start:g} to {end:g} mm is no part of 0 to {depth:g} mm",
                "give start below end, within depth_mm",
            )
        windows.append((start, end))
    if not windows or len(set(windows)) < len(windows):
        raise InputError(path, "windows_mm", "must be one or more, all different", "correct it")
    return tuple(windows)


def _check_name(path: Path, field: str, name: str) -> None:
    if name in PARAMETERS:
        return
    near = difflib.get_close_matches(name, PARAMETERS, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(PARAMETERS)}"
    raise InputError(path, field, "unknown factor", hint)


def _check_keys(path: Path, prefix: str, given: Mapping[str, Any], known: Any) -> None:
    for key in given:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f"did you mean '{near[0]}'?" if near else f"known keys: {', '.join(known)}"
            raise InputError(path, f"{prefix}{key}", "unknown key", hint)


def _table(path: Path, field: str, given: Any) -> dict[str, Any]:
    if given is None:
        raise InputError(path, field, "missing", 'add, for example, [factors."deep.C10"]')
    if not isinstance(given, dict):
        raise InputError(path, field, f"{given!r} is no table", f"write [{field}] (dots in quotes)")
    return given


def _number(path: Path, field: str, given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        raise InputError(path, field, f"{given!r} is not a finite number", "write a number")
    return float(given)


def _count(path: Path, field: str, given: Any) -> int:
    if isinstance(given, bool) or not isinstance(given, int) or given < 0:
        raise InputError(path, field, f"{given!r} is no number of simulations", "give 0 or more")
    return given


def _coding(path: Path, field: str, given: Any) -> Coding:
    for name in get_args(Coding):
        if given == name:
            return name  # type: ignore[no-any-return]
    raise InputError(path, field, f"unknown value {given!r}", "use 'linear' or 'logarithmic'")
