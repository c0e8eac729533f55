"""The leg of a stocking's page in 3D, and what colours its skin."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.geometry.curve import outward_normals
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.report.web.turned import Marked, SkinField, TurnedLeg, turned_leg
from legfem.stocking.run import StockingResult


def dressed_leg(result: StockingResult, moved: Mapping[str, FloatArray]) -> TurnedLeg:
    """Return the leg with the stocking's pressure, its movement and the skin's stretch.

    Parameters
    ----------
    result
        Of a run whose worn state was found.
    moved
        Displacement (mm) of skin's and hull's points, (n_levels, n_points, 3) each.
    """
    bare, found = result.leg.bare, result.pressures
    assert found is not None
    fields = [
        SkinField("pressure on the skin", "mmHg", mpa_to_mmhg(result.worn.pressure)),
        SkinField("inward movement", "mm", inward(bare, moved[SKIN])),
        SkinField("stretch of the skin round the leg", "%", stretch_round(bare, moved[SKIN])),
    ]
    marked = [
        Marked(f"{vein.name}: {mpa_to_mmhg(p):.1f} mmHg", vein.position)
        for vein, p in zip(result.leg.veins, found.at_veins, strict=True)
        if np.isfinite(p)
    ]
    return turned_leg(
        bare, moved, fields, marked,
        "The leg's skin, coloured by what the stocking does to it; inside it muscle, bones and "
        "veins. Bare and dressed were computed; what lies between is drawn in proportion.",
    )  # fmt: skip


def inward(bare: LegShape, moved: FloatArray) -> FloatArray:
    """Return how far the skin moved inwards (mm), (n_levels, n_points)."""
    normals = outward_normals(bare.contours[SKIN])
    return -np.einsum("lpd,lpd->lp", normals, moved[..., :2])


def stretch_round(bare: LegShape, moved: FloatArray) -> FloatArray:
    """Return the skin's elongation round the leg (%), of the ways to both neighbours."""
    points = bare.points(SKIN)

    def ways(at: FloatArray) -> FloatArray:
        ahead = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2)
        return np.asarray(ahead + np.roll(ahead, 1, axis=1))

    return 100 * (ways(points + moved) / ways(points) - 1)
