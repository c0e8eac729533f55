"""What ``python -m legfem.study correction`` does and writes."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from legfem.common.documents import write_document
from legfem.common.progress import Lines, Progress, Silent
from legfem.common.units import FloatArray
from legfem.correction.tabulated import smooth_ratio
from legfem.experiments.indentation_3d import IdealisedLegIndentation
from legfem.fem.fields import fields_of
from legfem.report.paraview import write_fields
from legfem.study.correction.calibration import (
    Calibrated,
    Calibration,
    calibrate,
    coarsened,
    run_cases,
)
from legfem.study.correction.cases import CaseOutcome, CorrectionCase
from legfem.study.correction.checks import check
from legfem.study.correction.figure import draw_correction, draw_trends
from legfem.study.correction.leg_table import LegTable, tabulate_legs

Trend = dict[str, dict[str, FloatArray]]
"""P by the value of what is varied, by what that is."""


@dataclass(frozen=True)
class Asked:
    """What is wanted besides the calibration and Fig. 4."""

    trends: bool = False
    """What P depends on."""
    legs: bool = False
    """The table of P over legs of several sizes."""
    checks: bool = False
    """How far the default mesh goes, and what first-order tetrahedra make of P."""
    fields: bool = False
    """Fields of the reference leg in 3D for ParaView, which solves it once more."""


SHOWN = np.array([2.5, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])


def run(given: Calibration, asked: Asked, out: Path, jobs: int) -> None:
    """Calibrate, draw Fig. 4, and look at what P depends on; collective over all ranks.

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
    """
    comm = MPI.COMM_WORLD
    progress: Progress = Lines(sys.stderr) if comm.rank == 0 else Silent()
    kept = out / "cases"
    found = calibrate(given, kept, jobs, progress, comm)
    if comm.rank == 0:
        path = found.correction.write(out / "correction.json")
        Console(width=110).print(correction_table(found))
        Console(width=110).print(meshes_table(found))
        print(f"correction: {path}", flush=True)
    progress.stage("cylinders of other lengths", len(LENGTHS))
    coarse = coarsened(given.reference, given.coarse)
    # The coarse mesh doesn't carry the longest one to 25 mm.
    others = _of_other_cylinders(coarsened(given.reference, given.between))
    lengths = _vary(others, kept, jobs, progress, comm)
    if comm.rank == 0:
        figure = draw_correction(given.reference, found, lengths, out)
        print(f"figure: {figure[0]}", flush=True)
    if asked.fields:
        written = write_leg_fields(given.reference, out, comm)
        if comm.rank == 0:
            print(f"fields: {', '.join(map(str, written))}", flush=True)
    if asked.legs:
        table = tabulate_legs(LegTable(given), kept, jobs, progress, comm)
        if comm.rank == 0:
            print(f"legs: {table.write(out / 'correction-legs.json')}", flush=True)
    if asked.checks:
        check(given.reference, out, kept, jobs, progress, comm)
    if not asked.trends:
        return
    studied: Trend = {"cylinder's length (mm)": lengths}
    for name, cases in _trend_cases(coarse).items():
        progress.stage(f"P against the {name}", len(cases))
        studied[name] = _vary(cases, kept, jobs, progress, comm)
    if comm.rank == 0:
        for name, curves in studied.items():
            Console(width=110).print(trend_table(name, curves))
        displacement = _grid(coarse.depth)
        write_document(
            out / "trends.json",
            {
                "schema": 1,
                "displacement_mm": displacement.tolist(),
                "P": {name: {k: _listed(v) for k, v in c.items()} for name, c in studied.items()},
            },
        )
        print(f"figure: {draw_trends(displacement, studied, out)[0]}")


def write_leg_fields(
    case: CorrectionCase, out: Path, comm: MPI.Intracomm = MPI.COMM_SELF
) -> list[Path]:
    """Solve a case's 3D model and write its fields at the depth it reached; collective."""
    experiment = IdealisedLegIndentation(
        case.leg, case.cylinder, case.material.laws, 3, case.settings, comm
    )
    solved = experiment.solve(depth=case.depth)
    return write_fields(fields_of(experiment.system), out, solved.report.reached)


LENGTHS = (30.0, 50.0, 70.0)


def _of_other_cylinders(case: CorrectionCase) -> dict[str, CorrectionCase]:
    fitting = [length for length in LENGTHS if length < case.leg.length]
    return {
        f"{length:g}": replace(case, cylinder=replace(case.cylinder, length=length))
        for length in fitting
    }


def _trend_cases(coarse: CorrectionCase) -> dict[str, dict[str, CorrectionCase]]:
    leg, material = coarse.leg, coarse.material
    legs = {f"{length:g}": replace(leg, length=length) for length in _LEG_LENGTHS}
    legs |= {f"{length:g} held": replace(leg, length=length, ends="held") for length in (80, 200)}
    return {
        "leg's length (mm)": {name: replace(coarse, leg=leg) for name, leg in legs.items()},
        "C10 (kPa)": {
            f"{c10:g}": replace(coarse, material=replace(material, C10_kPa=c10))
            for c10 in (0.2, 0.5, 2.0, 5.0)
        },
        "C20/C10": {
            f"{ratio:g}": replace(
                coarse, material=replace(material, C20_kPa=ratio * material.C10_kPa)
            )
            for ratio in (0.0, 1.0, 3.0)
        },
        "leg's radius (mm)": {
            f"{radius:g}": replace(coarse, leg=replace(leg, radius=radius))
            for radius in (50.0, 57.0, 64.0)
        },
    }


_LEG_LENGTHS = (60.0, 80.0, 100.0, 120.0, 150.0, 200.0)


def _vary(
    cases: dict[str, CorrectionCase], kept: Path, jobs: int, progress: Progress, comm: MPI.Intracomm
) -> dict[str, FloatArray]:
    """Return P on the grid by the cases' names, not-a-number beyond what a case reached."""
    outcomes = run_cases(list(cases.values()), kept, jobs, progress, comm)
    return {
        name: _curve(outcome, cases[name].depth)
        for name, outcome in zip(cases, outcomes, strict=True)
    }


def _curve(outcome: CaseOutcome, depth: float) -> FloatArray:
    displacement = _grid(depth)
    if outcome.reached < 5:
        return np.full(len(displacement), np.nan)
    value = smooth_ratio(outcome.spatial, outcome.plane, displacement)
    return np.where(displacement <= outcome.reached + 1e-9, value, np.nan)


def _grid(depth: float) -> FloatArray:
    return np.linspace(0, depth, round(2 * depth) + 1)


def _listed(values: FloatArray) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), 5) for value in values]


def correction_table(found: Calibrated) -> Table:
    """Return forces, P and its errors, a row a depth."""
    correction, reference = found.correction, found.reference
    depths = SHOWN[SHOWN <= correction.displacement[-1]]
    table = Table(title=f"P(d) = 1 - (RF3D / L) / RF2D, {correction.name}")
    for name in ("d (mm)", "RF3D (N)", "L RF2D (N)", "P", *correction.errors, "sd"):
        table.add_column(name, justify="right")
    smooth = smooth_ratio(reference.spatial, reference.plane, depths)
    modes = [np.interp(depths, correction.displacement, m) for m in correction.errors.values()]
    spread = correction.standard_deviation(depths)
    for k, depth in enumerate(depths):
        table.add_row(
            f"{depth:g}", f"{reference.spatial(depth):.3f}", f"{reference.plane(depth):.3f}",
            f"{smooth[k]:+.4f}", *(f"{mode[k]:+.4f}" for mode in modes), f"{spread[k]:.4f}",
        )  # fmt: skip
    return table


def meshes_table(found: Calibrated) -> Table:
    """Return P on the meshes, a row a mesh, and the finest one's error by Richardson's estimate."""
    displacement = found.correction.displacement
    depths = SHOWN[SHOWN <= displacement[-1]]
    table = Table(title="P on three meshes")
    for column in ("unknowns", *(f"{depth:g} mm" for depth in depths), "tangents", "s"):
        table.add_column(column, justify="right")
    for outcome in reversed(found.meshes):
        values = smooth_ratio(outcome.spatial, outcome.plane, depths)
        table.add_row(
            f"{outcome.unknowns}", *(f"{p:+.4f}" for p in values),
            f"{outcome.factorisations}", f"{outcome.seconds:.0f}",
        )  # fmt: skip
    error = np.interp(depths, displacement, found.correction.errors["mesh"])
    table.add_row("limit", *(f"{p:+.4f}" for p in values + error), "", "")
    return table


def trend_table(name: str, curves: dict[str, FloatArray]) -> Table:
    """Return P, a row a value of what is varied."""
    displacement = 0.5 * np.arange(len(next(iter(curves.values()))))
    depths = SHOWN[SHOWN <= displacement[-1]]
    table = Table(title=f"P against the {name}")
    for column in (name, *(f"{depth:g} mm" for depth in depths)):
        table.add_column(column, justify="right")
    for value, curve in curves.items():
        at = np.interp(depths, displacement, curve)
        table.add_row(value, *("-" if np.isnan(p) else f"{p:+.4f}" for p in at))
    return table
