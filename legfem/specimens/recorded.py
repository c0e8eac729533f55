"""A recording of a specimen, and one that can't be used."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.recording import Recording
from legfem.specimens.course import Course
from legfem.specimens.sizes import Sizes


@dataclass(frozen=True, eq=False)
class SpecimenRecording:
    """One recording of one specimen."""

    name: str
    """Of the file, with its folder where that tells it from others."""
    specimen: str
    sizes: Sizes
    """Of the specimen and what presses it."""
    course: Course
    recording: Recording
    """All of it, returns too."""


@dataclass(frozen=True)
class LeftOut:
    """A recording that can't be used."""

    name: str
    reason: str
