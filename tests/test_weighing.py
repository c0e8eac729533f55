"""What is expected of mechanisms before the recordings."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from legfem.inverse.explain import PRIOR_PAIR, PRIOR_SINGLE, log_prior_of
from legfem.mechanisms import mechanism_named, mechanisms


def test_priors_of_a_kind_add_up_whatever_is_expected():
    expected = {"a": 1.0, "b": 5.0, "c": 0.5, "d": 1.0}
    singles = [np.exp(log_prior_of([name], expected)) for name in expected]
    assert sum(singles) == pytest.approx(PRIOR_SINGLE)
    assert singles[1] == pytest.approx(5 * singles[0])
    pairs = [np.exp(log_prior_of(names, expected)) for names in combinations(expected, 2)]
    assert sum(pairs) == pytest.approx(PRIOR_PAIR)
    assert log_prior_of(["b", "c"], expected) == pytest.approx(log_prior_of(["c", "b"], expected))


def test_fibres_are_expected_of_muscle_more_than_anything_else_is():
    every = [mechanism_named("muscle-fibres"), *mechanisms()]
    assert max(every, key=lambda m: m.expected).name == "muscle-fibres"
    assert log_prior_of(["muscle-fibres"], {m.name: m.expected for m in mechanisms()}) > np.log(
        PRIOR_SINGLE / len(every)
    )
