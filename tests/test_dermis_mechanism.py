"""The dermis as a mechanism: nothing at its null, the membrane's own force beyond, tabulated well.

The membrane's closed forms, tangent and sensitivities are in tests/verification/test_dermis.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import coarse_leg, observations, ramps

from legfem.common.progress import Silent
from legfem.inverse.intervals import NUMERICAL_ERROR
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import CHANGES_AT, rounded
from legfem.inverse.responses import PLAIN, SolvedResponses
from legfem.mechanics.terms.membranes import Dermis
from legfem.mechanisms import Solution, mechanism_named

DEPTH, STIFFNESS = 6.0, 0.08
SOFT = (0.8e-3, 0.9e-3)
"""C10 and C20, kPa."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def variants():
    return coarse_leg()


@pytest.fixture(scope="module")
def solved(variants, tmp_path_factory):
    return SolvedResponses(variants, DEPTH, tmp_path_factory.mktemp("dermis"), {"test": 1})


def test_at_its_null_it_leaves_the_force_of_the_model_without_it(solved):
    change = solved.elastic_change(mechanism_named("dermis").solution({"stiffness": 0.0}), SOFT)["force"]
    np.testing.assert_array_equal(change, 0.0)
    np.testing.assert_allclose(solved.ramp(SOFT, Solution()), solved.ramp(SOFT, PLAIN), rtol=1e-9)


def test_beyond_it_adds_what_the_membrane_does(solved, variants):
    """Against the experiment with the membrane as its only added term."""
    mechanism = mechanism_named("dermis")
    change = solved.elastic_change(mechanism.solution({"stiffness": STIFFNESS}), SOFT)["force"]
    assert np.all(change > 0.02)
    deep = {"deep.C10": SOFT[0], "deep.C20": SOFT[1]}
    force = [
        replace(variants.base, mechanisms=terms).solve(deep, DEPTH).curve(solved.grid)
        for terms in ([], [Dermis(STIFFNESS)])
    ]
    np.testing.assert_allclose(change, force[1] / force[0] - 1, rtol=5e-3)


def test_its_table_stands_in_for_solutions_between_the_strengths(solved):
    """At a stiffness of the table, so that only the strengths are interpolated between."""
    observed, _ = observations(ramps(1))
    mechanism = mechanism_named("dermis")
    library = build_library(solved, observed, [mechanism], 1, Silent(), rounded(SOFT[0]), 0.8)
    assert library.missing == {}
    c10 = library.middle * float(np.exp(CHANGES_AT[1]))
    at = c10, c10 * float(np.expm1(0.8))
    deep = (observed.displacement > 0.3 * DEPTH) & (observed.displacement < DEPTH)
    for stiffness in (0.02, 0.06, 0.2, 0.6, 2.0):
        values = {"stiffness": stiffness}
        tabulated = library.relative_change((mechanism, values), at, observed)[deep]
        true = solved.relative_change((mechanism, values), at, observed)[deep]
        assert np.all(true > 0.01)
        assert np.abs(tabulated - true).max() < NUMERICAL_ERROR, "over the force"
