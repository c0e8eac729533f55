"""Engines: the same outcomes from processes, ranks and a cluster's workers; who dies costs itself alone."""

from __future__ import annotations

import functools
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from legfem.common.errors import InputError
from legfem.jobs.engines import Died, engine_named, outcomes

TASKS = [*range(8)]


def doubled(folder: Path, dying: tuple[int, ...], once: tuple[int, ...], task: int) -> int:
    """Tasks that die always or the first time."""
    marked = folder / f"{task}-died"
    if task in dying or (task in once and not marked.exists()):
        marked.touch()
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return 2 * task


def of(engine, work) -> list[int | Died]:
    found = dict(outcomes(engine, work, TASKS))
    return [found[place] for place in range(len(TASKS))]


def test_who_dies_is_tried_once_more_and_costs_itself_alone(tmp_path: Path) -> None:
    work = functools.partial(doubled, tmp_path, (2,), (5,))
    with engine_named("local", 2, None) as engine:
        found = of(engine, work)
    assert isinstance(found[2], Died) and found[2].problem == (
        "its process was ended from outside (out of memory?), twice"
    )
    assert [one for place, one in enumerate(found) if place != 2] == [0, 2, 6, 8, 10, 12, 14]


def test_what_a_task_raises_is_raised_and_the_others_are_ended() -> None:
    with pytest.raises(ZeroDivisionError), engine_named("local", 2, None) as engine:
        list(outcomes(engine, functools.partial(divmod, 1), [1, 0, 1]))


def test_one_job_works_in_this_process() -> None:
    with engine_named("local", 1, None) as engine:
        assert set(dict(outcomes(engine, here, [1, 2])).values()) == {os.getpid()}


def here(task: int) -> int:
    return os.getpid()


def test_dask_gives_the_same_and_loses_only_who_always_dies(tmp_path: Path) -> None:
    from distributed import LocalCluster  # here, for every process that works for these tests imports this file

    work = functools.partial(doubled, tmp_path, (2,), (5,))
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        engine_named("dask", 1, cluster.scheduler_address) as engine,
    ):
        assert engine.workers == 2
        found = of(engine, work)
    assert isinstance(found[2], Died) and "one after another" in found[2].problem
    assert [one for place, one in enumerate(found) if place != 2] == [0, 2, 6, 8, 10, 12, 14]


def test_workers_of_several_threads_are_refused() -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        pytest.raises(InputError, match="several threads, in which PETSc can't run; start workers with"),
        engine_named("dask", 1, cluster.scheduler_address),
    ):
        pass


@pytest.mark.parametrize(
    ("name", "scheduler", "line"),
    [
        ("dask", None, "--scheduler: missing: dask needs a scheduler; start one with"),
        ("dask", "tcp://127.0.0.1:9", "--scheduler: tcp://127.0.0.1:9: doesn't answer"),
        ("local", "tcp://127.0.0.1:9", "has no effect on local; add --on dask"),
        ("mpi", None, "--on: mpi: there is one rank; begin the command with mpirun"),
    ],
)
def test_an_engine_that_is_not_there_is_one_line(name, scheduler, line, monkeypatch) -> None:
    monkeypatch.setattr("legfem.jobs.engines._PATIENCE", "1s")
    with pytest.raises(InputError) as said, engine_named(name, 1, scheduler):
        pass
    assert line in str(said.value)


@pytest.mark.mpi
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun here")
def test_three_ranks_give_the_same(tmp_path: Path) -> None:
    script = tmp_path / "ranks.py"
    script.write_text(
        "from legfem.jobs.engines import engine_named, outcomes\n"
        "from test_engines import TASKS, doubled\n"
        "import functools, pathlib\n"
        "with engine_named('mpi', 1, None) as engine:\n"
        "    if engine is not None:\n"
        "        work = functools.partial(doubled, pathlib.Path('.'), (), ())\n"
        "        found = dict(outcomes(engine, work, TASKS))\n"
        "        print(engine.workers, [found[k] for k in TASKS])\n"
    )
    env = os.environ | {"PYTHONPATH": f"{Path(__file__).parent}:{Path(__file__).parents[1]}"}
    command = ["mpirun", "--oversubscribe", "-n", "3", sys.executable, str(script)]
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=300, check=True)
    assert done.stdout.strip() == "2 [0, 2, 4, 6, 8, 10, 12, 14]"
