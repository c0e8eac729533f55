"""Clean curves of another code, on legs without any left-out physics."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from legfem.common.errors import InputError
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from studies.lab.clean import clean_courses
from studies.lab.recording import Course

TRIALS = 3
C10_KPA = {"neo-hookean": 1.50, "reduced-polynomial": 0.72, "case-30": 1.45, "case-06": 1.25}
"""By the folder; `clean.csv` lies in it."""


@dataclass(frozen=True, eq=False)
class CleanCurve:
    """A leg, its true course, and its true stiffness (kPa)."""

    subject: Subject
    course: Course
    c10: float


def clean_curve(folder: Path) -> CleanCurve:
    """Return what another code computed.

    Raises
    ------
    InputError
        If there is no such curve.
    """
    path = folder / "clean.csv"
    if not path.is_file() or folder.name not in C10_KPA:
        raise InputError(
            path, "clean curve", "is none of a leg without effect", f"give folders of {', '.join(C10_KPA)}"
        )
    subject = load_subject(folder, need_recordings=False)
    return CleanCurve(subject, clean_courses(path)[0], C10_KPA[folder.name])


def clean_folders(crosscheck: Path, foreign: Path | None) -> list[Path]:
    """Return the folders of clean curves that are there.

    Raises
    ------
    InputError
        If there are none.
    """
    asked = [crosscheck / name for name in ("neo-hookean", "reduced-polynomial")]
    if foreign is not None:
        asked += [foreign / name for name in ("case-30", "case-06")]
    found = [folder for folder in asked if folder.is_dir()]
    if not found:
        raise InputError(crosscheck, "clean curves", "there are none", "give --crosscheck FOLDER")
    return found
