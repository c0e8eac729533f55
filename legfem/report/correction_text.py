"""The 3D correction of an identification, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from legfem.common.units import FloatArray
from legfem.identify.result import IdentificationResult, SpatialEvidence

_AT = (5.0, 15.0, 25.0)
"""mm."""


def correction_lines(result: IdentificationResult) -> list[str]:
    """Return what corrected the force, how well that is known, and what it was confirmed by."""
    applied = result.correction
    if applied is None:
        return ["3D correction      none (plane strain times the cylinder's length)"]
    grid = result.measured.displacement
    depths = [d for d in _AT if grid[0] <= d <= grid[-1]] or [float(grid[-1])]
    values = [
        f"{np.interp(d, grid, applied.P):+.2f} ± {np.interp(d, grid, applied.sd):.2f} at {d:.3g} mm"
        for d in depths
    ]
    return [
        f"3D correction      {applied.name}",
        f"                   force = (1 - P) x plane strain; P {', '.join(values)}",
        "                   (one standard deviation; the intervals carry it)",
        *(_spatial(result.spatial, grid, depths) if result.spatial else []),
    ]


def _spatial(found: SpatialEvidence, grid: FloatArray, depths: Sequence[float]) -> list[str]:
    """Return what the leg's own solves in 3D say, beside the table of idealised legs."""
    steps = [
        f"                   C10 {one.c10:.3g}, C20 {one.c20:.3g} kPa: 3D force within "
        f"{100 * one.error:.2g} % of what was predicted; C10 then moved by "
        f"{100 * one.moved:.2g} % ({one.seconds:.0f} s)"
        for one in found.confirmations
    ]
    errors = ", ".join(f"{name} {value:.3f}" for name, value in found.errors.items())
    lines = [
        f"leg in 3D          {found.shape}",
        f"                   {found.full_solves} full solves and {found.rough_solves} rougher ones",
        *steps,
        f"                   greatest error of P by cause: {errors}",
    ]
    if found.table_P is not None:
        at = [f"{np.interp(d, grid, found.table_P):+.2f} at {d:.3g} mm" for d in depths]
        lines.append(f"                   the table of idealised legs has P {', '.join(at)}")
    return lines
