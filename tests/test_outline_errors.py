"""Errors of outlines as independent ones."""

from __future__ import annotations

import numpy as np
import pytest
from making_stocking import short_leg

from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import displaced
from legfem.geometry.slices import CONTOURS, SliceSet, distance_rates, slice_distances
from legfem.stockings.contour_distances import HELD, ContourAccuracy, ContourMisfit, amplitudes, error_modes

ACCURACY = ContourAccuracy(sd=0.3, correlation=5.0, around=25.0, along=40.0)


@pytest.fixture(scope="module")
def shape() -> LegShape:
    return short_leg()


def test_modes_add_up_to_the_covariance(shape):
    contours = shape.contours["skin"]
    modes = error_modes(ACCURACY, contours, shape.levels)
    variance = np.sum(modes**2, axis=2)
    assert variance.mean() == pytest.approx(HELD * ACCURACY.smoothed_sd**2, rel=0.02)
    sides = np.linalg.norm(contours - np.roll(contours, 1, axis=1), axis=2).mean()
    found = np.einsum("pk,pk->p", modes[6], np.roll(modes[6], 5, axis=0)).mean()
    there = ACCURACY.covariance(np.array([5 * sides]), np.zeros(1))[0]
    # What is left out are the shortest waves, which lowers the correlation of near points least.
    assert found == pytest.approx(there, abs=0.05 * ACCURACY.smoothed_sd**2)


def test_shares_of_a_mode_are_its_own(shape):
    modes = error_modes(ACCURACY, shape.contours["hull"], shape.levels)
    some = modes[..., :4]
    np.testing.assert_allclose(amplitudes(modes, some), np.eye(modes.shape[-1])[:, :4], atol=1e-9)


def test_errors_as_assumed_are_white_for_the_misfit(shape):
    target = SliceSet.of(shape, shape.levels[4:9])
    misfit = ContourMisfit(target, ACCURACY)
    rng, squares = np.random.default_rng(1), []
    for _ in range(200):
        drawn = []
        for name in CONTOURS:
            modes = error_modes(ACCURACY, target.contours(name), target.levels)
            drawn.append((modes @ rng.standard_normal(modes.shape[-1])).ravel())
        white = misfit.whitened(np.concatenate(drawn))
        squares.append(np.mean(white**2))
    # The model's own errors and what the modes leave out are allowed for besides.
    besides = 1 + (1 - HELD) + (ACCURACY.model_sd / ACCURACY.smoothed_sd) ** 2
    assert np.mean(squares) * besides == pytest.approx(1.0, rel=0.02)


def test_rates_of_distances_are_those_of_differences(shape):
    """Of a motion that turns, slides along and leaves the levels."""
    target = SliceSet.of(shape, shape.levels[4:9])
    moved = {}
    for part in ("skin", "hull"):
        x, y, z = np.moveaxis(shape.points(part), 2, 0)
        angle = np.arctan2(y, x)
        moved[part] = np.stack([np.cos(3 * angle) + 0.02 * z, np.sin(2 * angle), 3 * np.sin(angle)], axis=-1)
    near = displaced(shape, {p: 0.3 * v for p, v in moved.items()}).at_levels(shape.levels[2:11])
    step = 1e-3
    both = [
        slice_distances(
            target, SliceSet.of(displaced(shape, {p: (0.3 + s) * v for p, v in moved.items()}), target.levels)
        )
        for s in (-step, step)
    ]
    expected = np.concatenate([(both[1][n] - both[0][n]).ravel() / (2 * step) for n in CONTOURS])
    rates = {p: v[2:11, ..., None] for p, v in moved.items()}
    found = distance_rates(target, near, rates)[:, 0]
    assert np.abs(found - expected).max() < 0.1 * np.abs(expected).max()
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.03 * np.abs(expected).max()
