"""Arguments of a call: checked before anything is done, and named as calls name them.

Every room names what is wrong by the command's option (``--leave-out``). `in_python_words` stands around the functions
of the front door and names the keyword instead (``leave_out``); the commands call the functions without it.
"""

import functools
import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from numbers import Integral, Real
from pathlib import Path

from legfem.common.command_line import check_out_folder
from legfem.common.errors import InputError, missing_module

_REMEDIES = (
    (r"legfem identify takes it", "load the folder with lf.load_subject"),
    (r"legfem stocking takes it", "load the folder with lf.load_leg"),
    (r"give it as --specimen-dir", "load the folder with lf.load_specimen"),
    (r"\blegfem (identify|diagnose) --model 3d", r'lf.\1(leg, model="3d")'),
    (r"\blegfem (identify|diagnose)\b", r"lf.\1(folder)"),
    (r"--(site|model) ([\w.-]+)", r'\1="\2"'),
    (r"add --identify ([\w.]+), or --fix '[^']*'", r"put \1 into identify or fix"),
    (r"--prior, as in ('[^']*')", r"prior=[\1]"),
    (r"--(prior|site|model|correction)\b", r"\1="),
)


@contextmanager
def in_python_words() -> Iterator[None]:
    """Name a call's keywords where an InputError names a command's options, and say how to get a missing package."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(missing_module(error), name=error.name) from None
    except InputError as error:
        source, field = (_keyword(text) for text in (error.source, error.field))
        remedy = error.remedy
        for option, keyword in _REMEDIES:
            remedy = re.sub(option, keyword, remedy)
        if (source, field, remedy) == (error.source, error.field, error.remedy):
            raise
        raise InputError(source, field, error.problem, remedy) from None


def front[**Given, Found](call: Callable[Given, Found]) -> Callable[Given, Found]:
    """Return a function of the front door: it looks at what it is given before it calls, and says keywords."""

    @functools.wraps(call)
    def called(*args: Given.args, **options: Given.kwargs) -> Found:
        with in_python_words():
            for name, value in options.items():
                _check_kind(name, value)
            return call(*args, **options)

    return called


_TEXTS = frozenset({"do", "law", "layout", "model", "on", "scheduler", "site", "weighting"})
_PATHS = {
    "correction": "a name or a file's path",
    "library": "a folder's path",
    "out": "a folder's path",
    "table": "a file's path",
}
_LISTS = frozenset({"leave_out", "prior", "specimens"})
_PAIRS = frozenset({"c10_bounds", "c20_bounds"})


def _check_kind(name: str, value: object) -> None:
    """Raise an InputError for a keyword's value that is of another kind; None, and what else is looked at, passes."""
    if value is None:
        return
    if name in _TEXTS and not isinstance(value, str):
        raise wrong(name, repr(value), "is no name" if name == "site" else f"is no {name}", "give a text")
    if name in _PATHS and not isinstance(value, str | Path):
        raise of_another_kind(name, value, _PATHS[name])
    if name in _LISTS:
        check_names(name, value)
    if name in _PAIRS and not (
        isinstance(value, list | tuple) and len(value) == 2 and all(isinstance(one, Real) for one in value)
    ):
        raise of_another_kind(name, value, "two numbers of kPa")


def _keyword(text: str) -> str:
    """Return the keyword of an option; what isn't one as it is."""
    if not text.startswith("--"):
        return text
    return text.removeprefix("--").removeprefix("no-").replace("-", "_")


def wrong(name: str, given: object, problem: str, remedy: str) -> InputError:
    """Return what is wrong with an argument, by the option of its name."""
    shown = given if isinstance(given, str) else repr(given)
    return InputError(f"--{name.replace('_', '-')}", shown, problem, remedy)


def check_whole(name: str, value: object, least: int) -> None:
    """Raise an InputError for what is no whole number, or below the least."""
    if not isinstance(value, Integral) or value < least:
        raise wrong(name, repr(value), "is no such whole number", f"give one from {least:g} on")


_LAST_SEED = 2**32 - 1
"""The greatest that generators of all libraries take."""


def check_seed(value: object) -> None:
    """Raise an InputError for what no generator of random numbers begins with."""
    check_whole("seed", value, 0)
    if int(value) > _LAST_SEED:  # type: ignore[call-overload]
        raise wrong("seed", repr(value), "is too large", f"give one up to {_LAST_SEED}")


def check_finite(name: str, value: object, unit: str = "mm") -> None:
    """Raise an InputError for what is no finite number; None is none."""
    if value is not None and not (isinstance(value, Real) and math.isfinite(value)):
        raise wrong(name, repr(value), f"is no {name}", f"give a number of {unit}")


def check_one_of(name: str, value: object, known: tuple[str, ...]) -> None:
    """Raise an InputError for what isn't among the known; None is none."""
    if value is not None and value not in known:
        raise wrong(name, repr(value), f"unknown {name}", f"give one of {', '.join(known)}")


def check_names(name: str, given: object) -> None:
    """Raise an InputError for what is no list of texts; a text is none."""
    if not isinstance(given, list | tuple) or not all(isinstance(one, str) for one in given):
        raise of_another_kind(name, given, "a list of texts")


def check_folder(name: str, folder: object) -> None:
    """Raise an InputError for what is no folder in which something can be kept; nothing is made."""
    if not isinstance(folder, str | Path):
        raise of_another_kind(name, folder, "a folder's path")
    try:
        check_out_folder(Path(folder))
    except InputError as error:
        raise wrong(name, error.field, error.problem, error.remedy) from None


def check_unused(what: str, given: Mapping[str, bool]) -> None:
    """Raise an InputError for an argument that is given, and that ``what`` has no use for."""
    for name, is_given in given.items():
        if is_given:
            raise wrong(name, "given", f"is of no use for {what}", "leave it out")


def of_another_kind(name: str, given: object, wanted: str) -> InputError:
    """Return what is wrong with an argument of another type than ``wanted``, which is in words."""
    return wrong(name, repr(given), "is of another kind", f"give {wanted}")
