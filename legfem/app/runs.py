"""A command that runs as a process of its own, and is known from its files alone.

A run's folder holds ``run.json`` (the command), ``log.txt`` (its progress and messages),
``out.txt``, ``exit.json`` (once it has ended), ``results/``, and ``lock``, which is locked as long
as any of its processes lives: no number of a process is trusted that another may have by now.
"""

import fcntl
import json
import os
import shlex
import shutil
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from legfem.app.workspace import Workspace, check_within
from legfem.common.command_line import BAD_INPUT, INTERRUPTED
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.progress import Reached, reached
from legfem.common.resources import resource
from legfem.jobs.supervise import started

EVERY = "all legs"
"""What a run of a cohort is about."""
_MOST_LOG = 100_000
"""Bytes at the log's end that are read."""


class RunState(StrEnum):
    """How far a run is."""

    RUNNING = "running"
    DONE = "done"
    REFUSED = "refused"
    """What was given can't be used: the log's last line says why."""
    STOPPED = "stopped"
    FAILED = "failed"
    WAITING = "begins when the run before it is done"
    LOST = "ended from outside"
    """Killed, or the machine went down: what was finished is kept."""


@dataclass(frozen=True)
class AskedRun:
    """What ``run.json`` holds."""

    about: str
    """What is looked at: the name of an input."""
    arguments: Annotated[list[str], Field(min_length=3)]
    cwd: str
    began: float
    """When it was asked for, s since the epoch."""
    then: str = ""
    """Name of the run that starts once this one is done; empty for none."""
    waits: bool = False


_ASKED = TypeAdapter(AskedRun)
_DAMAGED = AskedRun("its run.json is damaged", ["", "-m", "a run"], "", 0.0)


@dataclass(frozen=True)
class Run:
    """A run, by its folder."""

    folder: Path

    @classmethod
    def written(
        cls, folder: Path, module: str, options: Sequence[str], about: str, then: str = "", waits: bool = False
    ) -> "Run":
        """Return a run of ``python -m MODULE OPTIONS`` for what is called ``about``, which isn't started.

        ``then`` is the name of the run that starts once this one is done; one of those ``waits``.
        """
        asked = AskedRun(about, [sys.executable, "-m", module, *options], str(Path.cwd()), time.time(), then, waits)
        write_document(folder / "run.json", asdict(asked))
        return cls(folder)

    @classmethod
    def begun(cls, folder: Path, module: str, options: Sequence[str], about: str, then: str = "") -> "Run":
        """Start a run as `written` has it; return it."""
        run = cls.written(folder, module, options, about, then)
        run.resume()
        return run

    def resume(self) -> bool:
        """Run the same command again, unless it runs; return whether it was started.

        The commands go on from what they have finished under ``--out``.
        """
        return started(self.folder)

    def cancel(self, at_once: bool = False) -> bool:
        """Send Ctrl-C to all of a run's processes, or end them at once; return whether it ran."""
        if not self.alive:
            return False
        leader = read_json(self.folder / "session.json").get("leader")
        if leader is None:
            return False
        with suppress(ProcessLookupError):
            os.killpg(leader, signal.SIGKILL if at_once else signal.SIGINT)
        return True

    @property
    def alive(self) -> bool:
        """Whether any of its processes lives."""
        try:
            with (self.folder / "lock").open("rb") as lock:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except FileNotFoundError:
            return False
        except BlockingIOError:
            return True
        return False

    @property
    def state(self) -> RunState:
        """How far it is."""
        if self.alive:
            return RunState.RUNNING
        if self.asked.waits and not (self.folder / "lock").exists():
            return RunState.WAITING
        # Who waited for the command may be gone, and the command have ended as well as it can: its page is its last.
        done = self.report is not None and self.report.stat().st_mtime > self.started
        return {
            None: RunState.DONE if done else RunState.LOST,
            0: RunState.DONE,
            BAD_INPUT: RunState.REFUSED,
            INTERRUPTED: RunState.STOPPED,
            -signal.SIGINT: RunState.STOPPED,
            -signal.SIGKILL: RunState.LOST,
        }.get(read_json(self.folder / "exit.json").get("status"), RunState.FAILED)

    @property
    def results(self) -> Path:
        """The folder that the command writes to."""
        return self.folder / "results"

    @property
    def kind(self) -> str:
        """The command's name."""
        return self.asked.arguments[2].rpartition(".")[2]

    @property
    def started(self) -> float:
        """When it was last started, s since the epoch."""
        try:
            return (self.folder / "session.json").stat().st_mtime
        except FileNotFoundError:
            return self.asked.began

    @property
    def command(self) -> str:
        """The command, to be copied."""
        return written(self.asked.arguments[2], self.asked.arguments[3:])

    @property
    def report(self) -> Path | None:
        """The page of its results, or their text; None before there is one."""
        both = (self.results / name for name in ("report.html", "cohort.html", "report.txt"))
        return next((path for path in both if path.is_file()), None)

    def point_to(self, about: str, before: Path, now: Path) -> None:
        """Let the command find an input that was moved."""
        arguments = [str(now) if one == str(before) else one for one in self.asked.arguments]
        write_document(self.folder / "run.json", asdict(replace(self.asked, about=about, arguments=arguments)))

    def log(self) -> list[str]:
        """Return the last lines of its messages."""
        return self._lines(0)

    def reached(self) -> Reached | None:
        """Return how far its progress says that it is; None before it said anything."""
        begun = read_json(self.folder / "session.json").get("log_from")
        return None if begun is None else reached(self._lines(begun))

    def _lines(self, begun: int) -> list[str]:
        try:
            with (self.folder / "log.txt").open("rb") as file:
                file.seek(max(begun, file.seek(0, os.SEEK_END) - _MOST_LOG))
                return file.read().decode("utf-8", "replace").splitlines()
        except FileNotFoundError:
            return []

    @property
    def there(self) -> bool:
        """Whether the folder holds a run: a server may have been killed before it did."""
        return (self.folder / "run.json").is_file()

    @property
    def asked(self) -> AskedRun:
        """What was asked for; raises InputError without it."""
        if not self.there:
            raise InputError(self.folder, "run.json", "not found", "start the run again")
        try:
            return _ASKED.validate_json((self.folder / "run.json").read_bytes())
        except ValidationError:
            return _DAMAGED


def read_json(path: Path) -> dict[str, Any]:
    """Return a document that a process wrote; empty where it isn't there, or is cut short."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def written(module: str, options: Sequence[str]) -> str:
    """Return a command as people type it."""
    program = module.split(".") if module.startswith("legfem.") else ["python", "-m", module]
    return shlex.join([*program, *options])


@dataclass(frozen=True)
class Choice:
    """An option that the app asks for by itself.

    Parameters
    ----------
    option : str
        As the command knows it.
    label : str
        As people read it, with the unit.
    help : str
        What it does.
    choices : tuple of str
        What it may be; empty for a number.
    """

    option: str
    label: str
    help: str
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Action:
    """A command on one kind of folder.

    Parameters
    ----------
    name : str
        The command's.
    folder : str
        The option that takes the folder.
    does : str
        In a sentence.
    choices : tuple of Choice
        Asked for.
    """

    name: str
    folder: str
    does: str
    choices: tuple[Choice, ...] = ()

    @property
    def module(self) -> str:
        """What ``python -m`` starts."""
        return f"legfem.{self.name}"

    def options(self, folder: Path, out: Path, chosen: Mapping[str, str], more: str = "") -> list[str]:
        """Return the command's options.

        Parameters
        ----------
        folder, out : Path
            What is looked at, and where the results go.
        chosen : mapping
            Values by option; an empty one leaves it at its default.
        more : str
            Other options, as people type them.

        Raises
        ------
        InputError
            If ``more`` can't be taken apart, or names what the app itself gives; as `check_within` does.
        """
        try:
            typed = shlex.split(more)
        except ValueError as error:
            raise InputError("options", more, str(error).lower(), "close the quotes") from None
        for word in typed:
            if word.partition("=")[0] in (self.folder, "--out", "--subject", "--json", "--quiet"):
                raise InputError("options", word, "is given by the app", "leave it out")
        check_within(folder)
        stated = [part for option, value in chosen.items() if value for part in (option, value)]
        return [self.folder, str(folder), "--out", str(out), *stated, *typed]


ACTIONS = resource("app/actions", dict[str, tuple[Action, ...]])
"""By the file that says what a folder is."""


_TRUST = ("identify", "diagnose", "stocking")


def begin_all(workspace: Workspace, name: str, described: str, options: Mapping[str, Sequence[str]]) -> str:
    """Begin what answers "How stiff, and can I trust it?" of an input; return the first run's name.

    ``options`` are further ones, by the command's name; a command that isn't there isn't run.
    """
    actions, then = [one for one in ACTIONS[described] if one.name in _TRUST and one.name in options], ""
    for action in reversed(actions):
        run = workspace.new_run(f"{action.name}-{name}")
        given = action.options(workspace.input(name), workspace.folder / "runs" / run / "results", {})
        waits = action is not actions[0]
        Run.written(workspace.run(run), action.module, [*given, *options[action.name]], name, then, waits)
        then = run
    Run(workspace.run(then)).resume()
    return then


def looked_at(workspace: Workspace, name: str) -> Run:
    """Return the run that looks at an input as it is now, begun if there is none; raises as `check_within` does."""
    check_within(workspace.input(name))
    folder = workspace.preview(name)
    run = Run(folder)
    if run.there:
        if run.state is RunState.LOST:
            run.resume()
        return run
    for older in folder.parent.iterdir():
        if older != folder and not Run(older).alive:
            shutil.rmtree(older, ignore_errors=True)
    return Run.begun(folder, "legfem.data", ["preview", str(workspace.input(name)), "--out", str(run.results)], name)


def runs_of(workspace: Workspace, about: str = "") -> list[Run]:
    """Return the runs of a workspace, or of one of its inputs, the latest first."""
    there = [run for run in map(Run, map(workspace.run, workspace.runs)) if run.there]
    return [run for run in there if about in ("", run.asked.about)]


def rename_input(workspace: Workspace, name: str, wish: str) -> str:
    """Give an input another name, or one with a number behind it; its runs follow. Return the name.

    Raises
    ------
    InputError
        While a command runs on it.
    """
    check_idle(workspace, name)
    before, now = workspace.input(name), workspace.rename_input(name, wish)
    for run in runs_of(workspace, name):
        run.point_to(now, before, workspace.input(now))
    return now


def check_idle(workspace: Workspace, name: str) -> None:
    """Raise an InputError while a command runs on an input."""
    for run in runs_of(workspace, name):
        if run.alive:
            raise InputError("input", name, f"{run.folder.name} runs on it", "stop that first")
