"""What ``legfem study correction`` does and writes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.documents import json_types, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.common.units import FloatArray
from legfem.experiments.leg_3d import IdealisedLegIndentation
from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of
from legfem.report.curves import curves_figure
from legfem.report.page import PAGE, command_line
from legfem.report.render import brief, rendered
from legfem.report.style import save
from legfem.study.correction.calibration import (
    Calibrated,
    Calibration,
    LegTable,
    calibrate,
    coarsened,
    run_cases,
    tabulate_legs,
)
from legfem.study.correction.cases import CaseOutcome, CorrectionCase
from legfem.study.correction.page import DEPENDS_ON, HOW_SURE, Trend, correction_web_page, trend_curves

DOCUMENT = "correction.json"


def run(
    given: Calibration,
    out: Path,
    jobs: int,
    quiet: bool = False,
    *,
    trends: bool = False,
    legs: bool = False,
    fields: bool = False,
) -> tuple[Calibrated, dict[str, FloatArray]]:
    """Calibrate, and look at what P depends on; collective over all ranks.

    Parameters
    ----------
    given
        What is calibrated.
    out
        Folder; solved models are kept there.
    jobs
        Processes.
    quiet
        Whether progress isn't told.
    trends
        Whether to look at other lengths, stiffnesses and radii of the leg.
    legs
        Whether to tabulate P over legs of several sizes.
    fields
        Whether to write the reference leg's fields for ParaView, which solves it once more.

    Returns
    -------
    Calibrated
        The correction.
    dict of array
        P of cylinders of other lengths, every half a millimetre.
    """
    comm = MPI.COMM_WORLD
    first, kept = comm.rank == 0, out / "cases"
    with progress_on(quiet=quiet or not first) as progress:
        found = calibrate(given, kept, jobs, progress, comm)
        if first:
            print(f"correction: {found.correction.write(out / DOCUMENT)}", flush=True)
        if fields:
            written = write_leg_fields(given.reference, out, comm)
            if first:
                print(f"fields: {', '.join(map(str, written))}", flush=True)
        if legs:
            tabulated = tabulate_legs(LegTable(given), kept, jobs, progress, comm)
            if first:
                print(f"legs: {tabulated.write(out / 'correction-legs.json')}", flush=True)
        studied = dict[str, dict[str, FloatArray]]()
        for name, cases in _trend_cases(given, trends).items():
            progress.stage(f"P against the {name}", len(cases))
            outcomes = run_cases(list(cases.values()), kept, jobs, progress, comm)
            studied[name] = dict(zip(cases, map(_as_far_as_it_came, cases.values(), outcomes), strict=True))
    if first:
        _write(given, found, studied, out, trends)
    return found, studied[LENGTH]


def _as_far_as_it_came(case: CorrectionCase, outcome: CaseOutcome) -> FloatArray:
    """Return P on the case's grid, not-a-number beyond what it reached."""
    curve = np.full(len(case.displacement), np.nan)
    if outcome.reached >= 5:
        there = case.displacement <= outcome.reached + 1e-9
        curve[there] = outcome.P(case.displacement)[there]
    return curve


def _write(given: Calibration, found: Calibrated, studied: Trend, out: Path, trends: bool) -> None:
    page, displacement = correction_web_page(given, found, studied, command_line()), found.correction.displacement
    print(brief(page, (DEPENDS_ON, HOW_SURE) if trends else (HOW_SURE,)))
    write_atomically(out / PAGE, rendered(page))
    print(f"page: {out / PAGE}")
    if trends:
        curves_of = {name: {k: np.round(v, 5) for k, v in curves.items()} for name, curves in studied.items()}
        document = {"schema": 1, "displacement_mm": displacement, "P": curves_of}
        write_document(out / "trends.json", json_types(document))
        blocks, name = trend_curves(displacement, studied), found.correction.name
        drawn = save(curves_figure(blocks, "What P depends on", name, "simulated"), out, "trends", svg=True)
        print(f"figure: {drawn[0]}")


def write_leg_fields(case: CorrectionCase, out: Path, comm: MPI.Intracomm = MPI.COMM_SELF) -> list[Path]:
    """Solve a case's 3D model and write its fields at the depth it reached; collective."""
    experiment = IdealisedLegIndentation(case.leg, case.cylinder, case.material.laws, 3, case.settings, comm)
    solved = experiment.solve(depth=case.depth)
    return write_fields(fields_of(experiment.system), out, solved.report.reached)


LENGTH = "cylinder's length (mm)"


def _trend_cases(given: Calibration, all_of_them: bool) -> dict[str, dict[str, CorrectionCase]]:
    """Return what is varied: the cylinder's length, and what else P may depend on."""
    # The coarse mesh doesn't carry the longest cylinder to 25 mm.
    between, coarse = (coarsened(given.reference, factor) for factor in (given.between, given.coarse))
    fitting = [length for length in (30.0, 50.0, 70.0) if length < between.leg.length]
    cylinders = {f"{one:g}": replace(between, cylinder=replace(between.cylinder, length=one)) for one in fitting}
    if not all_of_them:
        return {LENGTH: cylinders}
    leg, material = coarse.leg, coarse.material
    legs = {f"{length:g}": replace(leg, length=length) for length in (60.0, 80.0, 100.0, 120.0, 150.0, 200.0)}
    legs |= {f"{length:g} held": replace(leg, length=length, ends="held") for length in (80, 200)}
    c10s, ratios = (0.2, 0.5, 2.0, 5.0), (0.0, 1.0, 3.0)
    stiffnesses = {f"{c10:g}": replace(material, C10_kPa=c10) for c10 in c10s}
    stiffenings = {f"{ratio:g}": replace(material, C20_kPa=ratio * material.C10_kPa) for ratio in ratios}
    radii = {f"{radius:g}": replace(leg, radius=radius) for radius in (50.0, 57.0, 64.0)}
    return {
        LENGTH: cylinders,
        "leg's length (mm)": {name: replace(coarse, leg=one) for name, one in legs.items()},
        "C10 (kPa)": {name: replace(coarse, material=one) for name, one in stiffnesses.items()},
        "C20/C10": {name: replace(coarse, material=one) for name, one in stiffenings.items()},
        "leg's radius (mm)": {name: replace(coarse, leg=one) for name, one in radii.items()},
    }
