"""The same curve on one rank and on several: PETSc's own LU on one, MUMPS on more."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from making_ranks import difference, run_on_ranks

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")]


def _check(ranks: int, formulation: str, folder: Path) -> None:
    one, more = (run_on_ranks(number, "ranks.py", folder / f"{number}.npz", formulation) for number in (1, ranks))
    np.testing.assert_array_equal(one["displacement"], more["displacement"])
    assert more["factorisations"] == pytest.approx(float(one["factorisations"]), rel=0.1)
    for name in ("force", "sensitivities", "contact", "bone", "works"):
        print(formulation, ranks, name, f"{difference(more[name], one[name]):.1e}")
        assert difference(more[name], one[name]) < 1e-9, name


def test_two_ranks_give_the_same_curve(tmp_path):
    _check(2, "mixed", tmp_path)


def test_ranks_do_a_task_together_each_with_its_context(tmp_path):
    found = run_on_ranks(2, "ranks_together.py", tmp_path / "2.npz")
    assert found["found"].tolist() == [22, 42, 82]
    assert "is negative" in str(found["refused"])


@pytest.mark.slow
def test_a_leg_is_identified_in_3d_alike_on_two_ranks(tmp_path):
    one, two = (
        run_on_ranks(number, "ranks_identify_3d.py", tmp_path / f"{number}.npz", seconds=1800) for number in (1, 2)
    )
    assert one["solves"] == two["solves"] >= 2
    for name in ("value", "ci95", "force"):
        print(name, f"{difference(two[name], one[name]):.1e}")
        assert difference(two[name], one[name]) < 1e-6, name


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 3])
def test_displacement_form_on_several_ranks(tmp_path, ranks):
    _check(ranks, "displacement", tmp_path)


@pytest.mark.slow
def test_the_correction_is_the_same_on_two_ranks(tmp_path):
    _check_correction(2, "direct", tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("ranks", [2, 4])
def test_the_correction_is_that_of_factors_on_one_rank(tmp_path, solver, ranks):
    _check_correction(ranks, solver, tmp_path)


def _check_correction(ranks: int, solver: str, folder: Path) -> None:
    one, more = (
        run_on_ranks(number, "ranks_3d.py", folder / f"{number}.npz", kind)
        for number, kind in ((1, "direct"), (ranks, solver))
    )
    print(solver, ranks, f"{np.abs(more['P'] - one['P']).max():.1e}")
    assert np.abs(more["P"] - one["P"]).max() < 1e-6
    assert difference(np.sort(more["pressure"]), np.sort(one["pressure"])) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("ranks, solver", [(2, "iterative"), (4, "iterative"), (4, "direct")])
def test_a_leg_in_its_stocking_is_the_same_on_several_ranks(tmp_path, ranks, solver):
    one, more = (
        run_on_ranks(number, "ranks_compression.py", tmp_path / f"{number}.npz", solver) for number in (1, ranks)
    )
    for name in ("skin", "hull", "rate", "veins", "fat"):
        print(solver, ranks, name, f"{difference(more[name], one[name]):.1e}")
        assert difference(more[name], one[name]) < 1e-6, name
