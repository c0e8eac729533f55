"""A study in the app: a table of legs and of what is known of each, and the run that it becomes."""

from pathlib import Path
from tempfile import TemporaryDirectory

from legfem.app.runs import EVERY, Run
from legfem.app.workspace import Workspace, check_within, description_of
from legfem.cohort.members import Members, find_members
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError

TABLE = "study.csv"
"""In the run's folder."""
_COLUMNS = ("folder", "subject", "group", "side", "session", "date")
_SHOWN_AS = "the table"


def legs_of(workspace: Workspace) -> list[str]:
    """Return the names of the pressed legs of a workspace."""
    return sorted(name for name in workspace.inputs if description_of(workspace.input(name)) == "subject.toml")


def table_of(workspace: Workspace, run: str = "") -> str:
    """Return a study's table as text; without a run that of all pressed legs, each a person of its own."""
    if run:
        return (workspace.run(run) / TABLE).read_text(encoding="utf-8")
    empty = "," * (len(_COLUMNS) - 2)
    return "\n".join([",".join(_COLUMNS), *(f"{name},{name}{empty}" for name in legs_of(workspace))]) + "\n"


def members_of(workspace: Workspace, text: str) -> Members:
    """Return who is in a table.

    Raises
    ------
    InputError
        If it can't be read, or a row names no pressed leg of the workspace.
    """
    inputs = workspace.folder / "inputs"
    with TemporaryDirectory() as folder:
        path = Path(folder) / TABLE
        path.write_text(text, encoding="utf-8")
        try:
            found = find_members(inputs, "identify", table=path)
        except InputError as error:
            raise InputError(_SHOWN_AS, error.field, error.problem, error.remedy) from None
    for one in found.every:
        if one.problem:
            raise InputError(_SHOWN_AS, "folder", one.problem.replace(f"{path}: ", ""), "or delete the row")
        if not one.folder.is_relative_to(inputs.resolve()):
            raise InputError(
                _SHOWN_AS, "folder", f"{one.name} is not a leg of this workspace", "drop the leg here first"
            )
        check_within(one.folder)
    return found


def begin_study(workspace: Workspace, text: str, task: str, law: str, run: str = "") -> str:
    """Begin a study, or go on with one whose table has changed; return the run's name.

    Raises
    ------
    InputError
        As `members_of` does, and while the run that is to be changed isn't finished.
    """
    members_of(workspace, text)
    if run and Run(workspace.run(run)).alive:
        raise InputError("study", run, "is not finished", "stop it first")
    run = run or workspace.new_run("study")
    folder = workspace.run(run)
    write_atomically(folder / TABLE, text)
    options = ["--table", str(folder / TABLE), "--out", str(Run(folder).results), "--do", task]
    stated = ["--law", law] if law and task == "identify" else []
    Run.begun(folder, "legfem.cohort", [str(workspace.folder / "inputs"), *options, *stated], EVERY)
    return run
