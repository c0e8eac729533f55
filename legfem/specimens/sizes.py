"""The tests of specimens that ``specimen.toml`` describes, with the sizes of each specimen, and its recordings."""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from legfem.data import Recording, Segmentation
from legfem.data.contact import Contact
from legfem.inverse.data import Channel, Data
from legfem.specimens.course import Course, course_of
from legfem.specimens.kind import WORDS, Direction, ShownAxes, SizeError, SpecimenKind, needed
from legfem.specimens.kinds import kind_of
from legfem.specimens.schema import SIZES, SpecimenEntry, SpecimenFile

type OneTissue = Any
"""Sizes of a test on one tissue: the body of a kind."""


@dataclass(frozen=True)
class LayeredTest:
    """A test of layers on each other.

    Parameters
    ----------
    whole
        The test, on a layer as thick as all together.
    layers
        Names and thicknesses (mm), from the base up.
    """

    whole: OneTissue
    layers: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class FibrousTest:
    """A test of a tissue that has fibres, or of layers of which one has.

    Parameters
    ----------
    whole
        The test.
    direction
        Of the fibres.
    """

    whole: OneTissue | LayeredTest
    direction: Direction

    @property
    def level(self) -> str:
        """What tells tests apart in which stiffness and the fibres' ratio trade off otherwise."""
        return kind_in(self).level(self.direction)


type Sizes = OneTissue | LayeredTest | FibrousTest


def bare(sizes: Sizes) -> OneTissue:
    """Return a test without what is in it."""
    return bare(sizes.whole) if isinstance(sizes, LayeredTest | FibrousTest) else sizes


def kind_in(sizes: Sizes) -> SpecimenKind[Any, Any]:
    """Return the kind of a test."""
    return kind_of(type(bare(sizes)))


def layered(sizes: Sizes) -> LayeredTest | None:
    """Return a test's layers; None of one tissue."""
    if isinstance(sizes, FibrousTest):
        return layered(sizes.whole)
    return sizes if isinstance(sizes, LayeredTest) else None


def level_of(sizes: Sizes) -> str:
    """Return a test's `FibrousTest.level`; "" without fibres."""
    return sizes.level if isinstance(sizes, FibrousTest) else ""


def fibres_text(sizes: Sizes) -> str:
    """Return how a test's fibres lie; "" without."""
    return f"fibres {WORDS[sizes.direction]}" if isinstance(sizes, FibrousTest) else ""


def lengths_of(sizes: Sizes) -> dict[str, float]:
    """Return a test's sizes by name: mm, and mm² of an area."""
    if isinstance(sizes, FibrousTest):
        return lengths_of(sizes.whole)
    if isinstance(sizes, LayeredTest):
        whole = lengths_of(sizes.whole)
        del whole["thickness"]
        return whole | {name + OF_LAYER: thickness for name, thickness in sizes.layers}
    return {name: value for name, value in asdict(sizes).items() if isinstance(value, float)}


def resized(sizes: Sizes, name: str, value: float) -> Sizes:
    """Return a test with another of the sizes of `lengths_of`."""
    if isinstance(sizes, FibrousTest):
        whole = resized(sizes.whole, name, value)
        assert not isinstance(whole, FibrousTest)
        return replace(sizes, whole=whole)
    if isinstance(sizes, LayeredTest):
        layers = tuple((layer, value if layer + OF_LAYER == name else thickness) for layer, thickness in sizes.layers)
        own: dict[str, Any] = {"thickness": sum(thickness for _, thickness in layers)}
        if layers == sizes.layers:
            own[name] = value
        return LayeredTest(replace(sizes.whole, **own), layers)
    return replace(sizes, **{name: value})


OF_LAYER = "_thickness"


def sizes_of(given: SpecimenFile, specimen: SpecimenEntry | None) -> Sizes:
    """Return a specimen's test, with the sizes of its own.

    Raises
    ------
    SizeError
        For a size that the test hasn't, or that isn't given; for fibres of no direction, or of one
        that breaks the test's symmetry.
    """
    whole = _without_fibres(given, specimen)
    if given.fibres is None:
        return whole
    own = None if specimen is None else specimen.fibres
    direction, kind = own or given.fibres.direction, given.kind
    key = "fibres.direction" if own is None else "fibres"
    if direction is None:
        raise SizeError(key, "missing", "give it in [fibres], or as fibres with every [[specimen]]")
    if direction not in kind.directions:
        names = " or ".join(f'"{one}"' for one in kind.directions)
        give = f"give {names}; other directions" if names else "remove [fibres]; they"
        raise SizeError(
            key, f'"{direction}" breaks the symmetry of {kind.words}', f"{give} take a cylinder across a block, or bars"
        )
    return FibrousTest(whole, direction)


def _without_fibres(given: SpecimenFile, specimen: SpecimenEntry | None) -> OneTissue | LayeredTest:
    stated = {key: getattr(specimen, key) for key in SIZES if getattr(specimen, key, None)}
    cube = {} if given.recordings.table is None else given.kind.cube
    own = {**{key: size for key, size in cube.items() if getattr(given.test, key) is None}, **stated}
    for key in own:
        if key not in type(given.test).model_fields:
            raise SizeError(key, "is no size of this test", "remove it")
    layers = _layers(given, specimen)
    if not layers:
        return given.kind.body_of(given.test.model_copy(update=own))
    if "thickness_mm" in own or getattr(given.test, "thickness_mm", None) is not None:
        raise SizeError("thickness_mm", "is that of the layers together", "remove it")
    own["thickness_mm"] = sum(thickness for _, thickness in layers)
    return LayeredTest(given.kind.body_of(given.test.model_copy(update=own)), layers)


def _layers(given: SpecimenFile, specimen: SpecimenEntry | None) -> tuple[tuple[str, float], ...]:
    """Return names and thicknesses of a specimen's layers, from the base up."""
    own = None if specimen is None else specimen.layers_mm
    if own is None:
        own = [needed(layer, "thickness_mm", "give it, or layers_mm with every [[specimen]]") for layer in given.layers]
    elif len(own) != len(given.layers):
        raise SizeError("layers_mm", f"{len(own)} thicknesses of {len(given.layers)} [[layers]]", "give one a layer")
    names = [layer.name for layer in given.layers]
    return tuple(zip(reversed(names), reversed(own), strict=True))


def under(sizes: Sizes, alternative: str) -> Sizes:
    """Return a test with one of the alternatives of its kind."""
    if isinstance(sizes, LayeredTest | FibrousTest):
        return replace(sizes, whole=under(sizes.whole, alternative))
    return kind_in(sizes).under(sizes, alternative)


def slipping(sizes: Sizes) -> Sizes | None:
    """Return a test whose faces don't hold what they touch; None where they don't as stated."""
    if isinstance(sizes, LayeredTest | FibrousTest):
        whole = slipping(sizes.whole)
        return None if whole is None else replace(sizes, whole=whole)
    free = kind_in(sizes).slipping(sizes)
    return None if free == sizes else free


def sizes_text(sizes: Sizes) -> str:
    """Return a specimen's test with its sizes, as people read them."""
    if isinstance(sizes, FibrousTest):
        return f"{sizes_text(sizes.whole)}; {fibres_text(sizes)}"
    if isinstance(sizes, LayeredTest):
        layers = " on ".join(f"{name} {thickness:g} mm" for name, thickness in sizes.layers[::-1])
        return f"{sizes_text(sizes.whole)}; {layers}"
    told = (
        f"{'in' if name == 'pulled' else name.replace('_', ' ')} "
        + (value if isinstance(value, str) else f"{value:g} {'mm²' if name == 'area' else 'mm'}")
        for name, value in asdict(sizes).items()
    )
    return f"{kind_in(sizes).words}: {', '.join(told)}"


@dataclass(frozen=True, eq=False)
class SpecimenRecording:
    """One recording of one specimen."""

    name: str
    """Of the file, with its folder where that tells it from others."""
    specimen: str
    sizes: Sizes
    """Of the specimen and what presses it."""
    course: Course
    trial: Segmentation
    """All of it as it is read, returns too."""
    found: Contact | None = None
    """First contact as detected, where the course begins at another."""
    reach: float = math.inf
    """Displacement (mm) beyond which its test can't be modelled."""

    @property
    def axes(self) -> ShownAxes:
        """As what it is shown."""
        return kind_in(self.sizes).axes(bare(self.sizes), self.recording)

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

    def begun(self, place: float, returns: bool) -> "SpecimenRecording":
        """Return the same with first contact at another displacement (mm) of the recording.

        Raises
        ------
        InputError
            If too little is left after it.
        """
        course = course_of(self.trial.touching(replace(self.detected, displacement=place)), returns)
        return replace(self, course=course.down_to(self.reach), found=self.detected)

    def to(self, reach: float) -> "SpecimenRecording":
        """Return what of it lies within a displacement (mm)."""
        return replace(self, course=self.course.down_to(reach), reach=reach)


@dataclass(frozen=True)
class LeftOut:
    """A recording that can't be used."""

    name: str
    reason: str
