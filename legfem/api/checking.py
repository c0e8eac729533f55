"""What a call is given, checked before anything is done: Python lets anything through."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any, get_args

from legfem.common.command_line import check_out_folder
from legfem.common.errors import InputError


def check_whole(name: str, value: object, least: int) -> None:
    """Check that an argument is a whole number, and not below the least.

    Raises
    ------
    InputError
        If it isn't.
    """
    if not isinstance(value, Integral) or value < least:
        raise InputError(name, repr(value), "is no such whole number", f"give one from {least:g} on")


def check_unused(what: str, given: Mapping[str, bool]) -> None:
    """Check that no argument is given that one kind of thing has no use for.

    Parameters
    ----------
    what
        The kind, in words.
    given
        By argument whether it is.

    Raises
    ------
    InputError
        If one is given.
    """
    for name, is_given in given.items():
        if is_given:
            raise InputError(name, "given", f"is of no use for {what}", "leave it out")


def check_folder(name: str, folder: object) -> None:
    """Check that an argument is a folder in which something can be kept; nothing is made.

    Raises
    ------
    InputError
        If it isn't.
    """
    if not isinstance(folder, str | Path):
        raise _of_kind(name, folder, "a folder's path")
    try:
        check_out_folder(Path(folder))
    except InputError as error:
        raise InputError(name, error.field, error.problem, error.remedy) from None


def wrong_mesh(mesh: object, problem: str, remedy: str) -> InputError:
    """Return what is wrong with a call's ``mesh`` that is of another model's elements."""
    return InputError("mesh", mesh if isinstance(mesh, str) else type(mesh).__name__, problem, remedy)


def check_names(name: str, given: object) -> None:
    """Check that an argument is a list of names, and no text.

    Raises
    ------
    InputError
        If it isn't.
    """
    if not isinstance(given, list | tuple) or not all(isinstance(one, str) for one in given):
        raise _of_kind(name, given, "a list of names")


def check_search(parameters: Any, fixed: Any, depth: object, settings: object, out: object, jobs: object) -> None:
    """Check arguments that legs and specimens share.

    Raises
    ------
    InputError
        If one is of another kind than `legfem.identify` says.
    """
    from legfem.inverse.settings import IdentificationSettings, Weighting

    check_whole("jobs", jobs, 1)
    if depth is not None and not (isinstance(depth, Real) and math.isfinite(depth)):
        raise InputError("depth", repr(depth), "is no depth", "give a number of mm")
    if settings is not None:
        if not isinstance(settings, IdentificationSettings):
            raise _of_kind("settings", settings, "legfem.inverse.settings.IdentificationSettings")
        check_whole("settings.seed", settings.seed, 0)
        known = get_args(Weighting)
        if settings.weighting not in (None, *known):
            raise InputError(
                "settings.weighting", repr(settings.weighting), "is unknown", f"give one of {', '.join(known)}, None"
            )
    if out is not None:
        check_folder("out", out)
    free = _checked_names(parameters)
    _check_fixed(fixed)
    for name in fixed or ():
        if name in free:
            raise InputError("fixed", name, "is to be identified too", "leave one of them out")


def _checked_names(parameters: Any) -> set[str]:
    """Return the names of what is to be identified."""
    from legfem.inverse.parameter import Parameter

    listed = "a list of full names or of legfem.inverse.parameter.Parameter"
    if not isinstance(parameters, list | tuple | None):
        raise _of_kind("parameters", parameters, listed)
    names, free = set[str](), set[str]()
    for one in parameters or ():
        if not isinstance(one, str | Parameter):
            raise _of_kind("parameters", one, listed)
        name = one if isinstance(one, str) else one.name
        if name in names:
            raise InputError("parameters", name, "is there twice", "give it once")
        names.add(name)
        if isinstance(one, str) or one.role == "identified":
            free.add(name)
    return free


def _check_fixed(fixed: Any) -> None:
    from legfem.inverse.catalogue import check_held

    if fixed is None:
        return
    if not isinstance(fixed, Mapping):
        raise _of_kind("fixed", fixed, "values by full name, as {'deep.D1': 28.0}")
    for name, value in fixed.items():
        # Without its term of (J - 1)^4 a law has an infinite D2.
        endless = value == math.inf and str(name).endswith(".D2")
        if not isinstance(value, Real) or not (math.isfinite(value) or endless):
            raise InputError(
                "fixed", str(name), f"{value!r} is no value", "give a number in MPa, 1/MPa, N or mm, without its unit"
            )
        check_held("fixed", f"{name}={value:g}", str(name), float(value))


def _of_kind(name: str, given: object, wanted: str) -> InputError:
    return InputError(name, repr(given), "is of another kind", f"give {wanted}")
