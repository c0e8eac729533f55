r"""Calibration of the 3D correction: its level on a fine mesh, its trends on a coarse one.

.. math:: P(d; m) = P_f(d; m_0) + P_c(d; m) - P_c(d; m_0)

for the reference material :math:`m_0` on the fine mesh and all materials on the coarse one, which
takes a tenth of the time. P is a ratio of two forces on the same grid, so that most of the mesh's
error cancels in it, and again in the difference of two coarse ones.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.documents import versions_of
from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.progress import Progress
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.correction import TabulatedCorrection, first_contact_error, mesh_error
from legfem.jobs.pool import Workers
from legfem.legs.correction_of_leg import LegCorrections
from legfem.meshing.structured import IdealisedLeg
from legfem.study.correction.cases import CaseOutcome, CorrectionCase, Material, remembered_case


@dataclass(frozen=True)
class Calibration:
    """What is calibrated.

    Parameters
    ----------
    reference
        The leg, the material of the paper and the fine mesh.
    c10_kPa, stiffening
        The table's axes; see `legfem.inverse.correction`.
    coarse
        Size of the fine mesh's elements over that of the coarse one's.
    between
        The same of a third mesh, which shows how P converges.
    spread
        Relative uncertainty of the leg's effective length, which nobody knows: P's error from it
        is half of the difference between lengths this much shorter and longer.
    """

    reference: CorrectionCase = field(default_factory=CorrectionCase)
    c10_kPa: tuple[float, ...] = (0.2, 0.7, 2.0, 5.0)
    stiffening: tuple[float, ...] = (0.0, 0.5, 0.8)
    coarse: float = 0.6
    between: float = 0.8
    spread: float = 0.25


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The correction and what it was made from."""

    given: Calibration
    correction: TabulatedCorrection
    outcomes: tuple[CaseOutcome, ...]
    """Of all cases: those of the reference first, the finest mesh's before the coarser two's."""

    @property
    def reference(self) -> CaseOutcome:
        """On the finest mesh."""
        return self.outcomes[0]

    def P_of_reference(self) -> FloatArray:
        """Return P of the reference's material over the displacement."""
        correction = self.correction
        return correction.correction(correction.displacement, *self.given.reference.material.stiffness)


def run_cases(
    cases: Sequence[CorrectionCase], folder: Path, jobs: int, progress: Progress, comm: MPI.Intracomm = MPI.COMM_SELF
) -> list[CaseOutcome]:
    """Solve cases: each over the ranks of a communicator, or in processes side by side."""
    outcomes = []
    with Workers(remembered_case, folder, jobs) as workers:
        together = (remembered_case(folder, case, comm) for case in cases)
        for outcome in together if comm.size > 1 else workers.in_order(cases):
            outcomes.append(outcome)
            progress.advance(
                f"{outcome.unknowns} unknowns, {outcome.reached:g} mm, "
                f"{outcome.factorisations} tangents, {outcome.seconds:.0f} s"
            )
    return outcomes


def coarsened(case: CorrectionCase, factor: float) -> CorrectionCase:
    """Return a case on a mesh with elements larger by ``1 / factor``, the edge's size bounded."""
    mesh = case.settings.mesh.refined(factor)
    resolved = 2 * case.cylinder.edge_radius * mesh.degree
    mesh = replace(mesh, edge_size=min(mesh.edge_size, resolved))
    return replace(case, settings=replace(case.settings, mesh=mesh))


def calibrate(
    given: Calibration, folder: Path, jobs: int, progress: Progress, comm: MPI.Intracomm = MPI.COMM_SELF
) -> Calibrated:
    """Calibrate the correction; solved cases are kept in a folder.

    Raises
    ------
    InputError
        If a model stops short of the depth.
    """
    reference = given.reference
    coarse = coarsened(reference, given.coarse)
    materials = [stiffened(reference.material, c10, q) for c10 in given.c10_kPa for q in given.stiffening]
    legs = [replace(coarse.leg, length=coarse.leg.length * factor) for factor in (1 - given.spread, 1 + given.spread)]
    cases = [
        reference,
        coarsened(reference, given.between),
        coarse,
        *(replace(coarse, leg=leg) for leg in legs),
        *(replace(coarse, material=material) for material in materials),
    ]
    progress.stage("the correction: both models of the idealised leg", len(cases))
    outcomes = run_cases(cases, folder, jobs, progress, comm)
    displacement, reference_case = reference.displacement, outcomes[0]
    fine, middle, rough, shorter, longer, *table = _ratios(cases, outcomes)
    shape = (len(given.c10_kPa), len(given.stiffening), len(displacement))
    errors = {
        "mesh": mesh_error(fine, rough, given.coarse),
        "leg length": 0.5 * (longer - shorter),
        "first contact": first_contact_error(reference_case.spatial, reference_case.plane, displacement, fine),
    }
    correction = TabulatedCorrection(
        name=f"idealised leg {reference.leg.length:g} mm long",
        displacement=displacement,
        c10=kpa_to_mpa(np.array(given.c10_kPa)),
        stiffening=np.array(given.stiffening),
        values=np.array(table).reshape(shape) + (fine - rough),
        errors=errors,
        given={
            "leg": asdict(reference.leg),
            "cylinder": asdict(reference.cylinder),
            "material": asdict(reference.material),
            "numerics": asdict(reference.settings),
            "trends_mesh": asdict(coarse.settings.mesh),
            "leg_length_spread": given.spread,
            "unknowns": reference_case.unknowns,
            "trends_unknowns": outcomes[2].unknowns,
            "P_by_unknowns": {
                str(outcome.unknowns): np.round(values, 5).tolist()
                for outcome, values in zip(outcomes, (fine, middle, rough), strict=False)
            },
            "balance_of_forces": reference_case.balance,
            "factorisations": sum(outcome.factorisations for outcome in outcomes),
            "processor_seconds": round(sum(outcome.seconds for outcome in outcomes), 1),
            "versions": versions_of("dolfinx", "python"),
        },
    )
    return Calibrated(given, correction, tuple(outcomes))


def _ratios(cases: Sequence[CorrectionCase], outcomes: Sequence[CaseOutcome]) -> list[FloatArray]:
    """Return P of every case; raise an InputError for one that stops short."""
    for case, outcome in zip(cases, outcomes, strict=True):
        if not outcome.complete:
            problem = f"a model stops at {outcome.reached:.1f} mm of {case.depth:g} mm (leg of {case.leg.length:g} mm, "
            problem += f"radius {case.leg.radius:g} mm, {case.leg.depth_to_bone:.1f} mm to the bone, "
            problem += f"C10 {case.material.C10_kPa:g} kPa)"
            remedy = Remedy("calibrate to a smaller ", Argument("depth"), ", or with a finer mesh")
            raise InputError("correction", "depth", problem, remedy)
    return [outcome.P(case.displacement) for case, outcome in zip(cases, outcomes, strict=True)]


def stiffened(material: Material, c10: float, stiffening: float) -> Material:
    """Return a material with another C10 (kPa) and q, as those of the table."""
    return replace(material, C10_kPa=c10, C20_kPa=c10 * stiffening / (1 - stiffening))


@dataclass(frozen=True)
class LegTable:
    """The legs and materials of the table, and the leg that checks it.

    Parameters
    ----------
    calibration
        Whose reference leg the changes are from.
    radius
        mm.
    depth
        From the skin to the bone, over the radius.
    c10_kPa, stiffening
        Axes of the materials; see `legfem.inverse.correction`.
    checked_radius, checked_depth, checked_c10_kPa, checked_stiffening
        Sizes and material of a leg that lies between the table's points.
    fat, fascia
        Thickness in the leg with layers (mm).
    """

    calibration: Calibration = field(default_factory=Calibration)
    radius: tuple[float, ...] = (50.0, 64.0)
    depth: tuple[float, ...] = (0.75, 1.25)
    c10_kPa: tuple[float, ...] = (0.7,)
    stiffening: tuple[float, ...] = (0.0, 0.8)
    checked_radius: float = 57.0
    checked_depth: float = 1.125
    checked_c10_kPa: float = 0.2
    checked_stiffening: float = 0.5
    fat: float = 8.0
    fascia: float = 0.6

    @property
    def materials(self) -> list[Material]:
        """Materials of the table, C10 by stiffening."""
        reference = self.calibration.reference.material
        return [stiffened(reference, c10, q) for c10, q in product(self.c10_kPa, self.stiffening)]


def tabulate_legs(
    given: LegTable, folder: Path, jobs: int, progress: Progress, comm: MPI.Intracomm = MPI.COMM_SELF
) -> LegCorrections:
    """Solve all legs; solved cases are kept in a folder.

    Raises
    ------
    InputError
        If one stops short of the depth.
    """
    coarse = coarsened(given.calibration.reference, given.calibration.coarse)
    legs = [leg_of_size(coarse.leg, radius, depth * radius) for radius, depth in product(given.radius, given.depth)]
    checked = replace(
        coarse,
        leg=leg_of_size(coarse.leg, given.checked_radius, given.checked_depth * given.checked_radius),
        material=stiffened(coarse.material, given.checked_c10_kPa, given.checked_stiffening),
    )
    layered = replace(checked, leg=replace(checked.leg, fat=given.fat, fascia=given.fascia))
    cases = [
        checked,
        layered,
        replace(coarse, material=checked.material),
        *(replace(coarse, leg=leg, material=material) for leg in (coarse.leg, *legs) for material in given.materials),
    ]
    progress.stage("P of legs of several sizes", len(cases))
    outcomes = run_cases(cases, folder, jobs, progress, comm)
    displacement = coarse.displacement
    between, with_layers, at_reference, *rest = _ratios(cases, outcomes)
    shape = (len(given.c10_kPa), len(given.stiffening), len(displacement))
    table = np.array(rest).reshape(-1, *shape)
    change = (table[1:] - table[0]).reshape(len(given.radius), len(given.depth), *shape)
    found = LegCorrections(
        np.array(given.radius),
        np.array(given.depth),
        displacement,
        kpa_to_mpa(np.array(given.c10_kPa)),
        np.array(given.stiffening),
        change,
    )
    c10, q = kpa_to_mpa(given.checked_c10_kPa), given.checked_stiffening
    expected = found.change_of(given.checked_radius, given.checked_depth * given.checked_radius).correction(
        displacement, np.array(c10), np.array(c10 * q / (1 - q))
    )
    errors = {"girth and bone": between - at_reference - expected, "layers": with_layers - between}
    stated = {name: value for name, value in asdict(given).items() if name.startswith("checked")}
    described: dict[str, object] = {
        "reference_leg": asdict(coarse.leg),
        "cylinder": asdict(coarse.cylinder),
        "mesh": asdict(coarse.settings.mesh),
        "checked_on": {**stated, "fat": given.fat, "fascia": given.fascia},
        "unknowns": max(outcome.unknowns for outcome in outcomes),
        "seconds": round(sum(outcome.seconds for outcome in outcomes), 1),
    }
    return replace(found, errors=errors, given=described)


def leg_of_size(like: IdealisedLeg, radius: float, depth_to_bone: float) -> IdealisedLeg:
    """Return a leg with another radius, its bone (of the same size) at a depth (mm)."""
    return replace(like, radius=radius, bone_offset=radius - like.bone_radius - depth_to_bone)
