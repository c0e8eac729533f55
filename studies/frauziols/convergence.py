"""How far a default curve is from the converged one: mesh, steps, contact, curvature."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.documents import Cells, column_cells, json_types, write_document
from legfem.common.progress import Progress, progress_on
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.jobs.pool import Workers
from legfem.legs.finite_element_models import tissues_of
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanics.materials import ReducedPolynomial
from legfem.report.render import table
from legfem.report.style import FAINT, new_figure, panel, save, styled
from legfem.solve.path import ForceCurve, SolveReport
from legfem.solve.settings import StepSettings
from studies.reconstruct import solve_once

DEPTHS = np.array([2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
WINDOWS = ((0.0, 5.0), (5.0, 20.0), (20.0, 30.0))
REFINEMENT = 1.5
SAFETY = 1.25


@dataclass(frozen=True, eq=False)
class Richardson:
    """Extrapolation from three meshes whose sizes differ by a constant ratio."""

    depths: FloatArray
    """(n,), mm."""
    order: FloatArray
    """(n,): observed; NaN where the three forces don't converge monotonically."""
    extrapolated: FloatArray
    """(n,), N."""
    grid_convergence_index: FloatArray
    """(n,): relative uncertainty of the finest force (Roache, safety factor 1.25)."""


@dataclass(frozen=True, eq=False)
class Convergence:
    """Curves on refined meshes, with smaller steps and with stiffer contact."""

    default: ForceCurve
    default_report: SolveReport
    meshes: tuple[ForceCurve, ...]
    """Coarse to fine, all with small steps."""
    mesh_reports: tuple[SolveReport, ...]
    stiffer: ForceCurve
    """The default with a contact law four times stiffer."""
    richardson: Richardson

    @property
    def depths(self) -> FloatArray:
        """Depths (mm) that were reached, of those compared."""
        return self.richardson.depths

    @property
    def default_error(self) -> FloatArray:
        """Relative error of the default curve, mesh and steps together."""
        return self.default(self.depths) / self.richardson.extrapolated - 1

    @property
    def contact_change(self) -> FloatArray:
        """Relative change of the force when the contact law is made four times stiffer."""
        return self.stiffer(self.depths) / self.default(self.depths) - 1

    def curvature_change(self) -> list[float]:
        """Relative difference of the default's mean curvature from the finest mesh's."""
        return [
            self.default.mean_curvature(*window) / self.meshes[-1].mean_curvature(*window) - 1
            for window in WINDOWS
            if window[1] <= self.default.depth
        ]


def study_convergence(
    section: LegSection, indenter: Indenter, tissues: Tissues, progress: Progress, depth: float = 30.0, jobs: int = 1
) -> Convergence:
    """Simulate one test on three meshes, with small steps and with stiffer contact.

    Raises
    ------
    RuntimeError
        If one of the simulations stops short.
    """
    base = PlaneStrainSettings()
    small = StepSettings(first=0.1, largest=0.4)
    stiffer = replace(base.contact, stiffness=4 * base.contact.stiffness)
    variants = {
        "default": base,
        "contact four times stiffer": replace(base, contact=stiffer),
        "mesh 1, small steps": replace(base, steps=small),
        "mesh 2, small steps": replace(base, steps=small, mesh=base.mesh.refined(REFINEMENT)),
        "mesh 3, small steps": replace(base, steps=small, mesh=base.mesh.refined(REFINEMENT**2)),
    }
    tasks = [(PlaneStrainIndentation(section, indenter, tissues, settings), depth) for settings in variants.values()]
    progress.stage("simulating on refined meshes", len(tasks))
    curves, reports = [], []
    with Workers(solve_once, None, jobs) as workers:
        for label, solved in zip(variants, workers.in_order(tasks), strict=True):
            report = solved.report
            if not report.complete:
                raise RuntimeError(f"{label}: {report}")
            progress.advance(f"{label}: {report.unknowns} unknowns, {report}")
            curves.append(solved.curve)
            reports.append(report)
    depths = DEPTHS[DEPTHS <= depth]
    meshes = tuple(curves[2:])
    return Convergence(
        curves[0],
        reports[0],
        meshes,
        tuple(reports[2:]),
        curves[1],
        extrapolate(depths, [curve(depths) for curve in meshes], REFINEMENT),
    )


def extrapolate(depths: FloatArray, forces: Sequence[FloatArray], ratio: float) -> Richardson:
    """Extrapolate forces of three meshes, coarse to fine, to zero size.

    The observed order is bounded to 1..3 for the extrapolation; without monotone convergence it is
    taken as 2.
    """
    coarse, medium, fine = forces
    change = (coarse - medium) / np.where(fine == medium, np.nan, medium - fine)
    order = np.full(depths.shape, np.nan)
    monotone = change > 1
    order[monotone] = np.log(change[monotone]) / np.log(ratio)
    used = np.clip(np.where(monotone, order, 2.0), 1.0, 3.0)
    correction = (fine - medium) / (ratio**used - 1)
    return Richardson(depths, order, fine + correction, SAFETY * np.abs(correction / fine))


COLOURS = ("#E69F00", "#56B4E9", "#009E73")


@styled
def draw_convergence(found: Convergence, path: Path) -> None:
    """Draw the default curve and every mesh's distance from the extrapolated force."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    fine = np.linspace(0, found.default.depth, 300)
    panel(left, "A", "force of the default settings")
    left.plot(fine, found.default(fine), color="#0072B2", label="F(d)")
    left.plot(found.default.displacement, found.default.force, "o", ms=3, color="#0072B2", label="solved steps")
    left.plot(found.depths, found.richardson.extrapolated, "x", color="#111111", label="extrapolated to zero size")
    left.set(xlabel="displacement of the indenter (mm)", ylabel="force (N)")
    left.legend()

    panel(right, "B", "distance from the extrapolated force")
    right.axhspan(-0.5, 0.5, color="#EEEEEE", label="±0.5 %")
    right.axhline(0, color=FAINT, lw=0.8)
    limit = found.richardson.extrapolated
    for curve, report, colour in zip(found.meshes, found.mesh_reports, COLOURS, strict=True):
        error = 100 * (curve(found.depths) / limit - 1)
        label = f"{report.unknowns} unknowns, small steps"
        right.plot(found.depths, error, "o-", color=colour, label=label)
    right.plot(found.depths, 100 * found.default_error, "s--", color="#0072B2", label="default")
    right.plot(found.depths, 100 * found.contact_change, ":", color="#CC79A7", label="change with contact x4")
    right.set(xlabel="displacement of the indenter (mm)", ylabel="%")
    right.legend(fontsize=8)
    save(figure, path.parent, path.stem)


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
    tissues = Tissues(ReducedPolynomial(c10, given.deep.D1, c20, given.deep.D1), given.superficial, given.fascia)
    with progress_on(quiet=quiet) as progress:
        found = study_convergence(subject.section, subject.indenter, tissues, progress, depth, jobs)
    print(f"Convergence of the force (N)\n{table(*_cells(found))}\n{_verdict(found)}")
    out.mkdir(parents=True, exist_ok=True)
    write_document(out / "result.json", {"subject": subject.id, **_as_json(found)})
    draw_convergence(found, out / "convergence.png")
    print(f"result: {out / 'result.json'}\nfigure: {out / 'convergence.png'}")


def _cells(found: Convergence) -> Cells:
    """Forces, their extrapolation and the default's error, a row a depth."""
    return column_cells(
        {
            "d (mm)": ("g", found.depths),
            "default": (".4f", found.default(found.depths)),
            **{f"mesh {k}": (".4f", curve(found.depths)) for k, curve in enumerate(found.meshes, 1)},
            "order": (".1f", found.richardson.order),
            "Richardson": (".4f", found.richardson.extrapolated),
            "GCI mesh 3": (".2%", found.richardson.grid_convergence_index),
            "default's error": ("+.2%", found.default_error),
            "contact x4": ("+.2%", found.contact_change),
        }
    )


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


def _as_json(found: Convergence) -> dict[str, Any]:
    document: dict[str, Any] = json_types(
        {
            "schema": 1,
            **asdict(found.richardson),
            **{name: getattr(found, name) for name in ("default_error", "contact_change")},
            "default_force_N": found.default(found.depths),
            "mesh_force_N": [curve(found.depths) for curve in found.meshes],
            "curvature_change": dict(zip(map(str, WINDOWS), found.curvature_change(), strict=False)),
            "unknowns": [report.unknowns for report in found.mesh_reports],
            "default_factorisations": found.default_report.factorisations,
            "default_seconds": found.default_report.seconds,
        }
    )
    return document
