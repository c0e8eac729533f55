"""A cylinder twisted between two plates that stick to its ends, as in a rheometer.

Angles are displacements and torques forces at a lever of 1 mm: rad are mm there, and N mm are N. Sizes then act on the
model alone.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from legfem.channels.kinds.normal_force import NORMAL_FORCE
from legfem.common.errors import Doubt, InputError
from legfem.common.input_files import FileTable, Positive
from legfem.common.units import FloatArray
from legfem.data import Instrument, Recording, Segmentation
from legfem.data.columns import find_column
from legfem.data.formats import read_sheets
from legfem.data.formats.labels import Quantity
from legfem.data.recording import RecordedChannel, check_increasing
from legfem.data.smoothing import sample_noise
from legfem.experiments.bodies import TwistedCylinder
from legfem.specimens.course import read_specimen
from legfem.specimens.kind import Law, ShownAxes, SpecimenKind, SpecimenRecordingsEntry, SpecimenTest

_QUANTITIES: tuple[Quantity, ...] = ("time", "angle", "torque")
_OTHERWISE = 0.3
"""Share of the theoretical rise by which one may be off before it is doubted."""
_GIVE = "give time_s, angle_rad or angle_deg, torque_mNm or torque_Nm, and normal_force_N if you have it"
_MOST_SHEAR = 5.0
"""At the rim: no tissue is sheared by more."""
_LEAST_SHEAR = 1e-4


class TorsionEntry(FileTable):
    """``[torsion]``: a cylinder between two plates that stick to its ends and keep their distance, twisted by one."""

    diameter_mm: Positive | None = None
    """Diameter of the specimen."""
    height_mm: Positive | None = None
    """Distance between the plates."""


class TorsionKind(SpecimenKind[TorsionEntry, TwistedCylinder]):
    """The twisted cylinder."""

    table: ClassVar = "torsion"
    words: ClassVar = "a twisted cylinder"
    done: ClassVar = "a cylinder twisted between two plates that stick to its ends"
    followed: ClassVar = "a diameter_mm of half the true value makes it sixteen times as large"
    note: ClassVar = "Displacements in mm are angles in rad, and forces in N are torques in N mm: at a lever of 1 mm."
    own: ClassVar = {"diameter_mm": "radius", "height_mm": "height"}
    beside: ClassVar = frozenset({NORMAL_FORCE.name})
    directions: ClassVar = ()
    relaxes_as_a_whole: ClassVar = True
    load_field: ClassVar = "torque"
    no_slip: ClassVar = "the plates are said to hold the cylinder"

    def model(self, body: TwistedCylinder, law: Law, depth: float) -> SpecimenTest:
        """Return the test in closed form."""
        from legfem.experiments.torsion import TorsionTest

        assert not isinstance(law, tuple)
        return TorsionTest(body, law)

    def presses(self, body: TwistedCylinder) -> bool:
        """Return whether it is shortened: it isn't."""
        return False

    def axes(self, body: TwistedCylinder, recording: Recording) -> ShownAxes:
        """Return twist and torque."""
        return ShownAxes("twist", "°", math.degrees(1.0), "torque", "N mm")

    def doubts(self, recording: Recording, body: TwistedCylinder) -> list[Doubt]:
        """Return a doubt about plates that are pushed apart otherwise than by the torque.

        Raises
        ------
        InputError
            For a twist that no tissue bears, and one that is none.
        """
        source = f"{recording.source or recording.trial}"
        twist = float(recording.displacement.max() - recording.displacement.min())
        shear = twist * body.radius / body.height
        if not _LEAST_SHEAR < shear < _MOST_SHEAR:
            problem = f"a twist of {math.degrees(twist):.3g}° shears the rim by {shear:.2g}"
            raise InputError(source, "angle", problem, "check whether the angle is in degrees or rad, and the sizes")
        pushed = None if recording.source is None else _readings(recording.source)[0].get("normal_force")
        if pushed is None or (apart := _pushed_otherwise(recording, body, pushed)) is None:
            return []
        risen, said = apart
        what = f"rises by {risen:.3g} N, where any law of I1 pushes the plates apart by {said:.3g} N: it isn't weighed"
        remedy = "check its sign and zero, whether the gap is kept, and the angle's unit"
        return [Doubt(source, NORMAL_FORCE.column, what, remedy)]

    def read(
        self, path: Path, given: SpecimenRecordingsEntry, body: TwistedCylinder, errors: Instrument | None, name: str
    ) -> Segmentation:
        """Read a recording of a time, an angle and a torque."""
        read, sizes = _readings(path)
        time, pushed = read["time"], read.get("normal_force")
        check_increasing(path, time, "time_s")
        # A spindle counts from anywhere, and either way round is the same test.
        angle = read["angle"] - read["angle"][0]
        way = np.sign(angle[np.argmax(np.abs(angle))]) or 1.0
        recording = Recording(time, way * angle, way * read["torque"], name, path, sizes=sizes)
        if pushed is not None and _pushed_otherwise(recording, body, pushed) is None:
            channel = RecordedChannel(NORMAL_FORCE.name, time, pushed, NORMAL_FORCE.usual)
            recording = replace(recording, channels=(channel,))
        return read_specimen(recording, errors, given.starts_at_contact, self.onset_power)


def _pushed_otherwise(recording: Recording, body: TwistedCylinder, pushed: FloatArray) -> tuple[float, float] | None:
    """Return by how much (N) a normal force rises, and would by theory; None where that is one."""
    first, last = recording.displacement.argmin(), recording.displacement.argmax()
    twist = recording.displacement[last] - recording.displacement[first]
    said = 0.5 * twist / body.height * float(np.abs(recording.force[last] - recording.force[first]))
    risen = float(pushed[last] - pushed[first])
    return None if abs(risen - said) <= _OTHERWISE * said + 5 * sample_noise(pushed) else (risen, said)


def _readings(path: Path) -> tuple[dict[str, FloatArray], Mapping[str, float]]:
    """Return time, angle, torque and perhaps the normal force (n,), and the sizes that the file's heading states."""
    sheets = read_sheets(path)
    sheet = next((one for one in sheets if any(c.quantity == "torque" for c in one.columns)), sheets[0])
    try:
        found = {quantity: find_column(path, sheet, quantity, None)[0] for quantity in _QUANTITIES}
    except InputError as error:
        raise InputError(path, "header", error.problem, _GIVE) from None
    pushed = [c for c in sheet.columns if c.quantity == "force" and re.search("normal|axial|^f_?n$", c.name, re.I)]
    columns = {str(q): replace(sheet.named(one.column)[0], unit=one.unit) for q, one in found.items()}
    if pushed:
        columns["normal_force"] = pushed[0]
    if not np.isfinite([c.values for c in columns.values()]).all():
        raise InputError(path, "rows", "have numbers that are not finite", "remove them, or record again")
    return {name: c.values * c.factor for name, c in columns.items()}, sheet.sizes
