"""The study of linear solvers: its meshes, one case, and what it says."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import pytest
from mpi4py import MPI

from legfem.experiments.indenter_pose import Cylinder
from legfem.jobs.store import Store
from legfem.meshing.structured import IdealisedLeg, mesh_leg
from studies.solvers.__main__ import cases_of, run, solvers_table
from studies.solvers.case import SolverCase, SolverWork, measure, mesh_of_size

SMALL = SolverCase(3000, "iterative")


@pytest.mark.parametrize(
    ("cells", "size"), [pytest.param("hexahedra", 20_000, marks=pytest.mark.slow), ("tetrahedra", 60_000)]
)
def test_meshes_have_about_the_size_asked_for(cells, size):
    case, leg, cylinder = SolverCase(size, "iterative", cells), IdealisedLeg(), Cylinder()
    settings = mesh_of_size(case, leg, cylinder)
    if cells == "tetrahedra":
        made = mesh_leg(leg, cylinder.radius, cylinder.length, settings).mesh
        assert made.topology.index_map(3).size_global == pytest.approx(size, rel=0.15)
    else:
        assert measure(replace(SMALL, size=3000)).unknowns == pytest.approx(3000, rel=0.15)


def test_factors_and_iterations_are_measured_at_the_same_state():
    direct, iterative = (measure(replace(SMALL, solver=solver), MPI.COMM_SELF) for solver in ("direct", "iterative"))
    assert direct.complete and iterative.complete
    assert iterative.force_N == pytest.approx(direct.force_N, rel=1e-7)
    assert len(iterative.iterations) == iterative.solves == iterative.tangents
    assert min(iterative.iterations) > 1 and max(direct.iterations) == 1
    assert direct.tangents < direct.solves
    assert direct.peak_GiB >= direct.start_GiB > 0.05
    assert direct.linear_seconds > 0


def test_cases_are_the_smallest_first_without_factors_of_the_largest():
    cases = cases_of([60_000, 20_000], 500_000, [1, 2], direct_up_to=20_000)
    direct = [case for case in cases if case.solver == "direct"]
    assert [case.size for case in cases][:4] == [20_000] * 4
    assert {case.size for case in direct} == {20_000}
    assert [case.cells for case in cases].count("tetrahedra") == 2


def made(iterations: int, seconds: float) -> SolverWork:
    return SolverWork(20_000, 900, 3_500_000, True, 8, 8, [iterations] * 8, 1.0, seconds, seconds, 0.3, 0.6, 0.2)


def test_the_report_has_a_row_a_case_and_says_which_ended():
    measured = {
        replace(SMALL, size=20_000): made(15, 10.0),
        replace(SMALL, size=20_000, solver="direct"): made(1, 5.0),
        replace(SMALL, size=20_000, ranks=2): made(16, 6.0),
        replace(SMALL, size=60_000): replace(made(24, 40.0), unknowns=60_000),
        replace(SMALL, size=200_000): None,
    }
    table = solvers_table(measured)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:7]]
    assert [row[-1] for row in rows[:4]] == ["0.30"] * 4 and rows[4][4] == "ended"
    assert {len(row) for row in rows} == {12}


def test_measured_cases_are_not_measured_again(tmp_path, capsys):
    Store(tmp_path / "cases", SolverWork, modules=("studies.solvers.case",)).put(SMALL, made(15, 10.0))
    run([SMALL], tmp_path)
    assert "20000" in capsys.readouterr().out
    found = json.loads((tmp_path / "result.json").read_text())["cases"]
    assert found == [{"case": asdict(SMALL), "work": asdict(made(15, 10.0))}]
    assert "20000" in (tmp_path / "report.md").read_text()
