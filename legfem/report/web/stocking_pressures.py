"""What a stocking's page says of the pressures on the skin and inside the leg."""

from __future__ import annotations

import numpy as np

from legfem.common.units import mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN
from legfem.inverse.intervals import quantile
from legfem.report.leg_directions import Directions, angle_round
from legfem.report.stocking_words import both_units, correlation, place_in_fat, vein_interval
from legfem.report.web.bars import Bars, LabelledBar
from legfem.report.web.page import Block, Prose, WebTable
from legfem.stockings.notices import unloaded_skin
from legfem.stockings.pressures import FatPressures, TissuePressures
from legfem.stockings.result import StockingResult


def pressure_blocks(result: StockingResult, fat: FatPressures | None) -> list[Block]:
    """Return the pressures on the skin and inside; those in the fat if they were sampled."""
    return [*_of_stocking(result), *_inside(result, fat)]


def _of_stocking(result: StockingResult) -> list[Block]:
    """Return what the stocking does to the skin, and to itself."""
    load = result.worn.load
    by_level = load.pressure.mean(axis=1)
    unloaded = unloaded_skin(result.leg.bare, load)
    rows = [
        ("mean over the skin", both_units(load.mean_pressure)),
        (
            "least",
            both_units(float(load.pressure.min()))
            + (f"; {100 * unloaded.mean():.0f} % of the skin bears none" if unloaded.any() else ""),
        ),
        ("greatest", f"{both_units(float(load.pressure.max()))}, {highest_place(result)}"),
        ("mean at the lower end", both_units(float(by_level[0]))),
        ("mean at the upper end", both_units(float(by_level[-1]))),
        ("the fabric's strain", f"{100 * load.strain.min():.1f} to {100 * load.strain.max():.1f} %"),
        ("its tension", f"{load.tension.min():.4f} to {load.tension.max():.4f} N/mm"),
    ]
    note = (
        "By Laplace's law, from the fabric's tension and the curvature of the leg as it is "
        "compressed; the fabric spans hollows and presses on nothing there."
        if result.worn.state.report.complete
        else "Of the bare leg's shape, since the leg in its stocking could not be computed."
    )
    blocks: list[Block] = [Prose(note), WebTable("Pressure of the stocking on the skin", ["where", "pressure"], rows)]
    if result.sensors:
        caption = f"{_SENSORS} {_used(result)}"
        blocks.append(WebTable(caption, ["sensor", "shown, and by the model"], sensor_rows(result)))
    return blocks


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
        (
            one.sensor.name,
            f"{mpa_to_mmhg(one.sensor.pressure):.1f} ± {mpa_to_mmhg(one.sensor.sd):.1f} mmHg (sd), "
            f"model {mpa_to_mmhg(one.pressure):.1f} mmHg ({one.departure:+.1f} sd)",
        )
        for one in result.sensors
    ]


def tension_text(result: StockingResult) -> str | None:
    """Return by how much the fabric's tension differs from what was given; None if it isn't let."""
    tension = None if result.best is None else result.best.tension
    if tension is None:
        return None
    prior = result.leg.accuracy.tension_sd
    factor, half = 1 + tension.value, quantile(0) * tension.sd
    return f"{factor:.3f} ({factor - half:.3f} to {factor + half:.3f}; known beforehand to {100 * prior:g} %, sd)"


def highest_place(result: StockingResult) -> str:
    """Return where the stocking presses most, in words."""
    pressure, bare = result.worn.load.pressure, result.leg.bare
    level, point = np.unravel_index(int(np.argmax(pressure)), pressure.shape)
    skin = bare.contours[SKIN][level]
    direction = Directions.of(bare).at(float(angle_round(skin[point], skin.mean(axis=0))))
    return f"{direction}, z = {bare.levels[level]:.0f} mm"


def _inside(result: StockingResult, fat: FatPressures | None) -> list[Block]:
    """Return the pressures at the veins, in the muscle and in the fat; nothing if not found."""
    found = result.pressures
    if found is None:
        return []
    beside = ", not those of the fabric" if tension_text(result) is None else " and those of the fabric's tension"
    note = (
        "Hydrostatic pressure, positive in compression; at the veins in tissue without a vein in "
        f"it, at z = {result.leg.veins[0].position[2]:.1f} mm. Intervals (95 %) count the errors "
        f"of stiffness, mesh and the pressure round the leg{beside}."
        if result.leg.veins
        else "Hydrostatic pressure, positive in compression. No veins were given or placed."
    )
    blocks: list[Block] = [Prose(note), _bars(result, found), *_postures(result)]
    where = place_in_fat(result.leg.bare, found.greatest_in_fat_at)
    blocks.append(
        Prose(
            "The greatest pressure in the fat, where the receptors of pain are, is the second "
            f"paper's measure of discomfort. It is {where}."
        )
    )
    if fat is not None:
        thickness = fat.rank_correlation(fat.greatest, fat.thickness)
        interface = fat.rank_correlation(fat.greatest, fat.interface)
        blocks.append(
            Prose(
                f"Round this leg the fat is {fat.thickness.min():.1f} to {fat.thickness.max():.1f} "
                "mm thick. The greatest pressure in the fat under a place on the skin goes with "
                f"the fat's thickness with a rank correlation of {correlation(thickness)}, with "
                f"the pressure on the skin there with {correlation(interface)}. That is within one "
                "leg; it says nothing of differences between legs."
            )
        )
    return blocks


def _postures(result: StockingResult) -> list[Block]:
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
        "below zero it is narrowed. The tissue's own weight is left out"
    )
    return [WebTable(said, ["vein", "pressure"], rows)]


def _bars(result: StockingResult, found: TissuePressures) -> Bars:
    leg, load = result.leg, result.worn.load
    bars = [
        LabelledBar("skin, mean", mpa_to_mmhg(found.mean_interface), both_units(found.mean_interface)),
        LabelledBar(
            f"skin, greatest ({highest_place(result)})",
            mpa_to_mmhg(found.greatest_interface),
            both_units(found.greatest_interface),
        ),
        LabelledBar("skin, least", mpa_to_mmhg(float(load.pressure.min())), both_units(float(load.pressure.min()))),
        LabelledBar(
            "fat, greatest",
            mpa_to_mmhg(found.greatest_in_fat),
            f"{both_units(found.greatest_in_fat)}, {_share(found.greatest_in_fat, found)}",
        ),
        LabelledBar("muscle, mean", mpa_to_mmhg(found.mean_in_muscle), both_units(found.mean_in_muscle)),
    ]
    for k, (vein, pressure) in enumerate(zip(leg.veins, found.at_veins, strict=True)):
        low, high = vein_interval(result, k)
        known = np.isfinite(high)
        bars.append(
            LabelledBar(
                f"vein, {vein.name}",
                mpa_to_mmhg(pressure) if np.isfinite(pressure) else 0.0,
                both_units(pressure)
                + (f", {low:.1f} to {high:.1f} mmHg" if known else "")
                + f", {_share(pressure, found)}"
                if np.isfinite(pressure)
                else "not in the tissues: check the vein's position",
                (low, high) if known else None,
            )
        )
    return Bars(
        "Pressures (mmHg, kPa), on the skin by Laplace's law, inside hydrostatic; ends: 95 %",
        ("where", "pressure"),
        bars,
    )


def _share(pressure: float, found: TissuePressures) -> str:
    return f"{100 * pressure / found.mean_interface:.0f} % of the mean on the skin"
