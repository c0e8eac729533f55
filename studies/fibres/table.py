"""The table of what fibres make of the force, over ratio and depth, and its errors.

The leg has fat and fascia, as every leg has: they spread the load over the ends, and without them
fibres would count a quarter more. What isn't alike on all legs is changed one by one at one
stiffness and ratio, by about as much as legs differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

from legfem.common.errors import UnsolvedError
from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.experiments.leg_3d import IdealisedLegSettings
from legfem.inverse.correction import FIRST_RATIO, FibreTable, mesh_error
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
from legfem.solve.path import ForceCurve
from legfem.study.correction.calibration import leg_of_size, run_cases, stiffened
from legfem.study.correction.cases import CaseOutcome, CorrectionCase, Material

RATIOS = (1.5, 2.5, 4.5, 8.0)
DEPTH_MM, GRID_MM = 20.0, 1.0
LEAST = 0.75
"""Of the depth, that a leg which measures an error has to come to."""
MESH = LegMeshSettings(contact_size=6, depth_size=12, edge_size=6, growth=0.5, far_size=30)
ROUGHER = 4 / 3
LEG = IdealisedLeg(fat=6.0, fascia=0.6)
AT = Material(C10_kPa=1.0)
AT_RATIO = 2.5
_ORDER = 5


def base_case() -> CorrectionCase:
    """Return the table's leg, of tissue alike in all directions."""
    return CorrectionCase(leg=LEG, material=AT, settings=replace(IdealisedLegSettings(), mesh=MESH), depth=DEPTH_MM)


def varied() -> Mapping[str, tuple[CorrectionCase, ...]]:
    """Return what an error is measured by: one leg against the table's, or two on either side."""
    base = base_case()
    leg, material = base.leg, base.material

    def of_leg(changed: IdealisedLeg) -> CorrectionCase:
        return replace(base, leg=changed)

    def of_size(radius: float, depth: float) -> CorrectionCase:
        return of_leg(leg_of_size(leg, radius, depth * radius))

    rougher = replace(base.settings, mesh=MESH.refined(1 / ROUGHER))
    return {
        "mesh": (replace(base, settings=rougher),),
        "stiffness of the muscle": tuple(replace(base, material=replace(material, C10_kPa=c10)) for c10 in (0.5, 1.6)),
        "stiffening of the muscle": (replace(base, material=stiffened(material, 1.0, 0.4)),),
        "girth": (of_size(50.0, 0.74), of_size(64.0, 0.74)),
        "depth of the bone": (of_size(57.0, 0.6), of_size(57.0, 1.1)),
        "leg's length": tuple(of_leg(replace(leg, length=mm)) for mm in (90.0, 150.0)),
        "fat": tuple(of_leg(replace(leg, fat=mm)) for mm in (2.0, 12.0)),
        "stiffness of the fat": tuple(
            replace(base, material=replace(material, superficial_C10_kPa=c10)) for c10 in (1.4, 2.9)
        ),
        "fascia": tuple(replace(base, material=replace(material, fascia_C10_kPa=c10)) for c10 in (50.0, 200.0)),
        "stiffness in tension": tuple(
            replace(base, material=replace(material, fibre_extension=times)) for times in (2.0, 8.0)
        ),
    }


def fibrous(case: CorrectionCase, ratio: float) -> CorrectionCase:
    """Return a case with fibres of a ratio; without any their tension is none of its own."""
    material = replace(case.material, fibre_ratio=ratio)
    if ratio == 1.0:
        material = replace(material, fibre_extension=AT.fibre_extension)
    return replace(case, material=material)


def tabulate(folder: Path, jobs: int, progress: Progress) -> FibreTable:
    """Solve all cases, and return the table; solved cases are kept in a folder.

    Raises
    ------
    UnsolvedError
        If one stops short of the depth.
    """
    base = base_case()
    cases = [fibrous(base, ratio) for ratio in (1.0, *RATIOS)]
    pairs = [case for group in varied().values() for case in group]
    cases += [fibrous(case, ratio) for case in pairs for ratio in (1.0, AT_RATIO)]
    cases = list(dict.fromkeys(cases))
    progress.stage("legs with fibres", len(cases))
    solved = dict(zip(cases, run_cases(cases, folder, jobs, progress), strict=True))
    for case, outcome in solved.items():
        least = DEPTH_MM if case in cases[: 1 + len(RATIOS)] else LEAST * DEPTH_MM
        if not outcome.spatial.depth >= least - 1e-6:
            raise UnsolvedError(f"{case.leg}, {case.material}: stops at {outcome.spatial.depth:.3g} mm of {least:g} mm")
    at = np.linspace(0.0, DEPTH_MM, round(DEPTH_MM / GRID_MM) + 1)

    def log_factor(case: CorrectionCase, ratio: float) -> FloatArray:
        return smooth_log(solved[fibrous(case, ratio)].spatial, solved[fibrous(case, 1.0)].spatial, at)

    table = np.array([log_factor(base, ratio) for ratio in RATIOS])
    own = log_factor(base, AT_RATIO)
    errors = {
        name: _error(name, [log_factor(case, AT_RATIO) for case in group], own) for name, group in varied().items()
    }
    return FibreTable(np.array(RATIOS), at, table, errors, _description(base, solved))


def smooth_log(fibrous: ForceCurve, plain: ForceCurve, at: FloatArray) -> FloatArray:
    """Return the logarithm of two forces' ratio at displacements (n,), level before first force.

    Before `FIRST_RATIO` forces are those of single quadrature points.
    """
    end = min(fibrous.depth, plain.depth)
    fitted = np.linspace(FIRST_RATIO, end, 60)
    logs = np.log(fibrous(fitted) / plain(fitted))
    return np.asarray(Polynomial.fit(fitted, logs, _ORDER)(np.clip(at, FIRST_RATIO, end)))


def _error(name: str, logs: list[FloatArray], own: FloatArray) -> FloatArray:
    """Return a standard deviation as a share of the logarithm."""
    if name == "mesh":
        return mesh_error(own, logs[0], 1 / ROUGHER) / own
    if len(logs) == 1:
        return (logs[0] - own) / own
    return np.asarray((logs[1] - logs[0]) / 2 / own)


def _description(base: CorrectionCase, solved: Mapping[CorrectionCase, CaseOutcome]) -> dict[str, object]:
    return {
        "command": "python -m studies.fibres --table",
        "definition": "log_factor = ln(RF3D with fibres / RF3D without)",
        "leg": asdict(base.leg),
        "cylinder": asdict(base.cylinder),
        "material": asdict(base.material),
        "mesh": asdict(base.settings.mesh),
        "errors_at_ratio": AT_RATIO,
        "unknowns": max(outcome.unknowns for outcome in solved.values()),
        "processor_seconds": round(sum(outcome.seconds for outcome in solved.values()), 1),
    }
