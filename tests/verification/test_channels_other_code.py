"""Channels beside the force, against another code's leg: felupe's elements, contact and outlines."""

from __future__ import annotations

import pytest

from legfem.legs.experiments import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from studies.other_code.plane_leg import OtherCase, OtherCode

pytestmark = pytest.mark.slow
DEPTH = 9.0


def test_both_codes_have_the_same_channels():
    """felupe's penalty is softer: its cylinder sinks in by some hundredths of a millimetre; its mesh errs by 0.5 %."""
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    other = OtherCode(subject, OtherCase(1.2)).solve(DEPTH, 1.0)
    own = plane_strain_test(subject).solve({"deep.C10": 1.2e-3, "deep.C20": 0.0}, DEPTH).curve
    assert other.reached
    assert own(DEPTH) == pytest.approx(other.force[-1], rel=0.01)
    for name, tolerance in (("lateral_force", 0.02), ("fat_thickness", 0.01), ("muscle_thickness", 0.01)):
        seen, at_rest = other.channels[name], own.channel(name, 0.0)
        assert float(at_rest) == pytest.approx(seen[0], abs=0.03)
        assert own.channel(name, DEPTH) - at_rest == pytest.approx(seen[-1] - seen[0], rel=tolerance), name
