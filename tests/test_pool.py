"""Workers: interrupted, orphaned, killed, and what they yield."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
import typer

from legfem.common.command_line import command_context
from legfem.common.progress import Silent
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish

HERE = Path(__file__).parent


def square(context: int, task: int) -> int:
    return context + task**2


def mark_ready(folder: Path) -> None:
    (folder / str(os.getpid())).touch()


def here_or_there(context: Path, task: int) -> int:
    time.sleep(0.2)
    return os.getpid()


def slow_first(context: None, task: int) -> int:
    time.sleep(0.3 if task == 0 else 0.0)
    return task


def die(context: None, task: int) -> int:
    if task == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return task


def wait(folder: Path, task: int) -> int:
    """Tell the process, and go on for a minute."""
    if task:
        (folder / str(os.getpid())).touch()
        time.sleep(60.0)
    return task


def fail(context: None, task: int) -> int:
    raise ValueError("made to fail")


class TwoWordsError(Exception):
    """Can't be unpickled: it is given two words and keeps one."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"{one} and {other}")


def fail_in_words(context: None, task: int) -> int:
    raise TwoWordsError("made", "failed")


class NotThere:
    """Something that no worker can unpickle."""

    def __reduce__(self) -> tuple[Callable[[], object], tuple[()]]:
        return _of_another_process, ()


def _of_another_process() -> object:
    raise AttributeError("no function of that name in __main__")


def leave(context: None, task: int) -> int:
    os._exit(7)


@pytest.mark.parametrize("jobs", [1, 2])
def test_all_tasks_come_back_with_their_outcomes(jobs: int) -> None:
    with Workers(square, 10, jobs) as workers:
        assert dict(workers.run(range(5))) == {k: 10 + k**2 for k in range(5)}
        assert list(workers.in_order([3, 1, 2])) == [19, 11, 14]
        assert list(workers.run([])) == []


def test_the_order_is_the_tasks_where_it_is_asked_for() -> None:
    with Workers(slow_first, None, 2) as workers:
        assert list(workers.in_order(range(6))) == list(range(6))
        assert sorted(task for task, _ in workers.run(range(6))) == list(range(6))


def test_this_process_works_along_where_it_is_asked_to(tmp_path: Path) -> None:
    def ready() -> int:
        return len(list(tmp_path.iterdir()))

    with Workers(here_or_there, tmp_path, 2, along=True) as workers:
        workers.start(mark_ready, most=3)
        while not ready():
            time.sleep(0.05)
        found = dict(workers.run(range(6)))
        assert sorted(found) == list(range(6))
        assert set(found.values()) == {os.getpid(), int(next(tmp_path.iterdir()).name)}
        assert dict(workers.run([7])) == {7: os.getpid()}
    assert ready() == 1
    with pytest.raises(ValueError, match="made to fail"), Workers(fail, None, 2, along=True) as workers:
        list(workers.run(range(4)))


def test_an_error_in_a_task_is_raised_and_ends_the_others(tmp_path: Path) -> None:
    began = time.monotonic()
    with pytest.raises(ValueError, match="made to fail"), Workers(fail, None, 2) as workers:
        list(workers.run(range(4)))
    assert time.monotonic() - began < 30.0


def test_what_a_worker_cannot_import_or_tell_is_told_as_its_own_error() -> None:
    with pytest.raises(AttributeError, match="no function of that name"), Workers(fail, NotThere(), 2) as workers:
        list(workers.run(range(3)))
    with pytest.raises(AttributeError, match="no function of that name"), Workers(fail, None, 2) as workers:
        list(workers.run([NotThere(), NotThere()]))
    with (
        pytest.raises(RuntimeError, match="TwoWordsError: made and failed"),
        Workers(fail_in_words, None, 2) as workers,
    ):
        list(workers.run(range(3)))


def test_a_worker_that_ends_itself_is_not_called_killed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit), command_context("run it again"), Workers(leave, None, 2) as workers:
        list(workers.run(range(4)))
    assert capsys.readouterr().err.startswith("a worker process ended by itself with status 7, and said why: run it")


def test_a_function_of_main_that_workers_cannot_find_is_told_as_that(tmp_path: Path) -> None:
    package = tmp_path / "aborting"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text("""if True:
        from legfem.common.command_line import command_context
        from legfem.jobs.pool import Workers
        def work(context, task):
            return task
        if __name__ == "__main__":
            with command_context(), Workers(work, None, 2) as workers:
                list(workers.run(range(3)))
    """)
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": paths}
    ended = subprocess.run(
        [sys.executable, "-m", "aborting"], env=environment, stderr=subprocess.PIPE, text=True, timeout=60.0
    )
    assert ended.returncode == 1
    assert "AttributeError" in ended.stderr and "'work'" in ended.stderr
    assert "memory" not in ended.stderr


def test_a_killed_process_costs_a_line_and_what_it_had_in_hand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = Store(tmp_path, int)
    with (
        pytest.raises(typer.Exit) as ended,
        command_context("run it again; what is done is kept"),
        Workers(die, None, 2) as workers,
    ):
        finish(workers, range(4), store, Silent(), "dying", lambda task, _: f"{task}")
    assert ended.value.exit_code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        "a worker process was ended from outside (out of memory?): run it again; what is done is "
        "kept; --jobs 1 takes the least memory"
    )
    kept = {task for task in range(4) if store.get(task) is not None}
    assert 3 not in kept
    with Workers(square, 0, 1) as workers:
        done = finish(workers, range(4), store, Silent(), "again", lambda task, _: f"{task}")
    assert done == [task if task in kept else task**2 for task in range(4)]


def test_a_broken_pool_is_what_it_is_without_a_command() -> None:
    with pytest.raises(BrokenProcessPool), Workers(die, None, 2) as workers:
        list(workers.run([3, 3]))


def running(pids: list[int]) -> list[int]:
    """Return those that still run; a zombie has ended."""
    states = {}
    for pid in pids:
        status = Path(f"/proc/{pid}/stat")
        try:
            states[pid] = status.read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
    return [pid for pid, state in states.items() if state != "Z"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_processes_end_with_the_one_that_started_them(tmp_path: Path, sent: signal.Signals) -> None:
    folder, store = tmp_path / "pids", tmp_path / "store"
    folder.mkdir()
    parent = subprocess.Popen([sys.executable, __file__, folder, store], cwd=HERE, stderr=subprocess.PIPE, text=True)
    try:
        until = time.monotonic() + 60.0
        while time.monotonic() < until and (len(list(folder.iterdir())) < 2 or not list(store.glob("*.json"))):
            time.sleep(0.05)
        children = [int(path.name) for path in folder.iterdir()]
        assert len(children) == 2 and running(children) == children
        parent.send_signal(sent)
        _, said = parent.communicate(timeout=20.0)
    finally:
        parent.kill()
    until = time.monotonic() + 20.0
    while running(children) and time.monotonic() < until:
        time.sleep(0.05)
    assert not running(children)
    if sent == signal.SIGINT:
        assert parent.returncode == 130 and said == "interrupted: run it again\n"
    # What was done before is there.
    assert Store(store, int).get(0) == 0


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_commands_apart_end_with_the_one_that_started_them(tmp_path: Path, sent: signal.Signals) -> None:
    told = tmp_path / "pid"
    inner = f"""if True:
        import os, pathlib, time
        from studies.solvers.case import end_with_starter
        end_with_starter()
        pathlib.Path({str(told)!r} + ".new").write_text(str(os.getpid()))
        pathlib.Path({str(told)!r} + ".new").rename({str(told)!r})
        time.sleep(60.0)
    """
    outer = f"""if True:
        import os, sys
        from studies.solvers.case import run_apart
        run_apart([sys.executable, "-c", {inner!r}], os.environ)
    """
    parent = subprocess.Popen([sys.executable, "-c", outer], stderr=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 60.0
        while not told.exists() and time.monotonic() < until:
            time.sleep(0.05)
        child = int(told.read_text())
        assert running([child]) == [child]
        parent.send_signal(sent)
        parent.wait(timeout=20.0)
    finally:
        parent.kill()
    until = time.monotonic() + 20.0
    while running([child]) and time.monotonic() < until:
        time.sleep(0.05)
    assert not running([child])


def test_a_command_apart_tells_how_it_ended() -> None:
    from studies.solvers.case import run_apart  # brings DOLFINx, which no worker here needs

    ended = [sys.executable, "-c", "raise SystemExit(3)"]
    assert run_apart(ended, os.environ) == 3


def main(folder: Path, store: Path) -> None:
    """Do one quick task and two long ones."""
    with command_context("run it again"), Workers(wait, folder, 2) as workers:
        finish(workers, range(3), Store(store, int), Silent(), "", lambda task, _: f"{task}")


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
    except typer.Exit as end:
        sys.exit(end.exit_code)
