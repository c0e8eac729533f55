"""What a kind of test says of itself: its table of ``specimen.toml``, sizes, model and readings; what kinds share.

Everything else (identification, diagnosis, pages, the form in a browser) works with that; see `legfem.specimens.kinds`.
"""

import typing
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import get_original_bases
from typing import ClassVar, Literal

import numpy as np

from legfem.channels.kind import Face
from legfem.common.errors import MISSING, Doubt, InputError, PhysicalRange
from legfem.common.input_files import FileTable, Positive
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.data import Instrument, Recording, Segmentation
from legfem.data.folder import RecordingsEntry
from legfem.data.ranges import RANGES
from legfem.data.reader import read_samples
from legfem.data.stress_tables import StressTableEntry, read_stress_table
from legfem.experiments.bodies import Base, HomogeneousBody
from legfem.specimens.course import read_specimen, read_table

Direction = Literal["load", "across", "cylinder"]
AXES: Mapping[Direction, tuple[float, float, float]] = {
    "load": (0.0, 1.0, 0.0),
    "across": (1.0, 0.0, 0.0),
    "cylinder": (0.0, 0.0, 1.0),
}
"""In the half plane that is meshed; of a bar, whose own axis is the second."""
WORDS: Mapping[Direction, str] = {
    "load": "along the load",
    "across": "across the load",
    "cylinder": "along the cylinder",
}


if typing.TYPE_CHECKING:
    # What reads a folder's file doesn't start MPI.
    from legfem.experiments.axisymmetric import Layer
    from legfem.experiments.experiment import ExtendedTest
    from legfem.mechanics.materials import Hyperelastic

type Law = Hyperelastic | tuple[Layer, ...]
"""Law of one tissue, or laws of layers from the base up."""
type SpecimenTest = ExtendedTest
"""A test that can be solved and takes mechanisms' terms."""


class SpecimenRecordingsEntry(RecordingsEntry):
    """``[recordings]`` of specimens, optional."""

    table: StressTableEntry | None = None


@dataclass(frozen=True)
class ShownAxes:
    """How displacement (mm) and force (N) are shown."""

    way: str = "displacement"
    way_unit: str = "mm"
    ways: float = 1.0
    """Units of the way in a mm."""
    load: str = "force"
    load_unit: str = "N"
    loads: float = 1.0
    """Units of the load in a N."""

    def load_text(self, force: float) -> str:
        """Return a force (N) with its unit."""
        return f"{self.loads * force:.3g} {self.load_unit}"


class SpecimenKind[Entry: FileTable, Body](ABC):
    """A kind of test on a specimen; an entry is what its table states, a body a frozen dataclass of sizes (mm)."""

    table: ClassVar[str]
    """Name of its table in ``specimen.toml``."""
    entry: ClassVar[type[FileTable]]
    body: ClassVar[type]
    """This and the entry are those that its class is declared with."""
    words: ClassVar[str]
    """What it is: "a ball on a layer"."""
    done: ClassVar[str]
    """What was done with specimens: "a ball pressed them"."""
    followed: ClassVar[str]
    """How stiffness follows the size that is most easily wrong, as a clause."""
    note: ClassVar[str] = ""
    """What displacement and force stand for, where that isn't plain, as sentences."""
    own: ClassVar[Mapping[str, str]]
    """Sizes of the body by the keys of its table that specimens of one folder may have of their own."""
    pressing: ClassVar[Mapping[str, str]] = {}
    """The same of what presses or draws them."""
    ranges: ClassVar[Mapping[str, PhysicalRange]] = {}
    """Plausible ranges of the keys that it alone has."""
    beside: ClassVar[frozenset[str]] = frozenset()
    """Channels beside the force that are weighed, whatever it is of."""
    layered: ClassVar[bool] = False
    """Whether it may be on layers."""
    free_faces: ClassVar[Mapping[str, str]] = {}
    """What the body states of faces that don't hold what they touch; nothing where they don't as stated."""
    along: ClassVar[str] = "thickness"
    """Name of the body's size in the direction of the displacement, beyond which it can't go."""
    directions: ClassVar[tuple[Direction, ...]] = ("load",)
    """Directions of fibres that leave it as symmetric as it is."""
    as_force: ClassVar[tuple[str, ...]] = ()
    """Sizes of the body that the force is in proportion to, as to a stiffness."""
    relaxes_as_a_whole: ClassVar[bool] = False
    """Whether its model is elastic, so that what relaxes is added to its force."""
    starts_at_contact: ClassVar[bool] = False
    onset_power: ClassVar[float | None] = 1.0
    """Power of the displacement that the force begins with on an even specimen; None where it may be any."""
    cube: ClassVar[Mapping[str, float]] = {}
    """Sizes by key of what a table of stretch and stress is of: any will do. Empty where none can be read."""
    load_field: ClassVar[str] = "force_N"
    """What a recording's column of the force is called in doubts."""
    no_slip: ClassVar[str] = "the faces are said to be free of friction"
    """Why nothing can slip that doesn't slip as stated."""

    weighed: ClassVar[Mapping[str, str]] = {}
    """What may be unknown of it, with each in words: all are fitted, and weighed by the recordings."""
    to_know: ClassVar[str] = ""
    """How that could be known, as a sentence without its end."""

    def __init_subclass__(cls) -> None:
        """Take entry and body from what the class is declared with."""
        if declared := typing.get_args(get_original_bases(cls)[0]):
            cls.entry, cls.body = declared

    def body_of(self, given: Entry) -> Body:
        """Return the sizes that a table states, radii as diameters; what is no size is called alike in both.

        Raises
        ------
        InputError
            For one that is missing.
        """
        keys = {**self.own, **self.pressing}
        sizes = {name: needed(given, key) * (0.5 if name.endswith("radius") else 1.0) for key, name in keys.items()}
        body: Body = self.body(**sizes, **{key: value for key, value in given if key not in keys})
        return body

    @abstractmethod
    def model(self, body: Body, law: Law, depth: float) -> SpecimenTest:
        """Return the test, its mesh and steps fit for a depth (mm)."""

    def alternatives(self, given: Entry) -> tuple[str, ...]:
        """Return which of `weighed` a table leaves open; none where it says."""
        return ()

    def under(self, body: Body, alternative: str) -> Body:
        """Return the body with one of them."""
        return body

    def slipping(self, body: Body) -> Body:
        """Return the body with faces that don't hold what they touch."""
        free: Body = replace(body, **self.free_faces)  # type: ignore[type-var]
        return free

    def level(self, direction: Direction) -> str:
        """Return what the directions of fibres share in which stiffness and the fibres' ratio trade off alike."""
        return WORDS[direction]

    def slenderness(self, body: Body) -> tuple[float, str] | None:
        """Return height over width where it could buckle, and the key of the width."""
        return None

    def covers(self, body: Body) -> tuple[float, str] | None:
        """Return the width of what presses over the specimen's, and the key of it; None where faces are one."""
        return None

    def presses(self, body: Body) -> bool:
        """Return whether displacement shortens the specimen."""
        return True

    def extent(self, body: Body) -> float | None:
        """Return the size (mm) in the direction of the displacement, beyond which it can't go; None without."""
        return getattr(body, self.along, None)

    def face(self, body: Body) -> Face | None:
        """Return the free face that a camera sees; None where no model gives how it is strained."""
        return None

    def loaded_area(self, body: Body) -> float | None:
        """Return the area (mm2) of a pressure that is recorded in the force's place."""
        return None

    def doubts(self, recording: Recording, body: Body) -> list[Doubt]:
        """Return what is unlikely in a recording of this kind alone."""
        return []

    def axes(self, body: Body, recording: Recording) -> ShownAxes:
        """Return as what a recording is shown."""
        return ShownAxes()

    def read(
        self, path: Path, given: SpecimenRecordingsEntry, body: Body, errors: Instrument | None, name: str
    ) -> Segmentation:
        """Read a file of a recording.

        Raises
        ------
        InputError
            If it can't be read, or nothing was pressed.
        """
        samples = read_samples(path, given.channels(), self.loaded_area(body))
        at_contact = given.starts_at_contact or self.starts_at_contact
        return read_specimen(replace(samples, trial=name), errors, at_contact, self.onset_power)


def needed(entry: FileTable, key: str, remedy: str = "give it with the test, or with every [[specimen]]") -> float:
    """Return a size that a table has to state.

    Raises
    ------
    InputError
        If it doesn't.
    """
    value: float | None = getattr(entry, key)
    if value is None:
        raise InputError("specimen", key, MISSING, remedy)
    return value


def length_range(what: str, low: float, high: float) -> PhysicalRange:
    """Return where a length of a lab usually lies (mm)."""
    return replace(RANGES["length_mm"], what=what, usual=(low, high))


class RoundLayerEntry(FileTable):
    """What tables state of a round layer on a rigid base."""

    thickness_mm: Positive | None = None
    """Thickness of the layer."""
    diameter_mm: Positive | None = None
    """Diameter of the round layer."""
    base: Base = "bonded"
    """Whether the layer sticks to what it lies on."""


class RoundLayerKind[Entry: RoundLayerEntry, Body](SpecimenKind[Entry, Body]):
    """A kind in which something lies on a round layer on a rigid base."""

    own: ClassVar = {"thickness_mm": "thickness", "diameter_mm": "layer_radius"}
    layered: ClassVar = True


_OTHER_WAY = 0.02
"""Share of the farthest strain: a row farther than that on the other side of none is of another test."""


class HomogeneousKind[Entry: FileTable, Body: HomogeneousBody](SpecimenKind[Entry, Body]):
    """A kind that is solved in closed form.

    Its recordings may be tables of stretch and stress, which are of a cube of 10 mm unless its sizes are stated.
    """

    own: ClassVar = {"length_mm": "length", "area_mm2": "area"}
    followed: ClassVar = "an area_mm2 of half the true value doubles the stiffness"
    along: ClassVar = "length"
    cube: ClassVar = {"length_mm": 10.0, "area_mm2": 100.0}
    directions: ClassVar[tuple[Direction, ...]] = ()
    as_force: ClassVar = ("area",)
    relaxes_as_a_whole: ClassVar = True
    strain: ClassVar[str] = "strain"
    """What its strain is called."""
    one_way: ClassVar[str] = ""
    """What a table of strains below none would have to state in ``specimen.toml``; none where the sign is a choice."""

    def model(self, body: Body, law: Law, depth: float) -> SpecimenTest:
        """Return the test in closed form."""
        from legfem.experiments.homogeneous import HomogeneousTest

        assert not isinstance(law, tuple)
        return HomogeneousTest(body, law)

    def presses(self, body: Body) -> bool:
        """Return whether it is shortened."""
        return body.sign < 0

    def axes(self, body: Body, recording: Recording) -> ShownAxes:
        """A table is shown as strain and nominal stress."""
        if recording.timed:
            return ShownAxes()
        return ShownAxes(self.strain, "-", 1 / body.length, "nominal stress", "kPa", mpa_to_kpa(1 / body.area))

    def read(
        self, path: Path, given: SpecimenRecordingsEntry, body: Body, errors: Instrument | None, name: str
    ) -> Segmentation:
        """Read a recording, or a table."""
        if given.table is None:
            return super().read(path, given, body, errors, name)
        strain, stress = read_stress_table(path, given.table, body.area)
        strain, stress = self._in_the_test_s_direction(path, body, strain, stress, given.table.stretch is not None)
        factor = body.nominal_over_true(strain)
        if given.table.measure is None and not given.table.of_force and not np.allclose(factor, 1.0):
            problem = "missing: engineering and true stress differ "
            problem += f"by up to {100 * float(np.abs(1 / factor - 1).max()):.0f} % here"
            remedy = 'give measure = "nominal" (force over the undeformed area) or measure = "true"'
            raise InputError(path, "recordings.table.measure", problem, remedy)
        nominal = stress * factor if given.table.measure == "true" else stress
        d = body.sign * body.length * strain
        way = np.cumsum(np.abs(np.diff(d, prepend=0.0)))
        # A clock that goes with the way, and on a little where that stands.
        time = way / way[-1] + 1e-9 * np.arange(len(way))
        recording = Recording(time, d, body.sign * body.area * nominal, name, path, timed=False)
        return read_table(recording, errors)

    def _in_the_test_s_direction(
        self, path: Path, body: Body, strain: FloatArray, stress: FloatArray, stretched: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Return strain and stress with the signs of the test's own direction, and from none on."""
        farthest = float(strain[np.argmax(np.abs(strain))])
        if farthest * body.sign < 0 and (stretched or body.sign > 0) and self.one_way:
            problem = f"goes to {farthest:+.3g} in a test in which it is to {'fall' if body.sign < 0 else 'grow'}"
            raise InputError(path, self.strain, problem, f"give in specimen.toml: {self.one_way}")
        strain = strain * (np.sign(farthest) * body.sign)
        if (body.sign * strain).min() < -_OTHER_WAY * abs(farthest):
            raise InputError(path, self.strain, "goes both ways", "keep the rows of one, and give the others a folder")
        if body.sign * strain[0] > body.sign * strain[-1]:
            strain, stress = strain[::-1], stress[::-1]
        # Compression is often written with positive stress, shear with either sign.
        last = stress[np.argsort(np.abs(strain))[-max(3, len(stress) // 5) :]]
        return strain, stress * (np.sign(np.median(last)) * body.sign or 1.0)
