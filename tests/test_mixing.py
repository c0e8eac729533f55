"""Updates by the factors of an earlier tangent learn from each other."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from legfem.solve.newton import AndersonMixing


def test_it_solves_linear_equations_in_as_many_updates_as_there_are_distinct_rates():
    generator = np.random.default_rng(0)
    basis = np.linalg.qr(generator.normal(size=(8, 8)))[0]
    matrix = basis @ np.diag([1.3, 1.3, 1.3, 0.8, 0.8, 0.6, 0.6, 0.6]) @ basis.T
    solution = generator.normal(size=8)
    mixing, state = AndersonMixing(MPI.COMM_SELF, 10), np.zeros(8)
    for _ in range(4):
        update = matrix @ (solution - state)
        better = mixing.improved(state, update)
        state = state + (update if better is None else better)
    np.testing.assert_allclose(state, solution, atol=1e-9)
    plain = np.zeros(8)
    for _ in range(4):
        plain = plain + matrix @ (solution - plain)
    assert np.abs(plain - solution).max() > 1e-3


def test_without_a_past_or_without_depth_an_update_stays():
    mixing, none = AndersonMixing(MPI.COMM_SELF, 3), AndersonMixing(MPI.COMM_SELF, 0)
    state, update = np.zeros(2), np.ones(2)
    assert mixing.improved(state, update) is None
    assert mixing.improved(state, update) is None, "the same once more says nothing"
    assert mixing.improved(state + 1.0, 0.5 * update) is not None
    mixing.forget()
    assert mixing.improved(state, update) is None
    for _ in range(3):
        assert none.improved(state, update) is None
