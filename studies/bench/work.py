"""What a piece of work takes, counted in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from mpi4py import MPI

from legfem.__main__ import command
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from studies.counting import Work, counted
from studies.reconstruct import read_definition, test_of
from studies.solvers.case import SolverCase, measure, peak_memory

SUBJECT = "3"
COMPARED = ("factorisations", "iterations", "residuals", "solves")
_IDENTIFY = f"identify --subject {SUBJECT} --law both --out FOLDER/identify --jobs 1"
_DIAGNOSE = "diagnose --library FOLDER/library --out FOLDER/diagnose --jobs 1"
TASKS: dict[str, tuple[str, ...]] = {
    "curve": (),
    "solid": (),
    "identify": (_IDENTIFY,),
    "identify-again": (_IDENTIFY, _IDENTIFY),
    "diagnose-specimen": (f"{_DIAGNOSE} --specimen-dir examples/specimen",),
    "diagnose": (f"{_DIAGNOSE} --subject {SUBJECT}",),
    "stocking": ("stocking --subject 1 --out FOLDER/stocking",),
    "doe": ("study doe --factorial-only --out FOLDER/doe --jobs 1",),
}
"""Commands of legfem, FOLDER being a fresh folder; the last one's work counts. Two tasks are solutions: subject 3's
curve to 30 mm, and a load step of an idealised leg in 3D."""
ASKED = ("doe",)
"""Tasks that are done only if they are asked for by name."""


def default_test() -> PlaneStrainIndentation:
    """Return the test of subject 3 with the parameters of the paper's Table 5."""
    return replace(test_of(read_definition(), SUBJECT), settings=PlaneStrainSettings())


def curve_work(test: PlaneStrainIndentation) -> Work:
    """Press to 30 mm, once forms are compiled, and return what that took."""
    test.solve({}, 0.5)
    return counted(lambda: test.solve({}, 30.0))[1]


def factorisation_seconds(test: PlaneStrainIndentation, times: int = 20) -> float:
    """Return the least time of the processor (s) for a factorisation at the test's present state."""
    tangent, linear = test.system.assemble_tangent(), test.solver.linear_solver
    diagonal, seconds = tangent.getDiagonal(), []
    for _ in range(times):
        tangent.setDiagonal(diagonal)  # marks the matrix as changed
        begun = time.process_time()
        linear.getPC().setUp()
        seconds.append(time.process_time() - begun)
    return min(seconds)


def run(words: str, folder: str) -> None:
    """Run a legfem command in this process."""
    name, *rest = words.replace("FOLDER", folder).split()
    command(name)(args=rest, standalone_mode=False, prog_name=f"legfem {name}")


def done(name: str, folder: str) -> Work:
    """Do a task in this process."""
    if name == "curve":
        test = default_test()
        work = replace(curve_work(test), factorisation_seconds=factorisation_seconds(test))
    elif name == "solid":
        work = counted(lambda: measure(SolverCase(8000, "direct")))[1]
    else:
        *first, last = TASKS[name]
        for words in first:
            run(words, folder)
        work = counted(lambda: run(last, folder))[1]
    return replace(work, peak_MiB=round(1024 * peak_memory(MPI.COMM_SELF)))


def done_apart(name: str) -> Work:
    """Do a task in a process of its own and a fresh folder."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "work.json")
        apart = [sys.executable, "-m", "studies.bench.work", name, folder]
        subprocess.run(apart, check=True, stdout=subprocess.DEVNULL)
        return Work(**json.loads(path.read_text()))


if __name__ == "__main__":
    Path(sys.argv[2], "work.json").write_text(json.dumps(asdict(done(*sys.argv[1:3]))))
