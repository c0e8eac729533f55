"""A bar or cylinder whose ends don't keep it from going sideways."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from legfem.common.input_files import FileTable, Positive
from legfem.experiments.homogeneous import HomogeneousTest
from legfem.experiments.uniaxial import UniaxialSpecimen
from legfem.specimens.kind import Law, SpecimenKind, needed


class BarEntry(FileTable):
    """``[uniaxial]``: a bar or cylinder whose ends don't keep it from going sideways."""

    direction: Literal["tension", "compression"]
    length_mm: Positive | None = None
    area_mm2: Positive | None = None


class BarKind(SpecimenKind[BarEntry, UniaxialSpecimen]):
    """The bar."""

    table: ClassVar = "uniaxial"
    entry: ClassVar = BarEntry
    body: ClassVar = UniaxialSpecimen
    words: ClassVar = "a bar"
    done: ClassVar = "a bar pulled or pressed along its length"
    followed: ClassVar = "an area_mm2 of half the true value makes it twice as large"
    own: ClassVar = ("length_mm", "area_mm2")
    directions: ClassVar = ("load", "across")
    as_force: ClassVar = ("area",)
    relaxes_as_a_whole: ClassVar = True
    no_slip: ClassVar = "a bar's ends are free as stated"

    def body_of(self, given: BarEntry) -> UniaxialSpecimen:
        """Return the sizes."""
        return UniaxialSpecimen(needed(given, "length_mm"), needed(given, "area_mm2"), given.direction)

    def model(self, body: UniaxialSpecimen, law: Law, depth: float) -> HomogeneousTest:
        """Return the test in closed form."""
        assert not isinstance(law, tuple)
        return HomogeneousTest(body, law)

    def slenderness(self, body: UniaxialSpecimen) -> tuple[float, str] | None:
        """Return length over width of one that is pressed."""
        return (body.length / math.sqrt(body.area), "area_mm2") if self.presses(body) else None

    def presses(self, body: UniaxialSpecimen) -> bool:
        """Return whether it is pressed."""
        return body.pulled == "compression"

    def extent(self, body: UniaxialSpecimen) -> float:
        """Return the length."""
        return body.length
