"""Patch test: a state of constant strain is reproduced exactly on an irregular mesh."""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem
from making_mechanics import (
    FORMULATIONS,
    boundary_pinned,
    free_of_contact,
    nodal,
    one_tissue,
    solid,
    solve_with_boundary,
)

from legfem.fem.system import System

GRADIENT = np.array([[0.15, -0.25], [0.10, -0.20]])
C10, D1, C20 = 1.2e-3, 28.0, 0.8e-3


def _irregular(points: np.ndarray) -> np.ndarray:
    """Move the inner nodes of the unit square by up to a third of an element."""
    inside = (np.abs(points - 0.5) < 0.499).all(axis=1)
    shift = np.random.default_rng(5).uniform(-0.065, 0.065, points.shape)
    return points + inside[:, None] * shift


def _patch(formulation: str) -> System:
    edges = np.linspace(0, 1, 6)
    meshed = solid(
        edges, edges, skin=lambda m: np.isclose(m[:, 1], 1), bone=lambda m: np.isclose(m[:, 1], 0), form=_irregular
    )
    free = free_of_contact(meshed, one_tissue(C10, D1, C20), formulation)
    return System(boundary_pinned(free.spaces), free.model, np.array([0.0, 1e3]), free.direction)


def _first_piola() -> np.ndarray:
    """By hand, for the deep tissue's reduced polynomial."""
    F = np.eye(3)
    F[:2, :2] += GRADIENT
    J, I1, inverse = np.linalg.det(F), np.trace(F.T @ F), np.linalg.inv(F).T
    slope = C10 + 2 * C20 * (J ** (-2 / 3) * I1 - 3)
    return 2 * slope * J ** (-2 / 3) * (F - I1 / 3 * inverse) + 2 * (J - 1) / D1 * J * inverse


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_constant_strain_is_reproduced_exactly(formulation):
    system = _patch(formulation)
    outcome = solve_with_boundary(system, lambda x, share: share * x @ GRADIENT.T, wobble=0.002)
    assert outcome.converged, outcome
    nodes, dofs = nodal(system)
    found = system.unknown.x.array[dofs]
    np.testing.assert_allclose(found, nodes @ GRADIENT.T, atol=1e-11)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_boundary_s_forces_are_those_of_the_constant_stress(formulation):
    system = _patch(formulation)
    assert solve_with_boundary(system, lambda x, share: share * x @ GRADIENT.T, wobble=0.002).converged
    forces = fem.Function(system.spaces.space)
    fem.assemble_vector(forces.x.array, system.body.residual)
    nodes, dofs = nodal(system)
    # The mean stress of a body is the sum of f x X over its boundary; its area is 1.
    mean = np.einsum("ni,nj->ij", forces.x.array[dofs], nodes)
    np.testing.assert_allclose(mean, _first_piola()[:2, :2], rtol=1e-9)


def test_the_pressure_of_the_mixed_form_is_constant_and_exact():
    system = _patch("mixed")
    assert solve_with_boundary(system, lambda x, share: share * x @ GRADIENT.T, wobble=0.002).converged
    pressure = system.unknown.sub(1).collapse().x.array
    J = np.linalg.det(np.eye(2) + GRADIENT)
    np.testing.assert_allclose(pressure, 2 * (J - 1) / D1, rtol=1e-9)


def test_a_wrong_boundary_is_noticed():
    """The test above can fail: a bent boundary leaves no constant strain inside."""
    system = _patch("displacement")
    assert solve_with_boundary(system, lambda x, share: share * x @ GRADIENT.T + share * 0.02 * x**2).converged
    nodes, dofs = nodal(system)
    assert np.abs(system.unknown.x.array[dofs] - nodes @ GRADIENT.T).max() > 1e-3
