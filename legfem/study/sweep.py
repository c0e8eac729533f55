"""Many simulations of sections in parallel processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context

from legfem.experiments.plane_strain import (
    PlaneStrainIndentation,
    PlaneStrainSettings,
    Tissues,
)
from legfem.experiments.pressing import Indentation
from legfem.geometry.section import LegSection
from legfem.meshing.quality import MeshQuality
from legfem.subject import Indenter


@dataclass(frozen=True, eq=False)
class Run:
    """One simulation."""

    label: str
    section: LegSection
    indenter: Indenter
    tissues: Tissues
    depth: float
    """mm."""
    settings: PlaneStrainSettings = field(default_factory=PlaneStrainSettings)
    parameters: Mapping[str, float] = field(default_factory=dict)
    turns: Sequence[float] = ()


@dataclass(frozen=True, eq=False)
class RunOutcome:
    """A finished simulation; one that stopped short says so in its report."""

    run: Run
    indentation: Indentation
    quality: MeshQuality


def simulate(run: Run) -> RunOutcome:
    """Do one simulation."""
    experiment = PlaneStrainIndentation(run.section, run.indenter, run.tissues, run.settings)
    indentation = experiment.solve(run.parameters, run.depth, turns=run.turns)
    return RunOutcome(run, indentation, experiment.section_mesh.quality)


def sweep[Task, Outcome](
    tasks: Sequence[Task], work: Callable[[Task], Outcome], jobs: int
) -> Iterator[Outcome]:
    """Yield the outcomes in the tasks' order as they become known."""
    if jobs == 1:
        yield from map(work, tasks)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(work, tasks)
