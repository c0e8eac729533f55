"""Locking: a thick-walled cylinder in plane strain, widened to twice its bore's area and more.

The reference is the radial equilibrium of the compressible law, integrated by a boundary-value
solver; in the incompressible limit it meets the closed form of the neo-Hookean cylinder.
"""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem
from making_mechanics import FORMULATIONS, free_of_contact, nodal, one_tissue, ring, solve_with_boundary
from scipy.integrate import solve_bvp

from legfem.fem.system import System
from legfem.solve.settings import NewtonSettings

INNER, OUTER, WIDENED = 10.0, 25.0, 14.0
C10 = 1e-3
MU = 2 * C10
# Forces are about 1e-2 N/mm; close to incompressibility rounding alone leaves 1e-13.
ROUNDED = NewtonSettings(absolute_tolerance=1e-11)


def _compressibility(poisson: float) -> float:
    """D1 = 2 / K."""
    return 2 / (MU * 2 * (1 + poisson) / (3 * (1 - 2 * poisson)))


def _closed_form() -> float:
    """Inner pressure (MPa) of the incompressible neo-Hookean cylinder, free outside."""
    c = WIDENED**2 - INNER**2
    a, b = INNER**2 + c, OUTER**2 + c
    return MU * (np.log(OUTER / INNER) - 0.5 * (np.log(b / a) + c / b - c / a))


def _radial_stresses(r: np.ndarray, dr: np.ndarray, R: np.ndarray, D1: float):
    """Return P_rr and P_tt of U = C10 (I1bar - 3) + (J - 1)^2 / D1 by hand."""
    along, around = dr, r / R
    J = along * around
    I1 = along**2 + around**2 + 1
    volumetric = 2 * (J - 1) / D1 * J
    return tuple(
        2 * C10 * J ** (-2 / 3) * (stretch - I1 / (3 * stretch)) + volumetric / stretch for stretch in (along, around)
    )


def _reference(poisson: float) -> float:
    """Inner pressure (MPa, per deformed area) of the compressible cylinder."""
    D1 = _compressibility(poisson)

    def stretch(P, r, R):
        """Invert P_rr for the radial stretch by Newton's method."""
        dr = R / r
        for _ in range(60):
            value = _radial_stresses(r, dr, R, D1)[0] - P
            slope = (_radial_stresses(r, dr * (1 + 1e-7), R, D1)[0] - P - value) / (1e-7 * dr)
            dr = dr - value / slope
            if np.max(np.abs(value)) < 1e-14 * MU:
                break
        return dr

    def equations(R, y):
        r, P = y
        dr = stretch(P, r, R)
        return np.vstack([dr, (_radial_stresses(r, dr, R, D1)[1] - P) / R])

    R = np.linspace(INNER, OUTER, 60)
    guess = np.sqrt(R**2 + WIDENED**2 - INNER**2)
    solved = solve_bvp(
        equations,
        lambda at_inner, at_outer: np.array([at_inner[0] - WIDENED, at_outer[1]]),
        R,
        np.vstack([guess, -_closed_form() * (OUTER - R) / (OUTER - INNER)]),
        tol=1e-8,
        max_nodes=20000,
    )
    assert solved.success, solved.message
    return -float(solved.y[1, 0]) * INNER / WIDENED


def _widened(formulation: str, poisson: float, around: int, across: int) -> System:
    tissues = one_tissue(C10, _compressibility(poisson))
    system = free_of_contact(ring(INNER, OUTER, around, across), tissues, formulation)

    def widening(x: np.ndarray, share: float) -> np.ndarray:
        R = np.linalg.norm(x, axis=1)[:, None]
        return x / R * (np.sqrt(R**2 + share * (WIDENED**2 - INNER**2)) - R)

    outcome = solve_with_boundary(system, widening, 8, newton=ROUNDED)
    assert outcome.converged, (poisson, outcome)
    return system


def _inner_pressure(system: System) -> float:
    """Return the bore's pressure (MPa) from the nodal forces."""
    forces = fem.Function(system.spaces.space)
    fem.assemble_vector(forces.x.array, system.body.residual)
    nodes, dofs = nodal(system)
    pinned = np.isin(dofs[:, 0], system.spaces.pinned)
    outward = nodes[pinned] / np.linalg.norm(nodes[pinned], axis=1)[:, None]
    return float((forces.x.array[dofs[pinned]] * outward).sum() / (2 * np.pi * WIDENED))


def _error(formulation: str, poisson: float, around: int = 48, across: int = 4) -> float:
    found = _inner_pressure(_widened(formulation, poisson, around, across))
    return found / _reference(poisson) - 1


def test_the_reference_meets_the_closed_form():
    assert _reference(0.4999999) == pytest.approx(_closed_form(), rel=1e-5)
    assert _reference(0.493) == pytest.approx(_closed_form(), rel=0.03)


def test_the_mixed_form_does_not_lock():
    """Ten times nearer to incompressibility, the same error."""
    errors = [_error("mixed", poisson, around=24, across=2) for poisson in (0.493, 0.499, 0.4999)]
    assert max(np.abs(errors)) < 2e-3
    assert np.ptp(errors) < 5e-5


def test_the_mixed_form_converges_close_to_incompressibility():
    """The pressure is a mean over the boundary, so its order is twice the displacement's."""
    coarse, fine = _error("mixed", 0.4999, 24, 2), _error("mixed", 0.4999, 48, 4)
    assert np.log2(coarse / fine) > 3.8


def test_quadratic_displacements_suffice_for_the_paper_s_tissues_but_lock_beyond():
    """At 0.493 P2 is right to 0.5 % on a mesh of two elements; at 0.4999 it is 7 % too stiff."""
    assert abs(_error("displacement", 0.493, around=24, across=2)) < 5e-3
    assert _error("displacement", 0.4999, around=24, across=2) > 0.04


@pytest.mark.slow
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_errors_over_poisson_s_ratio_and_mesh(formulation):
    for around, across, bound in ((24, 2, 2e-3), (48, 4, 1.2e-4), (96, 8, 8e-6)):
        errors = [_error(formulation, nu, around, across) for nu in (0.45, 0.493, 0.499, 0.4999)]
        print(formulation, around, [f"{error:.2e}" for error in errors])
        if formulation == "mixed":
            assert max(np.abs(errors)) < bound
        else:
            assert errors[0] < 2 * bound < 4 * bound < errors[-1]
