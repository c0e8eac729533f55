"""Numbers, places and lists of a stocking's page in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from legfem.common.units import FloatArray, mpa_to_kpa, mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN, LegShape, fat_thickness_around
from legfem.inverse.intervals import quantile
from legfem.report.leg_directions import Directions, angle_round
from legfem.stockings.notices import TISSUES
from legfem.stockings.pressures import too_low_by
from legfem.stockings.result import StockingResult

ORIGINS = {
    "measured": "measured data",
    "simulated": "simulated data (the scans were computed by a model; no leg was scanned)",
}


def both_units(pressure: float) -> str:
    """Return a pressure (MPa) in mmHg and kPa."""
    return f"{mpa_to_mmhg(pressure):.1f} mmHg ({mpa_to_kpa(pressure):.2f} kPa)"


def share_of(pressures: Sequence[float], mean: float) -> str:
    """Return the range of pressures over a mean, in per cent."""
    shares = sorted(100 * p / mean for p in pressures if np.isfinite(p))
    if not shares:
        return "an unknown share"
    low, high = f"{shares[0]:.0f}", f"{shares[-1]:.0f}"
    return f"{low} %" if low == high else f"{low} to {high} %"


def stiffness_values(parameters: dict[str, float]) -> str:
    """Return stiffnesses (MPa) by name, in kPa."""
    return ", ".join(f"{TISSUES[name]} C10 = {mpa_to_kpa(value):.3g} kPa" for name, value in parameters.items())


def stiffness_interval(interval: tuple[float, float]) -> str:
    """Return a 95 % interval (MPa) in kPa, in words where it is open."""
    low, high = (mpa_to_kpa(end) for end in interval)
    if low > 0 and np.isfinite(high):
        return f"{low:.3g} to {high:.3g}"
    if low > 0:
        return f"at least {low:.3g}"
    return f"at most {high:.3g}" if np.isfinite(high) else "any"


def vein_interval(result: StockingResult, vein: int) -> tuple[float, float]:
    """Return the 95 % interval of a vein's pressure (mmHg), NaN where it isn't known."""
    assert result.pressures is not None
    half = quantile(0) * result.pressures.at_veins_sd[vein]
    middle = result.pressures.at_veins[vein]
    return mpa_to_mmhg(middle - half), mpa_to_mmhg(middle + half)


def low_in_fat(result: StockingResult) -> str:
    """Return by how much the greatest pressure in the fat is too low on the mesh."""
    least, most = (f"{100 * share:.0f}" for share in too_low_by(result.tetrahedra))
    return f"{least} to {most} % too low on this mesh, as measured on leg 1"


def place_in_fat(bare: LegShape, point: FloatArray) -> str:
    """Return where a point of the bare leg is, in words."""
    level = float(point[2])
    skin = bare.at(SKIN, level)
    direction = Directions.of(bare).at(float(angle_round(point[:2], skin.mean(axis=0))))
    depth = np.linalg.norm(skin - point[:2], axis=1)
    row = int(np.argmin(np.abs(bare.levels - level)))
    thick = float(fat_thickness_around(bare)[row, int(np.argmin(depth))])
    return (
        f"at z = {level:.0f} mm on the {direction} side, {depth.min():.1f} mm under the skin where "
        f"the fat is {thick:.1f} mm thick"
    )


def correlation(value: float) -> str:
    """Return a rank correlation, if there is one."""
    return f"{value:.2f}" if np.isfinite(value) else "- (one of them is the same all round)"
