"""What the machine lacks (room, streams, a home, memory) costs no result, and is said in a line."""

from __future__ import annotations

import errno
import json
import logging
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from making_results import result
from matplotlib.figure import Figure
from test_fields import block

from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of
from legfem.report import render
from legfem.report.results import write_report


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """As where a quota or a full disk ends a file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_fields_without_room_are_left_out_in_a_line_before_the_writer_ends_the_program(tmp_path: Path, caplog) -> None:
    fields = fields_of(block("displacement"))
    with files_of_at_most(3000), caplog.at_level(logging.WARNING, "legfem"):
        assert write_fields(fields, tmp_path) == []
    assert list(tmp_path.iterdir()) == []
    (said,) = caplog.messages
    assert said == f"{tmp_path}: no room for fields for ParaView (File too large): they are left out"
    assert write_fields(fields, tmp_path) != []


def test_a_picture_that_cannot_be_written_takes_no_report_with_it(tmp_path: Path, monkeypatch, caplog) -> None:
    draw = Figure.savefig

    def full(self: Figure, where: object, **options: object) -> None:
        draw(self, where, **options)
        if isinstance(where, Path) and where.name == "fit.svg":
            where.write_text("half of a")
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    with caplog.at_level(logging.WARNING, "legfem"):
        report = write_report([result("neo-hookean")], tmp_path / "out")
    there = {path.name for path in report.parent.iterdir()}
    assert {"report.html", "report.txt", "result.json", "section.png"} <= there
    assert not {"fit.png", "fit.svg"} & there and "fit.png" not in report.read_text()
    assert caplog.messages == ["fit.png: can't be written (No space left on device): the report does without it"]


def test_a_page_without_room_leaves_the_numbers(tmp_path: Path, monkeypatch) -> None:
    def full(*_: object) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(render, "rendered", full)
    with pytest.raises(OSError, match="No space") as raised:
        write_report([result("neo-hookean")], tmp_path / "out")
    assert raised.value.filename == str(tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir() if path.name[0] != "."] == ["result.json"]
    assert json.loads((tmp_path / "out" / "result.json").read_text())["laws"]


def begun(code: str, streams: str = "", **environment: str | None) -> subprocess.CompletedProcess[str]:
    """Run code after legfem's command line was set up, with streams closed by a shell."""
    given = {name: value for name, value in {**os.environ, **environment}.items() if value is not None}
    program = f"from legfem.__main__ import command\ncommand('app')\n{code}"
    shell = ["bash", "-c", f'"$0" -c "$1" {streams}', sys.executable, program]
    return subprocess.run(shell, env=given, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("streams", [">&- 2>&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_files_of_ours(tmp_path: Path, streams: str) -> None:
    kept = tmp_path / "kept"
    code = f"""
import os, sys
with open({str(kept)!r}, "w") as file:
    os.write(1, b"a library prints"), os.write(2, b"a library warns")
    print("we print", sys.stderr.isatty(), flush=True)
    file.write("ours")
"""
    done = begun(code, streams)
    assert done.returncode == 0, done.stderr
    assert kept.read_text() == "ours"


def test_without_a_home_mpi_starts() -> None:
    done = begun("from mpi4py import MPI\nprint('ranks', MPI.COMM_WORLD.size)", HOME=None)
    assert done.returncode == 0 and "ranks 1" in done.stdout


def test_too_little_memory_is_a_line() -> None:
    shell = ["bash", "-c", 'ulimit -v 400000; exec "$0" -m legfem identify --subject 3', sys.executable]
    done = subprocess.run(shell, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert done.stderr == "legfem: memory: 410 MB are allowed (ulimit -v); allow 1200 MB\n"
