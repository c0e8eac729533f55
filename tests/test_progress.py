"""Progress: a bar with the time left on a terminal, lines elsewhere, nothing when asked for."""

from __future__ import annotations

import json
from io import StringIO
from itertools import pairwise
from pathlib import Path

import pytest

from legfem.commands.options import print_outcome
from legfem.common.progress import progress_on, reached


class Terminal(StringIO):
    """Passes for one."""

    def isatty(self) -> bool:
        return True


def worked(stream: StringIO, quiet: bool = False) -> str:
    with progress_on(stream, quiet) as progress:
        progress.stage("solving", 4)
        for k in range(3):
            progress.advance(f"C10 {k} kPa")
    return stream.getvalue()


def test_a_terminal_gets_a_bar_with_what_is_done_and_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "xterm")
    shown = worked(Terminal())
    assert "solving" in shown and "3/4" in shown and "left" in shown and "C10 2 kPa" in shown


def test_elsewhere_every_unit_is_a_line() -> None:
    lines = worked(StringIO()).splitlines()
    assert [line.split("] ")[1] for line in lines] == [
        "solving",
        "  1/4  C10 0 kPa",
        "  2/4  C10 1 kPa",
        "  3/4  C10 2 kPa",
    ]


def test_a_line_of_long_work_says_how_much_time_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 0.0, 0.0, 20.0, 20.0, 40.0, 40.0, 60.0, 60.0])
    monkeypatch.setattr("legfem.common.progress.time.perf_counter", lambda: next(clock))
    lines = worked(StringIO()).splitlines()
    assert lines[1:3] == [
        "[  20.0 s]   1/4  C10 0 kPa, about 60 s left",
        "[  40.0 s]   2/4  C10 1 kPa, about 40 s left",
    ]
    found = reached(lines)
    assert found is not None and found.last == "C10 2 kPa" and found.left == pytest.approx(20.0)


def test_a_notebook_gets_a_bar_on_a_line_that_is_written_over() -> None:
    stream = type("OutStream", (StringIO,), {"__module__": "ipykernel.iostream"})()
    seen = worked(stream).split("\r")
    assert seen[1].startswith("solving [........................] 0/4")
    assert "[" + 18 * "#" + 6 * "." + "] 3/4, 0 s left  C10 2 kPa" in seen[-1]
    assert "".join(seen).count("\n") == 1 and seen[-1].endswith("\n")
    assert all(len(new.rstrip("\n")) >= len(old.rstrip()) for old, new in pairwise(seen))


def test_quiet_says_nothing_on_either() -> None:
    assert worked(Terminal(), quiet=True) == worked(StringIO(), quiet=True) == ""


def test_the_end_of_a_command_is_text_paths_or_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = tmp_path / "result.json"
    result.write_text(json.dumps({"C10_kPa": 0.7}))
    report = tmp_path / "report.txt"
    (tmp_path / "report.html").touch()

    def printed(quiet: bool, as_json: bool) -> str:
        print_outcome("a text", result, report, quiet, as_json)
        return capsys.readouterr().out

    assert printed(False, False).startswith("a text\n")
    paths = f"result: {result}\nreport: {report}\npage:   {tmp_path / 'report.html'}\n"
    assert printed(True, False) == paths
    assert json.loads(printed(True, True)) == {"C10_kPa": 0.7}
