"""A rigid cylinder lying across a block on a rigid base, in plane strain."""

from typing import ClassVar

from legfem.common.input_files import FileTable, Positive
from legfem.experiments.bodies import Base, CylinderOnBlock, Faces
from legfem.specimens.kind import WORDS, Direction, Law, SpecimenKind, SpecimenTest, length_range


class CylinderEntry(FileTable):
    """``[cylinder]``: a rigid cylinder lying across a block on a rigid base, in plane strain."""

    cylinder_diameter_mm: Positive
    """Diameter of the cylinder."""
    thickness_mm: Positive | None = None
    """Thickness of the block."""
    width_mm: Positive | None = None
    """Width of the block, across the cylinder."""
    length_mm: Positive | None = None
    """Length over which the block and the cylinder touch, along the cylinder."""
    cylinder: Faces = "rough"
    """Whether the block sticks to the cylinder or slides on it."""
    base: Base = "bonded"
    """Whether the block sticks to what it lies on."""


class LyingCylinderKind(SpecimenKind[CylinderEntry, CylinderOnBlock]):
    """The cylinder."""

    table: ClassVar = "cylinder"
    words: ClassVar = "a cylinder across a block"
    done: ClassVar = "a cylinder lying across a block pressed it"
    followed: ClassVar = "a length_mm of half the true value doubles the stiffness"
    own: ClassVar = {"thickness_mm": "thickness", "width_mm": "width", "length_mm": "length"}
    pressing: ClassVar = {"cylinder_diameter_mm": "cylinder_radius"}
    ranges: ClassVar = {"cylinder_diameter_mm": length_range("a cylinder's diameter", 1.0, 100.0)}
    layered: ClassVar = True
    free_faces: ClassVar = {"cylinder": "frictionless"}
    directions: ClassVar = ("load", "across", "cylinder")
    as_force: ClassVar = ("length",)

    def model(self, body: CylinderOnBlock, law: Law, depth: float) -> SpecimenTest:
        """Return the test, solved by finite elements."""
        from legfem.experiments.axisymmetric import round_indenter
        from legfem.experiments.lying_cylinder import LateralCylinder

        radius = body.cylinder_radius
        return LateralCylinder(body, law, round_indenter(radius, body.cylinder, depth, radius / 16))

    def covers(self, body: CylinderOnBlock) -> tuple[float, str]:
        """Return the width of what presses over the specimen's."""
        return 2 * body.cylinder_radius / body.width, "cylinder_diameter_mm"

    def level(self, direction: Direction) -> str:
        """In plane strain fibres along the travel and across resist small strain alike."""
        return WORDS["cylinder"] if direction == "cylinder" else "in the cylinder's plane"
