"""The parts of a stocking's page on the pressures on the skin and inside the leg."""

from __future__ import annotations

import numpy as np

from legfem.common.units import mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN
from legfem.inference.constants import quantile
from legfem.report.leg_directions import Directions, angle_round
from legfem.report.lines import fill
from legfem.report.stocking_words import (
    both_units,
    correlation,
    place_in_fat,
    table,
    vein_interval,
)
from legfem.stocking.fat_pressures import FatPressures
from legfem.stocking.run import StockingResult
from legfem.stocking.warnings import unloaded_skin


def interface_section(result: StockingResult) -> str:
    """Return what the stocking does to the skin, and to itself."""
    load, stocking, bare = result.worn.load, result.leg.stocking, result.leg.bare
    by_level = load.pressure.mean(axis=1)
    unloaded = unloaded_skin(bare, load)
    low, high = stocking.unstretched.min(), stocking.unstretched.max()
    width = f"{low:.0f} mm" if high - low < 0.5 else f"{low:.0f} to {high:.0f} mm"
    rows = [
        ("mean over the skin", both_units(load.mean_pressure)),
        ("least", f"{both_units(float(load.pressure.min()))}"
         + (f"; {100 * unloaded.mean():.0f} % of the skin bears none" if unloaded.any() else "")),
        ("greatest", f"{both_units(float(load.pressure.max()))}, {highest_place(result)}"),
        ("mean at the lower end", f"{both_units(float(by_level[0]))}"),
        ("mean at the upper end", f"{both_units(float(by_level[-1]))}"),
        ("fabric", f"{stocking.stiffness:g} N/mm per unit of strain, unstretched {width} round"),
        ("its strain", f"{100 * load.strain.min():.1f} to {100 * load.strain.max():.1f} %"),
        ("its tension", f"{load.tension.min():.4f} to {load.tension.max():.4f} N/mm"),
    ]  # fmt: skip
    if not result.worn.state.report.complete:
        note = "Of the bare leg's shape, since the leg in its stocking could not be computed:"
    else:
        note = (
            "By Laplace's law, from the fabric's tension and the curvature of the leg as it is "
            "compressed; the fabric spans hollows and presses on nothing there."
        )
    if result.scan_load is not None:
        rows.insert(
            1, ("by the scanned shape", f"{both_units(result.scan_load.mean_pressure)} (mean)")
        )
    if (text := tension_text(result)) is not None:
        rows.append(("its tension over what was given", text))
    blocks = [fill(note), table(rows)]
    if result.sensors:
        blocks += [fill(f"{_SENSORS} {_used(result)}"), table(sensor_rows(result))]
    return "\n\n".join(blocks)


_SENSORS = "Sensors between stocking and skin beside the model, averaged over their faces."


def _used(result: StockingResult) -> str:
    if not result.searches:
        return "They were compared, and nothing was identified from them."
    return (
        "They are data of the identification."
        if tension_text(result) is not None
        else "They are data of the identification; the fabric was taken as it was given "
        "([accuracy] tension_relative_sd), so that they say little."
    )


def sensor_rows(result: StockingResult) -> list[tuple[str, str]]:
    """Return what each sensor showed beside the model."""
    return [
        (one.sensor.name,
         f"{mpa_to_mmhg(one.sensor.pressure):.1f} ± {mpa_to_mmhg(one.sensor.sd):.1f} mmHg (sd), "
         f"model {mpa_to_mmhg(one.pressure):.1f} mmHg ({one.departure:+.1f} sd)")
        for one in result.sensors
    ]  # fmt: skip


def tension_text(result: StockingResult) -> str | None:
    """Return by how much the fabric's tension differs from what was given; None if it isn't let."""
    tension = None if result.best is None else result.best.tension
    if tension is None:
        return None
    prior = result.leg.accuracy.tension_sd
    factor, half = 1 + tension.value, quantile(0) * tension.sd
    return (
        f"{factor:.3f} ({factor - half:.3f} to {factor + half:.3f}; known beforehand to "
        f"{100 * prior:g} %, sd)"
    )


def highest_place(result: StockingResult) -> str:
    """Return where the stocking presses most, in words."""
    pressure, bare = result.worn.load.pressure, result.leg.bare
    level, point = np.unravel_index(int(np.argmax(pressure)), pressure.shape)
    skin = bare.contours[SKIN][level]
    direction = Directions.of(bare).at(float(angle_round(skin[point], skin.mean(axis=0))))
    return f"{direction}, z = {bare.levels[level]:.0f} mm"


def inside_section(result: StockingResult, fat: FatPressures | None) -> str:
    """Return the pressures at the veins, in the muscle and in the fat; nothing if not found."""
    found = result.pressures
    if found is None:
        return ""
    mean, where = found.mean_interface, place_in_fat(result.leg.bare, found.greatest_in_fat_at)
    rows = [
        (vein.name,
         f"{both_units(p)}{_interval(result, k)}, {100 * p / mean:.0f} % of the mean on the skin"
         if np.isfinite(p) else "not in the tissues: check the vein's position")
        for k, (vein, p) in enumerate(zip(result.leg.veins, found.at_veins, strict=True))
    ]  # fmt: skip
    rows.append(("muscle, mean", f"{both_units(found.mean_in_muscle)}"))
    rows.append(
        ("fat, greatest",
         f"{both_units(found.greatest_in_fat)}, {100 * found.greatest_in_fat / mean:.0f} % of the "
         "mean on the skin")
    )  # fmt: skip
    blocks = [
        fill(
            "Hydrostatic pressure, positive in compression; at the veins in tissue without a vein "
            f"in it, at z = {result.leg.veins[0].position[2]:.1f} mm. Intervals (95 %) count the "
            "errors of stiffness, mesh and the pressure round the leg"
            + (
                ", not those of the fabric."
                if tension_text(result) is None
                else " and those of the fabric's tension."
            )
            if result.leg.veins
            else "Hydrostatic pressure, positive in compression. No veins were given or placed."
        ),
        table(rows),
        *_postures(result),
        fill(
            "The greatest pressure in the fat, where the receptors of pain are, is the second "
            f"paper's measure of discomfort. It is {where}."
        ),
    ]
    if fat is not None:
        thickness = fat.rank_correlation(fat.greatest, fat.thickness)
        interface = fat.rank_correlation(fat.greatest, fat.interface)
        blocks.append(
            fill(
                f"Round this leg the fat is {fat.thickness.min():.1f} to {fat.thickness.max():.1f} "
                "mm thick. The greatest pressure in the fat under a place on the skin goes with "
                f"the fat's thickness with a rank correlation of {correlation(thickness)}, with "
                f"the pressure on the skin there with {correlation(interface)}. That is within one "
                "leg; it says nothing of differences between legs."
            )
        )
    return "\n\n".join(blocks)


def _postures(result: StockingResult) -> list[str]:
    """Return what the veins' walls bear from inside, where the posture is given."""
    posture, found = result.leg.posture, result.pressures
    if posture is None or found is None or not result.leg.veins:
        return []
    rows = []
    for vein, tissue in zip(result.leg.veins, found.at_veins, strict=True):
        inside = posture.inside(float(vein.position[2]))
        bears = ", ".join(f"{name} {both_units(p - tissue)}" for name, p in inside.items())
        rows.append((vein.name, bears if np.isfinite(tissue) else "not in the tissues"))
    said = (
        "Inside a vein less outside, by the blood's column from the heart when standing still; "
        "below zero it is narrowed. The tissue's own weight is left out."
    )
    return [fill(said), table(rows)]


def _interval(result: StockingResult, vein: int) -> str:
    low, high = vein_interval(result, vein)
    return f", {low:.1f} to {high:.1f} mmHg" if np.isfinite(high) else ""
