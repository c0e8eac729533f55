"""The same curve on one rank and on several: PETSc's own LU on one, MUMPS on more."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun"),
]
HERE = Path(__file__).resolve().parent


def _run(ranks: int, formulation: str, folder: Path) -> dict[str, np.ndarray]:
    out = folder / f"{formulation}-{ranks}.npz"
    path = [HERE.parents[1], HERE.parent, os.environ.get("PYTHONPATH", "")]
    environment = {
        # mpirun refuses to start within another run's environment.
        **{k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX", "PRTE_"))},
        "PYTHONPATH": os.pathsep.join(map(str, path)),
        "OMP_NUM_THREADS": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
    }
    command = ["mpirun", "-n", str(ranks), sys.executable, HERE / "ranks.py", formulation, out]
    done = subprocess.run(
        list(map(str, command)), env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr[-2000:]
    with np.load(out) as saved:
        found = dict(saved)
    assert found["ranks"] == ranks
    return found


def _difference(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


def _check(ranks: int, formulation: str, folder: Path) -> None:
    one, more = _run(1, formulation, folder), _run(ranks, formulation, folder)
    np.testing.assert_array_equal(one["displacement"], more["displacement"])
    assert one["factorisations"] == more["factorisations"]
    for name in ("force", "sensitivities", "contact", "bone", "works"):
        print(formulation, ranks, name, f"{_difference(more[name], one[name]):.1e}")
        assert _difference(more[name], one[name]) < 1e-9, name


def test_two_ranks_give_the_same_curve(tmp_path):
    _check(2, "mixed", tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 3])
def test_displacement_form_on_several_ranks(tmp_path, ranks):
    _check(ranks, "displacement", tmp_path)
