"""Finished work on disk under a key of all it depends on, inputs and code: a rerun does only what isn't there yet.

States of a long solution are kept too, from which it goes on where it was killed. Every rank writes its own part, so
that a solution goes on with as many ranks as it was begun with. A part has the step's number in its name, and the first
rank names the last step of which all parts are there: neither a kill nor another solution's files are ever taken for a
state.

Each file begins with a digest of the rest, which is checked when it is read: what changed on the disk is absent.
"""

import ast
import hashlib
import io
import json
import logging
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from legfem.common.documents import Contents, package_version, write_atomically
from legfem.common.progress import Progress
from legfem.common.resources import resource
from legfem.jobs.pool import Workers

if TYPE_CHECKING:
    from mpi4py import MPI


def key_of(*given: object) -> str:
    """Return a hash of values: JSON's, dataclasses, arrays, `Contents` of files.

    Floats and arrays count to the last bit, dataclasses by their names and the fields that they
    are made from.

    Raises
    ------
    TypeError
        For a value of which nobody knows what it depends on. So is a path: say `Contents` of it,
        or ``str``.
    """
    return hashlib.sha256(json.dumps([_described(value) for value in given]).encode()).hexdigest()[:24]


def _described(value: Any) -> Any:
    """Return a value as JSON types that differ where the value does."""
    if value is None or isinstance(value, bool | str | int):
        return value
    if isinstance(value, Enum):
        return _described(value.value)
    if isinstance(value, np.generic):
        return _described(value.item())
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value).tobytes()
        return [value.dtype.str, list(value.shape), hashlib.sha256(data).hexdigest()]
    if isinstance(value, Contents):
        return value.digest()
    if isinstance(value, Mapping):
        entries = [[_described(name), _described(entry)] for name, entry in value.items()]
        return {"mapping": sorted(entries, key=json.dumps)}
    if isinstance(value, Set):
        return {"set": sorted((_described(entry) for entry in value), key=json.dumps)}
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [_described(entry) for entry in value]
    if is_dataclass(value) and not isinstance(value, type):
        made_from = [field.name for field in fields(value) if field.init]
        return {type(value).__qualname__: {n: _described(getattr(value, n)) for n in made_from}}
    raise TypeError(f"no key can be made of {type(value).__qualname__}")


_ROOT = Path(__file__).resolve().parents[2]


@cache
def code_fingerprint(*modules: str) -> str:
    """Return a hash of modules, all of legfem that they import, the tables these read, and the solvers' versions.

    Comments and docstrings don't count: they change no number.

    Parameters
    ----------
    modules
        Full names, for example ``legfem.experiments.plane_strain``.
    """
    digest = hashlib.sha256()
    for package in ("fenics-dolfinx", "petsc4py", "gmsh"):
        digest.update(package_version(package).encode())
    found, waiting = set[str](), list(modules)
    while waiting:
        name = waiting.pop()
        if name not in found and _file(name) is not None:
            found.add(name)
            waiting += _read(name)[1]
    for name in sorted(found):
        digest.update(_read(name)[0])
    return digest.hexdigest()[:16]


def _file(name: str) -> Path | None:
    if name.partition(".")[0] not in ("legfem", "studies"):
        return None
    path = _ROOT.joinpath(*name.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return file
    return None


@cache
def _read(name: str) -> tuple[bytes, list[str]]:
    """Return a module's name, code without texts that stand as statements, and tables; and what it may import."""
    file = _file(name)
    assert file is not None
    text = file.read_text(encoding="utf-8")
    tree, imported = ast.parse(text), []
    for node in _statements(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [
                entry
                for entry in node.body
                if not (isinstance(entry, ast.Expr) and isinstance(entry.value, ast.Constant))
            ]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            imported += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
    tables = [str(resource(table, dict[str, Any])) for table in re.findall(r'\bresource\("([\w/]+)"', text)]
    return "".join([name, ast.dump(tree), *tables]).encode(), imported


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield a tree and all statements within; expressions, of which most of it is, hold none."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, name, ())


_log = logging.getLogger(__name__)


def _write(path: Path, content: bytes) -> None:
    """Write a file, which begins with the digest of its content."""
    write_atomically(path, _head(content) + content)


def _content(path: Path) -> bytes:
    """Return a file's content; nothing where it is missing, and where it isn't what was written, which is said."""
    try:
        head, end, content = path.read_bytes().partition(b"\n")
    except OSError:
        return b""
    if head + end == _head(content):
        return content
    _say_changed(path.parent)
    return b""


def _head(content: bytes) -> bytes:
    """Return what a JSON object begins with, so that one without its first brace can follow; 16 bytes are enough."""
    return b'{"digest": "%b",\n' % hashlib.blake2b(content, digest_size=16).hexdigest().encode()


@cache
def _say_changed(folder: Path) -> None:
    _log.warning("%s: not all that is kept there is as legfem wrote it: what isn't, is done anew", folder)


class Store[Kept]:
    """A folder of finished work, one JSON file each, under a key of all that it depends on.

    What is kept comes back to the last bit, NaN and infinity too. A file that is cut short or changed, or that
    belongs to other inputs, settings, code or versions of DOLFINx, PETSc or gmsh, counts as absent.

    Parameters
    ----------
    folder : Path
        Made when the first piece is kept.
    kind : type
        Type of a finished piece: a dataclass, or a type of lists, mappings and numbers.
    depends_on : object
        What all pieces depend on; see `key_of`.
    modules : sequence of str
        The modules that compute a piece; they count with all of legfem that they import.
    named : callable, optional
        Returns a piece's file name, without ending, from what is asked for; the key by default.
        A named file is overwritten once its key is another.
    """

    def __init__(
        self,
        folder: Path,
        kind: type[Kept],
        depends_on: object = None,
        modules: Sequence[str] = (),
        named: Callable[[Any], str] | None = None,
    ) -> None:
        self.folder, self.named = folder, named
        self.kind: Any = kind
        self._common = key_of(depends_on, code_fingerprint(*modules))

    def key(self, asked: object) -> str:
        """Return the key of a piece of work, done or not."""
        return key_of(self._common, asked)

    def path(self, asked: object) -> Path:
        """Return the file of a piece of work, there or not."""
        return self.folder / f"{self.named(asked) if self.named else self.key(asked)}.json"

    def get(self, asked: object) -> Kept | None:
        """Return a finished piece; None if there is none that can be read."""
        document = json.loads(b"{" + (_content(self.path(asked)) or b"}"))
        if document.get("key") != self.key(asked):
            return None
        try:
            kept: Kept = _adapter(self.kind).validate_python(document["kept"])
        except ValueError:  # of a kind that has other fields by now
            return None
        return kept

    def put(self, asked: object, kept: Kept) -> None:
        """Write a finished piece; it is there whole or not at all."""
        self.folder.mkdir(parents=True, exist_ok=True)
        document = {"key": self.key(asked), "kept": _adapter(self.kind).dump_python(kept)}
        _write(self.path(asked), json.dumps(document, default=np.generic.item)[1:].encode())

    def get_or_make(
        self,
        asked: object,
        make: Callable[[], Kept],
        comm: "MPI.Intracomm | None" = None,
        worth: Callable[[Kept], bool] = lambda kept: True,
    ) -> Kept:
        """Return a finished piece; if it is absent, make it, and keep it if it is worth that.

        Collective over a communicator, whose first rank alone reads and writes; without one this process does.
        """
        first = comm is None or comm.rank == 0
        kept = self.get(asked) if first else None
        kept = kept if comm is None else comm.bcast(kept)
        if kept is None:
            kept = make()
            if first and worth(kept):
                self.put(asked, kept)
        return kept


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def finish[Context, Task, Outcome](
    workers: Workers[Context, Task, Outcome],
    tasks: Sequence[Task],
    store: Store[Outcome] | None,
    progress: Progress,
    stage: str,
    line: Callable[[Task, Outcome], str],
    asked: Callable[[Task], object] = lambda task: task,
    worth: Callable[[Outcome], bool] = lambda outcome: True,
    on_found: Callable[[dict[int, Outcome]], None] = lambda found: None,
) -> list[Outcome]:
    """Return the outcomes of all tasks, in their order, each kept as soon as it is known.

    Parameters
    ----------
    workers, tasks
        Tasks, and the processes for those without an outcome in the store.
    store
        Where outcomes are kept; they aren't without it.
    progress
        Where the stage and every new outcome are reported.
    stage, line
        Text of the stage, and function from a task and its outcome to a line of progress.
    asked
        Function from a task to what the store knows it by.
    worth
        Tells whether to keep an outcome; others are tried again the next time.
    on_found
        Called with all outcomes so far, by place in the list: those that are kept, and whenever there is a new one.
    """
    kept = ((place, store.get(asked(task)) if store else None) for place, task in enumerate(tasks))
    found = {place: outcome for place, outcome in kept if outcome is not None}
    waiting = [place for place in range(len(tasks)) if place not in found]
    on_found(found)
    known = f" ({len(found)} known)" if found else ""
    progress.stage(stage + known, len(waiting))
    todo = [tasks[place] for place in waiting]
    for number, outcome in workers.places(todo) if todo else ():
        if store and worth(outcome):
            store.put(asked(todo[number]), outcome)
        found[waiting[number]] = outcome
        progress.advance(line(todo[number], outcome))
        on_found(found)
    return [found[place] for place in range(len(tasks))]


type Arrays = dict[str, NDArray[Any]]


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]], compressed: bool = False) -> None:
    """Write arrays by name (``.npz`` after a digest of it); a reader never meets half of them."""
    content = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(content, **arrays)  # type: ignore[arg-type]
    _write(path, content.getvalue())


def read_arrays(path: Path) -> Arrays:
    """Return a file's arrays; none where it is missing or isn't as it was written."""
    content = _content(path)
    return dict(np.load(io.BytesIO(content))) if content else {}


@dataclass
class Checkpoint:
    """A folder for the states of one solution.

    Parameters
    ----------
    folder
        Made where it is missing; `clear` empties it.
    key
        Hash of the solution's inputs; states of another one are passed over.
    comm
        Ranks that the solution is spread over.
    seconds
        Least time between states, s.
    """

    folder: Path
    key: str
    comm: "MPI.Intracomm"
    seconds: float = 120.0
    _last: float = field(default_factory=time.monotonic)
    _number: int = 0

    @property
    def due(self) -> bool:
        """Whether it is time for a state; the same on all ranks."""
        return bool(self.comm.bcast(time.monotonic() - self._last >= self.seconds, root=0))

    def save(self, arrays: Arrays, plain: Mapping[str, Any]) -> None:
        """Write a state, the rank's arrays and what is the same on all ranks; collective."""
        before, self._number = self._number, self._number + 1
        self.folder.mkdir(parents=True, exist_ok=True)
        write_arrays(self._part(self._number), arrays)
        self.comm.Barrier()
        if self.comm.rank == 0:
            self._head.put(None, {"number": self._number, "plain": plain})
        self.comm.Barrier()
        self._part(before).unlink(missing_ok=True)
        self._last = time.monotonic()

    def load(self, shapes: Mapping[str, tuple[int, ...]]) -> tuple[Arrays, dict[str, Any]] | None:
        """Return the last state whose arrays have the given shapes, if there is one; collective."""
        head = self.comm.bcast(self._head.get(None) if self.comm.rank == 0 else None, root=0)
        if head is None:
            return None
        arrays = read_arrays(self._part(head["number"]))
        fits = all(name in arrays and arrays[name].shape == s for name, s in shapes.items())
        if not all(self.comm.allgather(fits)):
            return None
        self._number = head["number"]
        return arrays, head["plain"]

    def clear(self) -> None:
        """Remove the states: the solution is known; collective."""
        self.comm.Barrier()
        if self.comm.rank == 0 and self.folder.is_dir():
            for file in self.folder.iterdir():
                file.unlink()
            self.folder.rmdir()
        self.comm.Barrier()

    @property
    def _head(self) -> Store[dict[str, Any]]:
        """Of what the last state is."""
        return Store(self.folder, dict[str, Any], (self.key, self.comm.size), named=lambda _: "last")

    def _part(self, number: int) -> Path:
        return self.folder / f"{number:05d}-{self.comm.rank}.npz"
