"""The schema of ``specimen.toml``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from legfem.common.toml_file import FileTable, PlainName, Positive, Text, parse_toml, trouble
from legfem.experiments.axisymmetric import (
    BallIndentation,
    BallOnLayer,
    CylinderBetweenPlates,
    CylinderCompression,
)
from legfem.experiments.flat_punch import FlatPunchIndentation, PunchOnLayer
from legfem.experiments.lateral_cylinder import CylinderOnBlock, LateralCylinder
from legfem.experiments.uniaxial import Bar, UniaxialTest
from legfem.subjects.schema import InstrumentEntry, RecordingsEntry

Base = Literal["bonded", "sliding"]
Faces = Literal["rough", "frictionless"]
BaseLaw = Literal["neo-hookean", "reduced-polynomial"]
type Sizes = BallOnLayer | PunchOnLayer | CylinderBetweenPlates | CylinderOnBlock | Bar
Test = BallIndentation | FlatPunchIndentation | CylinderCompression | LateralCylinder | UniaxialTest
SIZES = ("thickness_mm", "diameter_mm", "height_mm", "width_mm", "length_mm", "area_mm2")
"""Of the body, which specimens of one folder may have their own of."""


class TestEntry(FileTable):
    """A table that says what is done to the specimen; sizes that specimens give may be absent."""

    thickness_mm: Positive | None = None
    diameter_mm: Positive | None = None


class BallEntry(TestEntry):
    """``[ball]``: a rigid ball on a round layer on a rigid base."""

    ball_diameter_mm: Positive
    ball: Faces = "rough"
    base: Base = "bonded"

    def sizes(self) -> Sizes:
        """Return the test of the specimen."""
        return BallOnLayer(
            _given(self, "thickness_mm"), self.ball_diameter_mm / 2,
            _given(self, "diameter_mm") / 2, self.ball, self.base,
        )  # fmt: skip


class PunchEntry(TestEntry):
    """``[punch]``: a rigid flat-ended cylinder, end-on, on a round layer on a rigid base."""

    punch_diameter_mm: Positive
    edge_mm: Positive | None = None
    """Radius of the edge's rounding; a twentieth of the punch's without it."""
    punch: Faces = "rough"
    base: Base = "bonded"

    def sizes(self) -> Sizes:
        """Return the test of the specimen."""
        radius = self.punch_diameter_mm / 2
        return PunchOnLayer(
            _given(self, "thickness_mm"), radius, self.edge_mm or 0.05 * radius,
            _given(self, "diameter_mm") / 2, self.punch, self.base,
        )  # fmt: skip


class PlatesEntry(FileTable):
    """``[plates]``: a round specimen, end-on, between two rigid plates."""

    diameter_mm: Positive | None = None
    height_mm: Positive | None = None
    ends: Base = "sliding"

    def sizes(self) -> Sizes:
        """Return the test of the specimen."""
        diameter, height = _given(self, "diameter_mm"), _given(self, "height_mm")
        return CylinderBetweenPlates(diameter / 2, height, self.ends)


class CylinderEntry(FileTable):
    """``[cylinder]``: a rigid cylinder lying across a block on a rigid base, in plane strain."""

    cylinder_diameter_mm: Positive
    thickness_mm: Positive | None = None
    width_mm: Positive | None = None
    """Of the block, across the cylinder."""
    length_mm: Positive | None = None
    """Over which both touch, along the cylinder."""
    cylinder: Faces = "rough"
    base: Base = "bonded"

    def sizes(self) -> Sizes:
        """Return the test of the specimen."""
        thickness, width, length = (
            _given(self, key) for key in ("thickness_mm", "width_mm", "length_mm")
        )
        radius = self.cylinder_diameter_mm / 2
        return CylinderOnBlock(thickness, width, length, radius, self.cylinder, self.base)


class BarEntry(FileTable):
    """``[uniaxial]``: a bar or cylinder whose ends don't keep it from going sideways."""

    direction: Literal["tension", "compression"]
    length_mm: Positive | None = None
    area_mm2: Positive | None = None

    def sizes(self) -> Sizes:
        """Return the test of the specimen."""
        return Bar(_given(self, "length_mm"), _given(self, "area_mm2"), self.direction)


class SpecimenEntry(FileTable):
    """``[[specimen]]``: one of several, with its own sizes and recordings."""

    name: PlainName
    recordings: Annotated[list[Text], Field(min_length=1)]
    """Files in the folder; ``*`` stands for anything."""
    thickness_mm: Positive | None = None
    diameter_mm: Positive | None = None
    height_mm: Positive | None = None
    width_mm: Positive | None = None
    length_mm: Positive | None = None
    area_mm2: Positive | None = None


class TissueEntry(FileTable):
    """``[tissue]``, optional: what isn't looked for."""

    poisson_ratio: Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False)] | None = None
    """At small strain; a bulk modulus of 1000 shear moduli without it."""
    one_stiffness: bool = False
    """Whether specimens are equally stiff; each has a stiffness of its own without it."""
    returns: bool = False
    """Whether unloading and what follows it is identified from, too."""
    law: BaseLaw = "neo-hookean"
    """That `legfem.diagnose` asks what it leaves out."""
    relaxes: bool | None = None
    """Whether its stress relaxes; without it, whether a recording holds."""


class SpecimenFile(FileTable):
    """``specimen.toml`` as it is written, in the file's units."""

    id: PlainName
    title: Text
    origin: Literal["measured", "reconstructed", "simulated"]
    ball: BallEntry | None = None
    punch: PunchEntry | None = None
    plates: PlatesEntry | None = None
    cylinder: CylinderEntry | None = None
    uniaxial: BarEntry | None = None
    specimen: list[SpecimenEntry] = Field(default_factory=list)
    tissue: TissueEntry = TissueEntry()
    instrument: InstrumentEntry | None = None
    recordings: RecordingsEntry = RecordingsEntry()

    @model_validator(mode="after")
    def _one_test(self) -> SpecimenFile:
        given = self._tests
        if len(given) != 1:
            names = "[ball], [punch], [plates], [cylinder], [uniaxial]"
            problem = "no test is given" if not given else f"{len(given)} tests are given"
            raise trouble("test", problem, f"give one of the tables {names}")
        return self

    @property
    def _tests(self) -> list[BallEntry | PunchEntry | PlatesEntry | CylinderEntry | BarEntry]:
        every = (self.ball, self.punch, self.plates, self.cylinder, self.uniaxial)
        return [one for one in every if one is not None]

    @property
    def test(self) -> BallEntry | PunchEntry | PlatesEntry | CylinderEntry | BarEntry:
        """The one that is given."""
        return self._tests[0]

    def sizes_of(self, specimen: SpecimenEntry | None) -> Sizes:
        """Return a specimen's test, with the sizes of its own.

        Raises
        ------
        SizeError
            For a size that the test hasn't, or that isn't given.
        """
        own = {key: getattr(specimen, key) for key in SIZES if getattr(specimen, key, None)}
        for key in own:
            if key not in type(self.test).model_fields:
                raise SizeError(key, "is no size of this test", "remove it")
        return self.test.model_copy(update=own).sizes()


class SizeError(Exception):
    """A size, what is wrong with it and how to mend that."""


def _given(entry: FileTable, key: str) -> float:
    value: float | None = getattr(entry, key)
    if value is None:
        raise SizeError(key, "missing", "give it with the test, or with every [[specimen]]")
    return value


def parse_specimen_file(path: Path) -> SpecimenFile:
    """Read and check ``specimen.toml``; see `legfem.common.toml_file.parse_toml`."""
    return parse_toml(path, SpecimenFile, "a specimen folder")
