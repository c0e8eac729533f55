"""Pressures at the makers' levels: where they are, their limits, and what their intervals include."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from making_stocking import COARSEST, laws, short_leg

from legfem.common.units import mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.report.stocking_pressures import _about_levels
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import Stocking, StockingLoad, fitted_stocking, stocking_load
from legfem.stockings.levels import (
    LEVELS,
    MESH_SHARE,
    LevelPressure,
    MakersLevels,
    PressureAlong,
    fabrics_for_classes,
    pressures_at_levels,
    rises,
)


def round_calf(radii):
    """Rings of given radii, a level a centimetre."""
    angles = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    leg = short_leg()
    levels = 10.0 * np.arange(len(radii))
    contours = {name: np.array([circle * r * (1.0 if name == SKIN else 0.5) for r in radii]) for name in leg.contours}
    return LegShape(levels, contours)


CALF = round_calf([40, 36, 35, 38, 45, 52, 55, 53, 50])


def test_levels_are_found_by_the_girth_and_stated_ones_count():
    assert MakersLevels().found(CALF) == {"B": (20.0, False), "C": (60.0, False)}
    stated = MakersLevels(heights={"B": 10.0, "B1": 35.0, "D": 200.0})
    assert stated.found(CALF) == {"B": (10.0, True), "B1": (35.0, True), "C": (60.0, False)}
    assert MakersLevels().found(round_calf([40, 45, 50])) == {}


def test_limits_are_the_class_at_the_ankle_and_shares_of_what_is_there():
    makers = MakersLevels("ENV 12718", "1", shares={"C": (50.0, 80.0)})
    assert makers.limits("B", 18.0) == (15.0, 21.0)
    assert MakersLevels("RAL-GZ 387", "1").limits("B", 18.0) == (18.0, 21.0)
    assert makers.limits("C", 20.0) == (10.0, 16.0)
    assert makers.limits("D", 20.0) is None and makers.limits("C", None) is None
    assert MakersLevels().limits("B", 20.0) is None


def test_the_pressure_along_round_rings_is_laplaces_and_errs_by_fabric_and_mesh():
    fabric = Stocking(0.3, CALF.levels[:1], np.array([180.0]))
    load = stocking_load(CALF, fabric)
    accuracy = replace(ContourAccuracy(), tension_sd=0.05, pressure_sd=1e-9)
    along = PressureAlong.of(CALF, load, load, accuracy)
    radii = np.array([40, 36, 35, 38, 45, 52, 55, 53, 50])
    around = 2 * 72 * np.sin(np.pi / 72) * radii
    # Each point bears its turn over half the chord between its neighbours.
    expected = mpa_to_mmhg(0.3 * (around / 180 - 1) * 2 * np.pi / (around * np.cos(np.pi / 72)))
    assert along.mean == pytest.approx(expected, rel=1e-6)
    assert along.sd == pytest.approx(0.05 * expected, rel=1e-6)
    # What the leg gives way by adds the mesh's part.
    on_bare = load.times(1.2)
    wider = PressureAlong.of(CALF, load, on_bare, accuracy)
    assert wider.sd == pytest.approx(np.hypot(0.05, 0.2 * MESH_SHARE) * expected, rel=1e-6)
    assert along.at(25.0)[0] == pytest.approx(np.mean(expected[2:4]), rel=1e-6)


def test_levels_between_which_the_pressure_does_not_decrease_are_named():
    load = stocking_load(CALF, Stocking(0.3, CALF.levels[:1], np.array([180.0])))
    along = PressureAlong.of(CALF, load, load, ContourAccuracy())
    heights = {"B": CALF.levels[1], "B1": CALF.levels[3], "C": CALF.levels[5]}
    for mean, named in (
        ([30.0, 25.0, 20.0], []),
        ([30.0, 18.0, 18.0], [("B1", "C")]),
        ([15.0, 20.0, 18.0], [("B", "B1")]),
    ):
        told = replace(along, mean=np.interp(CALF.levels, list(heights.values()), mean))
        found = rises(list(pressures_at_levels(told, MakersLevels(heights=heights), CALF)))
        assert [(lower.level, upper.level) for lower, upper in found] == named


def test_a_level_is_judged_by_its_interval_beside_the_limits():
    fabric = Stocking(0.3, CALF.levels[:1], np.array([180.0]))
    load = stocking_load(CALF, fabric)
    along = PressureAlong.of(CALF, load, load, replace(ContourAccuracy(), tension_sd=0.05, pressure_sd=1e-9))

    def judged(limits_of_c: tuple[float, float]) -> dict[str, str]:
        makers = MakersLevels("RAL-GZ 387", "4", shares={"C": limits_of_c})
        return {one.level: one.verdict for one in pressures_at_levels(along, makers, CALF)}

    at = {one.level: one for one in pressures_at_levels(along, MakersLevels(), CALF)}
    share = 100 * at["C"].over_pressure_at_B
    assert at["C"].verdict == "no limits" and at["B"].over_pressure_at_B == 1.0
    low, high = at["C"].ci95_mmHg
    assert high - at["C"].mean_pressure_mmHg == pytest.approx(at["C"].mean_pressure_mmHg - low)
    assert 1.96 < (high - at["C"].mean_pressure_mmHg) / along.at(60.0)[1] < 2.5
    assert judged((0.8 * share, 1.2 * share))["C"] == "within"
    assert judged((1.2 * share, 2.0 * share))["C"] == "too low"
    assert judged((0.1 * share, 0.8 * share))["C"] == "too high"
    assert judged((share, 1.2 * share))["C"] == "not certain"


@pytest.mark.parametrize(
    ("pressures", "said"),
    [
        ((20.0, 18.0, 15.0), "it does so at these levels."),
        ((20.0, 20.03, 15.0), "it is the same at B and B1."),
        ((20.0, 21.2, 21.2), "it increases from B to B1 (by 1.2 mmHg) and is the same at B1 and C."),
    ],
)
def test_a_rise_of_nothing_is_no_rise(pressures: tuple[float, ...], said: str) -> None:
    heights = dict(zip(("B", "B1", "C"), (0.0, 100.0, 200.0), strict=True))
    levels = [
        LevelPressure(name, height, True, p, (p - 1, p + 1), None, None)
        for (name, height), p in zip(heights.items(), pressures, strict=True)
    ]
    makers = SimpleNamespace(found=lambda bare: dict.fromkeys(LEVELS), intended_class=None, assumed_fabric=False)
    along = SimpleNamespace(levels=np.array([0.0, 100.0]), mean=np.array([20.0, 18.0]))
    leg = SimpleNamespace(makers=makers, bare=CALF)
    texts = list(_about_levels(SimpleNamespace(pressure_along=along, leg=leg, at_levels=levels)))
    assert any(one.startswith("The pressure should decrease") and one.endswith(f": {said}") for one in texts)


@pytest.mark.parametrize("change", ["stiffness", "size"])
def test_a_leg_in_the_fabric_that_meets_a_class_has_that_class_at_the_ankle(change: str) -> None:
    """Solved again with it, from a fabric of half the pressure: the leg gives way, and the fabric with it."""
    shape = short_leg()
    model = LegModel3D(shape, laws(1.0, 2.0), COARSEST)
    makers = MakersLevels("ENV 12718", "1", heights={"B": 80.0})

    def worn(fabric: Stocking) -> tuple[PressureAlong, StockingLoad]:
        load = EquilibriumSolver(model, fabric).solve().load
        return PressureAlong.of(shape, load, stocking_load(shape, fabric), ContourAccuracy()), load

    first = fitted_stocking(shape, "1")
    along, load = worn(first)
    told = list(fabrics_for_classes(along, load, makers, shape))
    assert [one.compression_class for one in told] == ["A", "1", "2", "3", "4"]
    assert told[-1].tension_factor[1] == np.inf and told[-1].unstretched_mm_at_B[0] == 0.0
    (one,) = (each for each in told if each.compression_class == "2")
    if change == "stiffness":
        chosen = replace(first, stiffness=one.tension_factor[0] * first.stiffness)
    else:
        now = np.interp(80.0, first.levels, first.unstretched)
        chosen = replace(first, unstretched=first.unstretched * one.unstretched_mm_at_B[1] / now)
    # The leg gives way, so that tension in proportion to the pressure alone is too little.
    assert one.tension_factor[0] > 23.0 / along.at(80.0)[0] > 1.5
    assert worn(chosen)[0].at(80.0)[0] == pytest.approx(23.0, rel=0.02)


def test_a_leg_without_an_ankle_has_no_fabric_for_a_class() -> None:
    rings = round_calf([40, 45, 50])
    load = stocking_load(rings, Stocking(0.3, rings.levels[:1], np.array([180.0])))
    along = PressureAlong.of(rings, load, load, ContourAccuracy())
    assert not list(fabrics_for_classes(along, load, MakersLevels(), rings))
