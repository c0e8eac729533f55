"""The study of the next test: what it can make, what its legs do then, and how it counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from legfem.correction.choice import REFERENCE
from legfem.correction.tabulated import read_correction
from legfem.plan.designs import designs
from legfem.solve.protocol import Protocol
from legfem.subjects.loading import SUBJECTS, load_subject
from studies.concealed.cases import DEPTH_MM, SealedCase, make_cases
from studies.concealed.truth import ELASTIC_RATE, ForceCourse, Truths
from studies.next_test.page import page, tried_document
from studies.next_test.trying import Outcome, Tried, as_driven, can_be_made

RATE = 0.4


def case_of(name: str, code: str = "legfem", **numbers: float) -> SealedCase:
    first = make_cases(20, 1, 2)[0]
    effects = ((name, tuple(numbers.items())),)
    return replace(first, kind="single", code=code, effects=effects, outside=())  # type: ignore[arg-type]


def made(case: SealedCase) -> set[str]:
    return {d.name for d in designs(20.1, RATE, 25.0) if can_be_made(d, case)}


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
    names = [[d.name for d in designs(20.0, RATE, 20.0, air)] for air in (False, True)]
    assert [any("above the skin" in name for name in some) for some in names] == [True, False]


def test_a_drive_goes_no_deeper_than_the_cases():
    driven = as_driven(Protocol.cycle(DEPTH_MM + 0.2, RATE, 60.0))
    assert max(driven.displacement) == DEPTH_MM
    assert [s.phase for s in driven.segments] == ["loading", "hold", "unloading"]


@pytest.fixture
def truths(monkeypatch: pytest.MonkeyPatch) -> Truths:
    """Return truths of a leg whose force is a square of the depth."""
    d = np.linspace(0.0, DEPTH_MM, 201)
    monkeypatch.setattr(
        Truths, "_elastic",
        lambda self, case, effects: ForceCourse.of(d / ELASTIC_RATE, 0.02 * d**2),
    )  # fmt: skip
    leg = load_subject(SUBJECTS.find("3"), need_recordings=False)
    return Truths(leg, SUBJECTS.find("3"), read_correction(REFERENCE))


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
    assert len(tried_document([tried(1, named, still)])["cases"]) == 1
