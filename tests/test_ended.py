"""A command that is ended says so, however that is asked, and leaves nothing half-written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from legfem.api import cohorts
from legfem.common.command_line import INTERRUPTED
from legfem.jobs.pool import interruptible

WORKS = """
import time
from legfem.__main__ import command
command("app")
import typer
from legfem.common.command_line import command_context

def work():
    with command_context("go on later"):
        import petsc4py.PETSc
        from mpi4py import MPI
        from legfem.jobs.pool import interruptible
        with interruptible():
            print("begun", flush=True)
            time.sleep(60)

typer.run(work)
"""


@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_batch_system_and_a_closed_terminal_end_a_command_as_ctrl_c_does(asked: signal.Signals) -> None:
    ends = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([sys.executable, "-c", WORKS], text=True, **ends) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(asked)
        said = process.stderr.read()
    assert process.returncode == INTERRUPTED
    assert said == "interrupted: go on later\n"


def test_what_nohup_began_does_not_end_with_its_terminal() -> None:
    begin = ["nohup", sys.executable, "-c", WORKS]
    with subprocess.Popen(begin, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(1.0)
        process.kill()


def test_an_end_that_a_library_took_for_a_failed_solve_is_raised_in_the_end() -> None:
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), interruptible():
            try:
                os.kill(os.getpid(), signal.SIGTERM)
                time.sleep(0.1)
            except KeyboardInterrupt:
                pass  # as a callback of PETSc's does
        assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("stops_at", ["cohort.xlsx", "cohort.html"])
def test_a_cohort_that_is_killed_as_it_ends_leaves_no_half_table(tmp_path: Path, monkeypatch, stops_at: str) -> None:
    """Files are written elsewhere, and each is moved to its place whole."""

    def write_tables(frame: pd.DataFrame, units: pd.DataFrame, folder: Path) -> None:
        (folder / "cohort.csv").write_text("whole")
        (folder / "cohort.xlsx").write_bytes(b"half of a workb")
        if stops_at == "cohort.xlsx":
            raise KeyboardInterrupt

    def write_page(page: object, folder: Path) -> Path:
        (folder / "cohort.html").write_text("half of")
        raise KeyboardInterrupt

    monkeypatch.setattr(cohorts.cohort_rows, "write_tables", write_tables)
    monkeypatch.setattr(cohorts, "write_cohort_page", write_page)
    monkeypatch.setattr(cohorts, "_check_apart", lambda *_: None)
    monkeypatch.setattr(cohorts.cohort_rows, "units_frame", lambda *_: pd.DataFrame())
    made = SimpleNamespace(
        members=None, rows=(), population=None, document=lambda: {}, to_frame=pd.DataFrame, _page=lambda: None
    )
    (tmp_path / "cohort.xlsx").write_text("the last one")
    with pytest.raises(KeyboardInterrupt):
        cohorts.Cohort.write(made, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"cohort.xlsx", "cohort.json"}
    assert (tmp_path / "cohort.xlsx").read_text() == "the last one"
