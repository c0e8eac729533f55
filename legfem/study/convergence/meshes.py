"""How far a default curve is from the converged one: mesh, steps, contact, curvature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.experiments.indentation import solve_once
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.jobs.pool import Workers
from legfem.solve.path import ForceCurve
from legfem.solve.report import SolveReport
from legfem.solve.settings import StepSettings

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
