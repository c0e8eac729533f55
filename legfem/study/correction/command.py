"""What ``legfem study correction`` does and writes."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.documents import json_types, write_atomically, write_document
from legfem.common.progress import Progress, progress_on
from legfem.common.units import FloatArray
from legfem.experiments.leg_3d import IdealisedLegIndentation
from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of
from legfem.inverse.correction import smooth_ratio
from legfem.report.page import PAGE, command_line
from legfem.report.render import rendered, table
from legfem.study.correction.calibration import (
    Calibrated,
    Calibration,
    LegTable,
    calibrate,
    coarsened,
    run_cases,
    tabulate_legs,
)
from legfem.study.correction.cases import CorrectionCase
from legfem.study.correction.page import correction_cells, correction_web_page, draw_trends, meshes_cells, trend_cells

DOCUMENT = "correction.json"


@dataclass(frozen=True)
class CorrectionOutputs:
    """What is wanted besides the calibration."""

    trends: bool = False
    """What P depends on."""
    legs: bool = False
    """The table of P over legs of several sizes."""
    fields: bool = False
    """Fields of the reference leg in 3D for ParaView, which solves it once more."""


def run(
    given: Calibration, asked: CorrectionOutputs, out: Path, jobs: int, quiet: bool = False
) -> tuple[Calibrated, dict[str, FloatArray]]:
    """Calibrate, and look at what P depends on; collective over all ranks.

    Parameters
    ----------
    given
        What is calibrated.
    asked
        What else is wanted.
    out
        Folder; solved models are kept there.
    jobs
        Processes.
    quiet
        Whether progress isn't told.

    Returns
    -------
    Calibrated
        The correction.
    dict of array
        P of cylinders of other lengths, every half a millimetre.
    """
    comm = MPI.COMM_WORLD
    with progress_on(quiet=quiet or comm.rank > 0) as progress:
        return _run(given, asked, out, jobs, progress, comm)


def _run(
    given: Calibration, asked: CorrectionOutputs, out: Path, jobs: int, progress: Progress, comm: MPI.Intracomm
) -> tuple[Calibrated, dict[str, FloatArray]]:
    kept = out / "cases"
    found = calibrate(given, kept, jobs, progress, comm)
    if comm.rank == 0:
        path = found.correction.write(out / DOCUMENT)
        title = f"P(d) = 1 - (RF3D / L) / RF2D, {found.correction.name}"
        print(f"{title}\n{table(*correction_cells(found))}\n")
        print(f"P on three meshes\n{table(*meshes_cells(found))}\n")
        print(f"correction: {path}", flush=True)
    progress.stage("cylinders of other lengths", len(LENGTHS))
    coarse = coarsened(given.reference, given.coarse)
    # The coarse mesh doesn't carry the longest one to 25 mm.
    between = coarsened(given.reference, given.between)
    fitting = [length for length in LENGTHS if length < between.leg.length]
    others = {f"{one:g}": replace(between, cylinder=replace(between.cylinder, length=one)) for one in fitting}
    lengths = _vary(others, kept, jobs, progress, comm)
    if asked.fields:
        written = write_leg_fields(given.reference, out, comm)
        if comm.rank == 0:
            print(f"fields: {', '.join(map(str, written))}", flush=True)
    if asked.legs:
        tabulated = tabulate_legs(LegTable(given), kept, jobs, progress, comm)
        if comm.rank == 0:
            print(f"legs: {tabulated.write(out / 'correction-legs.json')}", flush=True)
    studied = {"cylinder's length (mm)": lengths}
    for name, cases in _trend_cases(coarse).items() if asked.trends else ():
        progress.stage(f"P against the {name}", len(cases))
        studied[name] = _vary(cases, kept, jobs, progress, comm)
    if comm.rank != 0:
        return found, lengths
    page = correction_web_page(given, found, studied, command_line())
    write_atomically(out / PAGE, rendered(page))
    print(f"page: {out / PAGE}")
    if asked.trends:
        for name, curves in studied.items():
            print(f"P against the {name}\n{table(*trend_cells(name, curves))}\n")
        curves_of = {name: {k: np.round(v, 5) for k, v in curves.items()} for name, curves in studied.items()}
        document = {"schema": 1, "displacement_mm": _grid(coarse.depth), "P": curves_of}
        write_document(out / "trends.json", json_types(document))
        print(f"figure: {draw_trends(found.correction.name, studied, out)[0]}")
    return found, lengths


def write_leg_fields(case: CorrectionCase, out: Path, comm: MPI.Intracomm = MPI.COMM_SELF) -> list[Path]:
    """Solve a case's 3D model and write its fields at the depth it reached; collective."""
    experiment = IdealisedLegIndentation(case.leg, case.cylinder, case.material.laws, 3, case.settings, comm)
    solved = experiment.solve(depth=case.depth)
    return write_fields(fields_of(experiment.system), out, solved.report.reached)


LENGTHS = (30.0, 50.0, 70.0)


def _trend_cases(coarse: CorrectionCase) -> dict[str, dict[str, CorrectionCase]]:
    leg, material = coarse.leg, coarse.material
    legs = {f"{length:g}": replace(leg, length=length) for length in _LEG_LENGTHS}
    legs |= {f"{length:g} held": replace(leg, length=length, ends="held") for length in (80, 200)}
    return {
        "leg's length (mm)": {name: replace(coarse, leg=leg) for name, leg in legs.items()},
        "C10 (kPa)": {
            f"{c10:g}": replace(coarse, material=replace(material, C10_kPa=c10)) for c10 in (0.2, 0.5, 2.0, 5.0)
        },
        "C20/C10": {
            f"{ratio:g}": replace(coarse, material=replace(material, C20_kPa=ratio * material.C10_kPa))
            for ratio in (0.0, 1.0, 3.0)
        },
        "leg's radius (mm)": {
            f"{radius:g}": replace(coarse, leg=replace(leg, radius=radius)) for radius in (50.0, 57.0, 64.0)
        },
    }


_LEG_LENGTHS = (60.0, 80.0, 100.0, 120.0, 150.0, 200.0)


def _vary(
    cases: dict[str, CorrectionCase], kept: Path, jobs: int, progress: Progress, comm: MPI.Intracomm
) -> dict[str, FloatArray]:
    """Return P on the grid by the cases' names, not-a-number beyond what a case reached."""
    outcomes = run_cases(list(cases.values()), kept, jobs, progress, comm)
    curves = dict[str, FloatArray]()
    for (name, case), outcome in zip(cases.items(), outcomes, strict=True):
        displacement = _grid(case.depth)
        curves[name] = np.full(len(displacement), np.nan)
        if outcome.reached >= 5:
            there = displacement <= outcome.reached + 1e-9
            curves[name][there] = smooth_ratio(outcome.spatial, outcome.plane, displacement)[there]
    return curves


def _grid(depth: float) -> FloatArray:
    return np.linspace(0, depth, round(2 * depth) + 1)
