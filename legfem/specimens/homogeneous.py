"""What kinds of tests have in common in which a specimen is strained alike everywhere: recordings or tables of them."""

from abc import abstractmethod
from pathlib import Path
from typing import ClassVar

import numpy as np

from legfem.common.errors import InputError
from legfem.common.input_files import FileTable
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.data import Instrument, Recording, Segmentation
from legfem.data.stress_tables import read_stress_table
from legfem.experiments.bodies import HomogeneousBody
from legfem.specimens.course import read_table
from legfem.specimens.kind import Direction, Law, ShownAxes, SpecimenKind, SpecimenRecordingsEntry, SpecimenTest

_OTHER_WAY = 0.02
"""Of the farthest strain: a row so far on the other side of none is of another test."""


class HomogeneousKind[Entry: FileTable, Body: HomogeneousBody](SpecimenKind[Entry, Body]):
    """A kind that is solved in closed form.

    Its recordings may be tables of stretch and stress, which are of a cube of 10 mm unless its sizes are stated.
    """

    own: ClassVar = {"length_mm": "length", "area_mm2": "area"}
    followed: ClassVar = "an area_mm2 of half the true value doubles the stiffness"
    cube: ClassVar = {"length_mm": 10.0, "area_mm2": 100.0}
    directions: ClassVar[tuple[Direction, ...]] = ()
    as_force: ClassVar = ("area",)
    relaxes_as_a_whole: ClassVar = True
    strain: ClassVar[str] = "strain"
    """What its strain is called."""
    one_way: ClassVar[str] = ""
    """What a table of strains below none would have to state in ``specimen.toml``; none where the sign is a choice."""

    @abstractmethod
    def body_of(self, given: Entry) -> Body:
        """Return the sizes."""

    def model(self, body: Body, law: Law, depth: float) -> SpecimenTest:
        """Return the test in closed form."""
        from legfem.experiments.homogeneous import HomogeneousTest

        assert not isinstance(law, tuple)
        return HomogeneousTest(body, law)

    def presses(self, body: Body) -> bool:
        """Return whether it is shortened."""
        return body.sign < 0

    def extent(self, body: Body) -> float:
        """Return the length."""
        return body.length

    def axes(self, body: Body, recording: Recording) -> ShownAxes:
        """A table is shown as strain and nominal stress."""
        if recording.timed:
            return ShownAxes()
        return ShownAxes(self.strain, "-", 1 / body.length, "nominal stress", "kPa", mpa_to_kpa(1 / body.area))

    def read(
        self, path: Path, given: SpecimenRecordingsEntry, body: Body, errors: Instrument | None, name: str
    ) -> Segmentation:
        """Read a recording, or a table."""
        if given.table is None:
            return super().read(path, given, body, errors, name)
        strain, stress = read_stress_table(path, given.table.columns)
        strain, stress = self._in_the_test_s_direction(path, body, strain, stress, given.table.stretch is not None)
        factor = body.nominal_over_true(strain)
        if given.table.measure is None and not np.allclose(factor, 1.0):
            raise InputError(
                path,
                "recordings.table.measure",
                "missing: engineering and true stress differ "
                f"by up to {100 * float(np.abs(1 / factor - 1).max()):.0f} % here",
                'give measure = "nominal" (force over the undeformed area) or measure = "true"',
            )
        nominal = stress * factor if given.table.measure == "true" else stress
        d = body.sign * body.length * strain
        way = np.cumsum(np.abs(np.diff(d, prepend=0.0)))
        # A clock that goes with the way, and on a little where that stands.
        time = way / way[-1] + 1e-9 * np.arange(len(way))
        recording = Recording(time, d, body.sign * body.area * nominal, name, path, timed=False)
        return read_table(recording, errors)

    def _in_the_test_s_direction(
        self, path: Path, body: Body, strain: FloatArray, stress: FloatArray, stretched: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Return strain and stress with the signs of the test's own direction, and from none on."""
        farthest = float(strain[np.argmax(np.abs(strain))])
        if farthest * body.sign < 0 and (stretched or body.sign > 0) and self.one_way:
            problem = f"goes to {farthest:+.3g} in a test in which it is to {'fall' if body.sign < 0 else 'grow'}"
            raise InputError(path, self.strain, problem, f"give in specimen.toml: {self.one_way}")
        strain = strain * (np.sign(farthest) * body.sign)
        if (body.sign * strain).min() < -_OTHER_WAY * abs(farthest):
            raise InputError(path, self.strain, "goes both ways", "keep the rows of one, and give the others a folder")
        if body.sign * strain[0] > body.sign * strain[-1]:
            strain, stress = strain[::-1], stress[::-1]
        # Compression is often written with positive stress, shear with either sign.
        last = stress[np.argsort(np.abs(strain))[-max(3, len(stress) // 5) :]]
        return strain, stress * (np.sign(np.median(last)) * body.sign or 1.0)
