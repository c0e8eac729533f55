"""The study of the next test: what it can make, what its legs do then, and how it counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_sealed import square_truths

from legfem.geometry.indenter import Site
from legfem.inverse.plan import DirectReadings
from legfem.legs.plan import designs
from legfem.mechanisms import mechanism_named
from legfem.solve.protocol import Protocol
from studies.concealed.cases import DEPTH_MM, SealedCase, make_cases, sealed_leg
from studies.concealed.truth import Truths
from studies.next_test.__main__ import page
from studies.next_test.trying import Outcome, Tried, as_driven, can_be_made, readings_of, true_strength

RATE = 0.4
LEG = sealed_leg(1, 1)
SITE = Site(LEG.stated.section, LEG.stated.indenter)


def case_of(name: str, code: str = "legfem", **numbers: float) -> SealedCase:
    first = make_cases(20, 1, 2)[0]
    effects = ((name, tuple(numbers.items())),)
    return replace(first, kind="single", code=code, effects=effects, outside=())  # type: ignore[arg-type]


def made(case: SealedCase) -> set[str]:
    return {d.name for d in designs(20.1, RATE, 25.0, SITE) if can_be_made(d, case)}


def test_only_tests_whose_truth_is_known_are_made():
    names = made(case_of("support-compliance", strength=0.3, hardening=0.1))
    assert len(names) == 4
    unknown = ("25 mm deep", "twice the length", "ultrasound", "above the skin")
    assert not any(words in name for name in names for words in unknown)


def test_the_other_codes_friction_is_pressed_without_unloading():
    every = made(case_of("contact-slip", strength=0.1))
    loading = made(case_of("contact-slip", "felupe", strength=0.1))
    assert loading < every
    assert not any("unloading" in name for name in loading)


def test_where_recordings_begin_in_air_it_is_not_proposed_to_begin_there():
    names = [[d.name for d in designs(20.0, RATE, 20.0, SITE, air)] for air in (False, True)]
    assert [any("above the skin" in name for name in some) for some in names] == [True, False]


def test_a_drive_goes_no_deeper_than_the_cases():
    driven = as_driven(Protocol.cycle(DEPTH_MM + 0.2, RATE, 60.0))
    assert max(driven.displacement) == DEPTH_MM
    assert [s.phase for s in driven.segments] == ["loading", "hold", "unloading"]


def read(name: str, case: SealedCase) -> float:
    return true_strength(mechanism_named(name), case, LEG)


def test_what_a_lab_reads_is_what_the_leg_is():
    case = case_of("fascia-stiffness", strength=8.0)
    true, stated = (one.tissues["fascia"].C10 for one in (LEG.true, LEG.stated))
    assert read("fascia-stiffness", case) == pytest.approx(8.0 * true / stated)
    other = read("superficial-stiffness", case)
    assert other != 1.0 and 1 / 1.5 <= other <= 1.5, "a leg isn't quite as it is stated"
    assert read("support-compliance", case) == 0.0
    warm = case_of("force-drift", strength=0.4, time=30.0)
    duration = warm.protocol_of_trials.duration
    assert 0.3 / duration < read("force-drift", warm) < 0.4 / duration
    yielding = case_of("support-compliance", strength=0.3, hardening=0.1)
    assert read("support-compliance", yielding) == pytest.approx(0.15)


def test_readings_err_by_more_than_is_stated_and_only_where_there_is_a_number():
    case = case_of("contact-slip", strength=0.1)
    slip, dermis = (mechanism_named(name) for name in ("contact-slip", "dermis"))
    assert not can_be_made(DirectReadings((slip,)), case)
    assert can_be_made(DirectReadings((dermis,)), case)
    assert not can_be_made(DirectReadings((mechanism_named("viscoelasticity"),)), case)
    generator = np.random.default_rng(3)
    drawn = [readings_of([mechanism_named("indenter-tilt")], case, LEG, generator)[0] for _ in range(400)]
    off = np.array([one.value for one in drawn]) - read("indenter-tilt", case)
    assert drawn[0].sd == mechanism_named("indenter-tilt").measured_sd
    assert 1.1 < np.std(off) / drawn[0].sd < 2.0


@pytest.fixture
def truths(monkeypatch: pytest.MonkeyPatch) -> Truths:
    return square_truths(monkeypatch)


def test_a_leg_that_was_pressed_before_goes_on_where_it_was(truths: Truths):
    case = case_of("preconditioning", strength=0.1, fading=0.5, grading=0.0)
    programme = (Protocol.ramp(10.0, RATE), Protocol.ramp(DEPTH_MM, RATE))
    found = truths.of(case, programme, 3)
    assert found is not None
    for k, (trial, depth) in enumerate(zip(found.trials, (10.0, DEPTH_MM), strict=True), 3):
        assert trial.displacement[-1] == pytest.approx(depth)
        force = 0.02 * depth**2 * (1 + 0.1 * 0.5**k)
        assert trial.force[-1] == pytest.approx(force, rel=1e-3)


def test_without_a_programme_it_is_the_cases_own(truths: Truths):
    case = case_of("force-drift", strength=0.3, time=30.0)
    own = truths.of(case)
    again = truths.of(case, [case.protocol_of_trials] * 3)
    assert own is not None and again is not None
    for one, other in zip(own.trials, again.trials, strict=True):
        np.testing.assert_array_equal(one.force, other.force)


def outcome(design: str, verdict: str, *models: list[str], right: bool = False) -> Outcome:
    return Outcome(design, 0.6, verdict, list(models), right)


def tried(number: int, proposed: Outcome | None, random: Outcome | None) -> Tried:
    before = [["prestress"], ["dermis"]]
    return Tried(number, ["prestress"], "legfem", before, [], [], proposed, random, "it stopped")


def test_the_page_counts_what_ended_and_what_was_right():
    named = outcome("hold", "named", ["prestress"], right=True)
    wrong = outcome("hold", "named", ["dermis"])
    still = outcome("again", "ambiguous", ["prestress"], ["dermis"])
    text = page([tried(1, named, still), tried(2, wrong, wrong), tried(3, None, None)])
    assert "| 2 of 3 |" in text
    lines = [line for line in text.splitlines() if "left one explanation" in line]
    assert ["2/2" in lines[0], "1/2" in lines[1], "1/1" in lines[2]] == [True] * 3
    assert "it stopped" in text
    assert "prestress (right)" in text
