"""Anderson's acceleration."""

from __future__ import annotations

import numpy as np

from legfem.solve.fixed_point import AndersonMixing


def _count(accelerated: bool) -> int:
    """Evaluations until a linear map of spectral radius 0.95, alternating, has converged."""
    rng = np.random.default_rng(3)
    basis = np.linalg.qr(rng.normal(size=(40, 40)))[0]
    matrix = basis @ np.diag(np.concatenate([[-0.95, 0.8, -0.6, 0.5], np.full(36, 0.1)])) @ basis.T
    constant = rng.normal(size=40)
    x, mixing = np.zeros(40), AndersonMixing()
    for count in range(1, 1000):
        image = matrix @ x + constant
        if np.abs(image - x).max() < 1e-8:
            exact = np.linalg.solve(np.eye(40) - matrix, constant)
            np.testing.assert_allclose(x, exact, atol=1e-6)
            return count
        x = mixing.next(x, image) if accelerated else image
    raise AssertionError("did not converge")


def test_a_map_with_five_eigenvalues_takes_few_evaluations():
    assert _count(accelerated=True) <= 8
    assert _count(accelerated=False) > 100


def test_a_map_that_diverges_by_itself_is_mended():
    x, mixing = np.zeros(2), AndersonMixing()
    for _ in range(6):
        image = np.array([-3.0, 2.0]) * x + [4.0, 1.0]
        x = mixing.next(x, image)
    np.testing.assert_allclose(x, [1.0, -1.0], atol=1e-9)
