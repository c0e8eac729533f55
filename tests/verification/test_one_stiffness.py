"""A leg has one C10: an identification's is that of the base model of its diagnosis."""

from __future__ import annotations

import pytest

import legfem as lf
from legfem.common.progress import Silent
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", ["1", "2", "3", "4"])
def test_a_diagnosis_begins_from_what_identify_gives(name, tmp_path):
    """Both solve by themselves, in folders of their own."""
    subject = lf.load_subject(name)
    known = Diagnoser(tmp_path, read_correction(REFERENCE), 2).identified(subject, Silent()).fit
    given = lf.identify(subject, jobs=2)[known.law]
    for parameter, one in given.estimates.items():
        assert known.estimates[parameter].value == pytest.approx(one.value, rel=1e-6)
        assert known.estimates[parameter].ci95 == pytest.approx(one.ci95, rel=1e-6)
    assert DEEP_C10 in known.estimates and known.weighting == given.weighting
