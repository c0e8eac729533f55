"""The options of a command that name a leg."""

import shlex
from pathlib import Path

from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject


def options_of(subject: Subject) -> str:
    """Return the options by which a command finds a subject again."""
    site = f" --site {shlex.quote(subject.site)}" if subject.site else ""
    if subject.id in SUBJECTS.names and SUBJECTS.find(subject.id).resolve() == Path(subject.directory).resolve():
        return f"--subject {subject.id}{site}"
    return f"--subject-dir {shlex.quote(str(subject.directory))}{site}"
