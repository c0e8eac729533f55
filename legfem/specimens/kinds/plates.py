"""A round specimen, end-on, between two rigid plates, whose ends stick, slide, or do nobody knows which."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from legfem.channels.kind import Face
from legfem.channels.kinds.face_strain import FACE_STRAIN
from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH
from legfem.common.input_files import FileTable, Positive
from legfem.experiments.bodies import CylinderBetweenPlates
from legfem.specimens.kind import Law, SpecimenKind, SpecimenTest


class PlatesEntry(FileTable):
    """``[plates]``: a round specimen, end-on, between two rigid plates."""

    diameter_mm: Positive | None = None
    """Diameter of the specimen."""
    height_mm: Positive | None = None
    """Undeformed height of the specimen."""
    ends: Literal["bonded", "sliding", "unknown"] = "unknown"
    """Whether the ends stick to the plates; if that is unknown, both are fitted and weighed."""


@dataclass(frozen=True)
class PartlyHeld(CylinderBetweenPlates):
    """A cylinder whose ends slide by less than free ones."""


class PlatesKind(SpecimenKind[PlatesEntry, CylinderBetweenPlates]):
    """The plates."""

    table: ClassVar = "plates"
    words: ClassVar = "between plates"
    done: ClassVar = "pressed between plates, end-on (round specimens)"
    followed: ClassVar = "a diameter_mm of half the true value makes it at least four times as large"
    beside: ClassVar = frozenset({LATERAL_STRETCH.name, FACE_STRAIN.name})
    own: ClassVar = {"diameter_mm": "radius", "height_mm": "height"}
    along: ClassVar = "height"
    free_faces: ClassVar = {"ends": "sliding"}
    weighed: ClassVar[Mapping[str, str]] = {
        "bonded": "ends that stick to the plates",
        "partly held": "ends that slide in part",
        "sliding": "ends that slide freely",
    }
    to_know: ClassVar = (
        'State ends in [plates]: film the side, which bulges where ends stick; or glue the ends ("bonded"), or oil '
        'them ("sliding"), and press again'
    )

    def body_of(self, given: PlatesEntry) -> CylinderBetweenPlates:
        """Return the sizes, with ends that stick where it isn't known."""
        ends = "sliding" if given.ends == "sliding" else "bonded"
        return super().body_of(given.model_copy(update={"ends": ends}))

    def alternatives(self, given: PlatesEntry) -> tuple[str, ...]:
        """Return what the ends may do."""
        return tuple(self.weighed) if given.ends == "unknown" else ()

    def under(self, body: CylinderBetweenPlates, alternative: str) -> CylinderBetweenPlates:
        """Return the cylinder with such ends."""
        if alternative == "partly held":
            return PartlyHeld(body.radius, body.height)
        return replace(body, ends="bonded" if alternative == "bonded" else "sliding")

    def model(self, body: CylinderBetweenPlates, law: Law, depth: float) -> SpecimenTest:
        """Return the test, solved by finite elements."""
        from legfem.experiments.axisymmetric import CylinderCompression, HalfwayTest, settings_to

        if not isinstance(body, PartlyHeld):
            return CylinderCompression(body, law, settings_to(depth))
        plain = CylinderBetweenPlates(body.radius, body.height, "bonded")
        bonded, sliding = (
            CylinderCompression(one, law, settings_to(depth)) for one in (plain, replace(plain, ends="sliding"))
        )
        return HalfwayTest(bonded, sliding)

    def face(self, body: CylinderBetweenPlates) -> Face:
        """Return its side, seen from aside."""
        return Face(body.height / 2, body.radius)

    def slenderness(self, body: CylinderBetweenPlates) -> tuple[float, str]:
        """Return height over diameter."""
        return body.height / (2 * body.radius), "diameter_mm"
