"""The idealised leg of muscle alone, with fibres along it: its correction, as a worker solves it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.units import FloatArray
from legfem.experiments.leg_3d import IdealisedLegSettings
from legfem.inverse.correction import smooth_ratio
from legfem.meshing.structured import LegMeshSettings
from legfem.study.correction.cases import CaseOutcome, CorrectionCase, Material

C10_KPA = 1.0
DEPTH_MM = 15.0
RATIOS = (1.0, 2.0, 3.0, 5.0)
"""Of the shear moduli along the leg and across; about three in the thigh's vastus lateralis."""
AT_MM = np.array([2.0, 5.0, 10.0, 15.0])
_COARSE = LegMeshSettings(contact_size=8, depth_size=16, edge_size=8, growth=0.5, far_size=40)


def case_of(ratio: float, coarse: bool = False) -> CorrectionCase:
    """Return the idealised leg with a ratio of shear moduli."""
    settings = IdealisedLegSettings()
    return CorrectionCase(
        material=Material(C10_kPa=C10_KPA, fibre_ratio=ratio),
        settings=replace(settings, mesh=_COARSE) if coarse else settings,
        depth=DEPTH_MM,
    )


def correction_of(outcome: CaseOutcome) -> tuple[FloatArray, FloatArray]:
    """Return P and the 3D force (N) at `AT_MM`."""
    reached = min(outcome.spatial.depth, outcome.plane.depth)
    if reached < AT_MM[-1]:
        raise UnsolvedError(f"fibres: a leg stops at {reached:.3g} mm of {AT_MM[-1]:g} mm")
    return smooth_ratio(outcome.spatial, outcome.plane, AT_MM), outcome.spatial(AT_MM)
