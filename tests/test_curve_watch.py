"""How long a step may be for the curve between steps to hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from legfem.solve.stepping import CurveWatch, curve_error

TOLERANCE = 2e-3


def _near_a_bone(d: np.ndarray | float) -> np.ndarray:
    return np.asarray(1 / (8.0 - d) - 1 / 8.0)


def _in_deep_tissue(d: np.ndarray | float) -> np.ndarray:
    return np.asarray(d * np.exp(np.asarray(d) / 20))


def _walked(force: Callable[[float], np.ndarray], depth: float, tolerance: float) -> np.ndarray:
    """Return steps to a depth, as `legfem.solve.stepping` takes them."""
    watch = CurveWatch(tolerance)
    watch.start(0.0, 0.0)
    size, at = 0.2, 0.0
    while at < depth:
        length = min(size, depth - at)
        excess = watch.excess(at + length, float(force(at + length)))
        if excess > 1:
            size = length * watch.factor(excess)
            watch.bends = True
            continue
        at += length
        watch.points.append((at, float(force(at))))
        size = min(1.5, length * 1.6)
        if watch.bends:
            size = min(size, length * watch.factor(excess))
    return np.array([d for d, _ in watch.points])


def _greatest_error(steps: np.ndarray, force: Callable[[np.ndarray], np.ndarray]) -> float:
    at = np.linspace(1.0, steps[-1], 2000)
    return float(np.abs(CubicSpline(steps, force(steps))(at) / force(at) - 1).max())


def test_the_estimate_is_a_cubic_s_error_where_the_fourth_derivative_is_constant():
    d = np.array([1.0, 1.5, 2.0, 3.0, 4.0])
    cubic = np.polynomial.Polynomial.fit(d[1:], d[1:] ** 4, 3)
    at = np.linspace(3.0, 4.0, 11)[1:-1]
    expected = np.abs((cubic(at) - at**4) / np.interp(at, d[-2:], d[-2:] ** 4)).max()
    assert curve_error(d, d**4) == pytest.approx(expected, rel=1e-6)


def test_a_spline_through_the_steps_holds_near_a_bone_and_wouldn_t_without_the_bound():
    assert _greatest_error(_walked(_near_a_bone, 6.4, np.inf), _near_a_bone) > 0.01
    assert _greatest_error(_walked(_near_a_bone, 6.4, TOLERANCE), _near_a_bone) < 0.003


def test_a_gentle_curve_s_steps_stay_as_they_are():
    free, bound = (_walked(_in_deep_tissue, 30.0, t) for t in (np.inf, TOLERANCE))
    np.testing.assert_array_equal(free, bound)


def test_steps_much_closer_together_than_the_new_one_don_t_count_twice():
    """Noise of 1e-5 of the force between steps 0.01 mm apart tells nothing of one of 1 mm."""
    d = np.array([0.5, 1.0, 2.0, 3.0, 4.0, 4.01, 4.02, 4.03])
    noise = 1 + 1e-5 * np.array([0, 0, 0, 0, 1, -1, 1, -1])
    watch = CurveWatch(TOLERANCE)
    watch.start(0.0, 0.0)
    watch.points += zip(d.tolist(), (_in_deep_tissue(d) * noise).tolist(), strict=True)
    assert watch.excess(5.0, float(_in_deep_tissue(5.0))) < 1
    assert watch.excess(5.0, 1.1 * float(_in_deep_tissue(5.0))) > 1


def test_nothing_is_told_of_too_few_steps_or_without_force():
    watch = CurveWatch(TOLERANCE)
    watch.start(0.0, 0.0)
    assert watch.excess(0.2, 1.0) == 0.0
    watch.points += [(k, 0.0) for k in (0.2, 0.4, 0.7, 1.0)]
    assert watch.excess(2.0, 0.0) == 0.0
