"""Forces, P and its errors as cells of tables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from legfem.common.units import FloatArray
from legfem.legs.correction import smooth_ratio
from legfem.study.correction.calibration import GRID, Calibrated

SHOWN = np.array([2.5, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
"""mm, of the tables' depths."""

type Cells = tuple[list[str], list[list[str]]]
"""A header and rows."""


def correction_cells(found: Calibrated) -> Cells:
    """Return forces, P and its errors, a row a depth."""
    correction, reference = found.correction, found.reference
    depths = SHOWN[SHOWN <= correction.displacement[-1]]
    smooth = smooth_ratio(reference.spatial, reference.plane, depths)
    modes = [np.interp(depths, correction.displacement, m) for m in correction.errors.values()]
    spread = correction.standard_deviation(depths)
    rows = [
        [
            f"{depth:g}",
            f"{reference.spatial(depth):.3f}",
            f"{reference.plane(depth):.3f}",
            f"{smooth[k]:+.4f}",
            *(f"{mode[k]:+.4f}" for mode in modes),
            f"{spread[k]:.4f}",
        ]
        for k, depth in enumerate(depths)
    ]
    return ["d (mm)", "RF3D (N)", "L RF2D (N)", "P", *correction.errors, "sd"], rows


def meshes_cells(found: Calibrated) -> Cells:
    """Return P on the meshes, a row a mesh, and the finest one's error by Richardson's estimate."""
    displacement = found.correction.displacement
    depths = SHOWN[SHOWN <= displacement[-1]]
    rows = []
    for outcome in reversed(found.meshes):
        values = smooth_ratio(outcome.spatial, outcome.plane, depths)
        rows.append(
            [
                f"{outcome.unknowns}",
                *(f"{p:+.4f}" for p in values),
                f"{outcome.factorisations}",
                f"{outcome.seconds:.0f}",
            ]
        )
    error = np.interp(depths, displacement, found.correction.errors["mesh"])
    rows.append(["limit", *(f"{p:+.4f}" for p in values + error), "", ""])
    return ["unknowns", *(f"{depth:g} mm" for depth in depths), "tangents", "s"], rows


def trend_cells(name: str, curves: Mapping[str, FloatArray]) -> Cells:
    """Return P, a row a value of what is varied."""
    displacement = grid_of(curves)
    depths = SHOWN[SHOWN <= displacement[-1]]
    rows = []
    for value, curve in curves.items():
        at = np.interp(depths, displacement, curve)
        rows.append([value, *("-" if np.isnan(p) else f"{p:+.4f}" for p in at)])
    return [name, *(f"{depth:g} mm" for depth in depths)], rows


def grid_of(curves: Mapping[str, FloatArray]) -> FloatArray:
    """Return the displacements (mm) of curves of P."""
    return GRID * np.arange(len(next(iter(curves.values()))))
