"""Stations of a press of any size lie within what was recorded, and lengths of a thin specimen scale with its press."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from legfem.data import Recording, Scales, segment
from legfem.data.contact import LEG
from legfem.data.phases import HOLD
from legfem.data.segmentation import Segmentation
from legfem.inverse.errors import error_model
from legfem.inverse.observations import observe
from legfem.inverse.predictor import onset_prior
from legfem.inverse.trial_noise import Noise

DEPTHS = (0.161, 0.461, 2.36, 24.96)


def pressed(
    depth: float, air: float = 0.0, course: str = "hold", rate: int = 150, of_leg: bool = False
) -> Segmentation:
    """Return a press by a drive that slows down for nothing: up, and held, stepped or drawn back in part."""
    corners = {
        "loading": ([0, 1], [0, 1]),
        "hold": ([0, 1, 11.6], [0, 1, 1]),
        "steps": ([0, 1, 6, 6.3, 11, 11.3, 16], [0, 0.6, 0.6, 0.8, 0.8, 1, 1]),
        "return": ([0, 1, 4, 4.4], [0, 1, 1, 0.607]),
    }[course]
    times, ways = np.array(corners[0]), depth * np.array(corners[1])
    if air:
        times, ways = np.append(0, times + air / depth), np.append(0, ways + air)
    time = np.linspace(0, times[-1], round(rate * times[-1]))
    d = np.interp(time, times, ways)
    force = np.maximum(d - air, 0.0) / depth + 1e-4 * np.random.default_rng(5).normal(size=len(time))
    recording = Recording(time, d, force, f"{depth} {air} {course}")
    return segment(recording, scales=LEG if of_leg else Scales.of_specimen(recording, 1.0))


@pytest.mark.parametrize(
    ("depth", "air", "course"), product(DEPTHS, (0.0, 2.0), ("loading", "hold", "steps", "return"))
)
def test_no_force_is_read_beyond_what_was_recorded(depth: float, air: float, course: str) -> None:
    trial = pressed(depth, air, course)
    observed = observe([trial])
    (stations,) = observed.protocols
    assert len(trial.segments) == {"loading": 1, "hold": 2, "steps": 6, "return": 3}[course]
    for number, part in enumerate(trial.segments):
        here = stations.segment == number
        if part.phase == HOLD:
            since = stations.time[here] - stations.protocol.time[number]
            assert since[-1] <= part.time[-1] - part.time[0]
        else:
            within = stations.displacement[here]
            assert part.displacement.min() - 1e-9 <= within.min() <= within.max() <= part.displacement.max() + 1e-9
    np.testing.assert_allclose(observed.force, observed.displacement / depth, atol=0.02)


def test_steps_of_a_thin_layer_are_no_one_way_to_its_depth() -> None:
    """Of 0.16 mm, with the last steps 0.03 mm each: a leg's 0.3 mm would take all of them for the deepest."""
    ends = observe([pressed(0.161, course="steps")]).protocols[0].protocol.displacement
    np.testing.assert_allclose(ends[1::2], 0.161 * np.array([0.6, 0.8, 1.0]), rtol=0.01)


def test_air_before_a_thin_layer_does_not_count_for_how_short_its_ways_are() -> None:
    trial = pressed(0.2, air=2.0)
    assert trial.contact.displacement == pytest.approx(2.0, abs=0.004)
    assert trial.scales.way == pytest.approx(0.02, rel=0.05)
    assert pressed(24.96, air=2.0, of_leg=True).scales.way == 1.0


@pytest.mark.parametrize("air", [0.0, 15.0])
def test_errors_of_a_press_a_hundred_times_smaller_are_those_of_the_larger_one(air: float) -> None:
    """Lengths over which errors change, and what is known of first contact, go with the press; a leg's stay in mm."""
    large, small = (observe([pressed(depth, depth * air / 10)]) for depth in (10.0, 0.1))
    noise = Noise(1e-3, 2e-3, 0.3, 1e-3, 0.0, "")
    each = [error_model(one, noise, one.values).dense for one in (large, small)]
    np.testing.assert_allclose(each[1], each[0], rtol=0.2, atol=1e-8)
    ratio = onset_prior(large, 0).sd / onset_prior(small, 0).sd
    assert ratio == pytest.approx(100, rel=0.1)
    assert observe([pressed(20.0, of_leg=True)]).way == 1.0
