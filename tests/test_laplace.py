"""A stocking's pressure by Laplace's law, and the classes."""

from __future__ import annotations

import numpy as np
import pytest
from making_legs_3d import round_leg

from legfem.common.errors import InputError
from legfem.common.units import MPA_PER_MMHG
from legfem.geometry.leg_shape import LegShape, corresponding
from legfem.stockings.fabric import ANKLE_LIMITS, CALF_SHARE, Stocking, fitted_stocking, stocking_load


def _leg(skin: np.ndarray) -> LegShape:
    """A straight leg with a skin of given contour."""
    made = round_leg(57, 30, 12, 40, n_levels=3, n_points=len(skin))
    even = corresponding(skin, len(skin))
    return LegShape(made.levels, {**made.contours, "skin": np.repeat(even[None], 3, axis=0)})


def _skin(leg: LegShape) -> np.ndarray:
    return leg.contours["skin"][1]


def _ellipse(a: float, b: float, n: int = 360) -> np.ndarray:
    t = 2 * np.pi * np.arange(n) / n
    return np.stack([a * np.cos(t), b * np.sin(t)], axis=1)


def test_a_round_leg_bears_tension_over_radius():
    stocking = Stocking(0.3, np.array([0.0]), np.array([250.0]))
    load = stocking_load(round_leg(57, 49, 15, 40, n_levels=4), stocking)
    tension = 0.3 * (2 * np.pi * 57 / 250 - 1)
    np.testing.assert_allclose(load.tension, tension, rtol=1e-3)
    np.testing.assert_allclose(load.pressure, tension / 57, rtol=1e-3)


def test_on_an_ellipse_the_pressure_follows_its_curvature():
    a, b = 62.0, 52.0
    leg = _leg(_ellipse(a, b))
    t = np.arctan2(_skin(leg)[:, 1] / b, _skin(leg)[:, 0] / a)
    curvature = a * b / ((a * np.sin(t)) ** 2 + (b * np.cos(t)) ** 2) ** 1.5
    stocking = Stocking(0.3, np.array([0.0]), np.array([250.0]), bending_length=5.0)
    load = stocking_load(leg, stocking)
    np.testing.assert_allclose(load.curvature[1], curvature, rtol=0.01)


def test_forces_on_a_convex_leg_are_in_balance_and_sum_to_the_tension():
    """The resultant is nothing; over half the leg it is twice the tension."""
    leg = _leg(_ellipse(65.0, 50.0))
    skin = _skin(leg)
    load = stocking_load(leg, Stocking(0.3, np.array([0.0]), np.array([250.0])))
    side = np.roll(skin, -1, axis=0) - np.roll(skin, 1, axis=0)
    normal = 0.5 * np.stack([side[:, 1], -side[:, 0]], axis=1)
    force = load.pressure[1][:, None] * normal
    tension = load.tension[1]
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-3 * tension)
    assert force[skin[:, 0] > 0, 0].sum() == pytest.approx(2 * tension, rel=0.01)


def test_a_furrow_is_spanned_and_bears_nothing():
    t = 2 * np.pi * np.arange(360) / 360
    radius = 57 - 6 * np.exp(-((np.mod(t - np.pi / 2 + np.pi, 2 * np.pi) - np.pi) ** 2) / 0.08)
    leg = _leg(radius[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1))
    skin = _skin(leg)
    t = np.mod(np.arctan2(skin[:, 1], skin[:, 0]), 2 * np.pi)
    load = stocking_load(leg, Stocking(0.3, np.array([0.0]), np.array([250.0])))
    in_furrow = np.abs(t - np.pi / 2) < 0.15
    assert (load.pressure[1][in_furrow] == 0).all()
    assert (load.pressure[1][~in_furrow & (np.abs(t - np.pi / 2) > 0.8)] > 0).all()
    around = 0.5 * np.linalg.norm(np.roll(skin, -1, axis=0) - np.roll(skin, 1, axis=0), axis=1)
    assert load.perimeter[1] < around.sum()
    assert load.pressure[1] @ around == pytest.approx(2 * np.pi * load.tension[1], rel=1e-9)


def test_the_pressure_changes_smoothly_with_the_shape():
    """A search for the pressure of the compressed shape takes derivatives of it."""
    generator = np.random.default_rng(1)
    t = 2 * np.pi * np.arange(240) / 240
    waves = 0.2 * np.cos(np.arange(5, 20)[:, None] * t + generator.uniform(0, 6, (15, 1))).sum(0)
    stocking = Stocking(0.3, np.array([0.0]), np.array([250.0]))
    made = round_leg(57, 30, 12, 40, n_levels=3)

    def pressure(amplitude: float) -> np.ndarray:
        radius = 57 + amplitude * waves
        skin = radius[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)
        return stocking_load(
            LegShape(made.levels, {**made.contours, "skin": np.repeat(skin[None], 3, axis=0)}), stocking
        ).pressure[1]

    half, whole = (pressure(1 + step) - pressure(1.0) for step in (5e-4, 1e-3))
    assert np.abs(whole - 2 * half).max() < 0.1 * np.abs(whole).max()


def test_a_flat_side_bears_nothing_far_from_its_corners():
    s = np.linspace(-40, 40, 81)
    side = np.stack([s, np.full_like(s, -40.0)], axis=1)
    t = np.linspace(0, np.pi, 120)[1:-1]
    dome = 40 * np.stack([np.cos(t), np.sin(t)], axis=1) + [0.0, -40.0]
    made = round_leg(57, 30, 12, 40, n_levels=3)
    skin = np.repeat(np.concatenate([side, dome])[None], 3, axis=0)
    leg = LegShape(made.levels, {**made.contours, "skin": skin})
    load = stocking_load(leg, Stocking(0.3, np.array([0.0]), np.array([200.0])))
    assert (load.pressure[1][:81][np.abs(s) < 20] == 0).all()
    assert (load.pressure[1][81:] > 0).all()


def test_a_stocking_wider_than_the_leg_is_refused():
    with pytest.raises(InputError, match="wider than the leg"):
        stocking_load(round_leg(57, 49, 15, 40), Stocking(0.3, np.array([0.0]), np.array([400.0])))


def test_a_stocking_slack_at_some_levels_presses_elsewhere():
    stocking = Stocking(0.3, np.array([0.0, 40.0]), np.array([300.0, 400.0]))
    load = stocking_load(round_leg(57, 49, 15, 40, n_levels=9), stocking)
    assert load.tension[0] > 0 and load.tension[-1] == 0 and load.strain[-1] < 0


@pytest.mark.parametrize("chosen", list(ANKLE_LIMITS["RAL-GZ 387"]))
def test_a_fitted_stocking_has_its_class_s_mean_pressure(chosen):
    leg = _leg(_ellipse(63.0, 52.0))
    load = stocking_load(leg, fitted_stocking(leg, chosen))
    least, most = ANKLE_LIMITS["RAL-GZ 387"][chosen]
    aimed = CALF_SHARE * (least if np.isinf(most) else np.mean([least, most])) * MPA_PER_MMHG
    assert load.mean_pressure == pytest.approx(aimed, rel=0.005)


def test_a_fabric_too_soft_for_its_class_is_refused():
    with pytest.raises(InputError, match="stretched by"):
        leg = _leg(_ellipse(63.0, 52.0))
        fitted_stocking(leg, "3", stiffness=0.03)
