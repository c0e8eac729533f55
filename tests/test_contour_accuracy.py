"""Errors of smoothed outlines."""

from __future__ import annotations

import numpy as np
import pytest
from making_legs_3d import round_leg
from scipy.ndimage import gaussian_filter1d

from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.imaging.outlines import smoothed
from legfem.stockings.contour_distances import ContourAccuracy


def test_without_smoothing_the_errors_are_the_segmentation_s():
    accuracy = ContourAccuracy(sd=0.3, correlation=5.0)
    assert accuracy.smoothed_sd == pytest.approx(0.3)
    found = accuracy.covariance(np.array([0.0, 5.0]), np.zeros(2))
    np.testing.assert_allclose(found, 0.09 * np.exp([0.0, -0.5]))


def test_smoothed_errors_are_those_of_outlines_that_were_smoothed():
    """Against outlines of a round leg with random errors, put through the smoothing."""
    sd, length, radius, n, levels = 0.3, 5.0, 57.0, 180, 141
    leg = round_leg(radius, 49, 15, 140, n_levels=levels, n_points=n)
    spacing, generator = 2 * np.pi * radius / n, np.random.default_rng(2)
    direction = leg.contours[SKIN] / np.linalg.norm(leg.contours[SKIN], axis=2, keepdims=True)
    errors = []
    for _ in range(6):
        field = generator.standard_normal((levels + 80, n))
        field = gaussian_filter1d(field, length / np.sqrt(2), axis=0)[40:-40]
        field = gaussian_filter1d(field, length / np.sqrt(2) / spacing, axis=1, mode="wrap")
        field *= sd / field.std()
        skin = leg.contours[SKIN] + field[..., None] * direction
        made = smoothed(LegShape(leg.levels, {**leg.contours, SKIN: skin}), 25.0, 30.0, (SKIN,))
        errors.append((np.linalg.norm(made.contours[SKIN], axis=2) - radius)[30:-30])
    error = np.stack(errors)
    accuracy = ContourAccuracy(sd=sd, correlation=length, around=25.0, along=30.0)
    assert accuracy.smoothed_sd == pytest.approx(error.std(), rel=0.05)
    for steps in (3, 6):
        beside = np.mean(error * np.roll(error, steps, axis=2))
        above = np.mean(error[:, steps:] * error[:, :-steps])
        zero = np.zeros(1)
        around = accuracy.covariance(np.array([steps * spacing]), zero)[0]
        along = accuracy.covariance(zero, np.array([float(steps)]))[0]
        assert around == pytest.approx(beside, abs=0.1 * sd**2)
        assert along == pytest.approx(above, abs=0.1 * sd**2)
