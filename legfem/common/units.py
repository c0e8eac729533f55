"""Units: mm, N, MPa and s inside; kPa where people read and write."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator

MPA_PER_KPA = 1e-3
MPA_PER_MMHG = 133.322387415e-6

type FloatArray = Annotated[
    NDArray[np.floating[Any]],
    # How pydantic reads and writes one: a list, to the last bit.
    PlainValidator(lambda values: np.array(values, dtype=np.float64)),
    PlainSerializer(lambda array: array.tolist()),
]


def kpa_to_mpa[Value: (float, FloatArray)](value: Value) -> Value:
    """Convert a stress from kPa to MPa."""
    return value * MPA_PER_KPA


def mpa_to_kpa[Value: (float, FloatArray)](value: Value) -> Value:
    """Convert a stress from MPa to kPa."""
    return value / MPA_PER_KPA


def mmhg_to_mpa[Value: (float, FloatArray)](value: Value) -> Value:
    """Convert a pressure from mmHg to MPa."""
    return value * MPA_PER_MMHG


def mpa_to_mmhg[Value: (float, FloatArray)](value: Value) -> Value:
    """Convert a pressure from MPa to mmHg."""
    return value / MPA_PER_MMHG


def readable_unit(unit: str) -> tuple[str, float]:
    """Return the unit in which people read numbers of a unit, and the factor to it."""
    return ("kPa", 1 / MPA_PER_KPA) if unit == "MPa" else (unit, 1.0)


def spaced_unit(unit: str) -> str:
    """Return a unit as it stands after its number: nothing of a number that has none (-)."""
    return "" if unit == "-" else f" {unit}"


def runs_of(marks: NDArray[np.generic]) -> list[tuple[int, int]]:
    """Return the first number and the one after the last of each run of equal marks."""
    return list(pairwise([0, *(int(k) + 1 for k in np.flatnonzero(marks[1:] != marks[:-1])), len(marks)]))


def spans_of(sizes: Iterable[int]) -> list[slice]:
    """Return the places of parts of these sizes that stand one after the other."""
    return [slice(*pair) for pair in pairwise(np.cumsum([0, *sizes]))]


def frozen_array(values: object) -> FloatArray:
    """Return a read-only float64 copy, so that raw data can't be changed by accident."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def freeze(given: object, *names: str) -> None:
    """Put read-only copies (`frozen_array`) in place of some arrays of a frozen dataclass."""
    for name in names:
        object.__setattr__(given, name, frozen_array(getattr(given, name)))
