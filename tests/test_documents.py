"""Every command, path and module that the documents name is there."""

from __future__ import annotations

import importlib
import inspect
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from legfem.app.description import known_tests

ROOT = Path(__file__).resolve().parents[1]

COMMANDS = (
    "legfem.identify",
    "legfem.diagnose",
    "legfem.live",
    "legfem.stocking",
    "legfem.geometry",
    "legfem.meshing",
    "legfem.study",
    "legfem.plan",
    "legfem.data",
    "legfem.app",
    "legfem.cohort",
    "studies.cases",
    "studies.recordings",
    "studies.solvers",
    "studies.stockings",
    "studies.reconstruct",
    "studies.meshes",
    "studies.bench",
    "studies.cohort",
    "studies.cohort.scored",
    "studies.cohort.simulated",
    "studies.cohort.two_layers",
    "studies.frauziols",
    "studies.fibres",
    "studies.leg3d",
    "studies.leg3d.codes",
    "studies.leg3d.fascia",
    "studies.leg3d.fibres",
    "studies.leg3d.meshes",
    "studies.people",
)


def tracked() -> list[Path]:
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout")
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True, check=True)
    return [ROOT / name for name in listed.stdout.split("\0") if name]


def documents() -> list[Path]:
    ours = {".md", ".toml", ".py", ".slurm", ".yml", ".cff"}
    return [
        path
        for path in tracked()
        if (path.suffix in ours or path.name in ("Makefile", "Dockerfile", "in-env"))
        and path.is_file()
        and path != Path(__file__)
    ]


def found(pattern: str, *suffixes: str) -> Iterator[tuple[Path, re.Match[str]]]:
    for path in documents():
        if not suffixes or path.suffix in suffixes:
            for match in re.finditer(pattern, path.read_text(encoding="utf-8")):
                yield path, match


def where(path: Path, match: re.Match[str]) -> str:
    return f"{path.relative_to(ROOT)}: {match[0]!r}"


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_shows_its_help(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    # runpy warns of what is imported; a package has to stay, others hold it.
    package = (ROOT / name.replace(".", "/")).is_dir()
    monkeypatch.delitem(sys.modules, f"{name}.__main__" if package else name, raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module(name, run_name="__main__")
    assert not ended.value.code
    shown = capsys.readouterr().out
    typed = name.replace(".", " ") if name.startswith("legfem.") else f"python -m {name}"
    assert f"Usage: {typed} " in shown
    assert f"Example: {typed}" in shown


def test_commands_are_those_of_the_packages() -> None:
    there = {path.parent for path in ROOT.glob("legfem/*/__main__.py")}
    there |= {path.parent for path in ROOT.glob("studies/*/__main__.py")}
    names = {".".join(path.relative_to(ROOT).parts) for path in there}
    assert names == {name for name in COMMANDS if (ROOT / name.replace(".", "/")).is_dir()}


def options_of(module: str, words: list[str]) -> set[str]:
    """Return the options that a command, or its subcommand among the words, takes."""
    package = (ROOT / module.replace(".", "/")).is_dir()
    holder = f"{module}.__main__" if package else module
    command = typer.main.get_command(importlib.import_module(holder).app)
    for word in words:
        commands = getattr(command, "commands", {})
        if word in commands:
            command = commands[word]
    return {"--help", *(name for entry in command.params for name in entry.opts)}


@pytest.mark.parametrize("name", [name for name in COMMANDS if name.startswith("legfem.")])
def test_a_command_says_what_each_option_is_for_and_tells_of_none_that_it_has_not(name: str) -> None:
    app = importlib.import_module(f"legfem.commands.{name.rpartition('.')[2]}").app
    entry = typer.main.get_command(app)
    for command in getattr(entry, "commands", {"": entry}).values():
        assert [one.name for one in command.params if not one.help] == []
        told = inspect.getdoc(command.callback).partition("Parameters\n----------\n")[2]
        assert set(re.findall(r"^\w+", told, re.MULTILINE)) <= {one.name for one in command.params}
        assert "Parameters" not in command.help


def test_commands_in_documents_take_their_options() -> None:
    wrong = []
    # Names in capitals stand for any. A command may go on in the next line, and ends at a comma.
    word = r"(?!scripts/)[^`\s\"'),;]+"
    pattern = rf"python -m ((?:legfem|studies)(?:\.[a-z]\w*)*)\b(?!\.)((?:[ \n]{word})*)"
    short = rf"(?:in-env |mpirun -n \d+ |`|^)(legfem [a-z]+)\b((?:[ \n]{word})*)"
    for path, match in [*found(pattern), *found(short)]:
        module = match[1].replace(" ", ".")
        if module in ("legfem", "studies.solvers.case"):
            continue
        words = match[2].split()
        if module not in COMMANDS:
            wrong.append(where(path, match))
            continue
        asked = {word.strip("[].:|\\") for word in words if word.startswith(("--", "[--"))}
        if not {name.split("=")[0] for name in asked} <= options_of(module, words):
            wrong.append(where(path, match))
    assert not wrong, "\n".join(wrong)


def test_paths_in_documents_are_there() -> None:
    wrong = []
    pattern = r"(?<![\w./*-])((?:legfem|studies|tests|scripts|meshes)/[\w./*-]*\w)"
    for path, match in found(pattern):
        if path.name != "test_house.py" and not list(ROOT.glob(match[1])):
            wrong.append(where(path, match))
    assert not wrong, "\n".join(wrong)


def test_links_lead_somewhere() -> None:
    wrong = [
        where(path, match)
        for path, match in found(r"\]\((?!https?:|#)([^)#\s]+)[^)]*\)", ".md")
        if not (path.parent / match[1]).exists()
    ]
    assert not wrong, "\n".join(wrong)


def is_there(name: str) -> bool:
    """Whether a dotted name is a module, or what stands in one."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            thing: object = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            fields = getattr(thing, "__dataclass_fields__", {})
            if not hasattr(thing, part) and part not in fields:
                return False
            thing = getattr(thing, part, None)
        return True
    return False


def test_modules_in_documents_are_there() -> None:
    named = [(path, match) for path, match in found(r"`((?:legfem|studies)(?:\.\w+)+)`") if not is_there(match[1])]
    assert not [where(path, match) for path, match in named]


def test_the_page_of_specimens_keys_has_every_test_and_key() -> None:
    page = (ROOT / "docs" / "reference" / "specimen-keys.md").read_text(encoding="utf-8")
    for name, settings in known_tests().items():
        part = page.partition(f"## `[{name}]`")[2].partition("\n## ")[0]
        for one in settings:
            assert f"| `{'.'.join(one.key[1:])}` |" in part, one.name


def test_the_page_of_an_own_leg_is_short() -> None:
    lines = (ROOT / "docs" / "tutorials" / "own-leg.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 62
