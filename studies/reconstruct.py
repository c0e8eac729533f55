"""The paper's four subjects, reconstructed: plausible calves, simulated and recorded with noise.

The paper publishes neither contours nor recordings. The tests are simulated with Table 5's
parameters on another discretisation than identification uses: a mesh twice as fine, the exponential
contact law, smaller steps.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydantic import BaseModel, ConfigDict

from legfem.common.command_line import check_out_folder, command_context, leave_to_first_rank, usable_cores
from legfem.common.input_files import parse_toml
from legfem.common.progress import Progress, progress_on
from legfem.common.units import kpa_to_mpa
from legfem.data import Instrument
from legfem.experiments.experiment import Solved
from legfem.experiments.indentation import IndentationTest
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Indenter
from legfem.jobs.pool import Workers
from legfem.legs.folder import check_new_folder, write_subject_folder
from legfem.legs.typical import Calf, calf_section
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.protocol import Protocol
from legfem.solve.settings import StepSettings
from studies.command_line import Jobs, new_app
from studies.making.recording import record_path

DEFINITION = Path(__file__).parent / "frauziols" / "reconstruction.toml"
PAPER_D = 28.0
FAT_D = 22.5

GENERATOR_SETTINGS = PlaneStrainSettings(
    mesh=SectionMeshSettings(0.6, 0.11, 3.5, 1.5),
    contact=ContactSettings(normal="exponential", stiffness=4000.0, onset=0.01),
    steps=StepSettings(first=0.1, largest=0.6),
    quadrature_degree=5,
)


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReconstructedSubject(_Entry):
    """One subject of the definition file."""

    C10_kPa: float
    C20_kPa: float
    depth_mm: float
    aim_mm: tuple[float, float]
    direction_deg: float
    calf: dict[str, float]


class Reconstruction(_Entry):
    """The definition file; tissues and instruments are the paper's."""

    seed: int
    rate_mm_per_s: float
    sampling_hz: float
    trials: int
    force_sd_N: float
    displacement_sd_mm: float
    diameter_mm: float
    length_mm: float
    superficial_C10_kPa: float
    fascia_C10_kPa: float
    subjects: dict[str, ReconstructedSubject]


def read_definition(path: Path = DEFINITION) -> Reconstruction:
    """Read the definition of the reconstruction.

    Raises
    ------
    InputError
        If the file is missing or a key is wrong.
    """
    return parse_toml(path, Reconstruction, "a reconstruction")


def test_of(definition: Reconstruction, name: str) -> PlaneStrainIndentation:
    """Return one subject's test, with the true parameters."""
    subject = definition.subjects[name]
    deep = ReducedPolynomial(kpa_to_mpa(subject.C10_kPa), PAPER_D, kpa_to_mpa(subject.C20_kPa), PAPER_D)
    return PlaneStrainIndentation(
        calf_section(Calf(**subject.calf)),  # type: ignore[arg-type]
        Indenter(definition.diameter_mm / 2, definition.length_mm, np.array(subject.aim_mm), subject.direction_deg),
        Tissues(
            deep,
            NeoHookean(kpa_to_mpa(definition.superficial_C10_kPa), FAT_D),
            NeoHookean(kpa_to_mpa(definition.fascia_C10_kPa), FAT_D),
        ),
        GENERATOR_SETTINGS,
    )


def reconstruct(out: Path, definition: Reconstruction, progress: Progress, jobs: int = 1) -> Path:
    """Make one subject folder a subject under ``out``.

    Raises
    ------
    InputError
        If a folder exists already.
    RuntimeError
        If a simulation stops short.
    """
    subjects = dict(sorted(definition.subjects.items()))
    for name in subjects:
        check_new_folder(out / name)
    tasks = [
        (test_of(definition, name), Protocol.through((subject.depth_mm, 0.0), rate=1.0))
        for name, subject in subjects.items()
    ]
    progress.stage("simulating loading and unloading on the fine mesh", len(tasks))
    with Workers(solve_once, None, jobs) as workers:
        for name, (test, _), solved in zip(subjects, tasks, workers.in_order(tasks), strict=True):
            if not solved.report.complete:
                raise RuntimeError(f"subject {name}: {solved.report}")
            _write(out / name, definition, test, solved)
            progress.advance(f"subject {name}: {solved.report}")
    return out


def _write(out: Path, definition: Reconstruction, test: PlaneStrainIndentation, solved: Solved) -> None:
    noise = Instrument(definition.force_sd_N, definition.displacement_sd_mm)
    generator = np.random.default_rng([definition.seed, int(out.name)])
    path, speed = solved.path, (definition.rate_mm_per_s, definition.sampling_hz)
    recordings = [
        record_path(path.displacement, path.force, *speed, noise, generator, f"trial{trial}")
        for trial in range(1, definition.trials + 1)
    ]
    write_subject_folder(
        test.section,
        out,
        f"Subject {out.name} of Frauziols et al., reconstructed (not measured)",
        test.indenter.aim,
        test.indenter.direction_deg,
        origin="reconstructed",
        recordings=recordings,
        starts_at_contact=True,
        plane_strain=True,
    )


def solve_once(context: None, task: tuple[IndentationTest, Protocol | float]) -> Solved:
    """Return a test's outcome at its own values; work for `legfem.jobs.pool.Workers`.

    It is a copy that is solved, whose mesh goes with it.
    """
    test, protocol = task
    given: Any = test
    copy: IndentationTest = replace(given)
    return copy.solve(None, protocol)


app = new_app()


@app.command()
def reconstruct_subjects(
    out: Annotated[Path, typer.Option(help="Folder for the subject folders.")],
    definition: Annotated[Path | None, typer.Option(help="The one in studies by default.")] = None,
    jobs: Jobs = None,
) -> None:
    """Make the four subjects' folders: plausible calves, simulated recordings with noise.

    Example: python -m studies.reconstruct --out legfem/resources/frauziols/subjects
    """
    leave_to_first_rank()
    with command_context(), progress_on() as progress:
        check_out_folder(out)
        made = reconstruct(out, read_definition(definition or DEFINITION), progress, jobs or usable_cores())
        typer.echo(f"subject folders in {made}")


if __name__ == "__main__":
    app(prog_name="python -m studies.reconstruct")
