"""Pressures of a stocking on its page: the leg in 3D, tables and bars, in words."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from legfem.common.units import FloatArray, mpa_to_kpa, mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN, LegShape, fat_thickness_around
from legfem.geometry.motion import inward, stretch_round
from legfem.inverse.intervals import quantile
from legfem.report.answers import span_of
from legfem.report.curves import Curves, Dash, Line
from legfem.report.leg_3d_view import SkinField, from_none, turned_leg
from legfem.report.page import Bars, Block, Known, LabelledBar, Prose, Slider, TurnedLeg, View, WebTable
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.report.words import ROUND, TOLD, WORDS, Directions, angle_round, round_leg, unwrapped
from legfem.stockings.details import StockingDetails
from legfem.stockings.fabric import CALF_SHARE
from legfem.stockings.levels import LEVELS, rises
from legfem.stockings.pressures import TissuePressures, too_low_by
from legfem.stockings.tape import TapeDetails

ALONG = "Pressure along the leg"
PRESSURES = "Pressures on the skin and inside"
"""Titles of chapters."""


def both_units(pressure: float) -> str:
    """Return a pressure (MPa) in mmHg and kPa."""
    return f"{mpa_to_mmhg(pressure):.1f} mmHg ({mpa_to_kpa(pressure):.2f} kPa)"


_SEEN_MMHG = 0.05
"""A rise of less is none in a number of one decimal."""


def greatest_in_fat(details: StockingDetails, found: TissuePressures) -> str:
    """Return the greatest pressure in the fat, corrected for the mesh, and that on the mesh."""
    least, most = (f"{mpa_to_mmhg(found.greatest_in_fat / (1 - by)):.1f}" for by in too_low_by(details.tetrahedra))
    by = f"by finer meshes of a leg that comes with legfem; {both_units(found.greatest_in_fat)} on this mesh"
    return f"{least} to {most} mmHg ({by})"


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


def pressure_blocks(details: StockingDetails) -> list[Block]:
    """Return the pressures on the skin and inside."""
    note = "Of the bare leg's shape, since the leg in its stocking could not be computed."
    if details.equilibrium.state.report.complete:
        note = "By Laplace's law, from the fabric's tension and the curvature of the leg as it is compressed; the "
        note += "fabric spans hollows and presses on nothing there."
    blocks: list[Block] = [Prose(note), _bars(details)]
    return blocks if details.pressures is None else [*blocks, *_inside(details, details.pressures)]


def sensor_rows(details: StockingDetails) -> list[Known]:
    """Return what each sensor showed, averaged over its face, beside the model."""
    used = "compared, and nothing identified from it"
    if details.best is not None:
        used = "data of the identification"
        if details.best.tension is None:
            used += "; the fabric was taken as it was given ([accuracy] tension_relative_sd), so it adds little"
    return [
        Known(
            f"pressure on the skin at the sensor {one.sensor.name!r}",
            f"{mpa_to_mmhg(one.sensor.pressure):.1f} ± {mpa_to_mmhg(one.sensor.sd):.1f} mmHg (sd), "
            f"model {mpa_to_mmhg(one.pressure):.1f} mmHg ({one.standardised_residual:+.1f} sd)",
            details.leg.origin,
            "leg.toml",
            remark=used + (f"; corrected for its {one.sensor.thickness:g} mm" if one.sensor.thickness else ""),
        )
        for one in details.sensors
    ]


def tension_text(details: StockingDetails) -> str | None:
    """Return by how much the fabric's tension differs from what was given; None if it isn't let."""
    tension = None if details.best is None else details.best.tension
    if tension is None:
        return None
    prior = details.leg.accuracy.tension_sd
    factor, half = 1 + tension.value, quantile(0) * tension.sd
    return f"{factor:.3f} ({factor - half:.3f} to {factor + half:.3f}; known before the test to {100 * prior:g} %, sd)"


def highest_place(details: StockingDetails) -> str:
    """Return where the stocking presses most, in words."""
    pressure, bare = details.equilibrium.load.pressure, details.leg.bare
    level, point = np.unravel_index(int(np.argmax(pressure)), pressure.shape)
    skin = bare.contours[SKIN][level]
    direction = Directions.of(bare).at(float(angle_round(skin[point], skin.mean(axis=0))))
    return f"{direction}, z = {bare.levels[level]:.0f} mm"


def _inside(details: StockingDetails, found: TissuePressures) -> list[Block]:
    """Return the pressures at the veins, in the muscle and in the fat."""
    fat, stated = details.fat, details.leg.accuracy.tension_sd > 0
    beside = " and of the fabric's tension" if stated else "; the fabric's tension counts as exact"
    note, place = TOLD["no_veins"], place_in_fat(details.leg.bare, found.greatest_in_fat_at)
    if details.leg.veins:
        note = TOLD["inside"].format(level=details.leg.veins[0].position[2], beside=beside)
    blocks: list[Block] = [Prose(note), *_postures(details), Prose(TOLD["discomfort"].format(place=place))]
    if fat is not None:
        each = (fat.rank_correlation(fat.greatest, other) for other in (fat.thickness, fat.interface))
        thickness, interface = (
            f"{one:.2f}" if np.isfinite(one) else "- (one of them is the same all round)" for one in each
        )
        extent = {"thin": fat.thickness.min(), "thick": fat.thickness.max()}
        blocks.append(Prose(TOLD["fat_and_pressure"].format(thickness=thickness, interface=interface, **extent)))
    return [*blocks, *fat_curves(details)]


def fat_curves(details: StockingDetails) -> list[Curves]:
    """Thickness of the fat at mid calf, and the pressures over it and in it; nothing where these aren't known."""
    fat, section = details.fat, details.section
    if fat is None or section is None:
        return []
    row = int(np.argmin(np.abs(fat.levels - section.level)))
    angles = unwrapped(fat.skin)[row]
    shown: list[tuple[str, FloatArray, str, Dash]] = [
        ("hydrostatic in the fat, greatest in its depth", fat.greatest, "#D55E00", "solid"),
        ("hydrostatic in the fat, mean over its depth", fat.mean, "#D55E00", "dashed"),
        ("on the skin", fat.interface, "#0072B2", "dotdash"),
    ]
    lines = [
        Line(name, round_leg(angles, mpa_to_mmhg(values[row])), None, colour, dash)
        for name, values, colour, dash in shown
    ]
    title = f"Pressures over and in the fat, round the leg at z = {fat.levels[row]:.1f} mm"
    lines.append(Line("thickness of the fat", None, round_leg(angles, fat.thickness[row]), tabled=False))
    x, below = Directions.of(details.leg.bare).axis(), "fat thickness (mm)"
    return [Curves("fat", title, "; beneath, its thickness.", ROUND, x, "pressure (mmHg)", lines, below_label=below)]


def _postures(details: StockingDetails) -> list[Block]:
    """Return what the veins' walls bear from inside, where the posture is given."""
    posture, found = details.leg.posture, details.pressures
    if posture is None or found is None or not details.leg.veins:
        return []
    rows = []
    for vein, tissue in zip(details.leg.veins, found.at_veins, strict=True):
        inside = posture.inside(float(vein.position[2]))
        bears = ", ".join(f"{name} {both_units(p - tissue)}" for name, p in inside.items())
        rows.append((vein.name, bears if np.isfinite(tissue) else "not in the tissues"))
    return [WebTable(TOLD["inside_a_vein"], ["vein", "pressure"], rows)]


def _bars(details: StockingDetails) -> Bars:
    load, found = details.equilibrium.load, details.pressures
    bare = f", {100 * load.unloaded_skin.mean():.0f} % of the skin bears none" if load.unloaded_skin.any() else ""
    bars = [
        _bar("skin, mean", load.mean_pressure),
        _bar(f"skin, greatest ({highest_place(details)})", float(load.pressure.max())),
        _bar("skin, least", float(load.pressure.min()), bare),
    ]
    if found is not None:
        bars.append(_bar("fat, greatest", found.greatest_in_fat, _share(found.greatest_in_fat, found)))
        bars.append(_bar("muscle, mean", found.mean_in_muscle))
        for k, (vein, pressure) in enumerate(zip(details.leg.veins, found.at_veins, strict=True)):
            low, high = map(mpa_to_mmhg, found.vein_interval(k))
            known = (low, high) if np.isfinite(high) else None
            spread = f", {low:.1f} to {high:.1f} mmHg" if known else ""
            bars.append(_bar(f"vein, {vein.name}", pressure, spread + _share(pressure, found), known))
    caption = "Pressures in mmHg (kPa) with 95 % intervals: on the skin by Laplace's law, inside hydrostatic"
    return Bars(caption, ("where", "pressure"), bars)


def _bar(name: str, pressure: float, more: str = "", interval: tuple[float, float] | None = None) -> LabelledBar:
    if not np.isfinite(pressure):
        return LabelledBar(name, 0.0, "not in the tissues: check the vein's position", interval)
    return LabelledBar(name, mpa_to_mmhg(pressure), both_units(pressure) + more, interval)


def _share(pressure: float, found: TissuePressures) -> str:
    return f", {100 * pressure / found.mean_interface:.0f} % of the mean on the skin"


def level_blocks(details: TapeDetails) -> list[Block]:
    """Return levels with limits, the gradient, and the curve along the leg."""
    makers, levels, blocks = details.leg.makers, details.at_levels, list[Block]()
    if levels:
        intended = makers.intended_class
        asked = f"class {intended} of {makers.standard}" if intended else "no class was stated"
        verdicts = {"not certain": "not certain: the interval crosses a limit", "no limits": "–"}
        rows = [
            {
                "level": one.level,
                "height": f"{one.height_mm:.0f} mm, "
                + ("as stated" if one.height_is_stated else WORDS["levels"][one.level]),
                "pressure (mmHg)": f"{one.mean_pressure_mmHg:.1f} ({one.ci95_mmHg[0]:.1f} to {one.ci95_mmHg[1]:.1f})",
                "residual pressure ratio": "–"
                if one.over_pressure_at_B is None
                else f"{100 * one.over_pressure_at_B:.0f} %",
                "limits (mmHg)": span_of(one.limits_mmHg),
                "verdict": verdicts.get(one.verdict, one.verdict),
            }
            for one in levels
        ]
        caption = f"Mean pressure round the leg at the makers' levels, mmHg with 95 % intervals; limits: {asked}"
        blocks.append(WebTable.of(caption, rows))
    blocks += map(Prose, _about_levels(details))
    blocks += _fabric_blocks(details)
    return [*blocks, along_curves(details), Prose(_errors(details))]


def along_curves(details: TapeDetails) -> Curves:
    """Return the pressure over the height; on a leg by tape, of which no more is known, its mean alone."""
    along = details.pressure_along
    lines = [Line("mean round the leg", along.mean, None, DATA_COLOUR)]
    if details.leg.girth_sd is None:
        lines.append(Line("greatest round the leg", along.greatest, None, FAINT, "dashed"))
        lines.append(Line("least round the leg", along.least, None, FAINT, "dotted"))
    return Curves(
        "along",
        "Pressure of the stocking on the skin over the height",
        f": {', '.join(line.name for line in lines)}.",
        along.levels,
        "height z (mm)",
        "pressure (mmHg)",
        lines,
        band=quantile(0) * along.sd,
        band_name="95 % interval of the mean",
    )


def _errors(details: TapeDetails) -> str:
    """Return what the intervals of the pressure along the leg include."""
    told, around, girth = WORDS["along_errors"], details.leg.accuracy.pressure_sd, details.leg.girth_sd
    tension = f"{100 * details.tension_sd:.2g} % of the fabric's tension; " if details.tension_sd else ""
    last = told["scan"] if girth is None else told["tape"].format(girth=100 * girth)
    unstated = "" if tension else " " + told["unstated"]
    return TOLD["errors_along"].format(tension=tension, around=100 * around, last=last, unstated=unstated)


def _fabric_blocks(details: TapeDetails) -> list[Block]:
    """Return which fabric meets each class on this leg; nothing where the leg has no level B."""
    rows = [
        {
            "class": one.compression_class,
            "pressure at B (mmHg)": span_of(one.limits_mmHg),
            "tension, or stiffness at this size, times this fabric's": span_of(one.tension_factor),
            "or unstretched girth at B (mm)": span_of(one.unstretched_mm_at_B),
        }
        for one in details.fabrics
    ]
    caption = TOLD["fabric_for"].format(standard=details.leg.makers.standard)
    return [WebTable.of(caption, rows)] if rows else []


def _about_levels(details: TapeDetails) -> Iterator[str]:
    """Yield what is missing at the levels, whether the pressure falls from one to the next, and its gradient."""
    along, makers, leg, levels = details.pressure_along, details.leg.makers, details.leg, details.at_levels
    if missing := [name for name in LEVELS if name not in makers.found(leg.bare)]:
        low, *_, high = leg.bare.levels
        yield TOLD["level_unknown"].format(missing=", ".join(missing), low=low, high=high)
    open_ones = [one.level for one in levels if one.level != "B" and one.limits_mmHg is None]
    if makers.intended_class and open_ones:
        yield TOLD["limits_unknown"].format(standard=makers.standard, levels=", ".join(open_ones))
    if len(levels) > 1 and not makers.assumed_fabric:
        steps = [(a.level, b.level, b.mean_pressure_mmHg - a.mean_pressure_mmHg) for a, b in rises(levels)]
        said = [f"increases from {a} to {b} (by {step:.1f} mmHg)" for a, b, step in steps if step >= _SEEN_MMHG]
        said += [f"is the same at {a} and {b}" for a, b, step in steps if step < _SEEN_MMHG]
        does = " and ".join(said) or "does so at these levels"
        yield f"The pressure should decrease steadily from the ankle upwards (RAL-GZ 387 requires it): it {does}."
    slope = round(10 * float(np.polyfit(along.levels, along.mean, 1)[0]), 2) + 0.0
    assumed = TOLD["fabric_assumed"].format(share=100 * CALF_SHARE)
    yield (
        f"Gradient: {slope:+.2f} mmHg per cm upwards, from {along.mean[0]:.1f} mmHg at the lower end to "
        f"{along.mean[-1]:.1f} mmHg at the upper end.{assumed if makers.assumed_fabric else ''}"
    )


def dressed_leg(details: StockingDetails, moved: Mapping[str, FloatArray]) -> TurnedLeg:
    """Return the leg with the stocking's pressure, its movement and the skin's stretch.

    Parameters
    ----------
    details
        Of a run whose worn state was found.
    moved
        Displacement (mm) of skin's and hull's points, (n_levels, n_points, 3) each.
    """
    bare, found = details.leg.bare, details.pressures
    assert found is not None
    dressed = {
        ("pressure on the skin", "mmHg"): mpa_to_mmhg(details.equilibrium.pressure),
        ("inward movement", "mm"): inward(bare, moved[SKIN]),
        ("stretch of the skin round the leg", "%"): stretch_round(bare, moved[SKIN]),
    }
    fields = [SkinField(*named, from_none([values])) for named, values in dressed.items()]
    each = [f"{name} ({unit}): {which}" for name, unit in dressed for which in ("mean", "least", "most")]
    directions = Directions.of(bare)
    marked = [
        (f"{vein.name}: {mpa_to_mmhg(p):.1f} mmHg", vein.position)
        for vein, p in zip(details.leg.veins, found.at_veins, strict=True)
        if np.isfinite(p)
    ]
    return turned_leg(
        bare,
        {part: from_none([values]) for part, values in moved.items()},
        fields,
        Slider("Dress the leg", (0.0, 100.0), " % dressed"),
        # Coordinates are DICOM's: the front is at -y.
        View([directions.at(45.0 * k) for k in range(8)]),
        ["height z (mm)", "girth, bare (mm)", "girth, dressed (mm)", *each],
        by_height(bare, moved[SKIN], list(dressed.values())),
        TOLD["dressed_leg"],
        marked,
    )


def by_height(bare: LegShape, moved: FloatArray, fields: Sequence[FloatArray]) -> list[list[str]]:
    """Return a row a height: girths, and mean, least and most of fields (n_levels, n_points)."""

    def girths(points: FloatArray) -> FloatArray:
        return np.linalg.norm(np.diff(points, axis=1, append=points[:, :1]), axis=2).sum(axis=1)

    points = bare.points(SKIN)
    each = (column for f in fields for column in (f.mean(axis=1), f.min(axis=1), f.max(axis=1)))
    rows = np.column_stack([girths(points), girths(points + moved), *each])
    return [[f"{z:.0f}", *(f"{value:.1f}" for value in row)] for z, row in zip(bare.levels, rows, strict=True)]
