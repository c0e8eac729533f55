"""What is expected of mechanisms before the recordings."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from legfem.inverse.explain import PRIOR_PAIR, PRIOR_SINGLE, ExplanationPriors
from legfem.mechanisms import mechanism_named, mechanisms


def test_priors_of_a_kind_add_up_whatever_is_expected():
    priors = ExplanationPriors({"a": 1.0, "b": 5.0, "c": 0.5, "d": 1.0})
    singles = [np.exp(priors.log_of(name)) for name in priors.expected]
    assert sum(singles) == pytest.approx(PRIOR_SINGLE)
    assert singles[1] == pytest.approx(5 * singles[0])
    pairs = [np.exp(priors.log_of(*names)) for names in combinations(priors.expected, 2)]
    assert sum(pairs) == pytest.approx(PRIOR_PAIR)
    assert priors.log_of("b", "c") == pytest.approx(priors.log_of("c", "b"))


def test_fibres_are_expected_of_muscle_more_than_anything_else_is():
    every = [mechanism_named("muscle-fibres"), *mechanisms()]
    assert max(every, key=lambda m: m.expected).name == "muscle-fibres"
    assert ExplanationPriors.among(mechanisms()).log_of("muscle-fibres") > np.log(PRIOR_SINGLE / len(every))
