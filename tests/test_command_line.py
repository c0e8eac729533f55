"""What the machine lacks ends a command in one line with exit status 2."""

from __future__ import annotations

import errno
import inspect
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from legfem.__main__ import COMMANDS
from legfem.__main__ import command as application
from legfem.api.loading import in_python_words
from legfem.common.command_line import BAD_INPUT, FAILED, command_context
from legfem.common.errors import Argument, Command, InputError, Remedy
from legfem.common.input_files import FileTable, parse_toml


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "out/result.json"), "out/result.json: No"),
        (PermissionError(errno.EACCES, "Permission denied", "x"), "x: Permission denied"),
        (MemoryError(), "not enough"),
        (RecursionError(), "nested too deeply"),
        (InputError("a", "b", "c", "d"), "a: b: c; d"),
    ],
)
def test_what_the_machine_lacks_is_one_line(capsys, error, words):
    with pytest.raises(typer.Exit) as left, command_context():
        raise error
    said = capsys.readouterr().err
    assert left.value.exit_code == BAD_INPUT
    assert words in said and said.count("\n") == 1


def test_a_reader_that_left_is_not_a_full_disk():
    with pytest.raises(BrokenPipeError), command_context():
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")


@pytest.mark.parametrize("loaded", ["before", "inside"])
def test_a_reader_that_leaves_after_petsc_was_loaded_ends_a_command_quietly(loaded):
    petsc = {loaded: "import petsc4py.PETSc"}
    work = f"""
from legfem.common.command_line import command_context
{petsc.get("before", "")}
try:
    with command_context():
        {petsc.get("inside", "")}
        input()
        print("x" * 100_000, flush=True)
except BrokenPipeError:
    raise SystemExit(7)
"""
    command = [sys.executable, "-c", work]
    ends = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen(command, text=True, **ends) as process:
        process.stdout.close()
        process.stdin.write("now\n")
        process.stdin.close()
        said = process.stderr.read()
    assert process.returncode == 7, said
    assert "PETSC" not in said


def test_a_deeply_nested_toml_is_refused(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("a = " + "[" * 100_000)
    with pytest.raises(InputError, match="nested too deeply"):
        parse_toml(path, FileTable, "a folder")


def test_an_error_is_worded_by_each_door_and_survives_a_process():
    remedy = Remedy("give ", Argument("site", "the back"), " to ", Command("study doe", given="a leg"), " {as it is}")
    error = InputError(Argument("leave_out"), Argument("depth", "3"), "is wrong", remedy)
    error = pickle.loads(pickle.dumps(error.at(problem="is odd")))
    said = "--leave-out: --depth 3: is odd; give --site 'the back' to legfem study doe 'a leg' {as it is}"
    assert str(error) == said
    assert str(error.worded(lambda one: one.name)) == ("leave_out: depth: is odd; give site to study doe {as it is}")


def test_a_package_that_is_missing_is_one_line_that_says_how_to_get_it(capsys):
    for name, words in (("dolfinx.fem", "DOLFINx, which solves"), ("gmsh", "gmsh isn't installed")):
        with pytest.raises(typer.Exit) as left, command_context():
            raise ModuleNotFoundError(name=name)
        said = capsys.readouterr().err
        assert left.value.exit_code == FAILED
        assert words in said and "scripts/in-env" in said and said.count("\n") == 1
        with pytest.raises(ModuleNotFoundError, match=words), in_python_words():
            raise ModuleNotFoundError(name=name)
    with pytest.raises(ModuleNotFoundError), command_context():
        raise ModuleNotFoundError(name="legfem.none")


@pytest.mark.parametrize("name", ["identify", "study", "app"])
def test_without_typer_every_command_ends_in_that_line(tmp_path, name):
    (tmp_path / "typer.py").write_text("raise ModuleNotFoundError(name='typer')\n")
    there = f"{tmp_path}{os.pathsep}{Path(__file__).resolve().parents[1]}"
    for command in (["legfem", name], [f"legfem.{name}"]):
        done = subprocess.run(
            [sys.executable, "-m", *command],
            env={**os.environ, "PYTHONPATH": there},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 1 and done.stderr.startswith("legfem: typer isn't installed for ")
        assert done.stderr.count("\n") == 1


def _numbers() -> list[tuple[str, str]]:
    """Every command of every group, with each of its options that takes a number with decimals."""
    found = []
    for group in COMMANDS:
        made = application(group)
        one_by_one = typer.main.get_command(made)
        for registered in made.registered_commands:
            name = registered.name or registered.callback.__name__.replace("_", "-")
            among = getattr(one_by_one, "commands", {name: one_by_one})[name]
            for option in among.params:
                annotation = str(inspect.get_annotations(registered.callback).get(option.name))
                if count := annotation.count("float"):
                    words = f"{group} {name}" if hasattr(one_by_one, "commands") else group
                    found.append((words, f"{option.opts[0]}{' nan' * count}"))
    return found


@pytest.mark.parametrize("number", ["nan", "inf"])
@pytest.mark.parametrize(("words", "given"), _numbers())
def test_a_number_that_is_not_finite_is_refused_by_every_option(tmp_path, words, given, number):
    group, *rest = words.split()
    needed = {"meshing": ["--out", str(tmp_path / "a.inp")], "cohort": [str(tmp_path)]}.get(group, [])
    run = CliRunner().invoke(application(group), [*rest, *given.replace("nan", number).split(), *needed])
    option = given.split()[0]
    assert run.exit_code == BAD_INPUT
    assert (
        f"{option}: {number}: is not a finite number; give one" in run.output or f"value for '{option}'" in run.output
    )
    assert list(tmp_path.iterdir()) == []
