"""Bodies of two layers with ultrasound: what is drawn and recorded, and the page."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.geometry.section import layer_thicknesses
from studies.cases.layers import (
    BIAS_MM,
    FACTOR,
    THICKNESSES,
    TRIALS,
    USUAL_KPA,
    Identified,
    LayersOutcome,
    drawn,
    page,
    recorded,
    section_of,
)
from studies.cases.outcomes import Interval
from studies.making.pressing import OtherCurve


@pytest.mark.parametrize("body", ["limb", "calf"])
def test_bodies_have_the_layers_that_are_drawn(body):
    for truth in drawn(12, 5, body):
        for name, usual in USUAL_KPA.items():
            assert usual / FACTOR <= truth.true(f"{name}.C10") <= usual * FACTOR
        section = section_of(truth)
        own = layer_thicknesses(section, section.bones["tibia"].mean(axis=0), np.array([0.0, 1.0]))
        if body == "limb":
            assert own["fat_thickness"] == pytest.approx(truth.fat, abs=0.01)
            assert own["muscle_thickness"] == pytest.approx(truth.muscle, abs=0.05)
        else:
            assert 50 < own["muscle_thickness"] < 90


def test_frames_follow_what_the_probe_saw():
    """On each trial's own clock: after its air, less a lag."""
    truth = drawn(1, 5, "limb")[0]
    d = np.linspace(0, 10, 41)
    true = {"fat_thickness": truth.fat - 0.2 * d, "muscle_thickness": truth.muscle - 0.7 * d}
    subject = recorded(truth, OtherCurve(d, 0.3 * d + 0.02 * d**2, True, np.zeros(2), true))
    assert len(subject.recordings) == TRIALS
    for trial, seen in zip(subject.trials, subject.recordings, strict=True):
        assert [channel.name for channel in seen.channels] == list(THICKNESSES)
        for channel in seen.channels:
            depth = np.interp(channel.time, seen.time, seen.displacement) - trial.contact.displacement
            off = channel.values - np.interp(depth, d, true[channel.name])
            assert abs(np.median(off)) < BIAS_MM + 1.0
            assert np.std(off) < 0.6


def test_the_page_counts_what_held():
    truth = drawn(1, 5, "limb")[0]
    muscle = Interval(truth.deep, 0.9 * truth.deep, 1.1 * truth.deep)
    fat = Interval(1.2 * truth.superficial, 1.1 * truth.superficial, 1.3 * truth.superficial)
    one = Identified((muscle, fat), (0.4, 0.6), 0.5)
    text = page([LayersOutcome(truth, 12.0, one, one, 1.0)])
    rows = [line for line in text.splitlines() if line.startswith("| force")]
    assert ["1/1" in row.split("|")[3] for row in rows] == [True, False, True, False]
    assert "20.0 %" in rows[1] and "0.0 %" in rows[0]
