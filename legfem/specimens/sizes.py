"""The tests that ``specimen.toml`` describes: sizes, recordings, and what of them can't be or is unlikely."""

import math
import re
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from legfem.channels.kinds.layer_thickness import between_of
from legfem.common.errors import MISSING, Doubt, InputError
from legfem.common.input_files import FileTable
from legfem.common.units import mpa_to_kpa
from legfem.data import Recording, Segmentation, segment
from legfem.data.contact import Contact
from legfem.data.plausibility import loading_doubts
from legfem.data.ranges import MISTAKEN_UNITS, RANGES
from legfem.inverse.readings import Channel, Data
from legfem.specimens.course import Course, course_of
from legfem.specimens.kind import WORDS, Direction, ShownAxes, SpecimenKind, needed
from legfem.specimens.kinds import kind_of, kinds
from legfem.specimens.schema import SIZES, SpecimenEntry, SpecimenFile

OF_LAYER = "_thickness"
RESIZED = 0.03
"""Relative step by which the change of readings with a size is found."""


@dataclass(frozen=True)
class Sizes:
    """What a test is of.

    Parameters
    ----------
    body
        Sizes of the specimen and of what presses it: the body of a kind.
    layers
        Names and thicknesses (mm), from the base up, together as thick as the body; none of one tissue.
    fibres
        Direction of the fibres of the tissue, or of one of the layers; None without.
    """

    body: Any
    layers: tuple[tuple[str, float], ...] = ()
    fibres: Direction | None = None

    @property
    def kind(self) -> SpecimenKind[Any, Any]:
        """Kind of the test."""
        return kind_of(type(self.body))

    @property
    def heights(self) -> dict[str, tuple[float, float]]:
        """Heights (mm) above the base between which each layer lies, by its name."""
        ends = np.cumsum([0.0, *(thickness for _, thickness in self.layers)]).tolist()
        return dict(zip((name for name, _ in self.layers), pairwise(ends), strict=True))

    @property
    def thicknesses(self) -> dict[str, tuple[float, float]]:
        """By channel, the heights (mm) between which the thickness of layers is read; none of one tissue."""
        return between_of(self.heights)

    @property
    def level(self) -> str:
        """What tells tests apart in which stiffness and the fibres' ratio trade off otherwise; "" without fibres."""
        return "" if self.fibres is None else self.kind.level(self.fibres)

    @property
    def fibres_text(self) -> str:
        """How fibres lie; "" without."""
        return "" if self.fibres is None else f"fibres {WORDS[self.fibres]}"

    @property
    def lengths(self) -> dict[str, float]:
        """Sizes by name: mm, and mm² of an area."""
        whole = {name: value for name, value in asdict(self.body).items() if isinstance(value, float)}
        if self.layers:
            del whole["thickness"]
        return whole | {name + OF_LAYER: thickness for name, thickness in self.layers}

    def resized(self, name: str, value: float) -> "Sizes":
        """Return the test with another of its `lengths`."""
        layers = tuple((layer, value if layer + OF_LAYER == name else thickness) for layer, thickness in self.layers)
        changed: dict[str, float] = {"thickness": sum(thickness for _, thickness in layers)} if layers else {}
        if layers == self.layers:
            changed[name] = value
        return replace(self, body=replace(self.body, **changed), layers=layers)

    def larger(self, name: str) -> "Sizes":
        """Return the test with one of its `lengths` larger by `RESIZED`."""
        return self.resized(name, (1 + RESIZED) * self.lengths[name])

    def under(self, alternative: str) -> "Sizes":
        """Return the test with one of the alternatives of its kind."""
        return replace(self, body=self.kind.under(self.body, alternative))

    @property
    def slipping(self) -> "Sizes | None":
        """The test with faces that don't hold what they touch; None where they don't as stated."""
        free = replace(self, body=self.kind.slipping(self.body))
        return None if free == self else free

    def shape_doubts(self, toml: Path) -> Iterator[Doubt]:
        """Yield doubts where it is so slender that it would buckle, or narrower than what presses it."""
        kind, body = self.kind, self.body
        for usual, found in (("covered", kind.covers(body)), ("slenderness", kind.slenderness(body))):
            if found is not None:
                ratio, key = found
                yield from RANGES[usual].doubts(toml, key, ratio)

    def course_doubts(self, source: str, course: Course) -> Iterator[Doubt]:
        """Yield what is unlikely in a recording of such a specimen.

        Raises
        ------
        InputError
            For a depth beyond the specimen, and a speed that no machine has.
        """
        kind, body = self.kind, self.body
        extent = kind.extent(body)
        if extent is not None:
            remedy = f"check that {course.depth:.3g} mm are right, and the specimen's sizes"
            way = "depth" if kind.presses(body) else "elongation"
            yield from RANGES[f"{way}_of_specimen"].doubts(source, "displacement_mm", course.depth / extent, remedy)
        yield from RANGES["speed_of_specimen"].doubts(source, "time_s", course.rate)
        loading = course.samples.part(course.samples.time <= course.arrival)
        yield from loading_doubts(source, loading.time, loading.displacement, loading.force, _CUT_OFF)

    def __str__(self) -> str:
        """Return the test with its sizes, as people read them."""
        told = ", ".join(
            f"{'in' if name == 'direction' else name.replace('_', ' ')} "
            + (value if isinstance(value, str) else f"{value:g} {'mm²' if name == 'area' else 'mm'}")
            for name, value in asdict(self.body).items()
        )
        layers = " on ".join(f"{name} {thickness:g} mm" for name, thickness in self.layers[::-1])
        return "; ".join(filter(None, (f"{self.kind.words}: {told}", layers, self.fibres_text)))


def sizes_of(given: SpecimenFile, specimen: SpecimenEntry | None) -> Sizes:
    """Return a specimen's test, with the sizes of its own.

    Raises
    ------
    InputError
        For a size that the test hasn't, or that isn't given; for fibres of no direction, or of one
        that breaks the test's symmetry.
    """
    stated = {key: getattr(specimen, key) for key in SIZES if getattr(specimen, key, None)}
    cube = {} if given.recordings.table is None else given.kind.cube
    own = {**{key: size for key, size in cube.items() if getattr(given.test, key) is None}, **stated}
    for key in own:
        if key not in type(given.test).model_fields:
            raise InputError("specimen", key, "is not a size of this test", "remove it")
    layers = _layers(given, specimen)
    if layers:
        if "thickness_mm" in own or getattr(given.test, "thickness_mm", None) is not None:
            raise InputError("specimen", "thickness_mm", "is that of the layers together", "remove it")
        own["thickness_mm"] = sum(thickness for _, thickness in layers)
    return Sizes(given.kind.body_of(given.test.model_copy(update=own)), layers, _fibres(given, specimen))


def _fibres(given: SpecimenFile, specimen: SpecimenEntry | None) -> Direction | None:
    """Return how a specimen's fibres lie."""
    if given.fibres is None:
        return None
    own = None if specimen is None else specimen.fibres
    direction, kind = own or given.fibres.direction, given.kind
    key = "fibres.direction" if own is None else "fibres"
    if direction is None:
        raise InputError("specimen", key, MISSING, "give it in [fibres], or as fibres with every [[specimen]]")
    if direction not in kind.directions:
        names = " or ".join(f'"{one}"' for one in kind.directions)
        give = f"give {names}; other directions" if names else "remove [fibres]; they"
        problem = f'"{direction}" breaks the symmetry of {kind.words}'
        raise InputError("specimen", key, problem, f"{give} take a cylinder across a block, or bars")
    return direction


def _layers(given: SpecimenFile, specimen: SpecimenEntry | None) -> tuple[tuple[str, float], ...]:
    """Return names and thicknesses of a specimen's layers, from the base up."""
    own = None if specimen is None else specimen.layers_mm
    if own is None:
        own = [needed(layer, "thickness_mm", "give it, or layers_mm with every [[specimen]]") for layer in given.layers]
    elif len(own) != len(given.layers):
        problem = f"{len(own)} thicknesses of {len(given.layers)} [[layers]]"
        raise InputError("specimen", "layers_mm", problem, "give one a layer")
    names = [layer.name for layer in given.layers]
    return tuple(zip(reversed(names), reversed(own), strict=True))


@dataclass(frozen=True, eq=False)
class SpecimenRecording:
    """One recording of one specimen."""

    name: str
    """Name of the file, with its folder where that distinguishes it from others."""
    specimen: str
    sizes: Sizes
    """Sizes of the specimen and of what presses it."""
    course: Course
    trial: Segmentation
    """All of it as it is read, returns too."""
    found: Contact | None = None
    """First contact as detected, where the course begins at another."""
    reach: float = math.inf
    """Displacement (mm) beyond which its test can't be modelled."""
    test: str = ""
    """Name of its folder, where several tests of one material are given."""

    @property
    def axes(self) -> ShownAxes:
        """As what it is shown."""
        return self.sizes.kind.axes(self.sizes.body, self.recording)

    @property
    def recording(self) -> Recording:
        """The samples."""
        return self.trial.recording

    @property
    def data(self) -> Data:
        """One channel, the force (N) along the time after first contact (s)."""
        course = self.course
        sd = course.instrument.force_sd / np.sqrt(course.count)
        return Data((Channel("force", "N", course.time, "time_s", course.force, sd),))

    @property
    def detected(self) -> Contact:
        """First contact, by the recording alone."""
        return self.found or self.course.contact

    @property
    def from_contact(self) -> Segmentation:
        """All of it, first contact being where the course begins."""
        return self.trial.touching(replace(self.detected, displacement=self.course.contact.displacement))

    def begun(self, place: float, returns: bool) -> "SpecimenRecording":
        """Return the same with first contact at another displacement (mm) of the recording.

        Raises
        ------
        InputError
            If too little is left after it.
        """
        course = course_of(self.trial.touching(replace(self.detected, displacement=place)), returns)
        return replace(self, course=course.down_to(self.reach), found=self.detected)

    def on_rig(self, compliance: float, returns: bool) -> "SpecimenRecording":
        """Return the same without the way that a rig yields (mm/N)."""
        whole, contact = self.recording, self.trial.contact
        left = replace(whole, displacement=whole.displacement - compliance * (whole.force - contact.baseline))
        trial = segment(left, self.trial.instrument, contact.known, self.trial.scales)
        return replace(self, course=course_of(trial, returns), trial=trial, found=None)

    def to(self, reach: float) -> "SpecimenRecording":
        """Return what of it lies within a displacement (mm)."""
        return replace(self, course=self.course.down_to(reach), reach=reach)


@dataclass(frozen=True)
class LeftOut:
    """A recording that can't be used."""

    name: str
    reason: str


_TISSUES = {"muscle": "deep", "fat": "superficial", "adipose": "superficial"}
_APART, _REPEATS, _LIKE = 5.0, 2.0, 3.0
"""Greatest factors between recordings of one specimen: by any rates, by like ones, and which rates are alike. Rates a
thousand times apart change tissues by less."""
_THREE = 3
"""Recordings at least, for the middle to tell which of them is off."""
_CUT_OFF = 0.1
"""Share of the depth over which a force that doesn't rise counts as cut off."""


def size_doubts(toml: Path, table: str, entry: FileTable) -> Iterator[Doubt]:
    """Yield what is unlikely in the sizes that a table of ``specimen.toml`` gives.

    Raises
    ------
    InputError
        For what no lab has.
    """
    every = dict(RANGES)
    for kind in kinds().values():
        every |= kind.ranges
    for key, usual in every.items():
        value = getattr(entry, key, None)
        if value is not None:
            yield from usual.doubts(toml, f"{table}.{key}", value)


_ALSO = {"height": ("thickness", "length"), "thickness": ("height",), "length": ("height",)}
"""What else testing machines may call a size."""
_STATED = 0.02
"""Largest relative difference between what a heading and ``specimen.toml`` state."""


def sizes_of_heading(keys: Iterable[str], heading: Mapping[str, float]) -> dict[str, float]:
    """Return by keys of ``specimen.toml`` the sizes that a recording's heading states (`Recording.sizes`)."""
    round_area = math.pi / 4 * heading.get("diameter", 0.0) ** 2
    known = {"area": round_area or heading.get("width", 0.0) * heading.get("thickness", 0.0), **heading}
    names = ((key, key.rpartition("_")[0]) for key in keys)
    found = {key: [known[one] for one in (name, *_ALSO.get(name, ())) if known.get(one)] for key, name in names}
    return {key: sizes[0] for key, sizes in found.items() if sizes}


def heading_doubts(source: str, sizes: Sizes, heading: Mapping[str, float]) -> Iterator[Doubt]:
    """Yield a doubt about each size that a recording's heading states otherwise than ``specimen.toml``."""
    own = sizes.kind.own
    for key, told in sizes_of_heading(own, heading).items():
        stated = getattr(sizes.body, own[key]) * (2.0 if own[key].endswith("radius") else 1.0)
        if abs(told / stated - 1) > _STATED:
            problem = f"is {told:.4g} in its heading, and {stated:.4g} by specimen.toml"
            yield Doubt(source, key, problem, "correct the one that is wrong")


def stiffness_doubts(source: Path, c10: float, names: Sequence[str], field: str) -> Iterator[Doubt]:
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
    words = set(re.findall(r"[a-z]+", " ".join(names).lower()))
    known = [one for name, one in _TISSUES.items() if {name, f"{name}s"} & words]
    found, usual = mpa_to_kpa(c10), RANGES[f"C10.{known[0] if len(known) == 1 else 'soft'}"]
    low, high = usual.usual
    units = [unit for unit, by in MISTAKEN_UNITS.get(field, {}).items() if low <= by * found <= high]
    first = f"if it is in {' or '.join(units)}, say so; or " if units else ""
    others = "units and sizes" if field in MISTAKEN_UNITS else "its unit"
    yield from usual.likely(source, field, found, f"{first}check {others}")


def differing_doubts(stiffness: Mapping[SpecimenRecording, float]) -> Iterator[Doubt]:
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
            problem = f"gives {ratio:.3g} times the stiffness of the specimen's other recordings"
            remedy = "check that units, gain and specimen are the same"
            yield Doubt(str(one.recording.source or one.name), "force_N", problem, remedy)
