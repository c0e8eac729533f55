"""``legfem study``."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from legfem.common import command_line

Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; all cores by default.")]
Out = Annotated[Path | None, typer.Option(help="Folder for results; results/STUDY by default.")]


app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Studies of the model. Example: legfem study doe",
)


@app.command(cls=command_line.CheckedCommand)
def reproduce(
    seed: Annotated[int, typer.Option(min=0)] = 1,
    corrected: Annotated[bool, typer.Option("--corrected")] = False,
    weighting: Literal["paper", "covariance"] = "paper",
    out: Out = None,
    jobs: Jobs = None,
    quiet: command_line.Quiet = False,
    as_json: command_line.AsJson = False,
) -> None:
    """Tables 4 and 5 of the paper beside ours, from the four reconstructed subjects.

    Example: legfem study reproduce

    Parameters
    ----------
    seed
        Seed of the genetic algorithm.
    corrected
        Also apply each leg's own 3D correction.
    weighting
        Objective: the paper's unweighted sum (Eq. 12), or weighted with the covariance.
    """
    with command_line.study_context("reproduce", out, jobs, quiet=quiet) as (folder, processes):
        from legfem.study import reproduce as tables

        with command_line.brief_output(quiet, as_json) as written:
            tables.run(seed, folder, processes, corrected, quiet, weighting)
            written.append(folder / "result.json")


@app.command(cls=command_line.CheckedCommand)
def doe(
    factors: list[Path] | None = None,
    subject: str = "3",
    subject_dir: Path | None = None,
    factorial_only: Annotated[bool, typer.Option("--factorial-only")] = False,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    out: Out = None,
    jobs: Jobs = None,
    quiet: command_line.Quiet = False,
    as_json: command_line.AsJson = False,
) -> None:
    """Which parameters a compression test can see: a factorial design and its analysis.

    Simulations are kept as they are done: the same command goes on where it was stopped. Under
    mpirun the same command spreads them over the ranks.

    Example: legfem study doe --subject 3 --factorial-only --out results/doe

    Parameters
    ----------
    factors
        TOML with factors and ranges; several may be given. The paper's ranges, then those around the identified
        values, by default.
    subject
        Id of one of legfem's own subjects.
    subject_dir
        Folder of your own subject, in place of --subject.
    factorial_only
        Leave out the numerical error, the Sobol indices and the information.
    seed
        Seed of the emulator's points.
    """
    resume = "run the same command again to go on; simulations that are done are kept"
    with command_line.command_context(resume, quiet):
        from mpi4py import MPI

        from legfem.legs.schema import SUBJECTS
        from legfem.report.render import table
        from legfem.study.doe.command import DoeOptions, run
        from legfem.study.doe.design import IDENTIFIED, PAPER
        from legfem.study.doe.tables import anova_cells

        with (
            command_line.results_folder(out, "doe", MPI.COMM_WORLD) as folder,
            command_line.brief_output(quiet, as_json) as written,
        ):
            options = DoeOptions(
                tuple(factors or (PAPER, IDENTIFIED)),
                subject_dir or SUBJECTS.find(subject),
                folder,
                jobs or command_line.usable_cores(),
                seed,
                not factorial_only,
                quiet,
            )
            results = run(options, MPI.COMM_WORLD)
            if MPI.COMM_WORLD.rank == 0:
                for result in results:
                    print(f"{result.definition.title}\n{table(*anova_cells(result))}")
                written.append(options.out / "result.json")
        if results and all(len(result.failed) == len(result.outcomes) for result in results):
            command_line.end_without_a_solution("doe")


@app.command(cls=command_line.CheckedCommand)
def correction(
    subject_dir: Annotated[Path | None, typer.Option("--subject")] = None,
    length: Annotated[float, typer.Option(min=1.0, max=1000.0)] = 120.0,
    radius: Annotated[float, typer.Option(min=1.0, max=200.0)] = 57.0,
    bone_radius: Annotated[float, typer.Option(min=1.0, max=100.0)] = 15.0,
    bone_offset: float = 0.0,
    held: Annotated[bool, typer.Option("--held")] = False,
    cylinder_length: Annotated[float, typer.Option(min=1.0, max=500.0)] = 50.0,
    edge_radius: Annotated[float, typer.Option(min=0.01, max=100.0)] = 2.0,
    c10_kpa: Annotated[float, typer.Option("--c10", min=0.001)] = 2.0,
    c20_kpa: Annotated[float, typer.Option("--c20", min=0.0)] = 0.0,
    depth: Annotated[float, typer.Option(min=5.0, max=60.0)] = 25.0,
    finer: Annotated[float, typer.Option(min=0.1, max=10.0)] = 1.0,
    trends: Annotated[bool, typer.Option("--trends")] = False,
    legs: Annotated[bool, typer.Option("--legs")] = False,
    fields: Annotated[bool, typer.Option("--fields")] = False,
    out: Out = None,
    jobs: Jobs = None,
    quiet: command_line.Quiet = False,
    as_json: command_line.AsJson = False,
) -> None:
    """Calibrate the 3D correction P(d) on the idealised leg.

    With --subject, P(d) of that leg itself beside the table's, of --c10, --c20 and --depth alone.

    Example: legfem study correction, or mpirun -n 4 legfem study correction

    Parameters
    ----------
    subject_dir
        Folder of a subject, whose own leg is solved in 3D and compared with the table.
    length
        Length of the leg's segment (mm).
    radius
        Radius of the leg (mm).
    bone_radius
        Radius of the bone (mm).
    bone_offset
        Distance by which the bone is moved towards the cylinder (mm).
    held
        Hold the end faces along the leg.
    cylinder_length
        Length of the cylinder (mm).
    edge_radius
        Rounding of the cylinder's end edges (mm).
    c10_kpa
        Reference C10 (kPa).
    c20_kpa
        C20 of the subject's leg (kPa).
    depth
        Depth to press to (mm).
    finer
        Factor by which the mesh's elements are smaller.
    trends
        Also compute P for other lengths, stiffnesses and radii.
    legs
        Also tabulate P for legs of other girth and bone.
    fields
        Also write the 3D model's fields for ParaView.
    """
    with command_line.command_context("run the same command again to go on; solved models are kept", quiet):
        from mpi4py import MPI

        from legfem.experiments.indenter_pose import Cylinder
        from legfem.experiments.leg_3d import IdealisedLegSettings
        from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
        from legfem.study.correction import command as correction_command
        from legfem.study.correction.calibration import Calibration
        from legfem.study.correction.cases import CorrectionCase, Material

        reserved = command_line.results_folder(out, "correction", MPI.COMM_WORLD)
        if subject_dir is not None:
            from legfem.common.units import kpa_to_mpa
            from legfem.jobs.pool import leading
            from legfem.study.correction import of_leg

            brief = command_line.brief_output(quiet, as_json)
            with reserved as folder, leading(MPI.COMM_WORLD) as first, brief as written:
                if first:
                    stiffness = kpa_to_mpa(c10_kpa), kpa_to_mpa(c20_kpa)
                    of_leg.run(subject_dir, stiffness, depth, folder, quiet, MPI.COMM_WORLD)
                    written.append(folder / of_leg.DOCUMENT)
            return
        case = CorrectionCase(
            IdealisedLeg(radius, bone_radius, length, bone_offset, ends="held" if held else "free"),
            Cylinder(length=cylinder_length, edge_radius=edge_radius),
            Material(C10_kPa=c10_kpa),
            IdealisedLegSettings(mesh=LegMeshSettings().refined(finer)),
            depth,
        )
        processes = (jobs or command_line.usable_cores()) if MPI.COMM_WORLD.size == 1 else 1
        with reserved as folder, command_line.brief_output(quiet, as_json) as written:
            correction_command.run(Calibration(case), folder, processes, quiet, trends=trends, legs=legs, fields=fields)
            if MPI.COMM_WORLD.rank == 0:
                written.append(folder / correction_command.DOCUMENT)
