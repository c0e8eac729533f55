"""A round specimen, end-on, between two rigid plates."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from legfem.common.input_files import FileTable, Positive
from legfem.experiments.axisymmetric import CylinderBetweenPlates, CylinderCompression
from legfem.specimens.kind import Base, Law, SpecimenKind, needed, settings_to


class PlatesEntry(FileTable):
    """``[plates]``: a round specimen, end-on, between two rigid plates."""

    diameter_mm: Positive | None = None
    height_mm: Positive | None = None
    ends: Base = "sliding"


class PlatesKind(SpecimenKind[PlatesEntry, CylinderBetweenPlates]):
    """The plates."""

    table: ClassVar = "plates"
    entry: ClassVar = PlatesEntry
    body: ClassVar = CylinderBetweenPlates
    words: ClassVar = "between plates"
    done: ClassVar = "pressed between plates, end-on (round specimens)"
    followed: ClassVar = "a diameter_mm of half the true value makes it at least four times as large"
    own: ClassVar = ("diameter_mm", "height_mm")

    def body_of(self, given: PlatesEntry) -> CylinderBetweenPlates:
        """Return the sizes."""
        diameter, height = needed(given, "diameter_mm"), needed(given, "height_mm")
        return CylinderBetweenPlates(diameter / 2, height, given.ends)

    def model(self, body: CylinderBetweenPlates, law: Law, depth: float) -> CylinderCompression:
        """Return the test, solved by finite elements."""
        return CylinderCompression(body, law, settings_to(depth))

    def slipping(self, body: CylinderBetweenPlates) -> CylinderBetweenPlates:
        """Return it with ends that slide."""
        return replace(body, ends="sliding")

    def slenderness(self, body: CylinderBetweenPlates) -> tuple[float, str]:
        """Return height over diameter."""
        return body.height / (2 * body.radius), "diameter_mm"

    def extent(self, body: CylinderBetweenPlates) -> float:
        """Return the height."""
        return body.height
