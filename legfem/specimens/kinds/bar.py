"""A bar or cylinder whose ends don't keep it from going sideways."""

import math
from typing import ClassVar, Literal

from legfem.channels.kind import Face
from legfem.channels.kinds.face_strain import FACE_STRAIN
from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH
from legfem.common.input_files import FileTable, Positive
from legfem.experiments.bodies import UniaxialSpecimen
from legfem.specimens.kind import HomogeneousKind


class BarEntry(FileTable):
    """``[uniaxial]``: a bar or cylinder whose ends don't keep it from going sideways."""

    direction: Literal["tension", "compression"]
    """Whether the bar was pulled or pressed."""
    length_mm: Positive | None = None
    """Undeformed length between the grips or plates."""
    area_mm2: Positive | None = None
    """Undeformed cross-section."""


class BarKind(HomogeneousKind[BarEntry, UniaxialSpecimen]):
    """The bar."""

    table: ClassVar = "uniaxial"
    words: ClassVar = "a bar"
    done: ClassVar = "a bar pulled or pressed along its length"
    beside: ClassVar = frozenset({LATERAL_STRETCH.name, FACE_STRAIN.name})
    directions: ClassVar = ("load", "across")
    no_slip: ClassVar = "a bar's ends are free as stated"
    one_way: ClassVar = 'the other direction of [uniaxial], "tension" or "compression"'

    def face(self, body: UniaxialSpecimen) -> Face:
        """Return one of its sides, whose width isn't stated."""
        return Face(body.length / 2)

    def slenderness(self, body: UniaxialSpecimen) -> tuple[float, str] | None:
        """Return length over width of one that is pressed."""
        return (body.length / math.sqrt(body.area), "area_mm2") if self.presses(body) else None
