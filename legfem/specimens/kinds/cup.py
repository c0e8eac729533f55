"""A cup that draws a round layer on a rigid base up through its opening, and what its recordings can't be."""

import math
from typing import ClassVar

import numpy as np

from legfem.common.errors import Doubt, InputError
from legfem.common.input_files import Positive
from legfem.common.units import mpa_to_kpa
from legfem.data import Recording
from legfem.experiments.bodies import Base, CupOnLayer
from legfem.specimens.kind import Law, RoundLayerEntry, RoundLayerKind, ShownAxes, SpecimenTest, length_range

ATMOSPHERE_KPA = 101.325
_SLACK = 1.05
"""Factor on the atmosphere's pressure, for a gauge's error and high pressure over a plain."""
_USUAL_KPA = (1.0, 80.0)
"""Cutometers and aspiration devices on skin and organs draw with 2 to 60 kPa."""
_HIGHEST = 2.0
"""Greatest height of a dome over its opening's radius: a half ball has 1."""


class SuctionEntry(RoundLayerEntry):
    """``[suction]``: a cup that draws a round layer on a rigid base up through its opening."""

    opening_mm: Positive
    """Inner diameter of the cup."""
    rim_mm: Positive
    """Width of the cup's face on the skin."""
    rim: Base = "bonded"
    """Whether the layer sticks to the cup's rim."""


class CupKind(RoundLayerKind[SuctionEntry, CupOnLayer]):
    """The cup, which lies on the skin before it draws."""

    table: ClassVar = "suction"
    words: ClassVar = "a suction cup on a layer"
    done: ClassVar = "a suction cup drew them up"
    # A dome as wide as its opening.
    followed: ClassVar = "an opening_mm of half the true value makes it about half as large"
    note: ClassVar = (
        "The displacement is the height of the dome at its middle, the force is the suction times the area of the "
        "cup's opening; the cup does not move."
    )
    pressing: ClassVar = {"opening_mm": "opening_radius", "rim_mm": "rim_width"}
    ranges: ClassVar = {
        "opening_mm": length_range("a cup's opening", 1.0, 60.0),
        "rim_mm": length_range("a cup's rim", 0.2, 20.0),
    }
    free_faces: ClassVar = {"rim": "sliding"}
    relaxes_as_a_whole: ClassVar = True
    starts_at_contact: ClassVar = True
    load_field: ClassVar = "pressure"

    def model(self, body: CupOnLayer, law: Law, depth: float) -> SpecimenTest:
        """Return the test, solved by finite elements."""
        from legfem.experiments.axisymmetric import settings_to
        from legfem.experiments.suction import SuctionTest

        return SuctionTest(body, law, settings_to(depth))

    def covers(self, body: CupOnLayer) -> tuple[float, str]:
        """Return the width of what presses over the specimen's."""
        return (body.opening_radius + body.rim_width) / body.layer_radius, "opening_mm"

    def extent(self, body: CupOnLayer) -> None:
        """A dome rises out of the layer: nothing limits it."""

    def loaded_area(self, body: CupOnLayer) -> float:
        """Return the opening: the suction on it is the force."""
        return body.opening

    def axes(self, body: CupOnLayer, recording: Recording) -> ShownAxes:
        """The force is the suction on the opening."""
        return ShownAxes("height of the dome", "mm", 1.0, "suction", "kPa", mpa_to_kpa(1 / body.opening))

    def doubts(self, recording: Recording, body: CupOnLayer) -> list[Doubt]:
        """Return what is unlikely in a recording whose force is a suction on the opening.

        Raises
        ------
        InputError
            For a suction of more than the atmosphere, and a dome that no skin makes.
        """
        source = f"{recording.source or recording.trial}"
        peak = mpa_to_kpa(float(np.abs(recording.force).max()) / body.opening)
        if peak > _SLACK * ATMOSPHERE_KPA:
            problem = f"a suction of {peak:.4g} kPa is more than the atmosphere's pressure"
            remedy = f"check the unit: as mbar it is {0.1 * peak:.3g} kPa, as mmHg {0.1333 * peak:.3g} kPa"
            raise InputError(source, "pressure", problem, remedy)
        radius, height = math.sqrt(body.opening / math.pi), float(np.ptp(recording.displacement))
        if height > _HIGHEST * radius:
            problem = f"a dome of {height:.3g} mm over an opening of {2 * radius:.3g} mm"
            raise InputError(source, "displacement", problem, "check its unit, and opening_mm")
        if not _USUAL_KPA[0] <= peak <= _USUAL_KPA[1]:
            problem = f"a suction of {peak:.3g} kPa is unusual (it is {_USUAL_KPA[0]:g} to {_USUAL_KPA[1]:g} kPa)"
            return [Doubt(source, "pressure", problem, "check its unit")]
        return []
