"""Splines whose grid is made once."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.inverse.emulator import GridSpline

GRID = np.array([0.5, 1.0, 2.0, 3.5, 6.0])
AT = np.array([-1.0, 0.0, 0.2, 1.0, 3.0, 5.9, 6.0, 6.4])


def test_courses_are_those_of_cubic_splines() -> None:
    """Inside, at knots, somewhat beyond; before zero as at zero; all of them at once."""
    knots = np.concatenate([[0.0], GRID])
    courses = np.column_stack([np.exp(-knots), knots**3, 2.0 + np.sin(knots)])
    expected = CubicSpline(knots, courses)(np.maximum(AT, 0.0))
    spline = GridSpline(GRID)
    np.testing.assert_allclose(spline.at(AT)(courses), expected, rtol=1e-12, atol=1e-12)
    one = spline.through(courses[:, 0])
    for derivative in (0, 1):
        exact = CubicSpline(knots, courses[:, 0])(AT, derivative)
        np.testing.assert_allclose(one(AT, derivative), exact, rtol=1e-11, atol=1e-12)


def test_a_course_that_is_not_known_leaves_the_others() -> None:
    """NaN stays in its column."""
    courses = np.column_stack([np.full(6, np.nan), np.arange(6.0)])
    found = GridSpline(GRID).at(AT)(courses)
    assert np.isnan(found[:, 0]).all() and np.isfinite(found[:, 1]).all()
