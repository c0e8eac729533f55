"""Six hundred broken inputs of every kind, to all commands, calls and uploads: told in a line, in time, or taken."""

from __future__ import annotations

import csv
import json
import os
import re
import select
import subprocess
import sys
from pathlib import Path

import pytest
from making_attacks import ALL, GOOD, OUT, Attack, attack

COUNT, SEED = 600, 50_000
LONGEST_S = 60.0
PREVIEW = "preview"
PROGRESS = re.compile(r"\[ *[\d.]+ s\]")


class Answering:
    """The process that is asked, ended where it doesn't answer in time."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def ask(self, one: Attack, out: Path) -> dict[str, object]:
        if self._process is None:
            here = Path(__file__).parent
            self._process = subprocess.Popen(
                [sys.executable, str(here / "making_attacks.py")],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                cwd=out.parent,
                env=os.environ | {"PYTHONPATH": f"{here}{os.pathsep}{here.parent}", "OMP_NUM_THREADS": "1"},
            )
            assert self._process.stdout is not None and self._process.stdout.readline() == "ready\n"
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        words = [word.replace(OUT, str(out)) for word in one.words]
        try:
            print(json.dumps({"how": one.how, "words": words, "folder": one.folder}), file=stdin, flush=True)
        except BrokenPipeError:
            self.end()
            return {"status": -2, "told": "the process has ended", "printed": ""}
        ready, _, _ = select.select([stdout], [], [], LONGEST_S)
        line = stdout.readline() if ready else ""
        if not line:
            self.end()
            return {"status": -3, "told": "hangs" if not ready else "the process has ended", "printed": ""}
        found: dict[str, object] = json.loads(line)
        return found

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._process = None


@pytest.fixture
def answering():
    process = Answering()
    yield process
    process.end()


def wrong_with(one: Attack, answer: dict[str, object], out: Path) -> str:
    """Return what is wrong with an answer; nothing where it is as it should be."""
    status, told, printed = answer["status"], str(answer["told"]), str(answer["printed"])
    if status not in (0, 1, 2):
        return told[-3000:]
    lines = [line for line in told.splitlines() if not (line.startswith("warning: ") or PROGRESS.match(line))]
    if status and not told.startswith(("Usage: ", "Error: ")) and (len(lines) != 1 or ";" not in told):
        return f"status {status}, and not one line: {told[-1500:]!r}"
    there = sorted(path for path in out.rglob("*") if path.is_file()) if out.exists() else []
    if status == 2 and one.how == "command" and PREVIEW not in one.words and there:
        return f"refused, and left {there}"
    for path in there:
        if path.suffix == ".json":
            json.loads(path.read_text())
    if status == 0 and one.words[:2] == ["data", "look"]:
        return _lost(Path(one.words[2]), printed)
    return ""


def _lost(path: Path, printed: str) -> str:
    """Tell of rows of numbers that a reading of CSV left out without a word."""
    if path.suffix != ".csv" or "below the numbers" in printed or "without numbers" in printed:
        return ""
    samples = next((int(line.split("|")[2].split()[0]) for line in printed.splitlines() if "| samples" in line), 0)
    text = path.read_bytes().decode("latin-1").replace("\0", "")
    rows = [row for mark in ",;\t" for row in csv.reader(text.splitlines(), delimiter=mark)]
    most = sum(len(row) >= 3 and all(_is_number(cell) for cell in row[:3]) for row in rows)
    # A first sample that was written twice counts once.
    return "" if samples >= most - 1 else f"{samples} samples of {most} rows of numbers"


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize("kind", GOOD)
def test_what_is_whole_is_taken_by_every_command(tmp_path, answering, kind):
    make, commands = GOOD[kind]
    make(tmp_path / "given")
    for k, words in enumerate(commands):
        whole = [word.replace("{}", str(tmp_path / "given")) for word in words]
        answer = answering.ask(Attack("command", whole, "", ""), tmp_path / f"out{k}")
        assert answer["status"] == 0, answer["told"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ALL)
def test_six_hundred_broken_inputs_end_in_a_line_or_are_taken(tmp_path, answering, kind, capsys):
    """``LEGFEM_ATTACKS=FROM:TO`` runs others."""
    first, _, last = os.environ.get("LEGFEM_ATTACKS", f"{SEED}:{SEED + COUNT}").partition(":")
    faults, taken = [], 0
    for seed in (seed for seed in range(int(first), int(last)) if ALL[seed % len(ALL)] == kind):
        place = tmp_path / str(seed)
        place.mkdir()
        one = attack(seed, place / "given")
        answer = answering.ask(one, place / "out")
        taken += answer["status"] == 0
        if problem := wrong_with(one, answer, place / "out"):
            faults.append(f"seed {seed}, {one.told()}\n{problem}")
    with capsys.disabled():
        print(f"\n{kind}: {taken} taken, {len(faults)} wrong")
    assert not faults, "\n\n".join(faults)
