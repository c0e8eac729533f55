"""When something happens during a test: searches begin in every phase, however short it is."""

from __future__ import annotations

import numpy as np
import pytest
from making_diagnosis import SOUGHT, problem_of, two_rates

from legfem.data.phases import LOADING
from legfem.inverse.explain import explain
from legfem.mechanisms import mechanism_named, moments, shortest_programme


def test_searches_begin_in_a_loading_however_long_the_hold_after_it():
    problem, _ = problem_of(two_rates(), {}, seed=3)
    observed = problem.predictor.observed
    found = moments(observed)
    loading = max(observed.time[(observed.phase == LOADING) & (observed.protocol == 0)])
    shares = [onset * shortest_programme(observed) for onset, _ in found]
    assert np.all(np.diff(shares) > 0)
    assert sum(at < loading for at in shares) >= 4
    assert sum(width for _, width in found) == pytest.approx(1.0, abs=0.1)


def test_a_leg_that_moves_for_a_moment_before_a_long_hold_is_found():
    _, base = problem_of(
        two_rates(),
        {"leg-movement.shift": 0.4, "leg-movement.onset": 0.09, "leg-movement.rise": 0.02, "leg-movement.away": 0.03},
        seed=3,
    )
    sought = [*SOUGHT, *map(mechanism_named, ("leg-movement", "muscle-contraction"))]
    explained = explain(base, sought)
    assert explained.statements()[0].names == ("leg-movement",)
    moved = next(e for e in explained.every if e.names == ("leg-movement",))
    assert moved.value("leg-movement.shift") == pytest.approx(0.4, abs=0.15)
