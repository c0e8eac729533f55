"""Slices of a leg and the distances between contours."""

from __future__ import annotations

import numpy as np
import pytest
from making import circle
from making_legs_3d import round_leg

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape, shape_of_contours
from legfem.geometry.slices import SliceSet, calf_levels, signed_distances, slice_distances


def barrel(shift: float = 0.0) -> LegShape:
    levels = np.arange(0.0, 101.0, 5.0)
    radius = 55 - 0.002 * (levels - 60) ** 2
    parts = {
        "skin": [circle(0, 0, r + shift, 200) for r in radius],
        "hull": [circle(0, 0, r - 7, 200) for r in radius],
        "tibia": [circle(0, -30, 10)] * 21,
    }
    return shape_of_contours(levels, parts, 90)


def test_five_slices_stand_over_3_cm_of_the_largest_girth():
    levels = calf_levels(barrel())
    assert levels == pytest.approx([45, 52.5, 60, 67.5, 75])
    slices = SliceSet.of(barrel(), levels)
    assert np.linalg.norm(slices.outer[0], axis=1) == pytest.approx(55 - 0.002 * 15**2, abs=1e-3)
    assert np.linalg.norm(slices.inner[2], axis=1) == pytest.approx(48, abs=1e-3)


def test_slices_stay_within_the_leg():
    growing = barrel().at_levels(np.arange(0.0, 56.0, 5.0))
    assert calf_levels(growing)[-1] == pytest.approx(50.0), "five millimetres are left to move the leg as a whole"
    with pytest.raises(InputError, match="too short for slices over 30 mm"):
        calf_levels(round_leg(length=20))


def test_distances_are_along_the_normals_and_signed():
    outer, inner = circle(0, 0, 50, 120), circle(0, 0, 47.5, 77)
    # What is met is a polygon of eight corners for each point: its chords lie h^2/(8R) inside.
    chord = 1.05 * 47.5 * (2 * np.pi / (8 * 77)) ** 2 / 8
    assert signed_distances(inner, outer) == pytest.approx(2.5, abs=chord)
    assert signed_distances(outer, inner) == pytest.approx(-2.5, abs=chord)
    moved = circle(1.0, 0, 50, 150)
    angle = 2 * np.pi * np.arange(120) / 120
    # Distance along a ray from the centre to a circle shifted by 1 mm.
    wanted = np.cos(angle) + np.sqrt(50**2 - np.sin(angle) ** 2) - 50
    assert signed_distances(outer, moved) == pytest.approx(wanted, abs=chord)


def test_a_contour_that_no_normal_meets_still_has_a_distance():
    far = circle(200.0, 0, 5, 40)
    distance = signed_distances(circle(0, 0, 50, 60), far)
    assert np.isfinite(distance).all()
    assert distance[30] == pytest.approx(-245, abs=50.1)


def squared(target: SliceSet, simulated: SliceSet) -> float:
    """Return the sum of squared distances over both contours of all slices, mm2."""
    return sum(float((d**2).sum()) for d in slice_distances(target, simulated).values())


def test_squared_distances_go_with_the_square_and_are_nought_at_a_match():
    levels = calf_levels(barrel())
    target, start = (SliceSet.of(barrel(s), levels) for s in (-2.0, 0.0))
    assert squared(target, start) == pytest.approx(5 * 90 * 2.0**2, rel=1e-3)
    assert squared(target, target) == pytest.approx(0, abs=1e-9)
    halfway = SliceSet.of(barrel(-1.0), levels)
    quarter = squared(target, halfway) / squared(target, start)
    assert quarter == pytest.approx(0.25, rel=1e-3)
    distances = slice_distances(target, halfway)
    assert distances["outer"] == pytest.approx(np.ones((5, 90)), abs=1e-3)
    assert distances["inner"] == pytest.approx(np.zeros((5, 90)), abs=1e-6)
    with pytest.raises(ValueError, match="different levels"):
        slice_distances(target, SliceSet.of(barrel(), levels + 1))
