"""A folder for results belongs to one command at a time, and to its user."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from making_ranks import run_on_ranks
from typer.testing import CliRunner

from legfem.__main__ import command
from legfem.common.command_line import results_folder
from legfem.common.documents import write_document
from legfem.common.errors import InputError

HOLDS = """
import sys, time
from pathlib import Path
from legfem.common.command_line import results_folder
with results_folder(Path(sys.argv[1]), "held"):
    print("held", flush=True)
    time.sleep(60)
"""


def holder(folder: Path) -> subprocess.Popen[str]:
    """Return a process that holds a folder."""
    process = subprocess.Popen([sys.executable, "-c", HOLDS, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    return process


def table(path: Path) -> Path:
    rows = "".join(f"{k / 10},{k / 20},{0.02 * k**1.3:.4f}\n" for k in range(200))
    path.write_text(f"time_s,displacement_mm,force_N\n{rows}")
    return path


def test_a_second_command_is_refused_in_a_line_and_the_first_ones_death_frees_the_folder(tmp_path: Path) -> None:
    out, trial = tmp_path / "out", table(tmp_path / "trial1.csv")
    arguments = ["look", str(trial), "--out", str(out)]
    with holder(out) as first:
        second = CliRunner().invoke(command("data"), arguments)
        assert second.exit_code == 2
        assert second.stderr.strip().splitlines()[-1].startswith(f"--out: {out}: process {first.pid} writes")
        assert [path.name for path in out.iterdir()] == [".lock"]
        first.send_signal(signal.SIGKILL)
    third = CliRunner().invoke(command("data"), arguments)
    assert third.exit_code == 0, third.output
    assert (out / "look.json").is_file() and not (out / ".lock").exists()


def test_a_command_that_writes_nothing_leaves_no_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(KeyError), results_folder(out, "x"):
        raise KeyError
    assert not out.exists()
    out.mkdir()
    with results_folder(out, "x"):
        pass
    assert out.is_dir()


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks_of_one_command_share_the_folder_and_are_refused_together(tmp_path: Path) -> None:
    free = run_on_ranks(2, "holding.py", tmp_path / "free.npz", str(tmp_path / "out"))
    assert list(free["refused"]) == [0, 0]
    with holder(tmp_path / "out") as first:
        held = run_on_ranks(2, "holding.py", tmp_path / "held.npz", str(tmp_path / "out"))
        first.kill()
    assert list(held["refused"]) == [1, 1]


@pytest.mark.parametrize("given", [["--out", ""], ["--out="], ["--subject-dir", ""]])
def test_an_empty_text_is_not_the_folder_that_one_is_in(given: list[str]) -> None:
    for name in ("identify", "diagnose", "stocking", "cohort", "live"):
        done = CliRunner().invoke(command(name), given)
        assert done.exit_code == 2
        assert done.stderr == f"{given[0].rstrip('=')}: value: is empty; give one, or leave it out\n"


@pytest.mark.parametrize(("umask", "mode"), [(0o077, 0o600), (0o022, 0o644), (0o027, 0o640)])
def test_files_are_read_by_those_whom_the_umask_lets(tmp_path: Path, umask: int, mode: int) -> None:
    before = os.umask(umask)
    try:
        path = write_document(tmp_path / "result.json", {})
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == mode
    with pytest.raises(InputError), results_folder(path, "x"):
        pass
