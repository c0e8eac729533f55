"""One load step of the idealised leg in a process of its own, and what its linear solver took."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from legfem.common.documents import write_document
from legfem.common.units import kpa_to_mpa
from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.structured import Cells, IdealisedLeg, LegMeshSettings, grid_counts
from legfem.solve.linear import LinearSettings
from legfem.solve.settings import StepSettings

_APART = "LEGFEM_APART"


def run_apart(command: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run a command to its end and return its exit status; Ctrl-C and errors end it.

    The command reads from a pipe that this process alone holds, however it ends. In its first rank
    `end_with_starter` sees when the pipe is closed.
    """
    process = subprocess.Popen(command, env={**environment, _APART: "1"}, stdin=subprocess.PIPE, text=True)
    try:
        return process.wait()
    except BaseException:
        process.terminate()
        process.wait()
        raise
    finally:
        if process.stdin is not None:
            process.stdin.close()


def end_with_starter() -> None:
    """Let this process end once the one whose `run_apart` started it has; mpirun ends the rest."""
    if os.environ.get(_APART) and not os.environ.get("OMPI_COMM_WORLD_RANK", "0").strip("0"):
        threading.Thread(target=_end_at_close, daemon=True).start()


def _end_at_close() -> None:
    # Not by sys.stdin, whose lock the interpreter wants as it ends.
    while os.read(0, 1024):
        pass
    os._exit(1)


@dataclass(frozen=True)
class SolverCase:
    """A load step from the undeformed state on the correction's reference leg.

    Parameters
    ----------
    size : int
        About how many unknowns, or how many tetrahedra.
    solver : {"direct", "iterative"}
        See `legfem.solve.linear`.
    cells : {"hexahedra", "tetrahedra"}
        The default's elements of second order in the mixed form, or tetrahedra of first order in
        the displacement form.
    ranks : int
        Of MPI.
    step : float
        mm.
    """

    size: int
    solver: Literal["direct", "iterative"]
    cells: Cells = "hexahedra"
    ranks: int = 1
    step: float = 0.5


@dataclass(frozen=True)
class SolverWork:
    """What a case took; times are of the processor, of the slowest rank."""

    unknowns: int
    cells: int
    nonzeros: int
    """Of the tangent."""
    complete: bool
    tangents: int
    """Assembled, and factorised where the solver is direct."""
    solves: int
    """Of linear systems."""
    iterations: list[int] = field(default_factory=list)
    """Of every linear solve."""
    linear_seconds: float = 0.0
    """Median of a solve with a new tangent: factorisation, or multigrid's setup and iterations."""
    total_seconds: float = 0.0
    """Of the load step."""
    wall_seconds: float = 0.0
    """Of the load step, by the clock."""
    start_GiB: float = 0.0
    """Peak memory before the first solve, summed over the ranks: libraries, mesh and forms."""
    peak_GiB: float = 0.0
    """Peak memory at the end, summed over the ranks."""
    force_N: float = 0.0


def mesh_of_size(case: SolverCase, leg: IdealisedLeg, cylinder: Cylinder) -> LegMeshSettings:
    """Return the default mesh refined or coarsened so that it comes closest to a case's size."""
    linear = case.cells == "tetrahedra"
    base = LegMeshSettings(cells=case.cells, degree=1 if linear else 2)

    def size(mesh: LegMeshSettings) -> int:
        counts = np.array(grid_counts(leg, cylinder.radius, cylinder.length, mesh))
        cells = int(counts.prod())
        # Each hexahedron holds four pressures.
        return 6 * cells if linear else int(3 * (2 * counts + 1).prod()) + 4 * cells

    candidates = [base.refined(factor) for factor in np.geomspace(0.3, 8.0, 400)]
    return min(candidates, key=lambda mesh: abs(size(mesh) - case.size))


def measure(case: SolverCase, comm: MPI.Intracomm = MPI.COMM_WORLD) -> SolverWork:
    """Do the load step; collective."""
    leg, cylinder = IdealisedLeg(), Cylinder()
    settings = IdealisedLegSettings(
        mesh=mesh_of_size(case, leg, cylinder),
        linear=LinearSettings(solver=case.solver),
        steps=StepSettings.regular(first=case.step),
        formulation="mixed" if case.cells == "hexahedra" else "displacement",
    )
    if case.cells == "tetrahedra":
        # Twice as long as its linear elements at the edge at least, whatever the size asked for.
        resolved = max(cylinder.edge_radius, settings.mesh.edge_size / 2)
        cylinder = replace(cylinder, edge_radius=resolved)
    tissue = {"deep": NeoHookean(kpa_to_mpa(2.0), 28.0)}
    test = IdealisedLegIndentation(leg, cylinder, tissue, 3, settings, comm)
    timer = _Timer(test.solver.linear_solver, test.system.tangent_matrix)
    start = peak_memory(comm)
    clock, processor = time.perf_counter(), time.process_time()
    solved = test.solve(depth=case.step)
    wall, seconds = time.perf_counter() - clock, time.process_time() - processor
    mesh = test.leg_mesh.mesh
    return SolverWork(
        unknowns=test.system.spaces.unknowns,
        cells=int(mesh.topology.index_map(mesh.topology.dim).size_global),
        nonzeros=int(test.system.tangent_matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]),
        complete=solved.report.complete,
        tangents=solved.report.factorisations,
        solves=len(timer.iterations),
        iterations=timer.iterations,
        linear_seconds=_most(comm, float(np.median(timer.seconds))),
        total_seconds=_most(comm, seconds),
        wall_seconds=_most(comm, wall),
        start_GiB=start,
        peak_GiB=peak_memory(comm),
        force_N=float(solved.curve.force[-1]),
    )


class _Timer:
    """Processor time of the linear solves that follow a new tangent, and iterations of all."""

    def __init__(self, linear: PETSc.KSP, tangent: PETSc.Mat) -> None:
        self.seconds: list[float] = []
        self.iterations: list[int] = []
        self._tangent, self._state, self._new, self._started = tangent, -1, False, 0.0
        linear.setPreSolve(self._before)
        linear.setPostSolve(self._after)

    def _before(self, linear: PETSc.KSP, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        state = self._tangent.stateGet()
        self._new, self._state = state != self._state, state
        self._started = time.process_time()

    def _after(self, linear: PETSc.KSP, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        if self._new:
            self.seconds.append(time.process_time() - self._started)
        self.iterations.append(linear.getIterationNumber())


def _most(comm: MPI.Intracomm, value: float) -> float:
    return float(comm.allreduce(value, MPI.MAX))


def peak_memory(comm: MPI.Intracomm) -> float:
    """Return the peak resident memory summed over ranks (GiB)."""
    status = Path("/proc/self/status")
    if status.exists():  # of this program alone: getrusage counts what started it, too
        lines = status.read_text().splitlines()
        kibibytes = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    else:
        kibibytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(comm.allreduce(kibibytes)) / 2**20


def _main(given: str, out: str) -> None:
    end_with_starter()
    case = SolverCase(**json.loads(Path(given).read_text()))
    work = measure(case)
    if MPI.COMM_WORLD.rank == 0:
        write_document(Path(out), asdict(work))


if __name__ == "__main__":
    _main(*sys.argv[1:])
