"""Progress on stderr: a bar on a terminal or in a notebook, plain lines otherwise; and when work has to end.

After a `Deadline` nothing more is begun that could go on in another run, and what was done is told.
"""

import math
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TextIO

if TYPE_CHECKING:
    import rich.progress


class TimeIsUpError(Exception):
    """A deadline came before all was there that something can't do without."""


@dataclass(frozen=True)
class Deadline:
    """A moment after which no more work is begun; never without it.

    Parameters
    ----------
    at
        By the clock, s.
    clock
        This machine's; or the time that a processor spent, as `time.process_time` has it.
    """

    at: float = math.inf
    clock: Callable[[], float] = time.monotonic

    @classmethod
    def after(cls, seconds: float | None, clock: Callable[[], float] = time.monotonic) -> "Deadline":
        """Return the moment in so many seconds; never without them."""
        return cls() if seconds is None else cls(clock() + seconds, clock)

    @property
    def passed(self) -> bool:
        """Whether it is over."""
        return self.clock() >= self.at

    def check(self) -> None:
        """Raise TimeIsUpError if it is over."""
        if self.passed:
            raise TimeIsUpError


NEVER = Deadline()


_BAR = 24
_NOTEBOOK = "ipykernel"
"""The package whose streams end in a notebook."""


class Progress(Protocol):
    """What long work reports to."""

    def stage(self, text: str, total: int | None = None) -> None:
        """Begin a stage of ``total`` units of work, if their number is known."""
        ...

    def advance(self, text: str) -> None:
        """One unit of the stage is done."""
        ...


class Silent:
    """Reports nothing."""

    def stage(self, text: str, total: int | None = None) -> None:
        """Do nothing."""

    def advance(self, text: str) -> None:
        """Do nothing."""


class Until:
    """Reports to another, and ends work between two units of it once a deadline is over.

    Raises TimeIsUpError then; what was done is kept by whoever did it.
    """

    def __init__(self, progress: Progress, deadline: Deadline) -> None:
        self._deadline, self.stage, self._told = deadline, progress.stage, progress.advance

    def advance(self, text: str) -> None:
        """One unit of the stage is done."""
        self._told(text)
        self._deadline.check()


_SOON_S = 5.0
"""What is over before then needs no estimate of what is left."""


class Lines:
    """One line a unit of work, with the seconds since the start and an estimate of what is left of the stage."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._started = stream, time.perf_counter()
        self._began = self._started
        self._done, self._total = 0, 0

    def stage(self, text: str, total: int | None = None) -> None:
        """Print the stage."""
        self._done, self._total, self._began = 0, total or 0, time.perf_counter()
        self._print(text)

    def advance(self, text: str) -> None:
        """Print the unit of work, its number and the time left."""
        self._done += 1
        passed, open_ = time.perf_counter() - self._began, self._total - self._done
        left = f", about {duration(passed / self._done * open_)} left" if passed > _SOON_S and open_ > 0 else ""
        self._print(f"  {self._done}{f'/{self._total}' if self._total else ''}  {text}{left}")

    def _print(self, text: str) -> None:
        print(f"[{time.perf_counter() - self._started:6.1f} s] {text}", file=self._stream, flush=True)


class Rewritten:
    """A bar on one line that is written over, as notebooks show it."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._began = stream, time.perf_counter()
        self._stage, self._done, self._total, self._width = "", 0, 0, 0

    def stage(self, text: str, total: int | None = None) -> None:
        """Begin a line, and leave the last one as it is."""
        if self._stage:
            print(file=self._stream)
        self._stage, self._done, self._total = text, 0, total or 0
        self._began, self._width = time.perf_counter(), 0
        self._draw("")

    def advance(self, text: str) -> None:
        """Draw the bar anew."""
        self._done += 1
        self._draw(text)

    def _draw(self, last: str) -> None:
        shown = self._stage
        if self._total:
            part = min(self._done / self._total, 1.0)
            filled = round(_BAR * part)
            shown += f" [{'#' * filled}{'.' * (_BAR - filled)}] {self._done}/{self._total}"
            if self._done:
                left = (time.perf_counter() - self._began) * (1 / part - 1)
                shown += f", {left:.0f} s left"
        line = f"{shown}  {last}".rstrip()
        print(f"\r{line:<{self._width}}", end="", file=self._stream, flush=True)
        self._width = len(line)

    def end(self) -> None:
        """End the last line."""
        if self._stage:
            print(file=self._stream, flush=True)


@dataclass(frozen=True)
class Reached:
    """How far the lines of a run say that it is."""

    seconds: float
    """Time since the start, s."""
    stage: str
    done: int = 0
    total: int | None = None
    last: str = ""
    """Text of the unit of work that was done last."""
    began: float = 0.0
    """Time from the start to the beginning of the stage, s."""

    @property
    def left(self) -> float | None:
        """Estimated time that is left in the stage, s; None before its first unit of work is done."""
        if self.total is None or self.done == 0:
            return None
        return (self.seconds - self.began) / self.done * (self.total - self.done)


_LINE = re.compile(r"\[ *([\d.]+) s\] (?:  (\d+)(?:/(\d+))?  )?(.*?)(?:, about [\d.]+ \w+ left)?")


def reached(lines: Iterable[str]) -> Reached | None:
    """Return how far work is that reports with `Lines`; None where no line is its own."""
    found: Reached | None = None
    for line in lines:
        read = _LINE.fullmatch(line)
        if read is None:
            continue
        seconds, done, total, text = read.groups()
        if done is None:
            found = Reached(float(seconds), text, began=float(seconds))
        else:
            whole = None if total is None else int(total)
            stage, began = ("", 0.0) if found is None else (found.stage, found.began)
            found = Reached(float(seconds), stage, int(done), whole, text, began)
    return found


@contextmanager
def progress_on(stream: TextIO | None = None, quiet: bool = False) -> Iterator[Progress]:
    """Report on a stream, stderr by default, or nowhere.

    As a bar on a terminal and in a notebook, as lines elsewhere.
    """
    stream = stream or sys.stderr
    if quiet:
        yield Silent()
        return
    if type(stream).__module__.startswith(_NOTEBOOK):
        bar_there = Rewritten(stream)
        yield bar_there
        bar_there.end()
        return
    if not stream.isatty():
        yield Lines(stream)
        return
    from rich import progress as rich_progress
    from rich.console import Console

    columns = (
        rich_progress.SpinnerColumn(),
        rich_progress.TextColumn("{task.description}", markup=False),
        rich_progress.BarColumn(),
        rich_progress.MofNCompleteColumn(),
        rich_progress.TimeElapsedColumn(),
        rich_progress.TextColumn("passed,"),
        rich_progress.TimeRemainingColumn(),
        rich_progress.TextColumn("left"),
        rich_progress.TextColumn("{task.fields[last]}", markup=False),
    )
    with rich_progress.Progress(*columns, console=Console(file=stream)) as bar:
        yield _Bar(bar)


class _Bar:
    def __init__(self, bar: "rich.progress.Progress") -> None:
        self._bar = bar
        self._task: rich.progress.TaskID | None = None

    def stage(self, text: str, total: int | None = None) -> None:
        if self._task is not None:
            self._bar.stop_task(self._task)
        self._task = self._bar.add_task(text, total=total, last="")

    def advance(self, text: str) -> None:
        if self._task is None:
            self.stage("")
        assert self._task is not None
        self._bar.update(self._task, advance=1, last=text)


def duration(seconds: float) -> str:
    """Return a duration as people say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
