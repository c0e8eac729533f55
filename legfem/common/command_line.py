"""What every command does: its common options, its exit status, and one line for a user's mistake."""

import errno
import fcntl
import io
import logging
import math
import os
import re
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand

from legfem.common.errors import Argument, ContradictionError, InputError, UnsolvedError, missing_module

if TYPE_CHECKING:
    from mpi4py import MPI

_OPTION = "-no_signal_handler"
INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class CheckedCommand(TyperCommand):
    """A command that refuses ``nan`` and ``inf``, which limits let pass and meshes don't, and empty texts.

    What its options are for stands in its function's docstring, under ``Parameters``.
    """

    def __init__(self, name: str | None, *, help: str | None = None, **given: Any) -> None:
        told, _, parameters = (help or "").partition("Parameters\n----------\n")
        super().__init__(name, help=told.rstrip(), **given)
        said = dict(re.findall(r"^(\w+)\n((?: .*\n?)+)", parameters, re.MULTILINE))
        option: Any
        for option in self.params:
            option.help = " ".join(said[option.name].split()) if option.name in said else option.help

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Check that no text is empty, which would be the folder that one is in; then read what was given."""
        with command_context():
            for option, word in pairwise(["argument", *args]):
                if word == "" or (word.startswith("--") and word.endswith("=")):
                    raise InputError(word[:-1] or option, "value", "is empty", "give one, or leave it out")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Check what was given, then run the command."""
        with command_context():
            for option in self.params:
                given = ctx.params.get(str(option.name))
                for one in given if isinstance(given, list | tuple) else (given,):
                    if isinstance(one, float) and not math.isfinite(one):
                        raise InputError(option.opts[0], f"{one}", "is not a finite number", "give one")
        return super().invoke(ctx)


def ignore_broken_pipes() -> None:
    """Keep PETSc from ending the program where a reader has left, loaded or yet to be."""
    if threading.current_thread() is threading.main_thread() and hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    # PETSc takes the signals as it is loaded, but for this.
    given = os.environ.get("PETSC_OPTIONS", "")
    if _OPTION not in given.split():
        os.environ["PETSC_OPTIONS"] = f"{given} {_OPTION}".strip()


BAD_INPUT, INTERRUPTED, FAILED, FAULT = 2, 130, 1, 3


@contextmanager
def command_context(resume: str = "run the same command again to go on", quiet: bool = False) -> Iterator[None]:
    """Turn a user's mistake, Ctrl-C and what the machine lacks into a line and an exit status.

    Parameters
    ----------
    resume : str
        How to go on after Ctrl-C or a kill.
    quiet : bool
        Whether messages that warn of nothing are left out.
    """
    _show_messages(logging.WARNING if quiet else logging.INFO)
    ignore_broken_pipes()
    # What a batch system or a terminal that is closed sends says what Ctrl-C does; nohup's is ignored still.
    for one in INTERRUPTS if threading.current_thread() is threading.main_thread() else ():
        if signal.getsignal(one) is signal.SIG_DFL:
            signal.signal(one, signal.default_int_handler)
    try:
        yield
    except InputError as error:
        _end(str(error), BAD_INPUT)
    except UnsolvedError as error:
        _end(f"nothing was solved: {' '.join(str(error).split())}", FAILED)
    except ContradictionError as error:
        _end(f"a fault of legfem, please report it: {error}; nothing is written, and all solves are kept", FAULT)
    except ModuleNotFoundError as error:
        _end(missing_module(error), FAILED)
    except KeyboardInterrupt:
        _end(f"interrupted: {resume}", INTERRUPTED)
    except BrokenProcessPool as error:
        _end(f"{error}: {resume}; --jobs 1 takes the least memory", FAILED)
    except MemoryError:
        asked = "are its lengths in mm? Else ask for fewer elements, or --jobs 1"
        _end(f"memory: there is not enough for this input; {asked}", BAD_INPUT)
    except RecursionError:
        _end("input: something in it is nested too deeply; flatten it", BAD_INPUT)
    except OSError as error:
        # A pipe whose reader has left is the shell's business.
        if error.errno == errno.EPIPE:
            raise
        where = error.filename or "file"
        _end(f"{where}: {error.strerror or error}; {_FREED}, and {resume}", BAD_INPUT)


_FREED = "free the disk or give a place that can be read and written"


@contextmanager
def parallel_context(
    jobs: int | None = None, resume: str = "run the same command again to go on", quiet: bool = False
) -> Iterator[int]:
    """Yield a number of processes on the first rank alone, with `command_context` around it.

    Parameters
    ----------
    jobs : int, optional
        What the user gave; all usable cores by default, one process where there are ranks.
    resume, quiet
        See `command_context`.
    """
    with command_context(resume, quiet):
        yield process_count(jobs, leave_to_first_rank())


@contextmanager
def study_context(
    name: str,
    out: Path | None,
    jobs: int | None = None,
    resume: str = "run the same command again to go on",
    quiet: bool = False,
) -> Iterator[tuple[Path, int]]:
    """Yield a study's folder and number of processes, with `command_context` around it.

    Parameters
    ----------
    name : str
        Name of the folder in ``results`` if none is given.
    out : Path, optional
        What the user gave.
    jobs : int, optional
        See `parallel_context`.
    resume, quiet
        See `command_context`.
    """
    with parallel_context(jobs, resume, quiet) as processes, results_folder(out, name) as folder:
        yield folder, processes


def end_without_a_solution(what: str) -> NoReturn:
    """End a command whose solutions all failed; its report tells how far they came."""
    _end(f"{what}: nothing was solved, see the report", FAILED)


def _end(line: str, status: int) -> NoReturn:
    """Print a line to stderr and end the command."""
    print(line, file=sys.stderr)
    raise typer.Exit(status) from None


class _Stderr(logging.Handler):
    """Writes lines to what is stderr at that time: a progress bar puts itself in between."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        print(self.format(record), file=sys.stderr, flush=True)


def _show_messages(level: int) -> None:
    """Show legfem's messages of a level and above."""
    log = logging.getLogger("legfem")
    if not log.handlers:
        log.addHandler(_Stderr())
    log.setLevel(level)


def leave_to_first_rank() -> int:
    """Return the number of MPI ranks, and end all but the first: one process does the work."""
    from mpi4py import MPI

    ranks = int(MPI.COMM_WORLD.size)
    if ranks > 1:
        # PETSc starts on all ranks together: the first would wait for those that left.
        import petsc4py.PETSc  # noqa: F401
    if MPI.COMM_WORLD.rank > 0:
        raise typer.Exit(0)
    return ranks


def check_out_folder(out: Path) -> None:
    """Check, without leaving anything, that results can be written to a folder.

    Raises
    ------
    InputError
        If a file is in the way, the nearest folder that exists can't be written to, or results would lie among
        recordings.
    """
    asked, around = Argument("out"), (out.absolute(), *out.absolute().parents)
    nearest = next(folder for folder in around if folder.exists())
    if not nearest.is_dir():
        raise InputError(asked, str(out), f"{nearest} is a file", "give a folder")
    if any(folder.name == "recordings" and any(folder.parent.glob("*.toml")) for folder in around):
        problem = "lies among recordings: tables of results would be read as such"
        raise InputError(asked, str(out), problem, "give another folder")
    try:
        # What may be written isn't always what can: /proc says yes to root.
        tempfile.TemporaryFile(dir=nearest).close()
    except OSError:
        raise InputError(asked, str(out), f"{nearest} can't be written to", "give a folder of your own") from None


@contextmanager
def results_folder(out: Path | None, name: str, comm: "MPI.Intracomm | None" = None) -> Iterator[Path]:
    """Yield the folder for results, that of a name in ``results`` where none is given; no other command may have it.

    Collective over the ranks of a communicator, if there is one.

    Raises
    ------
    InputError
        As `check_out_folder` does, and where another process writes to it.
    """
    folder = out or Path("results") / name
    check_out_folder(folder)
    with _held(folder) if comm is None or comm.rank == 0 else nullcontext("") as holder:
        holder = holder if comm is None else comm.bcast(holder)
        if holder:
            problem = f"process {holder} writes its results there"
            raise InputError(Argument("out"), str(folder), problem, "wait until it has ended, or give another folder")
        yield folder


@contextmanager
def _held(folder: Path) -> Iterator[str]:
    """Hold a folder's lock, which the system releases when a process dies; yield who holds it, if it isn't free."""
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / ".lock"
    with path.open("a+") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield path.read_text() or "of another command"
            return
        except OSError:
            pass  # a file system without locks
        path.write_text(f"{os.getpid()}")
        try:
            yield ""
        finally:
            path.unlink(missing_ok=True)
            for one in made:
                with suppress(OSError):  # it isn't empty
                    one.rmdir()


def process_count(jobs: int | None, ranks: int) -> int:
    """Return the number of processes to use: ``--jobs``, or all usable cores.

    Raises
    ------
    InputError
        If ``jobs`` is below 1.
    """
    if jobs is not None and jobs < 1:
        raise InputError(Argument("jobs"), f"{jobs}", "is not a number of processes", "give 1 or more")
    # A rank of mpirun can't start processes that would use MPI too.
    return 1 if ranks > 1 else jobs or usable_cores()


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


Quiet = Annotated[bool, typer.Option("--quiet", help="No progress; print only where the results are.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result's JSON, and nothing else, to stdout.")]


@contextmanager
def brief_output(quiet: bool, as_json: bool) -> Iterator[list[Path]]:
    """Keep to itself what is printed, where that was asked for; print what is listed at the end.

    Yields a list for the paths of the JSON documents that were written. Nothing is printed of work
    that ends with an exception.
    """
    written: list[Path] = []
    with redirect_stdout(io.StringIO()) if quiet or as_json else nullcontext():
        yield written
    for path in written if quiet or as_json else ():
        print(path.read_text(encoding="utf-8").rstrip() if as_json else f"result: {path}")
