"""Intervals from a press after air, of which the model knows the shape, hold as often as they say."""

from functools import cache

import numpy as np
import pytest

from legfem.data import mean_loading_curve, segment_all
from studies.making.recording import INSTRUMENT, Course, LabErrors, record

DEPTH, RATE = 12.0, 0.5
LABS, AIR = 60, LabErrors(gain_sd=0.01, air=4.0)


TISSUES = [((0.9, 2.1), (1.05, 2.0)), ((1.5, 1.5), (1.25, 2.0))]
"""Sizes (N) and powers of fat and muscle."""


def parts(at, powers):
    """Of a fat and a muscle, as closed forms: (n, 2)."""
    return (np.asarray(at)[:, None] / DEPTH) ** np.array(powers)


@cache
def curves(sizes, powers):
    """Mean curves of the labs."""
    time = np.arange(0.0, DEPTH / RATE + 1e-9, 0.1)
    course = Course(time, RATE * time, parts(RATE * time, powers) @ sizes)
    recorded = (record([course] * 3, AIR, np.random.default_rng([48, lab])) for lab in range(LABS))
    return [mean_loading_curve(segment_all(trials, INSTRUMENT)) for trials in recorded]


def departures(sizes, powers, columns):
    """By how many standard errors generalised least squares miss the sizes of the columns, (LABS, columns)."""
    found = []
    for curve in curves(sizes, powers):
        design = parts(curve.displacement, powers) @ columns
        inverse = np.linalg.inv(curve.covariance + curve.open_contact)
        spread = np.linalg.inv(design.T @ inverse @ design)
        missed = spread @ design.T @ inverse @ curve.force - np.linalg.lstsq(columns, sizes)[0]
        found.append(missed / np.sqrt(np.diag(spread)))
    return np.array(found)


@pytest.mark.parametrize(("sizes", "powers"), TISSUES)
@pytest.mark.parametrize("single", [True, False])
def test_intervals_hold_where_contact_is_placed_by_the_readings_that_are_fitted(sizes, powers, single):
    away = departures(sizes, powers, np.array(sizes)[:, None] if single else np.eye(2))
    # A standard deviation from 60 draws errs by 9 %.
    assert away.std(axis=0).max() < 1.25
    assert away.std(axis=0).min() > 0.75
    assert np.abs(away.mean(axis=0)).max() < 0.35


def test_the_errors_of_a_curve_are_those_of_many_labs():
    sizes, powers = TISSUES[0]
    left, stated = [], []
    for curve in curves(sizes, powers):
        at, slope = curve.displacement[:44], curve.slope[:44]
        # What is left when first contact is free: the part of the errors across the slope.
        across = np.eye(44) - np.outer(slope, slope) / (slope @ slope)
        left.append(across @ (curve.force[:44] - parts(at, powers) @ sizes))
        stated.append(np.diag(across @ curve.covariance[:44, :44] @ across))
    ratio = np.std(left, axis=0) / np.sqrt(np.mean(stated, axis=0))
    assert 0.75 < np.sqrt(np.mean(ratio**2)) < 1.25
