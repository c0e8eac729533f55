"""Loading of the folder of a leg in a stocking, and checks of what it gives.

What is impossible is an error that names file, field and remedy; what is unlikely is a doubt.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from shapely import Point, Polygon

from legfem.common.errors import Doubt, InputError
from legfem.common.input_files import check_distinct, read_table
from legfem.common.progress import Progress, Silent
from legfem.common.resources import RESOURCES
from legfem.common.units import FloatArray, kpa_to_mpa, mmhg_to_mpa, mpa_to_kpa, mpa_to_mmhg
from legfem.data.folder import Catalogue
from legfem.data.ranges import RANGES, c10_of, doubts_about_size
from legfem.geometry.leg_shape import SKIN, LegShape, perimeter
from legfem.geometry.motion import rigidly_moved
from legfem.geometry.section_from_outlines import Clearances
from legfem.geometry.slices import calf_levels
from legfem.imaging.label_volume import check_same_spacing
from legfem.imaging.leg_source import LegSource
from legfem.imaging.outlines import OutlineSettings
from legfem.imaging.registration import Registration
from legfem.imaging.same_leg import check_scans_differ, doubts_about_registration, doubts_about_second_scan, registered
from legfem.imaging.shape_schema import ShapeEntry, existing
from legfem.inverse.elastography import ShearModulus, doubts_about_elastography
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import settings_for_cells
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.fabric import Stocking, fitted_stocking, stocking_load
from legfem.stockings.leg import KINDS, USUAL_DIAMETER, Posture, Sensor, StockingLeg, Vein, default_veins, off_skin
from legfem.stockings.levels import LEVELS, Level, MakersLevels
from legfem.stockings.schema import LegFile, StockingEntry, parse_leg_file
from legfem.stockings.tape import rings

_BEYOND_MM = 10.0
"""Length beyond a table's end for which its last perimeter may stand without a word."""
LEAST_LENGTH_MM = 80.0
"""Length of the segment below which its end faces decide what is found in it. With ends held and free,
the pressures at the veins in mid-segment differ by 30 to 45 % at 40 mm, by 20 to 30 % at 80 mm and by
15 to 20 % at 120 mm (legs 1 and 4, class 2, 3 kPa in both tissues)."""
_LEAST_SHARED_MM, _LEAST_COMPARED_MM = 40.0, 50.0
"""Of a leg, and of one whose scans are compared: where end faces move, the slices need some room."""
LEVEL_SPACING = 5.0
"""Spacing of the contours that the leg's surfaces interpolate (mm)."""
_MARGINS = {"bare": 10.0, "compressed": 40.0}
"""Lengths read beyond the segment (mm): smoothing reaches there, and the second scan may be shifted."""
_OFF_SKIN = 15.0
"""Distance from the skin (mm) beyond which a sensor isn't on this leg."""
OUTLINES = OutlineSettings()
CLEARANCES = Clearances(bone_to_fascia=1.5, fascia_to_skin=1.5)
LEGS = Catalogue(RESOURCES / "dubuis" / "subjects", "leg.toml")


def load_leg(directory: Path, progress: Progress | None = None, cells: int | None = None) -> StockingLeg:
    """Load the folder of a leg: ``leg.toml`` and the files it names.

    Reading and registering take minutes, which ``progress`` shows; segment and ``cells`` are checked on one scan.

    Raises
    ------
    InputError
        If anything in the folder is missing or wrong; names file, field and remedy.
    """
    toml = LEGS.opened(directory)
    given, progress = parse_leg_file(toml), progress or Silent()
    if given.bare.girths_mm is not None:
        return _by_tape(directory, toml, given, given.bare.girths_mm)
    progress.stage(f"outlines of the bare leg{_asked_length(toml, given)}")
    bare_scan, levels = _opened(directory, toml, "bare", given.bare, given)
    scanned_bare = bare_scan.shape(OUTLINES, levels)
    (first,) = _segment(toml, given, [scanned_bare])
    if cells is not None:
        # The second scan may have less of the leg; it is taken to have this share.
        settings_for_cells(first, cells, 1.0 if given.compressed is None else 0.7)
    shapes, registration = [bare_scan.shape(OUTLINES, levels, CLEARANCES), scanned_bare], None
    if given.compressed is not None:
        progress.stage("outlines of the leg in its stocking")
        scan, levels = _opened(directory, toml, "compressed", given.compressed, given)
        if bare_scan.volume is not None and scan.volume is not None:
            check_same_spacing(bare_scan.volume, scan.volume)
        scanned = scan.shape(OUTLINES, levels)
        _check_length(toml, given, "compressed", scanned.length)
        check_scans_differ(scanned_bare, scanned, toml)
        progress.stage("laying one scan on the other by the bones")
        registration = registered(_dense(scanned_bare), _dense(scanned), given.accuracy.contour_sd_mm, toml)
        shapes.append(rigidly_moved(scanned, registration.transform.rotation, registration.transform.translation))
    bare, scanned_bare, *others = _segment(toml, given, shapes)
    slices, posture = calf_levels(bare), given.posture
    lying = None if posture is None or posture.lying_mmHg is None else mmhg_to_mpa(posture.lying_mmHg)
    tissues = {name: NeoHookean(kpa_to_mpa(one.C10_kPa or 3.0), one.D1_per_MPa) for name, one in given.tissues}
    leg = StockingLeg(
        given.id,
        given.title,
        given.origin,
        bare,
        scanned_bare,
        others[0] if others else None,
        registration,
        _fabric(directory, toml, given.stocking, bare),
        _accuracy(given, registration),
        tissues,
        all(one.C10_kPa for _, one in given.tissues),
        given.segment.ends,
        slices,
        _veins(toml, given, bare, float(np.median(slices))),
        _sensors(toml, given, bare),
        None if posture is None else Posture(posture.heart_mm, lying),
        tuple(map(ShearModulus.of, given.elastography)),
        makers=_makers(given.stocking),
        directory=directory,
    )
    sensors = tuple(one.corrected(radius, c10) for one, radius, c10 in leg.sensors_there)
    return replace(leg, sensors=sensors, doubts=tuple(doubts_about_leg(leg, toml)))


def _by_tape(directory: Path, toml: Path, given: LegFile, girths: Mapping[Level, float]) -> StockingLeg:
    """Return a leg that a tape measured: round rings at its levels."""
    makers = _makers(given.stocking)
    named = [name for name in LEVELS if name in girths]
    bare = rings(np.array([makers.heights[name] for name in named]), np.array([girths[name] for name in named]))
    fabric, accuracy = _fabric(directory, toml, given.stocking, bare), _accuracy(given, None)
    leg = partial(StockingLeg, given.id, given.title, given.origin, bare, bare, None, None, fabric, accuracy, {}, True)
    doubts = *_stocking_doubts(bare, fabric, toml), *_tape_doubts(bare, girths, toml)
    girth_sd = given.accuracy.girth_relative_sd
    return leg("held", bare.levels, (), doubts=doubts, makers=makers, directory=directory, girth_sd=girth_sd)


def _tape_doubts(bare: LegShape, girths: Mapping[Level, float], toml: Path) -> Iterator[Doubt]:
    yield from RANGES["rise_of_levels"].doubts(toml, "stocking.levels_mm", bare.length)
    if girths.get("B", 0.0) > (least := min(girths.values())):
        problem = f"is {girths['B']:g} mm at B, where the ankle is thinnest, and {least:g} mm elsewhere"
        yield Doubt(str(toml), "bare.girths_mm", problem, "check that they aren't exchanged")


def _asked_length(toml: Path, given: LegFile) -> str:
    """How much of the leg the file asks for, and that it is too little; empty where it doesn't say."""
    asked = given.segment
    if asked.from_mm is None or asked.to_mm is None:
        return ""
    length = asked.to_mm - asked.from_mm
    _check_length(toml, given, "segment", length)
    few = f"; model {LEAST_LENGTH_MM:g} mm or more" if length < LEAST_LENGTH_MM - 1e-6 else ""
    return f", {length:g} mm of it as [segment] asks{few}"


def _opened(
    directory: Path, toml: Path, field: str, entry: ShapeEntry, given: LegFile
) -> tuple[LegSource, FloatArray | None]:
    """Return what a leg's shape is taken from, and the levels at which to cut surfaces (mm)."""
    source = LegSource.opened(directory, toml, field, entry, given.labels)
    low, high, margin = given.segment.from_mm, given.segment.to_mm, _MARGINS[field]
    # What lies beyond the segment may be anything.
    source = source.between(-np.inf if low is None else low - margin, np.inf if high is None else high + margin)
    if source.surfaces is None:
        return source, None
    if low is None or high is None:
        raise InputError(toml, "segment", "surfaces need the part of the leg to model", "add from_mm and to_mm")
    return source, np.linspace(low, high, max(1 + round((high - low) / LEVEL_SPACING), 2))


def _dense(shape: LegShape) -> LegShape:
    """Return the shape at a level a millimetre: registration wants the bones' surfaces."""
    return shape.at_levels(np.linspace(shape.levels[0], shape.levels[-1], 1 + round(shape.length)))


def _segment(toml: Path, given: LegFile, shapes: Sequence[LegShape]) -> list[LegShape]:
    """Cut shapes to the levels that they share and the file asks for, evenly spaced."""
    low = max(shape.levels[0] for shape in shapes)
    high = min(shape.levels[-1] for shape in shapes)
    asked = given.segment
    for name, value in (("from_mm", asked.from_mm), ("to_mm", asked.to_mm)):
        if value is not None and not low - 1e-6 <= value <= high + 1e-6:
            problem = f"{value:g} mm is not in what the scans share, {low:.4g} to {high:.4g} mm"
            raise InputError(toml, f"segment.{name}", problem, "choose a level within it")
    low = low if asked.from_mm is None else max(low, asked.from_mm)
    high = high if asked.to_mm is None else min(high, asked.to_mm)
    _check_length(toml, given, "segment", high - low)
    levels = np.linspace(low, high, 1 + max(2, round((high - low) / LEVEL_SPACING)))
    return [shape.at_levels(levels) for shape in shapes]


def _check_length(toml: Path, given: LegFile, field: str, length: float) -> None:
    least = _LEAST_SHARED_MM if given.compressed is None else _LEAST_COMPARED_MM
    if length < least:
        remedy = f"give scans that share {least:g} mm or more, their levels in mm"
        raise InputError(toml, field, f"is {length:.3g} mm long", remedy)


def _fabric(directory: Path, toml: Path, entry: StockingEntry, bare: LegShape) -> Stocking:
    if entry.compression_class is not None:
        return fitted_stocking(bare, entry.compression_class, entry.stiffness_N_per_mm)
    if entry.unstretched_mm is not None:
        return Stocking(entry.stiffness_N_per_mm, bare.levels[:1], np.array([entry.unstretched_mm]))
    assert entry.unstretched is not None
    path = existing(directory, entry.unstretched, toml, "stocking.unstretched")
    table = read_table(path, ("level_mm", "perimeter_mm")).sort_values("level_mm")
    levels, perimeters = (table[name].to_numpy(np.float64) for name in ("level_mm", "perimeter_mm"))
    if len(levels) < 2:
        raise InputError(path, "level_mm", "there is one level", "give two or more, or unstretched_mm in their place")
    try:
        return Stocking(entry.stiffness_N_per_mm, levels, perimeters)
    except InputError as error:
        raise error.at(path) from None


def _makers(entry: StockingEntry) -> MakersLevels:
    heights = {name: entry.levels_mm[name] for name in LEVELS if name in entry.levels_mm}
    shares: dict[Level, tuple[float, float]] = {name: (low, high) for name, (low, high) in entry.limits_percent.items()}
    chosen = entry.intended_class or entry.compression_class or ""
    return MakersLevels(entry.standard, chosen, heights, shares, entry.compression_class is not None)


def _accuracy(given: LegFile, registration: Registration | None) -> ContourAccuracy:
    stated = given.accuracy
    around, along = (0.0, 0.0) if given.bare.scan is None else (OUTLINES.around, OUTLINES.along)
    accuracy = ContourAccuracy(stated.contour_sd_mm, stated.correlation_mm, around, along)
    accuracy = replace(accuracy, pressure_sd=stated.pressure_relative_sd, tension_sd=stated.tension_relative_sd)
    if registration is None:
        return accuracy
    sx, sy, sz = map(float, np.maximum(registration.standard_error, 0.02))
    tx, ty, tz = map(float, np.maximum(np.radians(registration.rotation_error), 1e-4))
    return replace(accuracy, shift_sd=(sx, sy, sz), turn_sd=(tx, ty, tz))


def _sensors(toml: Path, given: LegFile, bare: LegShape) -> tuple[Sensor, ...]:
    found = []
    for entry in given.sensor:
        refused = partial(InputError, toml, f"sensor {entry.name}, position_mm")
        position = np.array(entry.position_mm)
        if not bare.levels[0] <= position[2] <= bare.levels[-1]:
            problem = f"z = {position[2]:g} mm is not in the part of the leg that is modelled, "
            problem += f"{bare.levels[0]:.4g} to {bare.levels[-1]:.4g} mm"
            raise refused(problem, "model more, or leave it out")
        away = off_skin(bare, position)
        if away > _OFF_SKIN:
            remedy = "give a point of the skin in the bare scan's coordinates, mm"
            raise refused(f"lies {away:.0f} mm off the bare leg's skin", remedy)
        pressure = mmhg_to_mpa(entry.pressure_mmHg)
        if entry.instrument is None:
            assert entry.sd_mmHg is not None
            sd, usual = mmhg_to_mpa(entry.sd_mmHg), USUAL_DIAMETER
        else:
            relative_sd, usual = KINDS[entry.instrument]
            sd = relative_sd * pressure
        found.append(Sensor(entry.name, position, pressure, sd, entry.diameter_mm or usual, entry.thickness_mm))
    check_distinct(toml, "sensor.name", (one.name for one in found), "give every sensor its own")
    return tuple(found)


def _veins(toml: Path, given: LegFile, bare: LegShape, level: float) -> tuple[Vein, ...]:
    if given.veins:
        check_distinct(toml, "veins.name", (one.name for one in given.veins), "give every vein its own")
        for vein in given.veins:
            x, y, z = vein.position_mm
            modelled = bare.levels[0] <= z <= bare.levels[-1]
            if not (modelled and Polygon(bare.at(SKIN, z)).contains(Point(x, y))):
                problem = f"{x:g}, {y:g}, {z:g} is not in the part of the leg that is modelled, "
                problem += f"{bare.levels[0]:.4g} to {bare.levels[-1]:.4g} mm high"
                remedy = "give a point in the bare leg, in its scan's coordinates, mm"
                raise InputError(toml, f"veins {vein.name}, position_mm", problem, remedy)
        return tuple(Vein(vein.name, np.array(vein.position_mm)) for vein in given.veins)
    return default_veins(bare, level)


def doubts_about_leg(leg: StockingLeg, toml: Path) -> Iterator[Doubt]:
    """Yield what is unlikely in a leg and its stocking.

    Raises
    ------
    InputError
        For what can't be; names file, field and remedy.
    """
    bare = leg.bare
    low, high, around = float(bare.levels[0]), float(bare.levels[-1]), perimeter(bare)
    largest = int(np.argmax(around))
    yield from doubts_about_size(toml, "bare", float(around[largest]), bare.contours["tibia"][largest])
    if bare.length < LEAST_LENGTH_MM - 1e-6:
        problem = f"is {bare.length:.0f} mm long: what its end faces do decides the pressures and the stiffness"
        more = f"model {LEAST_LENGTH_MM:g} mm or more: give scans that share as much, and widen from_mm and to_mm"
        yield Doubt(str(toml), "segment", problem, more)
    for name, law in leg.tissues.items():
        yield from RANGES["D1"].doubts(toml, f"tissues.{name}.D1_per_MPa", float(law.D1))
        if leg.known:
            yield from c10_of(name).doubts(toml, f"tissues.{name}.C10_kPa", mpa_to_kpa(float(law.C10)))
    if leg.compressed is not None:
        yield from doubts_about_second_scan(bare, leg.compressed, toml)
    if leg.registration is not None:
        yield from doubts_about_registration(leg.registration, leg.accuracy.sd, toml)
    yield from _stocking_doubts(bare, leg.stocking, toml)
    if leg.posture is not None:
        yield from RANGES["height_of_heart"].doubts(toml, "posture.heart_mm", leg.posture.heart - high)
    for level, height in leg.makers.heights.items():
        if not low <= height <= high:
            problem = f"{height:g} mm is not in the part that is modelled, {low:.4g} to {high:.4g} mm"
            problem += ", and gets no pressure"
            remedy = "give the height in the bare scan's coordinates, mm, or model more of the leg"
            yield Doubt(str(toml), f"stocking.levels_mm.{level}", problem, remedy)
    for sensor, radius, c10 in leg.sensors_there:
        if sensor.thickness is None:
            rise = 100 * sensor.rises(radius, c10, 1.0)[1]
            by = f"a sensor lifts the fabric, and one of 1 mm may read {rise:.0f} % too much"
            remedy = "give its thickness as it lies under the fabric (0 if the reading is corrected for it)"
            yield Doubt(f"{toml}", f"sensor {sensor.name}, thickness_mm", f"isn't stated: {by}", remedy, "isn't stated")
    yield from doubts_about_elastography(toml, leg.elastography)


def _stocking_doubts(bare: LegShape, stocking: Stocking, toml: Path) -> Iterator[Doubt]:
    doubt = partial(Doubt, str(toml), "stocking.unstretched")
    low, high = float(bare.levels[0]), float(bare.levels[-1])
    first, last = float(stocking.levels[0]), float(stocking.levels[-1])
    if len(stocking.levels) > 1:
        beyond = max(first - low, high - last)
        found = doubt(
            f"the table of {first:g} to {last:g} mm leaves {beyond:.0f} mm of the leg's {low:.4g} to {high:.4g} mm out",
            "give perimeters at the levels of the scan, in its coordinates and in mm, or restrict [segment]",
        )
        if last < low or first > high:
            raise found.error()
        if beyond > _BEYOND_MM:
            yield found
    try:
        load = stocking_load(bare, stocking)
    except InputError as error:
        raise error.at(toml, "stocking.unstretched") from None
    slack = bare.levels[load.strain <= 0]
    if 0 < len(slack) < len(bare.levels):
        yield doubt(
            f"the fabric is wider than the leg at {len(slack)} of {len(bare.levels)} levels, the first {slack[0]:g} mm",
            "check the perimeters there: whole, unstretched, in mm",
        )
    yield from RANGES["stretch_of_fabric"].doubts(toml, "stocking", 100 * float(load.strain.max()))
    pressure = mpa_to_mmhg(load.mean_pressure)
    yield from RANGES["pressure_of_stocking"].doubts(toml, "stocking.stiffness_N_per_mm", pressure)
