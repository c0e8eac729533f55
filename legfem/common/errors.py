"""What a user is told of what was given: errors, checks that raise them, missing files, doubts of what is unlikely.

What a person can set and start (`Argument`, `Command`) is named without saying how, since each door (the command line,
Python) words it. An error's line is the command's; `InputError.worded` asks another door.
"""

import logging
import math
import shlex
import sys
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Argument:
    """What is given to a run: a command's option, a call's keyword.

    Parameters
    ----------
    name : str
        As a keyword: ``leave_out``.
    value : str, optional
        What to give; None leaves it open.
    """

    name: str
    value: str | None = None

    def __str__(self) -> str:
        """Return the command's option."""
        option = self.name.replace("_", "-")
        return f"--{option}" if self.value is None else f"--{option} {shlex.quote(self.value)}"


@dataclass(frozen=True)
class Command:
    """Something that a person can start.

    Parameters
    ----------
    name : str
        The command's: ``identify``, ``study correction``.
    arguments : tuple of Argument
        How.
    given : str, optional
        File or folder that it takes.
    """

    name: str
    arguments: tuple[Argument, ...] = ()
    given: str | None = None

    def __str__(self) -> str:
        """Return the command."""
        given = [] if self.given is None else [shlex.quote(self.given)]
        return " ".join(["legfem", self.name, *given, *map(str, self.arguments)])


type Door = Callable[[Argument | Command], str]
"""How a door names arguments and commands."""


class Remedy:
    """What to do, as a text that names arguments and commands.

    Parameters
    ----------
    *parts : str, Argument or Command
        The text, in order.
    """

    def __init__(self, *parts: str | Argument | Command) -> None:
        self.parts = parts

    def worded(self, door: Door) -> str:
        """Return the text in a door's words."""
        return "".join(part if isinstance(part, str) else door(part) for part in self.parts)

    def __str__(self) -> str:
        """Return the text in the command's words."""
        return self.worded(str)


class Lack(str):
    """A problem that is no mistake: something isn't stated yet."""

    __slots__ = ()


MISSING = Lack("missing")


class InputError(Exception):
    """Something a user gave is wrong.

    Commands catch it, print its single line and exit with status 2.

    Parameters
    ----------
    source : str, PathLike or Argument
        File or setting at fault.
    field : str or Argument
        Key, column, part, row or value at fault.
    problem : str
        What is wrong; `MISSING`, or another `Lack`, where nothing is.
    remedy : str or Remedy
        What the user can do about it.
    """

    def __init__(
        self, source: str | PathLike[str] | Argument, field: str | Argument, problem: str, remedy: str | Remedy
    ) -> None:
        super().__init__(source, field, problem, remedy)
        self.source = str(source)
        self.field = str(field)
        self.problem = problem
        self.remedy = str(remedy)

    @property
    def unsaid(self) -> bool:
        """Whether something is missing, and nothing is wrong."""
        return isinstance(self.problem, Lack)

    def at(
        self,
        source: str | PathLike[str] | Argument | None = None,
        field: str | Argument | None = None,
        problem: str | None = None,
    ) -> "InputError":
        """Return the same error of another place."""
        old_source, old_field, old_problem, remedy = self.args
        return InputError(source or old_source, field or old_field, problem or old_problem, remedy)

    def worded(self, door: Door) -> "InputError":
        """Return the error with arguments and commands in another door's words; the text's are the command's."""
        source, field, problem, remedy = self.args
        source, field = (door(one) if isinstance(one, Argument) else one for one in (source, field))
        return InputError(source, field, problem, remedy.worded(door) if isinstance(remedy, Remedy) else remedy)

    def __str__(self) -> str:
        """Return ``file: field: what is wrong; remedy`` on one line."""
        line = f"{self.source}: {self.field}: {self.problem}; {self.remedy}"
        return "".join(c if c.isprintable() else "?" for c in " ".join(line.split()))


class UnsolvedError(Exception):
    """What all else rests on couldn't be solved.

    Commands catch it, print its message as one line and exit with status 1.
    """


class ContradictionError(Exception):
    """What a result says contradicts itself: a fault of legfem's.

    Commands print its message as one line and exit with status 3; what was solved is kept.
    """


EXTRAS = {
    "app": ("the app in a browser window", ("nicegui", "tomlkit", "uvicorn")),
    "cluster": ("work on dask's workers", ("bokeh", "dask", "dask_jobqueue", "distributed")),
    "cohort": ("a cohort", ("jax", "numpyro", "statsmodels")),
    "files": ("a file of this kind", ("h5py", "lvm_read", "meshio", "nptdms", "pymatreader", "xlrd")),
    "imaging": ("a scan", ("highdicom", "nibabel", "SimpleITK", "vtk")),
    "study": ("a design of experiments", ("pyDOE3", "SALib", "statsmodels")),
}
"""What needs more than legfem's own dependencies, and the modules, by pyproject.toml's extra that brings them."""


def missing_module(error: ModuleNotFoundError) -> str:
    """Return the line that says how to get a package that isn't installed; raises what is legfem's own fault.

    Raises
    ------
    ModuleNotFoundError
        The error itself, where the missing module is legfem's.
    """
    package = (error.name or "").partition(".")[0]
    if package in ("", "legfem", "studies"):
        raise error
    in_checkout = "in a checkout, begin the command with scripts/in-env, which installs all that it needs"
    for extra, (feature, modules) in EXTRAS.items():
        if package in modules:
            need = f"{feature} needs {package}, which isn't installed for {sys.executable}"
            return f"{need}: pip install 'legfem[{extra}]'; {in_checkout}"
    what = "DOLFINx, which solves the finite elements," if package in ("dolfinx", "ufl", "basix", "ffcx") else package
    return f"{what} isn't installed for {sys.executable}: {in_checkout}; else see docs/install.md"


@contextmanager
def naming(path: str | PathLike[str]) -> Iterator[None]:
    """Name a file or folder in an OSError that names none, as a full disk's."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


Kind = TypeVar("Kind")


class Least(StrEnum):
    """What a number has to be, in the words of an error."""

    POSITIVE = "more than zero"
    ZERO = "zero or more"


AboveZero = Annotated[Kind, Least.POSITIVE]
"""Of a field of a `Checked` class, as ``AboveZero[float]``, or of a tuple of numbers."""
ZeroOrMore = Annotated[Kind, Least.ZERO]


class Checked:
    """A dataclass that refuses what its annotations don't allow: numbers, and other choices than a ``Literal``'s.

    Numbers, alone or in tuples, are `AboveZero` or `ZeroOrMore`, and finite. Symbols of a discretised model pass.
    """

    def __post_init__(self) -> None:
        """Check every field.

        Raises
        ------
        InputError
            If one is something else than its annotation says.
        """
        owner: Any = type(self)
        for name, kind in _annotations(owner).items():
            given, choices = getattr(self, name, None), get_args(kind)
            if get_origin(kind) is Literal and given not in choices:
                raise InputError(owner.__name__, name, f"unknown kind {given!r}", f"choose {' or '.join(choices)}")
            for least in getattr(kind, "__metadata__", ()):
                for number in given if isinstance(given, tuple) else (given,):
                    if not isinstance(number, Real):
                        continue
                    value = float(number)
                    enough = value > 0 or (value == 0 and least is Least.ZERO)
                    if not (enough and math.isfinite(value)):
                        raise InputError(owner.__name__, name, f"is {value:g}", f"give a finite value of {least}")


@cache
def _annotations(owner: Any) -> dict[str, Any]:
    return get_type_hints(owner, include_extras=True)


_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Doubt:
    """Something unlikely; the same four words as an `InputError`.

    Parameters
    ----------
    source : str
        File at fault.
    field : str
        Key, column or part at fault.
    problem : str
        What is unlikely.
    remedy : str
        What to check, and how to mend it.
    kind : str
        The problem without its numbers, under which many are counted; empty where the field says enough.
    effect_on_C10 : float, optional
        Relative change of C10 by it at most, where that is known.
    """

    source: str
    field: str
    problem: str
    remedy: str
    kind: str = ""
    effect_on_C10: float | None = None

    def __str__(self) -> str:
        """Return ``file: field: what is unlikely; remedy`` on one line."""
        return str(self.error())

    def error(self) -> InputError:
        """Return the same as an error, for values that are impossible."""
        return InputError(self.source, self.field, self.problem, self.remedy)

    def refused_if(self, impossible: bool) -> "Iterator[Doubt]":
        """Yield the doubt.

        Raises
        ------
        InputError
            If it is impossible rather than unlikely.
        """
        if impossible:
            raise self.error()
        yield self


@dataclass(frozen=True)
class PhysicalRange:
    """Where a quantity of a leg or a test lies.

    Parameters
    ----------
    what : str
        The quantity, in words.
    unit : str
        Unit of all the numbers.
    usual : tuple of float
        Beyond which a value is doubted.
    possible : tuple of float
        Beyond which it is refused.
    basis : str
        Where the usual range comes from, or what was published.
    units : mapping of str to float
        Units that are taken for the right one, and what a value in one has to be multiplied by.
    published : tuple of float, optional
        Between which it was published.
    remedy : str
        What to do about an unlikely value, beside or without a unit that explains it.
    """

    what: str
    unit: str
    usual: tuple[float, float]
    possible: tuple[float, float]
    basis: str
    units: Mapping[str, float] = field(default_factory=dict)
    published: tuple[float, float] | None = None
    remedy: str = ""

    def doubts(self, source: str | PathLike[str], name: str, value: float, remedy: str = "") -> Iterator[Doubt]:
        """Yield a doubt if a value is unlikely.

        Raises
        ------
        InputError
            If it can't be.
        """
        for found in self.likely(source, name, value, remedy):
            yield from found.refused_if(not self.possible[0] <= value <= self.possible[1])

    def likely(self, source: str | PathLike[str], name: str, value: float, remedy: str = "") -> Iterator[Doubt]:
        """Yield a doubt if a value is unlikely, however impossible it is."""
        low, high = self.usual
        if low <= value <= high:
            return
        unit = f" {self.unit}" if self.unit else ""
        basis = self.basis
        if self.published is not None:
            basis = f"{self.published[0]:g} to {self.published[1]:g}{unit}: {basis}"
        problem = f"{self.what} of {value:.4g}{unit} where {low:g} to {high:g} is usual ({basis})"
        mend = [
            f"if the value is in {other}, multiply it by {factor:g}"
            for other, factor in self.units.items()
            if low <= value * factor <= high
        ]
        mended = " or ".join(filter(None, [*mend[:1], remedy or self.remedy]))
        kind = f"{self.what} of …{unit} where … to … is usual"
        yield Doubt(str(source), name, problem, mended or _CHECK, kind)


_CHECK = "check value and unit"


def log_doubts(doubts: Iterable[Doubt]) -> None:
    """Log doubts, which the commands show at once."""
    for doubt in doubts:
        _log.warning("warning: %s", doubt)


DOUBTFUL = "DOUBTFUL INPUT: "
"""What lines begin with that say a doubt."""


def doubt_lines(doubts: Iterable[Doubt]) -> list[str]:
    """Return doubts as lines for the top of a report."""
    return [f"{DOUBTFUL}{doubt}" for doubt in doubts]


_OTHER_KINDS = (".xlsx", ".xls", ".ods", ".numbers", ".rtf", ".docx", ".json", ".yaml", ".yml")


def remedy_for_missing[Otherwise](path: Path, otherwise: Otherwise) -> str | Otherwise:
    """Return what to do about a missing file, where one beside its place has nearly its name.

    A name in other capitals, of a copy (``subject (1).toml``), or with another ending or one more
    (``subject.toml.txt``).

    Parameters
    ----------
    path : Path
        Where it should be.
    otherwise : str or Remedy
        What to do where there is no such file.
    """
    if not path.parent.is_dir():
        return otherwise
    wanted, stem = _plain(path.name), _plain(path.stem)
    begins = tuple(stem + mark for mark in ". _-(")
    names = sorted(one.name for one in path.parent.iterdir() if one.name.isprintable())
    found = next((n for n in names if _plain(n) == wanted), None) or next(
        (n for n in names if _plain(n).startswith(begins) and not (path.parent / n).is_dir()), None
    )
    if found is None:
        return otherwise
    if _composed(found) == _composed(path.name):
        return f"name {found!r} anew: its accents are encoded in another way"
    if Path(found).suffix.lower() in _OTHER_KINDS:
        return f"save {found!r} as {path.name}"
    return f"rename {found!r} to {path.name}"


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _plain(name: str) -> str:
    return _composed(name).casefold()
