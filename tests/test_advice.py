"""Advice comes from what was recorded: nothing is asked for that is there, and a page says where all of it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import press
from making_diagnosed import diagnosed
from making_diagnosis import INSTRUMENT, MADE, observations, ramps, two_rates
from making_mechanics import subject_3
from making_pages import subject_in
from making_results import measured_curve, result
from test_channels_weighed import seen

from legfem.data import Recording
from legfem.geometry.indenter import Site
from legfem.inverse.estimates import Estimate
from legfem.legs.plan import designs
from legfem.mechanisms import mechanism_named
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_headline import headline
from legfem.report.diagnosis_sentences import next_experiments
from legfem.report.kinds import page_of
from legfem.solve.protocol import Protocol

HOLD, RATES = "hold the deepest position for a minute", "press at two rates"
LONGER, HALF = "hold for several minutes", "hold at half the depth too"
RELAXES = {
    "viscoelasticity.ratio": 0.6,
    "viscoelasticity.relaxation_time": 8.0,
    "viscoelasticity.spread": 1.5,
    "viscoelasticity.slow": 0.1,
}


def driven(protocol: Protocol, name: str) -> Recording:
    time = np.arange(0, protocol.duration + 1e-9, 0.1)
    return Recording(time, protocol.displacement_at(time), np.zeros(len(time)), name)


def held_at_two_depths(rate: float, name: str) -> Recording:
    """Return a recording that is held at half the depth, and for seven hundred seconds at the whole."""
    way = np.array([0.0, 10.0, 10.0, 20.0, 20.0, 0.0])
    time = np.cumsum([0.0, 10.0 / rate, 60.0, 10.0 / rate, 700.0, 20.0 / rate])
    return driven(Protocol(tuple(time), tuple(way)), name)


@pytest.mark.parametrize(
    ("recordings", "asked", "unasked"),
    [
        (ramps(3), [HOLD, RATES], [LONGER, HALF]),
        ([driven(Protocol.cycle(20.0, 0.4, hold=20.0), "a")], [HOLD, RATES], []),
        ([driven(Protocol.cycle(20.0, 0.4, hold=62.0), "a")], [RATES], [HOLD]),
        ([driven(Protocol.ramp(20.0, rate), f"{rate}") for rate in (0.4, 2.0)], [HOLD], [RATES]),
        (two_rates(1), [LONGER, HALF], [HOLD, RATES]),
        ([driven(Protocol.cycle(20.0, rate, hold=700.0), f"{rate}") for rate in (0.4, 2.0)], [HALF], [HOLD, LONGER]),
        ([held_at_two_depths(rate, f"{rate}") for rate in (0.4, 2.0)], [], [HOLD, RATES, LONGER, HALF]),
    ],
)
def test_what_would_settle_relaxation_is_what_was_not_recorded(recordings, asked, unasked):
    observed = observations(recordings)[0]
    said = mechanism_named("viscoelasticity").experiment_after(observed)
    assert all(one in said for one in asked) and not any(one in said for one in unasked)
    assert bool(said) is bool(asked)


def test_the_fats_thickness_is_not_asked_for_where_it_was_imaged():
    plain, imaged = observations(ramps(3))[0], seen(ramps(), ["fat_thickness"])
    fat, squeezed = mechanism_named("superficial-stiffness"), mechanism_named("superficial-stiffening")
    assert "image the fat's thickness" in fat.experiment_after(plain)
    assert fat.experiment_after(imaged) == "press gently with a small tip (2 mm deep)"
    assert squeezed.experiment_after(plain) and squeezed.experiment_after(imaged) == ""


def test_deeper_presses_are_asked_for_only_where_others_reach_deeper():
    stiffening = mechanism_named("strain-stiffening")
    shallow, deep = (observations([driven(Protocol.ramp(depth, 0.4), "a")])[0] for depth in (12.0, 29.0))
    assert "press deeper" in stiffening.experiment_after(shallow)
    assert stiffening.experiment_after(deep) == "press with a smaller indenter: larger strains"


def test_a_page_says_so_where_all_that_helps_was_recorded():
    every = [held_at_two_depths(rate, f"rate{rate}") for rate in (0.4, 2.0)]
    found = diagnosed(RELAXES, every, asked=("viscoelasticity", "force-drift"))
    assert found.verdict == "named" and next_experiments(found) == []
    said = dict(headline(found, ()).answers)["What to do"]
    assert said.endswith("was recorded already: no other test that this program knows would help.")
    page = diagnosis_web_page(found, MADE)
    (chapter,) = (one for one in page.chapters if one.title == "What to do next")
    assert [block.text for block in chapter.blocks] == [said]


def test_an_unexplained_misfit_asks_for_no_hold_that_was_made():
    found = diagnosed({}, two_rates(1), bump=2.0, asked=("force-drift",))
    assert found.verdict == "unexplained"
    (said,) = next_experiments(found)
    assert HOLD not in said and RATES not in said and "another day and rig" in said
    assert all(one in next_experiments(diagnosed({}, bump=2.0, asked=("force-drift",)))[0] for one in (HOLD, RATES))


def test_tests_that_are_weighed_leave_out_what_was_recorded():
    def names(recordings) -> str:
        recorded = observations(recordings)[0]
        return " | ".join(one.name for one in designs(20.0, 0.4, 25.0, Site(*subject_3()[:2]), recorded))

    assert "hold the deepest position" in names(ramps(3)) and "two rates" in names(ramps(3))
    one_rate = names([driven(Protocol.cycle(20.0, 0.4, hold=60.0), "a")])
    assert "hold the deepest position" not in one_rate and "two rates" in one_rate
    assert "hold" not in names(two_rates(1)) and "two rates" not in names(two_rates(1))


def weak(found: Estimate) -> Estimate:
    """Return an estimate that is known to a fifth, by its readings."""
    ends = (0.8 * found.value, 1.2 * found.value)
    return replace(
        found, ci95=ends, standard_error=0.1 * found.value, identifiability="weakly identifiable", error_shares={}
    )


@pytest.mark.parametrize(
    ("depth", "trials", "said", "unsaid"),
    [
        (12.0, 1, ["press deeper", "repeat the test"], []),
        (12.0, 3, ["press deeper"], ["repeat"]),
        (26.0, 3, ["recordings have all that would help much", "--prior"], ["press deeper", "repeat"]),
    ],
)
def test_an_identification_asks_for_what_its_recordings_lack(tmp_path, depth, trials, said, unsaid):
    fit = result("reduced-polynomial", measured_curve(trials, depth), subject_in(tmp_path))
    fit = replace(fit, estimates={name: weak(one) for name, one in fit.estimates.items()})
    to_do = dict(page_of([fit]).headline.answers)["What to do"]
    assert to_do.startswith("To know C10 better than to ± 20 %")
    assert all(one in to_do for one in said) and not any(one in to_do for one in unsaid)


@pytest.mark.parametrize(("contact", "said"), [(0.4, "([accuracy] contact_sd_mm)"), (0.1, "--prior")])
def test_what_is_next_is_told_where_recordings_have_all_that_would_help(tmp_path, contact, said):
    fit = result("reduced-polynomial", measured_curve(3, 26.0), subject_in(tmp_path))
    shares = {"recordings": 0.9 - contact, "contact": contact, "shape": 0.1}
    fit = replace(fit, estimates={name: replace(weak(one), error_shares=shares) for name, one in fit.estimates.items()})
    assert said in dict(page_of([fit]).headline.answers)["What to do"]


def test_a_trial_that_cuts_the_others_short_is_named_and_no_deeper_press_is_asked_for(tmp_path):
    presses = [press(air=1.0, depth=depth, seed=k, trial=f"trial{k + 1}") for k, depth in enumerate((30.0, 30.0, 5.0))]
    subject = replace(subject_in(tmp_path), recordings=tuple(presses), instrument=INSTRUMENT)
    fit = result("reduced-polynomial", measured_curve(3, 5.0), subject)
    fit = replace(fit, estimates={name: weak(one) for name, one in fit.estimates.items()})
    to_do = dict(page_of([fit]).headline.answers)["What to do"]
    assert "leave trial3 out, which ends at 5 mm where others reach 30 mm" in to_do and "press deeper" not in to_do
