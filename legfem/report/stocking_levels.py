"""The pressure along a leg, and at the levels at which makers give it, with the limits of a class."""

from __future__ import annotations

import numpy as np

from legfem.inverse.intervals import quantile
from legfem.report.page import Block, Curves, Line, Prose, WebTable
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.stockings.fabric import CALF_SHARE, PLACES, PressureAlong, stocking_load
from legfem.stockings.result import StockingResult

ALONG = "Pressure along the leg"
"""Title of the chapter."""


def pressures_along(result: StockingResult) -> PressureAlong:
    """Return the stocking's pressure by height."""
    leg, tension = result.leg, None if result.best is None else result.best.tension
    on_bare = stocking_load(leg.bare, leg.stocking).times(1.0 if tension is None else 1 + tension.value)
    return PressureAlong.of(leg.bare, result.equilibrium.load, on_bare, leg.accuracy)


def level_rows(result: StockingResult) -> list[tuple[str, ...]]:
    """Return a row for every level that the modelled part of the leg has."""
    along, makers = pressures_along(result), result.leg.makers
    places = makers.found(result.leg.bare)
    ankle = along.at(places["B"][0])[0] if "B" in places else None
    rows: list[tuple[str, ...]] = []
    for name, (height, stated) in places.items():
        mean, sd = along.at(height)
        low, high = mean - quantile(0) * sd, mean + quantile(0) * sd
        limits = makers.limits(name, ankle)
        rows.append(
            (
                name,
                f"{height:.0f} mm, {'as stated' if stated else PLACES[name]}",
                f"{mean:.1f} ({low:.1f} to {high:.1f})",
                "–" if ankle is None else f"{100 * mean / ankle:.0f} %",
                "–" if limits is None else _span(*limits),
                "–" if limits is None else _judged((low, high), limits),
            )
        )
    return rows


def _span(low: float, high: float) -> str:
    return f"{low:.3g} to {high:.3g}" if np.isfinite(high) else f"{low:.3g} or more"


def _judged(interval: tuple[float, float], limits: tuple[float, float]) -> str:
    if limits[0] <= interval[0] and interval[1] <= limits[1]:
        return "within"
    if interval[1] < limits[0]:
        return "too low"
    return "too high" if interval[0] > limits[1] else "not certain: the interval crosses a limit"


def level_blocks(result: StockingResult) -> list[Block]:
    """Return levels with limits, the gradient, and the curve along the leg."""
    along, makers, leg = pressures_along(result), result.leg.makers, result.leg
    rows, blocks = level_rows(result), list[Block]()
    if rows:
        asked = (
            f"class {makers.intended_class} of {makers.standard}" if makers.intended_class else "no class was stated"
        )
        blocks.append(
            WebTable(
                f"Mean pressure round the leg at the makers' levels, mmHg with 95 % intervals; limits: {asked}",
                ("level", "height", "pressure (mmHg)", "share of B's", "limits (mmHg)", "verdict"),
                rows,
            )
        )
    missing = [name for name in PLACES if name not in makers.found(leg.bare)]
    if missing:
        blocks.append(
            Prose(
                f"The modelled part has no {', '.join(missing)}: state heights as [stocking.levels_mm] in "
                f"leg.toml, within {leg.bare.levels[0]:.0f} to {leg.bare.levels[-1]:.0f} mm."
            )
        )
    open_ones = [row[0] for row in rows if row[0] != "B" and row[4] == "–"]
    if makers.intended_class and open_ones:
        blocks.append(
            Prose(
                f"For limits at {', '.join(open_ones)}, state [stocking.limits_percent] in leg.toml: the least and "
                "greatest share of the pressure at B that your standard allows."
            )
        )
    slope = 10 * np.polyfit(along.levels, along.mean, 1)[0]
    blocks.append(
        Prose(
            f"Gradient: {slope:+.2f} mmHg per cm upwards, from {along.mean[0]:.1f} mmHg at the lower end to "
            f"{along.mean[-1]:.1f} mmHg at the upper end."
            + (
                f" The fabric was not given: it was chosen to press with {100 * CALF_SHARE:.0f} % of the class's "
                "pressure at the ankle at all heights, so gradient and limits say nothing about a real stocking."
                if makers.assumed_fabric
                else ""
            )
        )
    )
    blocks.append(
        Curves(
            "along",
            "Pressure of the stocking on the skin over the height: mean round the leg with its 95 % interval, and the "
            "least and greatest round the leg.",
            along.levels,
            "height z (mm)",
            "pressure (mmHg)",
            "",
            [
                Line("mean round the leg", along.mean, None, DATA_COLOUR),
                Line("greatest round the leg", along.greatest, None, FAINT, "dashed"),
                Line("least round the leg", along.least, None, FAINT, "dotted"),
            ],
            band=quantile(0) * along.sd,
            band_name="95 % interval of the mean",
        )
    )
    error = leg.accuracy
    tension = (
        f"{100 * error.tension_sd:g} % of the fabric's tension"
        if error.tension_sd
        else "none of the fabric's tension, which counts as exact until [accuracy] tension_relative_sd states its error"
    )
    blocks.append(
        Prose(
            f"The intervals include these standard deviations: {tension}; {100 * error.pressure_sd:g} % of the "
            "pressure over an eighth of the girth; and, for the mesh, a tenth of the change that the leg's giving way "
            "causes (a judgement)."
        )
    )
    return blocks


_BESIDE = {"within": "within", "too low": "too low for", "too high": "too high for"}
_UNSURE = "which may or may not be within"


def sentence_at_ankle(result: StockingResult) -> str:
    """Return the pressure at B beside the class; empty where B isn't in the modelled part, or no fabric was given."""
    if result.leg.makers.assumed_fabric:
        return ""
    for name, _, pressure, _, limits, verdict in level_rows(result):
        if name == "B":
            of_class = f"class {result.leg.makers.intended_class} ({limits} mmHg)"
            beside = "" if limits == "–" else f", {_BESIDE.get(verdict, _UNSURE)} {of_class}"
            return f"At the ankle (B) the stocking presses with {pressure} mmHg{beside}."
    return ""
