"""Courses that another code computed: clean.csv, one row a sample."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.lab.recording import Course

RATE_MM_PER_S = 0.4
"""Of files without a column of times."""


def clean_courses(path: Path) -> tuple[Course, ...]:
    """Return each trial's course from first touch on.

    Columns are displacement_mm and force_N, with time_s and trial where there are several.
    """
    names = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    values = dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))
    at, force = values["displacement_mm"], values["force_N"]
    time = values.get("time_s", at / RATE_MM_PER_S)
    trial = values.get("trial", np.ones(len(at)))
    return tuple(
        _touching(time[mine], at[mine], force[mine]) for mine in (trial == number for number in np.unique(trial))
    )


def _touching(time: np.ndarray, at: np.ndarray, force: np.ndarray) -> Course:
    first = max(int(np.argmax(force > 0.0)) - 1, 0)
    return Course(time[first:] - time[first], at[first:] - at[first], force[first:])
