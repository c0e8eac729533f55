"""A recording of a specimen, and one that can't be used."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from legfem.data import Recording, Segmentation
from legfem.data.contact import Contact
from legfem.inverse.data import Channel, Data
from legfem.specimens.course import Course, course_of
from legfem.specimens.kind import ShownAxes
from legfem.specimens.sizes import Sizes, bare, kind_in


@dataclass(frozen=True, eq=False)
class SpecimenRecording:
    """One recording of one specimen."""

    name: str
    """Of the file, with its folder where that tells it from others."""
    specimen: str
    sizes: Sizes
    """Of the specimen and what presses it."""
    course: Course
    trial: Segmentation
    """All of it as it is read, returns too."""
    found: Contact | None = None
    """First contact as detected, where the course begins at another."""
    reach: float = math.inf
    """Displacement (mm) beyond which its test can't be modelled."""

    @property
    def axes(self) -> ShownAxes:
        """As what it is shown."""
        return kind_in(self.sizes).axes(bare(self.sizes), self.recording)

    @property
    def recording(self) -> Recording:
        """The samples."""
        return self.trial.recording

    @property
    def data(self) -> Data:
        """One channel, the force (N) along the time after first contact (s)."""
        course = self.course
        sd = course.instrument.force_sd / np.sqrt(course.count)
        return Data((Channel("force", "N", course.time, "time_s", course.force, sd),))

    @property
    def detected(self) -> Contact:
        """First contact, by the recording alone."""
        return self.found or self.course.contact

    def begun(self, place: float, returns: bool) -> SpecimenRecording:
        """Return the same with first contact at another displacement (mm) of the recording.

        Raises
        ------
        InputError
            If too little is left after it.
        """
        course = course_of(self.trial.touching(replace(self.detected, displacement=place)), returns)
        return replace(self, course=course.down_to(self.reach), found=self.detected)

    def to(self, reach: float) -> SpecimenRecording:
        """Return what of it lies within a displacement (mm)."""
        return replace(self, course=self.course.down_to(reach), reach=reach)


@dataclass(frozen=True)
class LeftOut:
    """A recording that can't be used."""

    name: str
    reason: str
