"""The command on a folder of specimens."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from legfem.commands.identify import app


def test_the_command_predicts_what_it_leaves_out(bars: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = [
        "--specimen-dir",
        str(bars),
        "--law",
        "neo-hookean",
        "--leave-out",
        "slow",
        "--prior",
        "deep.C10=7 x/ 1.5 kPa",
        "--out",
        str(out),
        "--jobs",
        "1",
    ]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    assert "left out, slow: predicted with R² 0.9" in done.output
    (document,) = json.loads((out / "result.json").read_text())["laws"].values()
    assert [one["fitted"] for one in document["tests"]] == [True, True, False]
    report = (out / "report.txt").read_text()
    assert "SIMULATED" in report and (out / "fit.png").is_file()
    again = CliRunner().invoke(app, asked)
    assert again.exit_code == 0
    (second,) = json.loads((out / "result.json").read_text())["laws"].values()
    assert second["forward_solves_reused"] == second["forward_solves"]
    assert second["parameters"] == document["parameters"]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--leave-out", "nobody"], "is neither a recording nor a specimen"),
        (["--leave-out", "bar"], "leaves nothing to fit"),
        (["--identify", "deep.C1"], "did you mean deep.C10"),
        (["--subject", "3"], "is given as well"),
    ],
)
def test_a_wrong_option_is_one_line(bars: Path, more: list[str], words: str) -> None:
    done = CliRunner().invoke(app, ["--specimen-dir", str(bars), "--jobs", "1", *more])
    assert done.exit_code == 2 and words in done.output
