"""What ``python -m legfem.study convergence`` does and writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.common.documents import write_document
from legfem.common.progress import progress_on
from legfem.common.units import kpa_to_mpa
from legfem.experiments.plane_strain import Tissues
from legfem.legs.experiments import tissues_of
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanics.materials import ReducedPolynomial
from legfem.report.render.text import table
from legfem.study.convergence.figure import draw_convergence
from legfem.study.convergence.meshes import WINDOWS, Convergence, study_convergence


def run(
    subject_id: str,
    subject_dir: Path | None,
    deep_kpa: tuple[float, float],
    depth: float,
    out: Path,
    jobs: int,
    quiet: bool = False,
) -> None:
    """Study a subject's section, print the table and write it to a folder."""
    subject = load_subject(subject_dir or SUBJECTS.find(subject_id), need_recordings=False)
    given = tissues_of(subject)
    c10, c20 = (kpa_to_mpa(value) for value in deep_kpa)
    deep = ReducedPolynomial(c10, given.deep.D1, c20, given.deep.D1)
    tissues = Tissues(deep, given.superficial, given.fascia)
    with progress_on(quiet=quiet) as progress:
        found = study_convergence(subject.section, subject.indenter, tissues, progress, depth, jobs)
    print(f"Convergence of the force (N)\n{table(*_cells(found))}\n{_verdict(found)}")
    out.mkdir(parents=True, exist_ok=True)
    write_document(out / "result.json", {"subject": subject.id, **_as_json(found)})
    draw_convergence(found, out / "convergence.png")
    print(f"result: {out / 'result.json'}\nfigure: {out / 'convergence.png'}")


def _cells(found: Convergence) -> tuple[list[str], list[list[str]]]:
    """Return the forces, their extrapolation and the default's error, a row a depth."""
    header = [
        "d (mm)",
        "default",
        "mesh 1",
        "mesh 2",
        "mesh 3",
        "order",
        "Richardson",
        "GCI mesh 3",
        "default's error",
        "contact x4",
    ]
    forces = [curve(found.depths) for curve in found.meshes]
    columns = zip(
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
    rows = [
        [
            f"{depth:g}",
            f"{default:.4f}",
            f"{one:.4f}",
            f"{two:.4f}",
            f"{three:.4f}",
            "-" if np.isnan(order) else f"{order:.1f}",
            f"{limit:.4f}",
            f"{index:.2%}",
            f"{error:+.2%}",
            f"{contact:+.2%}",
        ]
        for depth, default, one, two, three, order, limit, index, error, contact in columns
    ]
    return header, rows


def _verdict(found: Convergence) -> str:
    worst, contact = np.abs(found.default_error).max(), np.abs(found.contact_change).max()
    windows = ", ".join(
        f"{a:g}-{b:g} mm {change:+.2%}" for (a, b), change in zip(WINDOWS, found.curvature_change(), strict=False)
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
