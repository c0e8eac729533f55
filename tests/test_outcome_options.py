"""``--quiet`` and ``--json``: every command has them, and prints what they promise."""

from __future__ import annotations

import json
from importlib import import_module

import pytest
import typer
from making import press, write_recording, write_subject
from typer.testing import CliRunner

from legfem.__main__ import COMMANDS
from legfem.common.command_line import brief_output

SERVES = "app"


def commands():
    """Return every command by name, those of a group by both names."""
    for name in COMMANDS:
        if name == SERVES:
            continue  # it has no result
        made = typer.main.get_command(import_module(f"legfem.commands.{name}").app)
        parts = getattr(made, "commands", None)
        yield from ([(name, made)] if parts is None else ((f"{name} {part}", one) for part, one in parts.items()))


@pytest.mark.parametrize(("name", "command"), list(commands()))
def test_every_command_is_quiet_and_gives_json_when_asked(name, command):
    options = {option for one in command.params for option in one.opts}
    assert {"--quiet", "--json"} <= options


def test_what_is_printed_is_kept_back_and_the_document_is_told(tmp_path, capsys):
    path = tmp_path / "result.json"
    path.write_text('{"a": 1}\n')
    short, document = f"result: {path}\n", '{"a": 1}\n'
    for quiet, as_json, told in (
        (False, False, "a table\n"),
        (True, False, short),
        (False, True, document),
        (True, True, document),
    ):
        with brief_output(quiet, as_json) as written:
            print("a table")
            written.append(path)
        assert capsys.readouterr().out == told
    with pytest.raises(ValueError, match="stopped"), brief_output(True, True) as written:
        written.append(path)
        raise ValueError("stopped")
    assert capsys.readouterr().out == ""


def ran(module: str, *arguments: str) -> str:
    done = CliRunner().invoke(import_module(f"legfem.commands.{module}").app, list(arguments))
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture
def leg(tmp_path):
    return write_subject(tmp_path / "leg")


def cases(leg, out):
    trial = str(write_recording(out / "good.csv", press(air=3.0, force_sd=0.01)))
    return {
        "look": (["data", "look", trial, "--out", str(out)], lambda d: d["recordings"][0]["grade"]),
        "preview": (["data", "preview", str(leg), "--out", str(out)], lambda d: d["pictures"]),
        "geometry": (["geometry", "--subject-dir", str(leg)], lambda d: 200 < d["girth_mm"] < 600),
        "meshing": (
            ["meshing", "--subject-dir", str(leg), "--out", str(out / "leg.inp"), "--finer", "0.5"],
            lambda d: d["regions"]["deep"]["elements"],
        ),
    }


@pytest.mark.parametrize("name", ["look", "preview", "geometry", "meshing"])
def test_json_is_all_that_is_printed_and_quiet_is_short(name, leg, tmp_path):
    arguments, says = cases(leg, tmp_path)[name]
    assert says(json.loads(ran(*arguments, "--json")))
    whole, brief = ran(*arguments), ran(*arguments, "--quiet")
    assert 0 < len(brief.splitlines()) <= 2 and len(brief) < len(whole)
