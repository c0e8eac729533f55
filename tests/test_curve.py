"""The force-displacement curve and its measures."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.solve.path import ForceCurve


def _curve(force, depth: float = 30.0) -> ForceCurve:
    at = np.concatenate([np.linspace(0, 2, 9), np.linspace(3, depth, 28)])
    return ForceCurve(at, force(at), {"deep.C10": 2 * force(at)})


@pytest.mark.parametrize("window", [(0.0, 5.0), (5.0, 20.0), (20.0, 30.0)])
def test_slope_and_curvature_of_a_parabola(window):
    curve = _curve(lambda d: 0.3 * d + 0.02 * d**2)
    assert curve.mean_slope(*window) == pytest.approx(0.3 + 0.02 * sum(window), rel=1e-10)
    assert curve.mean_curvature(*window) == pytest.approx(0.04, rel=1e-9)


def test_mean_curvature_is_the_least_squares_parabola_s():
    curve = _curve(lambda d: 1e-3 * d**3)
    at = np.linspace(5, 20, 20001)
    parabola = np.polyfit(at, curve(at), 2)
    assert curve.mean_curvature(5, 20) == pytest.approx(2 * parabola[0], rel=1e-3)


def test_values_between_the_steps():
    curve = _curve(lambda d: 0.3 * d + 0.02 * d**2)
    at = np.array([-1.0, 0.0, 0.77, 13.3, 30.0])
    np.testing.assert_allclose(curve(at), np.where(at > 0, 0.3 * at + 0.02 * at**2, 0), atol=1e-12)
    np.testing.assert_allclose(curve.stiffness(at[2:]), 0.3 + 0.04 * at[2:], rtol=1e-9)
    np.testing.assert_allclose(curve.sensitivity("deep.C10", at), 2 * curve(at), atol=1e-12)
    assert curve.depth == 30.0
