"""A study of which nothing was solved says so by its exit status."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from typer.testing import CliRunner

from legfem.common.errors import UnsolvedError
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import NewtonOutcome
from studies.cases.__main__ import app as cases_app
from studies.people import __main__ as people
from studies.people.__main__ import app as people_app
from studies.people.probe import SolvedPoint
from studies.solvers import __main__ as solvers
from studies.solvers.__main__ import app as solvers_app


def test_solvers_of_which_none_ends_exit_nonzero(tmp_path, monkeypatch):
    monkeypatch.setattr(solvers, "measured_apart", lambda case: None)
    done = CliRunner().invoke(solvers_app, ["--size", "2000", "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "solvers: nothing was solved" in done.output
    assert (tmp_path / "report.md").is_file(), "what was tried is told all the same"


def test_people_for_whom_no_probe_is_solved_exit_nonzero(tmp_path, monkeypatch):
    failed = SolvedPoint((), (), "no step converges")
    monkeypatch.setattr(people, "read_indentations", lambda data: None)
    monkeypatch.setattr(people, "solve_points", lambda model, asked, *_: [failed] * len(asked))
    done = CliRunner().invoke(people_app, ["--out", str(tmp_path)])
    assert done.exit_code == 1, done.output
    assert "people: nothing was solved" in done.output
    assert "no step converges" in (tmp_path / "report.md").read_text()


@pytest.mark.slow
def test_planted_truths_whose_solver_never_converges_end_in_one_line(tmp_path, monkeypatch):
    def failing(self: NewtonSolver, *_: object) -> NewtonOutcome:
        return NewtonOutcome(False, "made to fail", 1, 1, np.inf)

    monkeypatch.setattr(NewtonSolver, "solve", failing)
    done = CliRunner().invoke(cases_app, ["layers", "--n", "1", "--jobs", "1", "--out", str(tmp_path)])
    assert done.exit_code == 1, done.output
    assert "nothing was solved" in done.output.strip().splitlines()[-1]


@pytest.mark.parametrize(
    ("study", "work", "options"),
    [
        ("fibres", "correction_of", ["--coarse", "--jobs", "1"]),
        ("leg3d", "identified", []),
        ("leg3d", "identified", ["--code", "felupe"]),
    ],
)
def test_a_study_that_cannot_be_solved_ends_in_one_line(tmp_path, monkeypatch, study, work, options):
    def failing(*_: object) -> None:
        raise UnsolvedError("it stops at 1 mm")

    module = import_module(f"studies.{study}.__main__")
    monkeypatch.setattr(module, work, failing)
    done = CliRunner().invoke(module.app, [*options, "--out", str(tmp_path)])
    assert done.exit_code == 1, done.output
    assert done.output.strip().splitlines()[-1] == "nothing was solved: it stops at 1 mm"
