"""What ``python -m legfem.study convergence`` does and writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from legfem.common.documents import write_document
from legfem.common.progress import progress_on
from legfem.common.units import kpa_to_mpa
from legfem.experiments.plane_strain import Tissues, tissues_of
from legfem.mechanics.materials import ReducedPolynomial
from legfem.study.convergence.corners import CornerOutcome, study_corners, table_2_points
from legfem.study.convergence.figure import draw_convergence
from legfem.study.convergence.meshes import WINDOWS, Convergence, study_convergence
from legfem.subjects.loading import SUBJECTS, load_subject
from legfem.subjects.subject import Subject


def run(
    subject_id: str,
    subject_dir: Path | None,
    corners: bool,
    deep_kpa: tuple[float, float],
    depth: float,
    out: Path,
    jobs: int,
    quiet: bool = False,
) -> bool:
    """Study a subject's section, print the table and write it to a folder.

    Returns whether every point was reached.
    """
    subject = load_subject(subject_dir or SUBJECTS.find(subject_id), need_recordings=False)
    if corners:
        return _corners(subject, depth, out, jobs, quiet)
    _convergence(subject, deep_kpa, depth, out, jobs, quiet)
    return True


def _convergence(
    subject: Subject,
    deep_kpa: tuple[float, float],
    depth: float,
    out: Path,
    jobs: int,
    quiet: bool,
) -> None:
    given = tissues_of(subject)
    c10, c20 = (kpa_to_mpa(value) for value in deep_kpa)
    deep = ReducedPolynomial(c10, given.deep.D1, c20, given.deep.D1)
    tissues = Tissues(deep, given.superficial, given.fascia)
    with progress_on(quiet=quiet) as progress:
        found = study_convergence(subject.section, subject.indenter, tissues, progress, depth, jobs)
    table = convergence_table(found)
    Console(width=120).print(table)
    print(_verdict(found))
    out.mkdir(parents=True, exist_ok=True)
    write_document(out / "result.json", {"subject": subject.id, **_as_json(found)})
    draw_convergence(found, out / "convergence.png")
    print(f"result: {out / 'result.json'}\nfigure: {out / 'convergence.png'}")


def convergence_table(found: Convergence) -> Table:
    """Return the forces, their extrapolation and the default's error, a row a depth."""
    table = Table(title="Convergence of the force (N)")
    for name in ("d (mm)", "default", "mesh 1", "mesh 2", "mesh 3", "order", "Richardson"):
        table.add_column(name, justify="right")
    for name in ("GCI mesh 3", "default's error", "contact x4"):
        table.add_column(name, justify="right")
    forces = [curve(found.depths) for curve in found.meshes]
    rows = zip(
        found.depths,
        found.default(found.depths),
        *forces,
        found.richardson.order,
        found.richardson.extrapolated,
        found.richardson.grid_convergence_index,
        found.default_error,
        found.contact_change,
        strict=True,
    )
    for depth, default, one, two, three, order, limit, index, error, contact in rows:
        table.add_row(
            f"{depth:g}", f"{default:.4f}", f"{one:.4f}", f"{two:.4f}", f"{three:.4f}",
            "-" if np.isnan(order) else f"{order:.1f}", f"{limit:.4f}", f"{index:.2%}",
            f"{error:+.2%}", f"{contact:+.2%}",
        )  # fmt: skip
    return table


def _verdict(found: Convergence) -> str:
    worst, contact = np.abs(found.default_error).max(), np.abs(found.contact_change).max()
    windows = ", ".join(
        f"{a:g}-{b:g} mm {change:+.2%}"
        for (a, b), change in zip(WINDOWS, found.curvature_change(), strict=False)
    )
    sizes = ", ".join(str(report.unknowns) for report in found.mesh_reports)
    return (
        f"default: {found.default_report.unknowns} unknowns, {found.default_report}\n"
        f"unknowns of the meshes: {sizes}\n"
        f"largest error of the default (mesh and steps): {worst:.2%}\n"
        f"largest change with a contact law four times stiffer: {contact:.2%}\n"
        f"mean curvature against the finest mesh: {windows}"
    )


def _as_json(found: Convergence) -> dict[str, object]:
    return {
        "schema": 1,
        "displacement_mm": found.depths.tolist(),
        "default_force_N": found.default(found.depths).tolist(),
        "mesh_force_N": [curve(found.depths).tolist() for curve in found.meshes],
        "observed_order": [None if np.isnan(p) else float(p) for p in found.richardson.order],
        "extrapolated_force_N": found.richardson.extrapolated.tolist(),
        "grid_convergence_index": found.richardson.grid_convergence_index.tolist(),
        "default_relative_error": found.default_error.tolist(),
        "stiffer_contact_relative_change": found.contact_change.tolist(),
        "curvature_relative_change": found.curvature_change(),
        "curvature_windows_mm": WINDOWS,
        "unknowns": [report.unknowns for report in found.mesh_reports],
        "default_factorisations": found.default_report.factorisations,
        "default_seconds": found.default_report.seconds,
    }


def _corners(subject: Subject, depth: float, out: Path, jobs: int, quiet: bool) -> bool:
    done: list[CornerOutcome] = []
    total = len(table_2_points())
    with progress_on(quiet=quiet) as progress:
        progress.stage("the 33 points of Table 2", total)
        for outcome in study_corners(subject.section, subject.indenter, depth, jobs):
            done.append(outcome)
            progress.advance(str(outcome.report))
    Console(width=120).print(corners_table(done))
    short = sum(not outcome.report.complete for outcome in done)
    print(f"{total - short} of {total} points reach {depth:g} mm")
    out.mkdir(parents=True, exist_ok=True)
    write_document(
        out / "result.json",
        {"schema": 1, "subject": subject.id, "points": [_corner_json(o) for o in done]},
    )
    print(f"result: {out / 'result.json'}")
    return not short


def corners_table(done: list[CornerOutcome]) -> Table:
    """Return a row a point: depth reached, factorisations, rejected steps, seconds."""
    table = Table(title="The 33 points of Table 2")
    for name in (
        "C10 deep (kPa)", "C20 deep (kPa)", "C10 fat (kPa)", "C10 fascia (MPa)", "fascia (mm)",
        "reached (mm)", "force (N)", "factorisations", "rejected", "contact", "seconds",
    ):  # fmt: skip
        table.add_column(name, justify="right")
    for outcome in done:
        point, report = outcome.point, outcome.report
        table.add_row(
            f"{point.c10_deep:g}", f"{point.c20_deep:g}", f"{point.c10_superficial:g}",
            f"{point.c10_fascia / 1e3:g}", f"{point.fascia_thickness:g}", f"{report.reached:.2f}",
            f"{outcome.force_N:.1f}", str(report.factorisations), str(report.rejected),
            f"x{report.contact_stiffness_factor:g}", f"{report.seconds:.1f}",
        )  # fmt: skip
    return table


def _corner_json(outcome: CornerOutcome) -> dict[str, object]:
    point, report = outcome.point, outcome.report
    return {
        "c10_deep_kPa": point.c10_deep,
        "c20_deep_kPa": point.c20_deep,
        "c10_superficial_kPa": point.c10_superficial,
        "c10_fascia_kPa": point.c10_fascia,
        "fascia_thickness_mm": point.fascia_thickness,
        "reached_mm": report.reached,
        "complete": report.complete,
        "reason": report.reason,
        "force_N": outcome.force_N,
        "factorisations": report.factorisations,
        "rejected_steps": report.rejected,
        "contact_stiffness_factor": report.contact_stiffness_factor,
        "seconds": report.seconds,
    }
