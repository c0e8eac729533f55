"""A solution that was killed goes on where it was, to the same curve."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_ranks import run_on_ranks
from mpi4py import MPI

from legfem.experiments.indentation import IndentationModel, IndentationRequest
from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.jobs.store import Checkpoint
from legfem.mechanics.materials import ReducedPolynomial
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
from legfem.solve.path import SolveReport
from legfem.solve.protocol import Protocol

TINY = LegMeshSettings(contact_size=12, depth_size=20, edge_size=8, growth=0.5, far_size=40)
DEEP = {"deep": ReducedPolynomial(2e-3, 28.0, 2e-3)}


class KilledError(Exception):
    """Stands for a kill."""


@pytest.fixture
def every_step(monkeypatch):
    monkeypatch.setattr(Checkpoint, "due", True)


def made(dimension: int = 3, **settings) -> IdealisedLegIndentation:
    given = IdealisedLegSettings(mesh=TINY, **settings)
    return IdealisedLegIndentation(IdealisedLeg(length=60), Cylinder(), DEEP, dimension, given)


def killed_at(depth: float):
    def on_step(at: float) -> None:
        if at > depth:
            raise KilledError

    return on_step


def numbers(report: SolveReport) -> list[tuple[float, bool, int]]:
    return [(step.displacement, step.converged, step.factorisations) for step in report.steps]


def test_a_killed_solution_goes_on_to_the_same_curve(tmp_path: Path, every_step):
    whole = made().solve(depth=4.0)
    folder = tmp_path / "states"
    with pytest.raises(KilledError):
        made().solve(depth=4.0, on_step=killed_at(1.5), keep_in=folder)
    assert len(list(folder.iterdir())) == 2
    later: list[float] = []
    resumed = made().solve(depth=4.0, on_step=later.append, keep_in=folder)
    assert min(later) > 1.5
    np.testing.assert_array_equal(resumed.curve.displacement, whole.curve.displacement)
    assert resumed.curve.force == pytest.approx(whole.curve.force, rel=1e-10, abs=1e-13)
    assert numbers(resumed.report) == numbers(whole.report)
    assert not folder.exists()


def test_it_goes_on_within_a_hold_too(tmp_path: Path, every_step):
    protocol = Protocol(np.array([0.0, 1.0, 3.0, 4.0]), np.array([0.0, 1.0, 1.0, 0.5]))
    folder = tmp_path / "states"

    def run(kill_after: int, keep: bool = True):
        left = [kill_after]

        def on_step(at: float) -> None:
            left[0] -= 1
            if left[0] == 0:
                raise KilledError

        pressing: IndentationModel = made(2).pressing
        kept = (folder, "a test") if keep else None
        return pressing.run(IndentationRequest(None, protocol, (), on_step), keep_in=kept)

    whole = run(0, keep=False)
    resumed, kills = None, 0
    while resumed is None:
        try:
            resumed = run(4)  # so three steps at a time
        except KilledError:
            kills += 1
    assert kills == (len(whole.path.time) - 2) // 3
    np.testing.assert_array_equal(resumed.path.time, whole.path.time)
    assert resumed.path.force == pytest.approx(whole.path.force, rel=1e-10, abs=1e-13)


@pytest.mark.parametrize("change", ["key", "ranks", "part", "shape"])
def test_states_of_something_else_are_passed_over(tmp_path: Path, change: str):
    checkpoint = Checkpoint(tmp_path / "states", "a key", MPI.COMM_SELF)
    arrays = {"unknown": np.arange(3.0)}
    checkpoint.save(arrays, {"position": 1.0})
    checkpoint.save({"unknown": np.arange(3.0) + 1}, {"position": 2.0})
    found = checkpoint.load({"unknown": (3,)})
    assert found is not None and found[1] == {"position": 2.0}
    assert found[0]["unknown"][0] == 1.0
    head = tmp_path / "states" / "last.json"
    shapes = {"unknown": (3,)}
    if change == "key":
        checkpoint = replace(checkpoint, key="another")
    elif change == "ranks":
        head.write_text(json.dumps({**json.loads(head.read_text()), "ranks": 2}))
    elif change == "part":
        next((tmp_path / "states").glob("*.npz")).unlink()
    else:
        shapes = {"unknown": (4,)}
    assert checkpoint.load(shapes) is None


@pytest.mark.slow
@pytest.mark.mpi
def test_a_killed_solution_goes_on_on_two_ranks(tmp_path: Path):
    whole, resumed = (run_on_ranks(2, "resuming.py", tmp_path / f"{how}.npz", how) for how in ("whole", "killed"))
    assert resumed["first"] > 1.0
    np.testing.assert_array_equal(resumed["displacement"], whole["displacement"])
    assert resumed["force"] == pytest.approx(whole["force"], rel=1e-10, abs=1e-13)
