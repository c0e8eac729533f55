"""A cylinder twisted between two plates that stick to its ends, as in a rheometer.

Angles are displacements and torques forces at a lever of 1 mm: rad are mm there, and N mm are N. Sizes then act on the
model alone.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from legfem.channels.kinds.normal_force import NORMAL_FORCE
from legfem.common.errors import Doubt, InputError
from legfem.common.input_files import FileTable, Positive, read_table
from legfem.common.units import FloatArray
from legfem.data import Instrument, Recording, Segmentation
from legfem.data.recording import RecordedChannel, check_increasing
from legfem.data.smoothing import sample_noise
from legfem.experiments.bodies import TwistedCylinder
from legfem.specimens.course import read_specimen
from legfem.specimens.kind import Law, ShownAxes, SpecimenKind, SpecimenRecordingsEntry, SpecimenTest

if TYPE_CHECKING:
    import pandas as pd

_ANGLES = {"angle_rad": 1.0, "angle_deg": math.pi / 180, "angle_mrad": 1e-3}
_TORQUES = {"torque_Nmm": 1.0, "torque_mNm": 1.0, "torque_uNm": 1e-3, "torque_Nm": 1e3}
"""Columns, and rad and N mm of their units."""
_NORMAL = NORMAL_FORCE.column
"""What the plates are pushed apart by, if that was recorded."""
_OTHERWISE = 0.3
"""Share of the theoretical rise by which one may be off before it is doubted."""
_GIVE = f"give time_s, one of {', '.join(_ANGLES)}, one of {', '.join(_TORQUES)}, and {_NORMAL} if you have it"
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
        pushed = None if recording.source is None else _table(recording.source).get(_NORMAL)
        if pushed is None or (apart := _pushed_otherwise(recording, body, pushed.to_numpy(dtype=float))) is None:
            return []
        risen, said = apart
        what = f"rises by {risen:.3g} N, where any law of I1 pushes the plates apart by {said:.3g} N: it isn't weighed"
        return [Doubt(source, _NORMAL, what, "check its sign and zero, whether the gap is kept, and the angle's unit")]

    def read(
        self, path: Path, given: SpecimenRecordingsEntry, body: TwistedCylinder, errors: Instrument | None, name: str
    ) -> Segmentation:
        """Read a recording of ``time_s``, an angle and a torque."""
        table = _table(path)
        angles, torques = ([one for one in units if one in table] for units in (_ANGLES, _TORQUES))
        if given.channels() is not None or len(angles) != 1 or len(torques) != 1:
            what = f"has {len(angles)} columns of an angle and {len(torques)} of a torque"
            raise InputError(path, "header", what, _GIVE)
        time, angle, torque = (table[one].to_numpy(dtype=float) for one in ("time_s", angles[0], torques[0]))
        check_increasing(path, time, "time_s")
        recording = Recording(time, _ANGLES[angles[0]] * angle, _TORQUES[torques[0]] * torque, name, path)
        if _NORMAL in table:
            pushed = table[_NORMAL].to_numpy(dtype=float)
            if _pushed_otherwise(recording, body, pushed) is None:
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


def _table(path: Path) -> "pd.DataFrame":
    every = (*_ANGLES, *_TORQUES, _NORMAL)
    try:
        return read_table(path, ("time_s", *every), optional=every)
    except InputError as error:
        raise InputError(path, error.field, error.problem, _GIVE if error.field == "header" else error.remedy) from None
