"""What a call is about, by id or by its folder, and its arguments, checked before anything is done.

Every room names arguments and commands as values (`legfem.common.errors`). `in_python_words` stands around the
functions of the front door and says keywords (``leave_out``); the commands call the functions without it.
"""

import functools
import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from legfem.common.command_line import check_out_folder
from legfem.common.errors import Argument, Command, Door, InputError, Remedy, log_doubts, missing_module
from legfem.data.folder import Catalogue
from legfem.legs import loading as of_legs
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS, site_names
from legfem.legs.subject import SitedLeg, Subject

if TYPE_CHECKING:
    from typing_extensions import TypeIs

    from legfem.specimens.folder import SpecimenFolder
    from legfem.stockings.leg import StockingLeg


_REPEATED = frozenset({"fix", "identify", "leave_out", "prior", "specimens"})


def in_python(part: Argument | Command) -> str:
    """Return an argument or a command as a call has it; a `legfem.common.errors.Door`."""
    if isinstance(part, Argument):
        if not part.value:
            return part.name
        return f'{part.name}=["{part.value}"]' if part.name in _REPEATED else f'{part.name}="{part.value}"'
    if part.name not in ("identify", "diagnose", "stocking", "cohort"):
        return str(part)
    return f"lf.{part.name}({', '.join(['leg' if part.arguments else 'folder', *map(in_python, part.arguments)])})"


@contextmanager
def in_python_words() -> Iterator[None]:
    """Say an InputError as a call does, and how to get a missing package."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(missing_module(error), name=error.name) from None
    except InputError as error:
        raise error.worded(in_python) from None


class _LoadWith(Remedy):
    """Another function that loads such a folder; commands are told otherwise."""

    def __init__(self, function: str, *otherwise: str | Argument | Command) -> None:
        super().__init__(*otherwise)
        self.function = function

    def worded(self, door: Door) -> str:
        """Return the text in a door's words."""
        return f"load the folder with lf.{self.function}" if door is in_python else super().worded(door)


def front[**Given, Found](call: Callable[Given, Found]) -> Callable[Given, Found]:
    """Return a function of the front door, which says keywords."""

    @functools.wraps(call)
    def called(*args: Given.args, **options: Given.kwargs) -> Found:
        # A number is an id for whoever writes it.
        known: Any = (f"{args[0]}", *args[1:]) if args and type(args[0]) is int else args
        with in_python_words():
            return call(*known, **options)

    return called


@dataclass(frozen=True)
class Wanted:
    """What an argument is, in its annotation, for whoever gave something else."""

    remedy: str
    problem: str = "is of another kind"


type Folder = Annotated[str | Path, Wanted("give a folder's path")]
type Texts = Annotated[Sequence[str] | None, Wanted("give a list of texts")]
type Pair = Annotated[tuple[float, float], Field(strict=False), Wanted("give two numbers of kPa")]
type Jobs = Annotated[int, Field(ge=1), Wanted("give a whole number from 1")]
type Seed = Annotated[int, Field(ge=0, le=2**32 - 1), Wanted("give a whole number from 0 to 4294967295")]
"""What generators of random numbers of all libraries take."""
type Depth = Annotated[float, Field(allow_inf_nan=False), Wanted("give a number of mm", "is not a depth")]


def checked[**Given, Found](call: Callable[Given, Found]) -> Callable[Given, Found]:
    """Return a function that raises an InputError for an argument that isn't what its annotation says.

    What is annotated by a text, as classes that are imported where they are needed, is looked at by the function.
    """
    signature = inspect.signature(call)

    @functools.wraps(call)
    def called(*args: Given.args, **options: Given.kwargs) -> Found:
        for name, value in signature.bind(*args, **options).arguments.items():
            check_kind(name, value, signature.parameters[name].annotation)
        return call(*args, **options)

    return called


def check_kind(name: str, value: object, kind: Any) -> None:
    """Raise an InputError for an argument that isn't of a kind; a number of NumPy's is as good as Python's."""
    if isinstance(kind, str):
        return
    try:
        _adapter(kind).validate_python(value.item() if isinstance(value, np.generic) else value)
    except ValidationError as error:
        problem, remedy = _told(name, kind)
        beyond = error.errors()[0]["type"].startswith(("greater", "less"))
        raise wrong(name, repr(value), "is not possible here" if beyond else problem, remedy) from None


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind, config=ConfigDict(strict=True, arbitrary_types_allowed=True))


def _told(name: str, kind: Any) -> tuple[str, str]:
    """Return problem and remedy of an argument that isn't of a kind."""
    parts = list(_parts(kind))
    if said := next((one for one in parts if isinstance(one, Wanted)), None):
        return said.problem, said.remedy
    choices = [one for one in parts if isinstance(one, str)]
    if choices:
        return f"unknown {name}", f"give {'one of ' * (len(choices) > 1)}{', '.join(choices)}"
    words = {bool: "True or False", str: "a text"}
    return Wanted("").problem, f"give {next((words[one] for one in parts if one in words), 'what its help says')}"


def _parts(kind: Any) -> Iterator[Any]:
    """Yield what an annotation is made of."""
    yield kind
    for one in get_args(getattr(kind, "__value__", kind)):
        yield from _parts(one)


def wrong(name: str, given: object, problem: str, remedy: str | Remedy) -> InputError:
    """Return what is wrong with an argument."""
    return InputError(Argument(name), given if isinstance(given, str) else repr(given), problem, remedy)


def seconds_of(name: str, given: str | None) -> float | None:
    """Return a time such as ``30s`` or ``2min`` in seconds; InputError for what is none."""
    if given is None:
        return None
    import pandas as pd

    try:
        found = float(pd.Timedelta(given).total_seconds())
    except ValueError:
        found = math.nan
    if not found > 0.0:
        raise wrong(name, repr(given), "is not a time", "give one such as 30s or 2min")
    return found


def check_folder(name: str, folder: str | Path | None) -> None:
    """Raise an InputError for what is no folder in which something can be kept; nothing is made. None is none."""
    try:
        if folder is not None:
            check_out_folder(Path(folder))
    except InputError as error:
        raise wrong(name, error.field, error.problem, error.remedy) from None


def check_unused(what: str, given: Mapping[str, bool]) -> None:
    """Raise an InputError for an argument that is given, and that ``what`` has no use for."""
    for name, is_given in given.items():
        if is_given:
            raise wrong(name, "given", f"has no effect for {what}", "leave it out")


type Given = str | Path
"""Id of a subject that comes with legfem, or the path of a folder."""
type Tested = Subject | SitedLeg | SpecimenFolder
_TAKEN_BY = {
    "subject.toml": _LoadWith("load_subject", Command("identify"), " takes it"),
    "leg.toml": _LoadWith("load_leg", Command("stocking"), " takes it"),
    "specimen.toml": _LoadWith("load_specimen", "give it as ", Argument("specimen_dir")),
}


def load_subject(subject: Given, site: str = "") -> Subject:
    """Load a leg that was indented.

    Parameters
    ----------
    subject : str or Path
        Id of a subject that comes with legfem (``"1"`` to ``"4"``), or the path of a folder.
    site : str
        Name of the one to load, of a leg with several ``[[site]]``; `load_sites` loads all.

    Raises
    ------
    InputError
        If there is no such subject, or anything in the folder is missing or wrong.

    Examples
    --------
    >>> import legfem as lf
    >>> leg = lf.load_subject("3")  # or the path of a folder
    >>> leg.section, leg.recordings  # a notebook shows what they look like
    """
    loaded = of_legs.load_subject(folder_of(subject, SUBJECTS), need_instrument=False, site=site)
    log_doubts(doubts_about(loaded))
    return loaded


def load_sites(leg: Given) -> SitedLeg:
    """Load all sites of a leg that was indented at several, to be identified together.

    Parameters
    ----------
    leg : str or Path
        The path of a folder whose ``subject.toml`` has ``[[site]]``.

    Raises
    ------
    InputError
        If the leg has no ``[[site]]``, or anything in the folder is missing or wrong.

    Examples
    --------
    >>> import legfem as lf
    >>> leg = lf.load_sites("legs/pressed-at-two-sites")
    >>> lf.identify(leg)
    """
    folder = folder_of(leg, SUBJECTS)
    loaded = of_legs.load_sites(folder)
    if loaded is None:
        raise InputError(folder / SUBJECTS.file, "site", "the leg has none", "load it with load_subject")
    for site in loaded.sites:
        log_doubts(doubts_about(site))
    return loaded


def are_specimens(given: object) -> "TypeIs[SpecimenFolder]":
    """Tell specimens from all else; who gives a leg doesn't load what is theirs."""
    if isinstance(given, Subject | SitedLeg | str | Path):
        return False
    from legfem.specimens.folder import SpecimenFolder

    return isinstance(given, SpecimenFolder)


def opened(given: Tested | Given, site: str = "") -> Tested:
    """Return what is to be identified: a leg, one of its sites, all of them, or specimens.

    Raises
    ------
    InputError
        If there is no such folder or site, or what is given is none of these.
    """
    if isinstance(given, str | Path):
        if (Path(given) / "specimen.toml").is_file() and not (Path(given) / SUBJECTS.file).exists():
            return load_specimen(given)
        several = not site and site_names(SUBJECTS.opened(folder_of(given, SUBJECTS)))
        return load_sites(given) if several else load_subject(given, site)
    if are_specimens(given):
        return given
    if not isinstance(given, Subject | SitedLeg):
        raise not_a_leg(given, "was indented", "load_subject or load_sites")
    if not site:
        return given
    sites = given.sites if isinstance(given, SitedLeg) else (given,)
    for one in sites:
        if one.site == site:
            return one
    names = ", ".join(one.site for one in sites if one.site)
    remedy = f"give one of {names}" if names else "leave it out: the leg has none"
    raise wrong("site", site, "is not a site of the leg", remedy)


def named(subject: str | None, subject_dir: Path | None, specimen_dir: Path | None, site: str | None) -> Tested:
    """Return what a command's options name: a leg, one of its sites, all of them, or specimens.

    Raises
    ------
    InputError
        If none or several are named, or anything in the folder is missing or wrong.
    """
    if specimen_dir is None:
        return opened(SUBJECTS.named(subject, subject_dir), site or "")
    if subject is None and subject_dir is None:
        return load_specimen(specimen_dir)
    raise InputError(Argument("subject"), Argument("specimen_dir"), "is given as well", "leave one out")


def one_of(leg: Subject | SitedLeg | Given, site: str = "") -> Subject:
    """Return a leg that was indented at one place, or one of its sites.

    Raises
    ------
    InputError
        As `opened` does, and if there are several sites and none is named.
    """
    if isinstance(leg, str | Path):
        return load_subject(leg, site)
    found = opened(leg, site)
    if isinstance(found, SitedLeg):
        names = ", ".join(each.site for each in found.sites)
        problem = f"the leg has {len(found.sites)} ({names}), and here one is taken"
        raise wrong("site", "missing", problem, Remedy("give ", Argument("site", found.sites[0].site)))
    assert isinstance(found, Subject)
    return found


def load_specimen(folder: Given) -> "SpecimenFolder":
    """Load specimens that were tested in a lab: a ball, a punch, a cup, plates, a bar ...

    Parameters
    ----------
    folder : str or Path
        That holds ``specimen.toml`` and recordings.

    Raises
    ------
    InputError
        If anything in the folder is missing or wrong; a recording that can't be used stands in
        ``left_out``.

    Examples
    --------
    >>> import legfem as lf
    >>> specimens = lf.load_specimen("examples/specimen")
    >>> specimens.recordings, specimens.left_out
    """
    from legfem.specimens.folder import load_specimen as load_specimen_folder

    _check_path(folder)
    _check_folder_kind(Path(folder), "specimen.toml")
    loaded = load_specimen_folder(Path(folder))
    log_doubts(loaded.doubts)
    return loaded


def load_leg(leg: Given, cells: int | None = None) -> "StockingLeg":
    """Load a leg that was scanned with and without a stocking, or measured by a tape.

    Parameters
    ----------
    leg : str or Path
        Id of a leg that comes with legfem (``"1"`` to ``"6"``), or the path of a folder.
    cells : int, optional
        Tetrahedra that it will be meshed with, to be told early if it can't be.

    Raises
    ------
    InputError
        If there is no such leg, or anything in the folder is missing or wrong.

    Examples
    --------
    >>> import legfem as lf
    >>> leg = lf.load_leg("1")
    >>> leg.stocking, leg.tissues
    """
    from legfem.stockings import loading as of_stockings

    loaded = of_stockings.load_leg(folder_of(leg, of_stockings.LEGS), cells=cells)
    log_doubts(loaded.doubts)
    return loaded


def folder_of(given: Given, catalogue: Catalogue) -> Path:
    """Return the folder of an id, or the one that is given.

    Raises
    ------
    InputError
        If there is none, or it is one of another kind.
    """
    _check_path(given)
    if isinstance(given, str) and given in catalogue.names:
        return catalogue.find(given)
    if not Path(given).is_dir():
        known = ", ".join(catalogue.names)
        raise InputError(str(given), "subject", "not found", f"give one of {known}, or the path of a folder")
    folder = Path(given)
    _check_folder_kind(folder, catalogue.file)
    return folder


def not_a_leg(given: object, that: str, loaders: str) -> InputError:
    """Return what is wrong with what was given for a leg that something was done with."""
    remedy = f"give an id, a folder, or what {loaders} returned"
    return InputError("leg", type(given).__name__, f"is not a leg that {that}", remedy)


def _check_path(given: object) -> None:
    if not isinstance(given, str | Path):
        raise InputError("folder", type(given).__name__, "is not a path", "give an id, or the path of a folder")


def _check_folder_kind(folder: Path, wanted: str) -> None:
    for file, remedy in _TAKEN_BY.items():
        if (folder / file).exists() and not (folder / wanted).exists():
            raise InputError(folder, file, f"is there, and no {wanted}", remedy)
