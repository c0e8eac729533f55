"""What it is worth to measure effects by themselves: as often as drawn readings tell them apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import diagnosed
from scipy.stats import norm

from legfem.inverse.accuracy import Accuracy
from legfem.inverse.mechanism import prior_of
from legfem.inverse.plan import DISTINGUISHED, Candidate, DesignValue, DirectReadings, evaluate_readings
from legfem.inverse.verdict import Diagnosis
from legfem.legs.loading import load_subject
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_sentences import next_experiments
from legfem.report.render import plain_page

TWINS = ("fascia-stiffness", "prestress", "force-drift")
"""The first two are alike in closed form."""


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    made = diagnosed({"fascia-stiffness.factor": 4.0}, asked=TWINS)
    assert made.verdict == "ambiguous"
    return made


@pytest.fixture(scope="module")
def candidates(found) -> list[Candidate]:
    return [Candidate(m.names[0], m.fit, m.posterior.mean, m.posterior.covariance, m.probability) for m in found.models]


@pytest.fixture(scope="module")
def reckoned(candidates) -> list[DesignValue]:
    asked = [m for c in candidates for m in c.fit.mechanisms]
    return evaluate_readings(asked, candidates, Accuracy())


def name_of(one: DesignValue) -> list[str]:
    assert isinstance(one.design, DirectReadings)
    return [m.name for m in one.design.mechanisms]


def test_a_chance_is_how_often_drawn_readings_tell(candidates, reckoned):
    """Readings of the fascia, drawn under one candidate and weighed under both."""
    (one,) = (r for r in reckoned if name_of(r) == ["fascia-stiffness"])
    (stiff,) = (c for c in candidates if c.name == "fascia-stiffness")
    mechanism = stiff.fit.mechanisms[0]
    k = stiff.fit.free.index("fascia-stiffness.factor")
    error = np.hypot(mechanism.measured_sd, 0.25) / prior_of(mechanism.parameters[0]).sd
    spread = np.hypot(error, np.sqrt(stiff.covariance[k, k]))
    drawn = np.random.default_rng(4).standard_normal(4000)
    for true, at, other in ((stiff.name, stiff.mean[k], 0.0), ("prestress", 0.0, stiff.mean[k])):
        sds = (spread, error) if other == 0.0 else (error, spread)
        read = at + sds[0] * drawn
        gains = norm.logpdf(read, at, sds[0]) - norm.logpdf(read, other, sds[1])
        rival = "prestress" if true == stiff.name else stiff.name
        share = float(np.mean(gains > DISTINGUISHED))
        print(true, share, one.chances[true, rival])
        assert one.chances[true, rival] == pytest.approx(share, abs=0.15)


def test_two_readings_are_proposed_only_where_they_tell_more(reckoned):
    single = [one.chance for one in reckoned if len(name_of(one)) == 1]
    double = [one.chance for one in reckoned if len(name_of(one)) == 2]
    assert len(single) == 2 and len(double) <= 1
    assert all(chance > max(single) for chance in double)


def test_what_can_not_be_measured_is_not_proposed(candidates):
    without = replace(candidates[0].fit.mechanisms[0])
    object.__setattr__(without, "measured_sd", None)
    assert evaluate_readings([without], candidates, Accuracy()) == []


def test_a_page_says_what_to_write_into_the_folder(found, reckoned, tmp_path):
    subject = load_subject(write_subject(tmp_path / "leg"), need_recordings=False)
    page = " ".join(plain_page(diagnosis_web_page(found, subject, reckoned), []).split())
    assert "[[measured]]" in page and '"fascia-stiffness"' in page
    assert all(line.lower() in page.lower() for line in next_experiments(found))
    assert "whose chance was not calculated" not in page
