"""One cohort by every engine, with workers that are killed in the middle: the same table."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import making_slurm
import numpy as np
import pandas as pd
import pytest
from distributed import LocalCluster
from making_specimens import PLANTED, write_bars

pytestmark = pytest.mark.slow
TIMED = ["seconds", "peak_MB"]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven members: bars as stiff as they are many, and one that nobody can read."""
    folder = tmp_path_factory.mktemp("study")
    for k in range(6):
        law = type(PLANTED)((4 + k) * 1e-3, 1.0, C20=3e-3)
        (folder / f"S{k}").mkdir()
        write_bars(folder / f"S{k}", law)
    (folder / "S6").mkdir()
    (folder / "S6" / "specimen.toml").write_text("id = 3\n")
    return folder


def command(study: Path, out: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "legfem.cohort", str(study), "--law", "reduced-polynomial", "--out", str(out), *more]


@pytest.fixture(scope="module")
def local(study: Path, tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    out = tmp_path_factory.mktemp("local")
    subprocess.run(command(study, out, "--jobs", "2"), check=True, capture_output=True, timeout=900)
    return table(out)


def table(out: Path) -> pd.DataFrame:
    found = pd.read_csv(out / "cohort.csv")
    return found.drop(columns=[name for name in TIMED if name in found])


def run_and_hit(command: list[str], out: Path, hit: Callable[[], None], env: dict[str, str] | None = None) -> str:
    """Run a command; after the first members are done, hit it. Return what it said."""
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=env)
    try:
        end = time.monotonic() + 600
        while len(list((out / "members").glob("*/result.json"))) < 2:
            assert running.poll() is None and time.monotonic() < end, running.communicate()[0]
            time.sleep(0.1)
        hit()
        said, _ = running.communicate(timeout=600)
    finally:
        running.kill()
    assert running.returncode == 0, said
    return said


def same(found: pd.DataFrame, other: pd.DataFrame) -> None:
    assert found["problem"].notna().tolist() == [False] * 6 + [True]
    numbers = found.select_dtypes(np.number).columns
    assert len(numbers) > 5
    np.testing.assert_allclose(found[numbers], other[numbers], rtol=1e-9, atol=0)
    pd.testing.assert_frame_equal(found.drop(columns=numbers), other.drop(columns=numbers))


def test_three_ranks(study: Path, local: pd.DataFrame, tmp_path: Path) -> None:
    if shutil.which("mpirun") is None:
        pytest.skip("no mpirun here")
    ranks = ["mpirun", "--oversubscribe", "-n", "3", *command(study, tmp_path, "--on", "mpi")]
    subprocess.run(ranks, check=True, capture_output=True, timeout=900)
    same(table(tmp_path), local)


def test_three_dask_workers_of_which_one_is_killed(study: Path, local: pd.DataFrame, tmp_path: Path) -> None:
    with LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster:
        pids = [worker.pid for worker in cluster.workers.values()]
        asked = command(study, tmp_path, "--on", "dask", "--scheduler", cluster.scheduler_address)
        run_and_hit(asked, tmp_path, lambda: os.kill(pids[0], signal.SIGKILL))
    same(table(tmp_path), local)


@pytest.mark.skipif(bool(making_slurm.missing()), reason=f"no {', '.join(making_slurm.missing())} here")
def test_jobs_of_slurm_of_which_one_loses_its_node(study: Path, local: pd.DataFrame, tmp_path: Path) -> None:
    queue, out = tmp_path / "queue.toml", tmp_path / "out"
    (tmp_path / "logs").mkdir()
    queue.write_text(
        '[slurm]\njobs = 2\ncores = 1\nmemory = "2GB"\nwalltime = "00:20:00"\n'
        f'log_directory = "{tmp_path}/logs"\nscheduler_options = {{ host = "127.0.0.1", dashboard_address = ":0" }}\n'
    )
    with making_slurm.slurm(tmp_path / "slurm", 2) as env:

        def jobs() -> list[list[str]]:
            asked = ["squeue", "-h", "-t", "running", "-o", "%A %N"]
            said = subprocess.run(asked, env=env, capture_output=True, text=True, check=True).stdout
            return [line.split() for line in said.splitlines()]

        def lose() -> None:
            (_, node), *_ = jobs()
            down = ["scontrol", "update", f"nodename={node}", "state=down", "reason=lost"]
            subprocess.run(down, env=env, check=True)

        said = run_and_hit(command(study, out, "--on", "dask", "--scheduler", str(queue)), out, lose, env)
        assert "2 workers when their jobs begin" in said
        end = time.monotonic() + 60
        while jobs():  # the command's end ends its jobs
            assert time.monotonic() < end
            time.sleep(0.5)
    same(table(out), local)
