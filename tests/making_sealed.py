"""Truths of sealed cases in closed form, no finite elements."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from studies.concealed.cases import DEPTH_MM
from studies.concealed.truth import ELASTIC_RATE, ForceCourse, Truths


def square_truths(monkeypatch: pytest.MonkeyPatch) -> Truths:
    """Return truths of a leg whose force is 0.02 N/mm2 times the depth's square."""
    d = np.linspace(0.0, DEPTH_MM, 201)
    monkeypatch.setattr(Truths, "_elastic", lambda self, case, effects: ForceCourse.of(d / ELASTIC_RATE, 0.02 * d**2))
    leg = load_subject(SUBJECTS.find("3"), need_recordings=False)
    return Truths(leg, SUBJECTS.find("3"), read_correction(REFERENCE))
