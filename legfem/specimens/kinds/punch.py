"""A rigid flat-ended cylinder, end-on, on a round layer on a rigid base."""

from dataclasses import replace
from typing import ClassVar

from legfem.common.input_files import Positive
from legfem.experiments.bodies import Faces, PunchOnLayer
from legfem.specimens.kind import Law, RoundLayerEntry, RoundLayerKind, SpecimenTest, length_range


class PunchEntry(RoundLayerEntry):
    """``[punch]``: a rigid flat-ended cylinder, end-on, on a round layer on a rigid base."""

    punch_diameter_mm: Positive
    """Diameter of the punch."""
    edge_mm: Positive | None = None
    """Radius of the edge's rounding; without it, a twentieth of the punch's radius."""
    punch: Faces = "rough"
    """Whether the layer sticks to the punch or slides on it."""


class PunchKind(RoundLayerKind[PunchEntry, PunchOnLayer]):
    """The punch."""

    table: ClassVar = "punch"
    words: ClassVar = "a flat punch on a layer"
    done: ClassVar = "a flat punch pressed them on a rigid base"
    # Boussinesq.
    followed: ClassVar = "a punch_diameter_mm of half the true value makes it at least twice as large"
    pressing: ClassVar = {"punch_diameter_mm": "radius", "edge_mm": "edge"}
    ranges: ClassVar = {
        "punch_diameter_mm": length_range("a punch's diameter", 0.5, 80.0),
        "edge_mm": length_range("the rounding of an edge", 0.02, 20.0),
    }
    free_faces: ClassVar = {"punch": "frictionless"}

    def body_of(self, given: PunchEntry) -> PunchOnLayer:
        """Return the sizes, with the usual rounding where none is stated."""
        edge = given.edge_mm or 0.05 * (given.punch_diameter_mm / 2)
        return super().body_of(given.model_copy(update={"edge_mm": edge}))

    def model(self, body: PunchOnLayer, law: Law, depth: float) -> SpecimenTest:
        """Return the test, solved by finite elements."""
        from legfem.experiments.axisymmetric import onset_to, settings_to
        from legfem.experiments.flat_punch import FlatPunchIndentation

        settings = replace(settings_to(depth), contact=onset_to(body.punch, depth))
        return FlatPunchIndentation(body, law, settings)

    def covers(self, body: PunchOnLayer) -> tuple[float, str]:
        """Return the width of what presses over the specimen's."""
        return body.radius / body.layer_radius, "punch_diameter_mm"
