"""A rigid ball on a round layer on a rigid base."""

from typing import ClassVar

from legfem.common.input_files import Positive
from legfem.experiments.bodies import BallOnLayer, Faces
from legfem.specimens.kind import Law, RoundLayerEntry, RoundLayerKind, SpecimenTest, length_range


class BallEntry(RoundLayerEntry):
    """``[ball]``: a rigid ball on a round layer on a rigid base."""

    ball_diameter_mm: Positive
    """Diameter of the ball."""
    ball: Faces = "rough"
    """Whether the layer sticks to the ball or slides on it."""


class BallKind(RoundLayerKind[BallEntry, BallOnLayer]):
    """The ball."""

    table: ClassVar = "ball"
    words: ClassVar = "a ball on a layer"
    done: ClassVar = "a ball pressed them on a rigid base"
    # Hertz.
    followed: ClassVar = (
        "a ball_diameter_mm of half the true value makes it about 1.4 times as large, or twice on a thin layer"
    )
    pressing: ClassVar = {"ball_diameter_mm": "ball_radius"}
    ranges: ClassVar = {"ball_diameter_mm": length_range("a ball's diameter", 0.5, 80.0)}
    free_faces: ClassVar = {"ball": "frictionless"}
    # Hertz's 3/2 on what is smooth and even; on beef the force begins in proportion to the displacement.
    onset_power: ClassVar = None

    def model(self, body: BallOnLayer, law: Law, depth: float) -> SpecimenTest:
        """Return the test, solved by finite elements."""
        from legfem.experiments.axisymmetric import BallIndentation, round_indenter

        radius = body.ball_radius
        return BallIndentation(body, law, round_indenter(radius, body.ball, depth, radius / 8))

    def covers(self, body: BallOnLayer) -> tuple[float, str]:
        """Return the width of what presses over the specimen's."""
        return body.ball_radius / body.layer_radius, "ball_diameter_mm"
