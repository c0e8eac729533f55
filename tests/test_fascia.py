"""The sheet round the deep tissue of a leg in 3D."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem

from legfem.experiments.compression import LegCompression
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Fascia
from legfem.mechanics.terms.fascia import membrane_invariant
from legfem.meshing.solid_leg import SolidMeshSettings, mesh_solid_leg
from studies.legs.parametric_leg import round_leg

STIFFNESS = 0.2
"""N/mm."""


@pytest.fixture(scope="module")
def leg() -> LegCompression:
    shape = round_leg(50.0, 42.0, 12.0, 20.0)
    law = NeoHookean(3e-3, 2.0)
    mesh = mesh_solid_leg(shape, SolidMeshSettings(skin_size=9, inside_size=12, bone_size=8))
    return LegCompression(mesh, {"deep": law, "superficial": law}, None, (Fascia(),))


def stretched(leg: LegCompression, around: float, along: float) -> None:
    moved = fem.Function(leg.spaces.displacement_space)
    moved.interpolate(
        lambda x: np.stack([(around - 1) * x[0], (around - 1) * x[1], (along - 1) * x[2]])
    )
    leg.system.unknown.x.array[:] = 0.0
    leg.system.unknown.x.array[leg.spaces.displacement_dofs] = moved.x.array


def test_energy_is_that_of_a_stretched_sheet(leg):
    """Of a tube that widens and lengthens: stretches around, along, and through its thickness."""
    body, around, along = leg.system.body.domain, 1.08, 0.95
    area = fem.assemble_scalar(fem.form(1.0 * body.hull))
    assert area == pytest.approx(2 * np.pi * 42.0 * 20.0, rel=0.01)
    stretched(leg, around, along)
    found = fem.assemble_scalar(fem.form(membrane_invariant(body) * body.hull)) / area
    expected = around**2 + along**2 + 1 / (around * along) ** 2 - 3
    # The facets of the tube are flat, and their edges run at all angles.
    assert found == pytest.approx(expected, rel=0.01)


def test_force_is_what_the_energy_changes_by_and_vanishes_without_stiffness(leg):
    body = leg.system.body.domain
    stretched(leg, 1.05, 1.0)
    state = leg.system.unknown.x.array.copy()
    term = Fascia()
    force = fem.assemble_vector(fem.form(term.residual(body, {}))).array
    assert np.abs(force).max() == 0.0
    leg.system.set_parameters({"fascia.membrane.stiffness": STIFFNESS})
    force = fem.assemble_vector(fem.form(term.residual(body, {}))).array.copy()
    energy = fem.form(0.5 * STIFFNESS * membrane_invariant(body) * body.hull)
    rng, step = np.random.default_rng(0), 1e-4
    direction = np.zeros_like(state)
    direction[leg.spaces.displacement_dofs] = rng.standard_normal(len(leg.spaces.displacement_dofs))
    both = []
    for sign in (1, -1):
        leg.system.unknown.x.array[:] = state + sign * step * direction
        both.append(fem.assemble_scalar(energy))
    leg.system.set_parameters({"fascia.membrane.stiffness": 0.0})
    assert force @ direction == pytest.approx((both[0] - both[1]) / (2 * step), rel=1e-5)


def test_tangent_is_the_force_s_derivative(leg):
    body, term = leg.system.body.domain, Fascia()
    leg.system.set_parameters({"fascia.membrane.stiffness": STIFFNESS})
    stretched(leg, 1.04, 0.98)
    state = leg.system.unknown.x.array.copy()
    residual = term.residual(body, {})
    trial = ufl.TrialFunction(leg.spaces.space)
    tangent = fem.assemble_matrix(fem.form(ufl.derivative(residual, body.unknown, trial)))
    rng, step = np.random.default_rng(1), 1e-4
    direction = rng.standard_normal(len(state))
    sides = []
    for sign in (1, -1):
        leg.system.unknown.x.array[:] = state + sign * step * direction
        sides.append(fem.assemble_vector(fem.form(residual)).array.copy())
    leg.system.set_parameters({"fascia.membrane.stiffness": 0.0})
    expected = (sides[0] - sides[1]) / (2 * step)
    found = tangent.to_scipy() @ direction
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
