"""Recordings that another code made, with their truth: ../shared/foreign, where it is there."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from making import SHARED

from legfem.common.progress import Silent
from legfem.common.units import mpa_to_kpa
from legfem.inverse.accuracy import MeasuredEffect
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject

FOREIGN = SHARED / "foreign"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FOREIGN.is_dir(), reason="the other code's recordings are not there"),
]


@pytest.fixture(scope="module")
def diagnoser(tmp_path_factory):
    return Diagnoser(tmp_path_factory.mktemp("responses"), read_correction(REFERENCE), 2)


def truth(case):
    return json.loads((FOREIGN / "truth.json").read_text())["cases"][f"case-{case}"]


def diagnosed(case, diagnoser):
    return diagnoser.diagnose(load_subject(FOREIGN / f"case-{case}"), Silent())


@pytest.mark.parametrize("case", ["30", "06"])
def test_nothing_is_found_where_nothing_is(case, diagnoser):
    found = diagnosed(case, diagnoser)
    assert found.verdict == "consistent"
    low, high = found.shown_interval(DEEP_C10)
    assert low < truth(case)["true_C10_kPa"] < high


def test_air_is_found_with_the_stiffness(diagnoser):
    found = diagnosed("08", diagnoser)
    assert found.verdict == "consistent"
    for k in range(len(found.observed.trials)):
        assert found.first_contact(k)[0] == pytest.approx(1.2, abs=0.15)
    assert mpa_to_kpa(found.best.value(DEEP_C10)) == pytest.approx(truth("08")["true_C10_kPa"], rel=0.03)


def test_a_stiffer_first_trial_is_named(diagnoser):
    found = diagnosed("16", diagnoser)
    assert found.verdict == "named"
    assert found.models[0].names == ("preconditioning",)
    assert mpa_to_kpa(found.best.value(DEEP_C10)) == pytest.approx(truth("16")["true_C10_kPa"], rel=0.03)


@pytest.mark.parametrize(("case", "most"), [("05", 3), ("02", 3), ("07", 6)])
def test_an_effect_is_among_few_and_the_interval_holds_the_truth(case, most, diagnoser):
    """A stiff fascia under loading alone looks like slip, compressibility, a stiff skin."""
    found, given = diagnosed(case, diagnoser), truth(case)
    names = [model.names for model in found.models]
    assert len(names) <= most
    assert tuple(given["effects"]) in names
    low, high = found.shown_interval(DEEP_C10)
    assert low < given["true_C10_kPa"] < high


def test_soft_bones_take_a_share_of_the_force(diagnoser):
    """The size of what is concealed shows in the base model's bias."""
    found, given = diagnosed("05", diagnoser), truth("05")
    spring = next(e for e in found.explained.every if e.names == ("support-compliance",))
    assert abs(mpa_to_kpa(spring.value(DEEP_C10)) / given["true_C10_kPa"] - 1) < 0.05
    assert np.isfinite(spring.posterior.log_evidence)


@pytest.mark.parametrize(
    ("case", "read"),
    [
        ("02", MeasuredEffect("contact-slip", 0.9, 0.15, "marks on the skin, invented")),
        # Two bones on 5 N/mm each; the fibula's across are 3.5.
        ("05", MeasuredEffect("support-compliance", 0.11, 0.02, "a dial gauge, invented")),
        ("07", MeasuredEffect("fascia-stiffness", 8.0, 3.2, "shear waves, invented")),
    ],
)
def test_a_reading_of_the_effect_ends_the_ambiguity(case, read, diagnoser):
    """The readings are invented, about one standard deviation off; the recordings aren't ours."""
    given = truth(case)
    subject = replace(load_subject(FOREIGN / f"case-{case}"), measured=(read,))
    found = diagnoser.diagnose(subject, Silent())
    assert found.verdict == "named"
    assert found.models[0].names == tuple(given["effects"])
    low, high = found.shown_interval(DEEP_C10)
    assert low < given["true_C10_kPa"] < high
