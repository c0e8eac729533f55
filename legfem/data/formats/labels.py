"""What a column's label says: the quantity that it names, and the unit."""

import math
import re
from collections.abc import Sequence
from typing import Literal, NamedTuple, get_args

from legfem.common.units import MPA_PER_MMHG

Quantity = Literal["time", "displacement", "force", "pressure", "angle", "torque"]


class Unit(NamedTuple):
    """A unit as a multiple of legfem's own: s, mm, N, MPa, rad, N mm; others measure something else."""

    quantity: Quantity | None
    factor: float


_G = 9.80665
_POUND = 4.4482216152605
_UNITS = {
    "time": {
        1.0: "s sec secs second seconds sek sekunde sekunden seconde secondes segundos secondi с сек 秒 초",
        1e-3: "ms msec millisec millisecond milliseconds millisekunden millis мс",
        1e-6: "us µs microsecond microseconds micros",
        1e-9: "ns",
        1e3: "ks",
        60.0: "min mins minute minutes minuten мин",
        3600.0: "h hr hrs hour hours",
        86400.0: "day days",
    },
    "displacement": {
        1.0: "mm millimeter millimeters millimetre millimetres millimetri мм 毫米 公釐",
        10.0: "cm centimeter centimeters centimetre centimetres см",
        100.0: "dm",
        1000.0: "m meter meters metre metres",
        1e6: "km",
        1e-3: "um µm micron microns micrometer micrometers micrometre micrometres мкм 微米",
        1e-6: "nm nanometer nanometers nanometre nanometres",
        1e-7: "å angstrom angstroms",
        1e-9: "pm",
        25.4: "in inch inches zoll pouce pouces",
        0.0254: "mil mils thou",
        304.8: "ft foot feet",
    },
    "force": {
        1.0: "n newton newtons н 牛 牛顿 牛頓",
        0.1: "dn",
        10.0: "dan",
        100.0: "hn",
        1e-2: "cn",
        1e-5: "dyn dyne dynes",
        1e-3: "mn millinewton millinewtons",
        1e-6: "µn un",
        1e-9: "nn",
        1e-12: "pn",
        1e3: "kn kilonewton kilonewtons кн",
        _G: "kgf kp kilogram-force kilograms-force кгс",
        1e-3 * _G: "gf p гс gram-force grams-force",
        1e-6 * _G: "mgf",
        _POUND: "lbf pound-force pounds-force",
        _POUND / 16: "ozf ounce-force",
    },
    "pressure": {
        1.0: "mpa n/mm² n/mm2 n/mm^2",
        1e3: "gpa",
        1e-3: "kpa kn/m² kn/m2",
        1e-2: "n/cm² n/cm2",
        1e-4: "mbar hpa",
        0.1: "bar",
        1e-6: "pa pascal pascals n/m² n/m2",
        0.1e-4 * _G: "cmh2o",
        MPA_PER_MMHG: "mmhg torr",
        6.894757293168e-3: "psi",
    },
    "angle": {1.0: "rad", 1e-3: "mrad", math.pi / 180: "deg ° degree degrees"},
    "torque": {1.0: "nmm n.mm n·mm mnm mn.m mn·m", 1e3: "n.m n·m n*m", 1e-3: "µnm unm µn.m un.m µn·m", 10.0: "n.cm"},
}
_OTHERS = """
% percent pct prozent - v volt volts mv a ma c °c degc k hz mm/s mm/min m/s n/mm kn/mm mm/mm
kn·mm kn.mm µm/s um/s nm/s cycles cycle g kg lb strain
m/s² m/s^2 m/s2 count counts adc raw lsb bit bits digit digits inc increments steps pulses %fs
"""
_KNOWN = {
    name: Unit(quantity, factor)  # type: ignore[arg-type]
    for quantity, factors in _UNITS.items()
    for factor, names in factors.items()
    for name in names.split()
} | {name: Unit(None, 1.0) for name in _OTHERS.split()}
UNIT_OF: dict[Quantity, str] = dict(zip(get_args(Quantity), ("s", "mm", "N", "kPa", "rad", "N.mm"), strict=True))
"""legfem's unit of each quantity."""


FORCE_OF = {"mg": "mgf", "g": "gf", "gram": "gf", "grams": "gf", "kg": "kgf", "lb": "lbf", "lbs": "lbf", "oz": "ozf"}
"""What a scale's unit of mass means where a force is measured in it."""
_WRONG_MICRO = re.compile(r"^(?:Â[µμ]|æ)(?=[mNs]$)")
"""A micro sign of UTF-8 read as cp1252, and one of cp437."""


def unit_named(name: str) -> Unit | None:
    """Return a unit by its name; None for one that isn't known.

    Capitals count in mN and MN, nm and Nm: nobody measures soft tissue in meganewtons, so that
    isn't known, and a newton metre is no length. A micro sign that was decoded by another code page is one.
    """
    # As in ``seconds since 2024-05-03``, of NetCDF.
    plain = name.partition(" since ")[0].strip(" ()[]<>").removeprefix("in ").rstrip(".").replace("μ", "µ")
    plain = _WRONG_MICRO.sub("µ", plain)
    if plain in ("Nm", "NM"):
        return Unit("torque", 1e3)
    return None if plain == "MN" else _KNOWN.get(plain.lower())


WORDS: dict[Quantity, str] = {
    "time": r"time|zeit|χρόνος|temps|tiempo|tempo|^t$|x_value|tijd|^tid$|^czas|^čas$|zaman|время|時間|时间|시간",
    "displacement": r"disp|extension|position|crosshead|travers|weg|stroke|travel|indentation|depth|distance"
    r"|penetration|\bcourse\b|enfoncement|profondeur|corsa|profondità|carrera|profundidad|tiefe|eindring|\bhub\b"
    r"|déplacement|deplacement|verschiebung|spostamento|desplazamiento|deslocamento|verplaatsing|förskjutning"
    r"|deformation|przemieszczenie|перемещение|деформация|μετατόπιση|変位|変形|ストローク|位移|变形|行程|변위|^d$|^z$",
    "force": r"force|load|kraft|(?<![ep])last|fuerza|forza|força|effort|kracht|^charge|carga|carico|siła|síla|kuvvet"
    r"|weight|gewicht|\bpeso\b|\bpoids\b|сила|нагрузка|усилие|δύναμη|荷重|試験力|^力|载荷|负荷|하중|^f[nxyz]?$",
    "angle": r"angle|angular disp|winkel|twist|rotation|auslenkung|^(?:φ|phi|θ|theta)$",
    "torque": r"torque|drehmoment|couple|^m$",
}
"""By which columns are named."""
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[(\[<{]\s*(?P<unit>[^)\]>}]*?)\s*[)\]>}]\s*$")
_AT_THE_END = re.compile(r"^(?P<name>.+?)(?:_|[,;:]\s*|\s*/\s*|\s+-\s+|\s+(?:in|en)\s+|\s+)(?P<unit>[^\W\d_]+\.?|%)$")

_BY_PROGRAMS = re.compile(r"^(?P<name>.+?)(?:\.\.(?P<unit_r>[^\W\d_]+)\.|_(?P<unit>[^\W\d_]+)_)$")
"""``Load..N.`` and ``Load_N_``: R and MATLAB write points and lines for all that can't be in their names."""
_BEFORE_A_RUN = re.compile(r"^(?P<name>[^(\[]+?)\s*[(\[](?P<unit>[^)\]]+)[)\]]\s*(?P<run>(?:#|[^\W\d_]{2,})[\w #.-]*)$")
"""``Force (N) Run #1``; what may be a factor is no run's name."""
_TIME_ALONE = re.compile(r"(?:millis|micros)(?:\(\))?|m?sec|ms|us|µs|seconds", re.IGNORECASE)
"""What a column of time is called by its unit alone."""


def name_and_unit(label: str) -> tuple[str, str | None]:
    """Part a column's label, such as ``Load (N)``, ``Kraft [N]`` or ``force_N``."""
    label = " ".join(label.split())
    label = label[1:-1].strip() if len(label) > 2 and label[0] == label[-1] == "'" else label
    bracketed = _IN_BRACKETS.match(label)
    before = _IN_BRACKETS.match(bracketed["name"]) if bracketed else None
    if bracketed and before and unit_named(bracketed["unit"]) is None and unit_named(before["unit"]):
        return f"{before['name']} ({bracketed['unit']})", before["unit"]
    if bracketed:
        return bracketed["name"].rstrip(" ,;:"), bracketed["unit"].removeprefix("in ") or None
    run = _BEFORE_A_RUN.match(label)
    if run and unit_named(run["unit"]) is not None:
        return f"{run['name']} {run['run']}", run["unit"]
    if _TIME_ALONE.fullmatch(label):
        return label, label.lower().removesuffix("()")
    ended = _AT_THE_END.match(label) or _BY_PROGRAMS.match(label)
    found = next((text for text in ended.groups()[1:] if text), "") if ended else ""
    return (ended["name"], found) if ended and unit_named(found) is not None else (label, None)


def one_unit(named: str | None, stated: str | None) -> str | None:
    """Return the unit that a column's name states, or what stands beside it; both where they differ, which is none."""
    if named and stated and (one := unit_named(named)) and (other := unit_named(stated)) and one != other:
        return f"{named} or {stated}"
    return stated or named


def names_quantity(label: str, quantity: Quantity) -> bool:
    """Tell whether a column is called like a quantity."""
    return re.search(WORDS[quantity], label, re.IGNORECASE) is not None


_SIZES = {
    "length": "length|länge|longueur|longitud|lunghezza|l0",
    "width": "width|breite|largeur|ancho|larghezza|b0",
    "thickness": "thickness|dicke|[ée]paisseur|espesor|spessore|a0",
    "diameter": "diameter|durchmesser|diam[èe]tre|diámetro|diametro|d0",
    "height": "height|höhe|hauteur|altura|altezza|h0",
    "area": r"(?:cross[ -]?section(?:al)? )?area|querschnitt(?:sfläche)?|section|sección|sezione|s0",
}
_SIZE = re.compile(
    r"(?i)(?:specimen|sample|test ?piece|(?:gau?ge|grip) (?=length)|initial|original|proben(?=\w)|anfangs|ausgangs|mess"
    rf"|einspann|[\W_])*(?:{'|'.join(f'(?P<{name}>{words})' for name, words in _SIZES.items())})"
    r"(?:[\W_]|\b(?:[abdhls]0|of|the|de|della?|la|[ld]|specimen|sample|test ?piece|éprouvette|probeta|provino)\b)*"
)
"""A specimen's size alone: an indenter's diameter and a cable's length have another word."""
_LONGEST = 200
"""Characters of a line that states a size."""
_VALUED = re.compile(
    r"(?P<label>[^-]*?[^\W\d][^-]*?)[^\w-]*?(?:[(\[](?P<unit>[^)\]]+)[)\]])?[\s:=;,]*(?<![\w.,])(?P<value>\d+(?:[.,]\d+)?)\W*?"
    r"(?P<behind>[^\W\d]\S*)?\W*"
)


def sizes_in(rows: Sequence[Sequence[str | float | None]]) -> dict[str, float]:
    """Return a specimen's sizes by name (mm, mm²), as a heading states them: ``Diameter: 12.0 mm``, or above a number.

    What has no unit, or several values, isn't there.
    """
    found = []
    for k, row in enumerate(rows):
        line = _VALUED.fullmatch(" ".join(str(cell).strip() for cell in row if cell not in (None, ""))[:_LONGEST])
        if line is not None:
            found.append((line["label"], line["unit"] or line["behind"], float(line["value"].replace(",", "."))))
        for c, cell in enumerate(row):
            below = [other[c] for other in rows[k + 1 : k + 4] if c < len(other)]
            name, unit = name_and_unit(cell[:_LONGEST]) if isinstance(cell, str) else ("", None)
            units, numbers = [one for one in below[:1] if isinstance(one, str)], [*map(type, below)].count(float)
            if numbers == 1 and isinstance(number := below[len(units)], float):
                found.append((name, unit or "".join(units), number))
    told: dict[str, set[float]] = {}
    for label, unit, value in found:
        size = named.lastgroup if (named := _SIZE.fullmatch(label.replace(":", ""))) else None
        known = unit_named((unit or "").rstrip("²2^") if size == "area" else unit or "")
        if size and value > 0 and known and known.quantity == "displacement":
            told.setdefault(size, set()).add(value * known.factor ** (2 if size == "area" else 1))
    return {size: values.pop() for size, values in told.items() if len(values) == 1}
