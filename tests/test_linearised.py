"""A fit's sensitivities, whose columns of first contacts are found all at once."""

from __future__ import annotations

import numpy as np
import pytest
from making_diagnosis import TRUTH, problem_of, ramps, two_rates

from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import prior_of
from legfem.inverse.predictor import Predictor
from legfem.mechanisms import mechanism_named


@pytest.mark.parametrize("recordings", [ramps(), two_rates()], ids=["ramps", "two rates"])
def test_sensitivities_are_those_of_one_parameter_after_the_other(recordings):
    problem, _ = problem_of(recordings, {"support-compliance.compliance": 0.2}, seed=2)
    support = mechanism_named("support-compliance")
    found = fit(problem, [support], TRUTH)
    predict = problem.predictor
    for k, parameter in enumerate(found.parameters):
        prior, h = prior_of(parameter), 1e-4
        ends = [
            predict({**found.values, parameter.name: prior.value_at(found.prior_z[k] + side * h)}, [support])
            for side in (-1, 1)
        ]
        column = (ends[1] - ends[0]) / (2 * h)
        largest = np.abs(column).max()
        np.testing.assert_allclose(found.sensitivities[:, k], column, rtol=5e-3, atol=5e-3 * largest + 1e-9)


def test_derivatives_take_one_prediction_for_all_first_contacts(monkeypatch):
    problem, base = problem_of(two_rates(), seed=2)
    calls = []
    whole = Predictor.__call__

    def counted(self, *given):
        calls.append(1)
        return whole(self, *given)

    monkeypatch.setattr(Predictor, "__call__", counted)
    again = fit(problem, (), base.values)
    trials, evaluations = len(problem.predictor.observed.trials), len(calls)
    assert trials == 6
    # Where it begins and where it ends: the prediction, C10, C20, and all first contacts.
    assert evaluations <= 4 * 4
    np.testing.assert_allclose(again.prior_z, base.prior_z, atol=1e-3)
