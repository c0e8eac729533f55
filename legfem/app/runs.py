"""A command that runs as a process of its own, and is known from its files alone.

A run's folder holds ``run.json`` (the command), ``log.txt`` (its progress and messages),
``out.txt``, ``exit.json`` (once it has ended), ``results/``, and ``lock``, which is locked as long
as any of its processes lives: no number of a process is trusted that another may have by now.
"""

from __future__ import annotations

import fcntl
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from legfem.common.command_line import BAD_INPUT, INTERRUPTED
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.progress import Reached, reached

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
    LOST = "ended from outside"
    """Killed, or the machine went down: what was finished is kept."""


@dataclass(frozen=True)
class Run:
    """A run, by its folder."""

    folder: Path

    @classmethod
    def begun(cls, folder: Path, module: str, options: Sequence[str], about: str) -> Run:
        """Start ``python -m MODULE OPTIONS`` for what is called ``about``; return the run."""
        arguments = [sys.executable, "-m", module, *options]
        document = {"about": about, "arguments": arguments, "cwd": str(Path.cwd()), "began": time.time()}
        write_document(folder / "run.json", document)
        run = cls(folder)
        run.resume()
        return run

    def resume(self) -> bool:
        """Run the same command again, unless it runs; return whether it was started.

        The commands go on from what they have finished under ``--out``.
        """
        with (self.folder / "lock").open("wb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return False
            for name in ("exit.json", "session.json"):
                (self.folder / name).unlink(missing_ok=True)
            supervisor = [sys.executable, "-m", "legfem.app.supervise"]
            subprocess.Popen(
                [*supervisor, str(self.folder), str(lock.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                pass_fds=(lock.fileno(),),
            )
        return True

    def cancel(self, at_once: bool = False) -> bool:
        """Send Ctrl-C to all of a run's processes, or end them at once; return whether it ran."""
        if not self.alive:
            return False
        leader = self._read("session.json").get("leader")
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
        return {
            None: RunState.LOST,
            0: RunState.DONE,
            BAD_INPUT: RunState.REFUSED,
            INTERRUPTED: RunState.STOPPED,
            -signal.SIGINT: RunState.STOPPED,
            -signal.SIGKILL: RunState.LOST,
        }.get(self._read("exit.json").get("status"), RunState.FAILED)

    @property
    def results(self) -> Path:
        """The folder that the command writes to."""
        return self.folder / "results"

    @property
    def about(self) -> str:
        """What is looked at: the name of an input."""
        return str(self._given()["about"])

    @property
    def kind(self) -> str:
        """The command's name."""
        return str(self._given()["arguments"][2]).rpartition(".")[2]

    @property
    def began(self) -> float:
        """When it was asked for, s since the epoch."""
        return float(self._given()["began"])

    @property
    def started(self) -> float:
        """When it was last started, s since the epoch."""
        try:
            return (self.folder / "session.json").stat().st_mtime
        except FileNotFoundError:
            return self.began

    @property
    def command(self) -> str:
        """The command, to be copied."""
        return written(self._given()["arguments"][2], self._given()["arguments"][3:])

    @property
    def report(self) -> Path | None:
        """The page of its results, or their text; None before there is one."""
        both = (self.results / name for name in ("report.html", "report.txt"))
        return next((path for path in both if path.is_file()), None)

    def log(self) -> list[str]:
        """Return the last lines of its messages."""
        return self._lines(0)

    def reached(self) -> Reached | None:
        """Return how far its progress says that it is; None before it said anything."""
        begun = self._read("session.json").get("log_from")
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

    def _given(self) -> dict[str, Any]:
        if not self.there:
            raise InputError(self.folder, "run.json", "not found", "begin the run anew")
        return self._read("run.json")

    def _read(self, name: str) -> dict[str, Any]:
        try:
            found: dict[str, Any] = json.loads((self.folder / name).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return {}
        return found


def written(module: str, options: Sequence[str]) -> str:
    """Return a command as people type it."""
    return shlex.join(["python", "-m", module, *options])
