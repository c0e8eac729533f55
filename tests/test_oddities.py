"""Readings that can't have been: a force that is cut off, told from one that only eases."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.data.plausibility import cut_off

DEPTH, NOISE = 20.0, 0.02


def pressed(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a stiffening leg's way (mm) and force (N), at 10 Hz and 0.4 mm/s, and its noise."""
    d = np.linspace(0.0, DEPTH, 500)
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(d))
    return d, 0.15 * d * (1 + 0.03 * d), noise


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("way", [1.0, 3.0, 9.0])
def test_a_force_that_is_cut_off_is_seen_with_the_noise_of_what_comes_after(way, seed):
    d, force, noise = pressed(seed)
    limit = np.interp(DEPTH - way, d, force)
    found = cut_off(d, np.minimum(force, limit) + noise)
    assert 0.5 * way < found < 1.5 * way
    assert cut_off(d, np.minimum(force + noise, limit)) > 0.5 * way, "exactly level, too"


@pytest.mark.parametrize("seed", range(5))
def test_what_eases_drops_or_waves_is_not_cut_off(seed):
    d, force, noise = pressed(seed)
    eased = np.where(d > 15.0, np.interp(15.0, d, force) + 0.3 * (force - force[375]), force)
    dropped = force - 0.3 * (d > 17.0)
    waving = force + 0.1 * np.sin(2 * np.pi * d / 3.0)
    for one in (force, eased, dropped, waving):
        assert cut_off(d, one + noise) == 0.0


def test_noise_alone_and_a_standing_drive_are_not_cut_off():
    _, _, noise = pressed()
    assert cut_off(np.linspace(0.0, DEPTH, 500), noise) == 0.0
    still = np.concatenate([np.linspace(0.0, DEPTH, 50), np.full(450, DEPTH)])
    assert cut_off(still, np.interp(still, [0.0, DEPTH], [0.0, 5.0]) + noise) == 0.0


def test_one_value_to_the_last_digit_is_seen_in_few_samples_too():
    d = np.linspace(0.0, DEPTH, 25)
    force = 0.15 * d * (1 + 0.03 * d)
    assert cut_off(d, np.minimum(force, 0.7 * force[-1])) > 0.1 * DEPTH
    assert cut_off(d, np.minimum(force, force[-2])) == 0.0, "two alike may be chance"
