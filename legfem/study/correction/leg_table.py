"""The table of P over legs of several sizes, from which a subject's own correction is taken.

All on the coarse mesh of the calibration, since only changes from its reference leg are kept. Two
further legs measure what the table leaves out: one between its points and of softer tissue
(interpolation, and that the change is tabulated for few stiffnesses), and the same with fat and
fascia (the table's legs have none).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.legs.correction import smooth_ratio
from legfem.legs.correction_of_leg import LegCorrections
from legfem.meshing.idealised_leg import IdealisedLeg
from legfem.study.correction.calibration import GRID, Calibration, coarsened, run_cases, stiffened
from legfem.study.correction.cases import CaseOutcome, CorrectionCase, Material


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
        Of the materials; see `legfem.legs.correction`.
    checked_radius, checked_depth, checked_c10_kPa, checked_stiffening
        Of the leg that lies between the table's points.
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
        """Of the table, C10 by stiffening."""
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
    displacement = np.linspace(0, coarse.depth, round(coarse.depth / GRID) + 1)
    between, with_layers, at_reference, *rest = _ratios(cases, outcomes, displacement)
    shape = (len(given.c10_kPa), len(given.stiffening), len(displacement))
    table = np.array(rest).reshape(-1, *shape)
    change = (table[1:] - table[0]).reshape(len(given.radius), len(given.depth), *shape)
    found = LegCorrections(
        np.array(given.radius),
        np.array(given.depth),
        displacement,
        np.array(given.c10_kPa),
        np.array(given.stiffening),
        change,
    )
    c10, q = given.checked_c10_kPa, given.checked_stiffening
    expected = found.change_of(given.checked_radius, given.checked_depth * given.checked_radius).correction(
        displacement, np.array(c10), np.array(c10 * q / (1 - q))
    )
    errors = {"girth and bone": between - at_reference - expected, "layers": with_layers - between}
    return replace(found, errors=errors, given=_description(given, coarse, outcomes))


def leg_of_size(like: IdealisedLeg, radius: float, depth_to_bone: float) -> IdealisedLeg:
    """Return a leg with another radius, its bone (of the same size) at a depth (mm)."""
    return replace(like, radius=radius, bone_offset=radius - like.bone_radius - depth_to_bone)


def _ratios(
    cases: Sequence[CorrectionCase], outcomes: Sequence[CaseOutcome], displacement: FloatArray
) -> list[FloatArray]:
    for case, outcome in zip(cases, outcomes, strict=True):
        if not outcome.complete:
            raise InputError(
                "correction",
                "depth",
                f"a model stops at {outcome.reached:.1f} mm of {case.depth:g} mm (radius "
                f"{case.leg.radius:g} mm, {case.leg.depth_to_bone:.1f} mm to the bone, C10 "
                f"{case.material.C10_kPa:g} kPa)",
                "tabulate to a smaller --depth, or with a finer mesh",
            )
    return [smooth_ratio(outcome.spatial, outcome.plane, displacement) for outcome in outcomes]


def _description(given: LegTable, coarse: CorrectionCase, outcomes: Sequence[CaseOutcome]) -> dict[str, object]:
    checked = {name: value for name, value in asdict(given).items() if name.startswith("checked")}
    return {
        "reference_leg": asdict(coarse.leg),
        "cylinder": asdict(coarse.cylinder),
        "mesh": asdict(coarse.settings.mesh),
        "checked_on": {**checked, "fat": given.fat, "fascia": given.fascia},
        "unknowns": max(outcome.unknowns for outcome in outcomes),
        "seconds": round(sum(outcome.seconds for outcome in outcomes), 1),
    }
