"""Scripts run by mpirun, for tests that compare numbers of ranks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

VERIFICATION = Path(__file__).resolve().parent / "verification"


def environment() -> dict[str, str]:
    """Return the environment that mpirun starts in, with the tests' helpers on the path."""
    path = [VERIFICATION.parents[1], VERIFICATION.parent, os.environ.get("PYTHONPATH", "")]
    return {
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


def run_on_ranks(ranks: int, script: str, out: Path, *arguments: str, seconds: float = 300) -> dict[str, np.ndarray]:
    """Run a script of tests/verification, given arguments and out; return what it saved there."""
    command = ["mpirun", "-n", ranks, sys.executable, VERIFICATION / script, *arguments, out]
    done = subprocess.run(list(map(str, command)), env=environment(), capture_output=True, text=True, timeout=seconds)
    assert done.returncode == 0, done.stderr[-2000:]
    with np.load(out) as saved:
        found = dict(saved)
    assert found["ranks"] == ranks
    return found


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Return the greatest difference relative to the greatest value."""
    return float(np.abs(a - b).max() / np.abs(b).max())
