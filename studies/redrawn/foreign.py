"""Another code's cases: their legs, true courses and truths."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from legfem.common.errors import InputError
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from studies.lab.clean import clean_courses
from studies.lab.recording import Course

AIR, NONE = "contact-onset", "none"
"""What truths call air before the skin, which every set of recordings has here, and no effect."""


@dataclass(frozen=True, eq=False)
class ForeignCase:
    """A leg that another code pressed."""

    name: str
    subject: Subject
    courses: tuple[Course, ...]
    """One a trial, from first touch on."""
    effects: tuple[str, ...]
    """By the names of the diagnosis' mechanisms."""
    c10: float
    """kPa."""


def cases_in(folder: Path) -> dict[str, Any]:
    """Return the truths of a folder's cases that have a clean course, by name.

    Raises
    ------
    InputError
        If there are none.
    """
    path = folder / "truth.json"
    if not path.is_file():
        raise InputError(path, "truth", "is missing", "give the folder of another code's cases")
    every = json.loads(path.read_text(encoding="utf-8"))["cases"]
    return {name: own for name, own in every.items() if (folder / name / "clean.csv").is_file()}


def foreign_case(folder: Path, name: str) -> ForeignCase:
    """Return a case of a folder."""
    truth, path = cases_in(folder)[name], folder / name / "clean.csv"
    effects = tuple(effect for effect in truth["effects"] if effect not in (AIR, NONE))
    subject = load_subject(folder / name, need_recordings=False)
    return ForeignCase(name, subject, clean_courses(path), effects, float(truth["true_C10_kPa"]))
