"""Checks that several parameter classes share."""

from __future__ import annotations

import math
from numbers import Real

from legfem.common.errors import InputError


def check_positive(owner: object, *names: str, zero_allowed: bool = False) -> None:
    """Check attributes of a parameter object; symbols of a discretised model pass.

    Raises
    ------
    InputError
        If one is a number that is negative, not finite, or zero where zero isn't allowed.
    """
    for name in names:
        value = getattr(owner, name)
        if not isinstance(value, Real):
            continue
        number = float(value)
        good = number >= 0 if zero_allowed else number > 0
        if not (good and math.isfinite(number)):
            bound = "zero or more" if zero_allowed else "more than zero"
            raise InputError(
                source=type(owner).__name__,
                field=name,
                problem=f"is {number:g}",
                remedy=f"give a finite value of {bound}",
            )


def check_finite(**options: float | None) -> None:
    """Check options of a command: ``depth=`` is ``--depth``.

    Raises
    ------
    InputError
        If one is not a finite number, which ranges of options let pass.
    """
    for name, value in options.items():
        if value is not None and not math.isfinite(value):
            raise InputError(f"--{name.replace('_', '-')}", f"{value}", "is not a finite number", "give a number")
