"""What of specimens can't be (an error) or is unlikely (a doubt): units, sizes, stiffness."""

import re
import statistics
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from legfem.common.errors import Doubt, PhysicalRange
from legfem.common.input_files import FileTable
from legfem.common.units import mpa_to_kpa
from legfem.data import ranges
from legfem.data.plausibility import loading_doubts
from legfem.specimens.course import Course
from legfem.specimens.kind import LABS, LENGTH_UNITS, length_range
from legfem.specimens.kinds import kinds
from legfem.specimens.sizes import Sizes, SpecimenRecording, bare, kind_in

_SIZES = {
    "thickness_mm": length_range("a thickness", 0.5, 150.0),
    "diameter_mm": length_range("a specimen's diameter", 3.0, 400.0),
    "height_mm": length_range("a specimen's height", 1.0, 150.0),
    "width_mm": length_range("a specimen's width", 3.0, 500.0),
    "length_mm": length_range("a length", 2.0, 300.0),
    "area_mm2": PhysicalRange("an area", "mm²", (4.0, 2e4), (1e-3, 1e6), LABS, {"cm²": 100.0, "m²": 1e6}),
}
"""By key of ``specimen.toml``; a kind of test has ranges of its own keys."""
_SPEED = PhysicalRange(
    "a speed of loading", "mm/s", (1e-3, 100.0), (1e-7, 1e5), "testing machines, 0.06 to 6000 mm/min"
)
_SHARE = {
    True: PhysicalRange(
        "a depth", "of what is pressed", (0.01, 0.8), (1e-5, 1.0), "labs press by 2 to 60 %", LENGTH_UNITS
    ),
    False: PhysicalRange(
        "an elongation", "of the length", (0.01, 2.0), (1e-5, 15.0), "labs pull by 2 to 200 %", LENGTH_UNITS
    ),
}
"""Of the thickness or length: pressed, or pulled."""
_SLENDER = PhysicalRange("a height", "times the width", (0.0, 3.0), (0.0, 100.0), "what is taller buckles")
_COVERED = PhysicalRange(
    "what presses", "times the specimen's width", (0.0, 1.0), (0.0, 20.0), "it presses a part of it"
)
_ANYTHING_SOFT = PhysicalRange(
    "a C10", "kPa", (0.02, 2e3), (1e-5, 1e6), "brain and gels to rubber, E of 0.1 kPa to 12 MPa"
)
_STIFFNESS = {"muscle": ranges.C10["deep"], "fat": ranges.C10["superficial"], "adipose": ranges.C10["superficial"]}
"""Of a tissue that is called so."""
_APART, _REPEATS, _LIKE = 5.0, 2.0, 3.0
"""Of recordings of one specimen: rates a thousand times apart change tissues by less, those at like rates differ less
still, and which rates are alike."""
_THREE = 3
"""Recordings at least, for the middle to tell which of them is off."""
_CUT_OFF = 0.1
"""Of the depth: a force that doesn't rise any more."""
_UNITS: Mapping[str, Mapping[str, float]] = {
    "pressure": {"mbar": 0.1, "mmHg": 0.1333, "psi": 6.895, "Pa": 1e-3},
    "force_N": {"kgf": 9.80665, "gf": 9.80665e-3, "mN": 1e-3, "kN": 1e3, "lbf": 4.448, "ozf": 0.278},
}
"""Units that are taken for the right one by column, and by what they change a stiffness."""


def doubts_about_sizes(toml: Path, table: str, entry: FileTable) -> Iterator[Doubt]:
    """Yield what is unlikely in the sizes that a table of ``specimen.toml`` gives.

    Raises
    ------
    InputError
        For what no lab has.
    """
    every = dict(_SIZES)
    for kind in kinds().values():
        every |= kind.ranges
    for key, usual in every.items():
        value = getattr(entry, key, None)
        if value is not None:
            yield from usual.doubts(toml, f"{table}.{key}", value)


def doubts_about_shape(toml: Path, sizes: Sizes) -> Iterator[Doubt]:
    """Yield doubts about a specimen so slender that it would buckle, or narrower than what presses it."""
    covered = kind_in(sizes).covers(bare(sizes))
    if covered is not None:
        share, key = covered
        yield from _COVERED.doubts(toml, key, share, "check that both are diameters or widths in mm")
    found = kind_in(sizes).slenderness(bare(sizes))
    if found is not None:
        slender, key = found
        yield from _SLENDER.doubts(toml, key, slender, "check that sizes are in mm and mm²")


def doubts_about_course(source: str, course: Course, sizes: Sizes) -> Iterator[Doubt]:
    """Yield what is unlikely in a recording.

    Raises
    ------
    InputError
        For a depth beyond the specimen, and a speed that no machine has.
    """
    kind, body = kind_in(sizes), bare(sizes)
    extent = kind.extent(body)
    if extent is not None:
        yield from _SHARE[kind.presses(body)].doubts(
            source,
            "displacement_mm",
            course.depth / extent,
            f"check that {course.depth:.3g} mm are right, and the specimen's sizes",
        )
    yield from _SPEED.doubts(source, "time_s", course.rate, "check that time is in s (not min or ms)")
    loading = course.samples.time <= course.arrival
    yield from loading_doubts(
        source,
        course.samples.time[loading],
        course.samples.displacement[loading],
        course.samples.force[loading],
        _CUT_OFF,
    )


def doubts_about_stiffness(source: Path, c10: float, names: Sequence[str], field: str) -> Iterator[Doubt]:
    """Yield a doubt about a stiffness that is stated, or that recordings ask for.

    Parameters
    ----------
    source
        File, or folder of recordings.
    c10
        MPa.
    names
        What the tissue and its folder are called: a muscle is compared with muscles.
    field
        ``force_N``, ``pressure``, or where it is stated.
    """
    found, usual = mpa_to_kpa(c10), _range_of(names)
    low, high = usual.usual
    units = [unit for unit, by in _UNITS.get(field, {}).items() if low <= by * found <= high]
    first = f"if it is in {' or '.join(units)}, say so; or " if units else ""
    others = "units and sizes" if field in _UNITS else "its unit"
    yield from usual.likely(source, field, found, f"{first}check {others}")


def doubts_about_differing(stiffness: Mapping[SpecimenRecording, float]) -> Iterator[Doubt]:
    """Yield a doubt about each recording that is far stiffer or softer than its specimen's others.

    Parameters
    ----------
    stiffness
        C10 (MPa) that a recording asks for by itself.
    """
    for one, c10 in stiffness.items():
        same = {two: other for two, other in stiffness.items() if two.specimen == one.specimen}
        like = {two: other for two, other in same.items() if 1 / _LIKE < two.course.rate / one.course.rate < _LIKE}
        among, apart = (like, _REPEATS) if len(like) > 1 else (same, _APART)
        if len(among) < _THREE:
            among.pop(one)
        ratio = c10 / statistics.median(among.values()) if among else 1.0
        if not 1 / apart < ratio < apart:
            yield Doubt(
                str(one.recording.source or one.name),
                "force_N",
                f"gives {ratio:.3g} times the stiffness of the specimen's other recordings",
                "check that units, gain and specimen are the same",
            )


def _range_of(names: Sequence[str]) -> PhysicalRange:
    words = set(re.findall(r"[a-z]+", " ".join(names).lower()))
    known = [one for name, one in _STIFFNESS.items() if {name, f"{name}s"} & words]
    return known[0] if len(known) == 1 else _ANYTHING_SOFT
