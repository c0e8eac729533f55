"""A leg's stiffness beside people's: what few have is doubted, with the units that explain it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from legfem.inverse.catalogue import parameter_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.population import population_prior
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about_stiffness
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject

TABLE_4 = (2.11, 1.72, 1.21, 0.51)
"""kPa, neo-Hookean: Frauziols et al. (2015)."""
MISTAKES = {
    "lbf": 1 / 4.448,
    "kgf": 1 / 9.807,
    "gf": 1 / 9.807e-3,
    "ozf": 1 / 0.278,
    "mN": 1e3,
    "halved": 0.5,
    "doubled": 2.0,
    "2.2046": 2.2046,
    "1 / 2.2046": 1 / 2.2046,
    "25.4": 25.4,
    "1 / 25.4": 1 / 25.4,
}
"""By what a stiffness is wrong then."""


@pytest.fixture(scope="module")
def leg() -> Subject:
    return load_subject(SUBJECTS.find("3"), need_recordings=False)


def _estimate(kpa: float, error: float = 0.1, name: str = "deep.C10") -> dict[str, Estimate]:
    parameter, value = parameter_of(name, {name: 1e-3}), 1e-3 * kpa
    interval = (value * np.exp(-2 * error), value * np.exp(2 * error))
    return {name: Estimate(parameter, value, error * value, interval, "identifiable", {}, {})}


def _told(leg: Subject, kpa: float, error: float = 0.1) -> list[str]:
    return [str(doubt) for doubt in doubts_about_stiffness(leg, _estimate(kpa, error))]


def _share_doubted(leg: Subject, stiffness: np.ndarray) -> float:
    return float(np.mean([bool(_told(leg, kpa)) for kpa in stiffness]))


def test_people_are_hardly_doubted_and_units_far_off_are(leg: Subject) -> None:
    usual = population_prior("deep.C10")
    drawn = 1e3 * usual.centre * np.exp(usual.sd * np.random.default_rng(0).normal(size=400))
    right = _share_doubted(leg, drawn)
    shares = {name: _share_doubted(leg, drawn * by) for name, by in MISTAKES.items()}
    print(f"right {right:.3f}", {name: f"{share:.2f}" for name, share in shares.items()})
    assert right <= 0.05
    assert all(shares[name] > 0.9 for name in ("kgf", "gf", "mN", "25.4", "1 / 25.4"))
    # People differ as much as that.
    assert all(shares[name] < 0.3 for name in ("halved", "doubled"))


def test_published_legs_are_not_doubted_but_for_the_softest(leg: Subject) -> None:
    assert [bool(_told(leg, kpa)) for kpa in TABLE_4] == [False, False, False, True]


def test_a_doubt_names_the_units_that_would_explain_it(leg: Subject) -> None:
    (text,) = _told(leg, 2.2 / 9.807)
    assert "c10_deep" in text and "force_N in kgf, it would be some 2.2 kPa" in text
    (text,) = _told(leg, 2.2 / 9.807e-3)
    assert "force_N in gf, it would be some 2.2 kPa" in text


def test_what_is_open_or_confirmed_is_not_doubted(leg: Subject) -> None:
    assert _told(leg, 0.3) and not _told(leg, 0.3, error=1.0)
    assert not _told(replace(leg, confirmed=("c10_deep",)), 0.3)


def test_a_shin_is_compared_with_shins(leg: Subject) -> None:
    tibia, skin = (leg.section.polygon(part).centroid for part in ("tibia", "skin"))
    inward = np.degrees(np.arctan2(skin.y - tibia.y, skin.x - tibia.x))
    shin = replace(leg, indenter=replace(leg.indenter, direction_deg=float(inward)))
    assert not _told(shin, 12.0) and "shin" in _told(shin, 1.0)[0]
    assert "calf" in _told(leg, 12.0)[0]
