"""The sheet round the deep tissue of a leg in 3D."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from making_legs_3d import round_leg
from scipy.optimize import minimize_scalar

from legfem.experiments.compression import LegCompression
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Fascia
from legfem.mechanics.terms.membranes import face_strain, free_volume_ratio
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.solid_leg import mesh_solid_leg

STIFFNESS = 0.2
"""N/mm."""
COMPRESSIBILITY = 2.25
VALUES = {"fascia.membrane.stiffness": STIFFNESS, "fascia.membrane.compressibility": COMPRESSIBILITY}


@pytest.fixture(scope="module")
def leg() -> LegCompression:
    shape = round_leg(50.0, 42.0, 12.0, 20.0)
    law = NeoHookean(3e-3, 2.0)
    mesh = mesh_solid_leg(shape, SolidMeshSettings(skin_size=9, inside_size=12, bone_size=8))
    return LegCompression(mesh, {"deep": law, "superficial": law}, None, (Fascia(),))


def stretched(leg: LegCompression, around: float, along: float) -> None:
    moved = fem.Function(leg.spaces.displacement_space)
    moved.interpolate(lambda x: np.stack([(around - 1) * x[0], (around - 1) * x[1], (along - 1) * x[2]]))
    leg.system.unknown.x.array[:] = 0.0
    leg.system.unknown.x.array[leg.spaces.displacement_dofs] = moved.x.array


def least_energy(trace: float, area2: float) -> tuple[float, float]:
    """Return the least energy over k / 2 of a layer with a face's strain, and J there."""

    def energy(J: float) -> float:
        return J ** (-2 / 3) * (trace + J**2 / area2) - 3 + (J - 1) ** 2 / COMPRESSIBILITY

    found = minimize_scalar(energy, bounds=(0.3, 2.0), method="bounded", options={"xatol": 1e-10})
    return float(found.fun), float(found.x)


@pytest.mark.parametrize("stretches", [(1.05, 1.0), (1.2, 1.1), (0.9, 1.1), (0.8, 0.8), (1.3, 0.7)])
def test_nothing_presses_across_the_thickness(stretches):
    a, b = stretches
    trace, area2 = a**2 + b**2, (a * b) ** 2
    J = free_volume_ratio(trace, area2, COMPRESSIBILITY)
    assert pytest.approx(least_energy(trace, area2)[1], abs=1e-6) == J
    assert free_volume_ratio(trace, area2, 0.0) == 1.0


def test_a_face_s_strain_is_that_of_a_stretched_sheet(leg):
    """Of a tube that widens and lengthens: stretches around and along."""
    body, around, along = leg.system.body.domain, 1.08, 0.95
    area = fem.assemble_scalar(fem.form(1.0 * body.hull))
    assert area == pytest.approx(2 * np.pi * 42.0 * 20.0, rel=0.01)
    stretched(leg, around, along)
    trace, area2 = (fem.assemble_scalar(fem.form(x * body.hull)) / area for x in face_strain(body))
    # The facets of the tube are flat, and their edges run at all angles.
    assert trace == pytest.approx(around**2 + along**2, rel=0.01)
    assert area2 == pytest.approx((around * along) ** 2, rel=0.01)


@pytest.mark.parametrize("compressibility", [0.0, COMPRESSIBILITY])
def test_force_is_what_the_energy_changes_by_and_vanishes_without_stiffness(leg, compressibility):
    body = leg.system.body.domain
    stretched(leg, 1.05, 1.0)
    state = leg.system.unknown.x.array.copy()
    term = Fascia()
    leg.system.set_parameters({**VALUES, "fascia.membrane.stiffness": 0.0})
    force = fem.assemble_vector(fem.form(term.residual(body, {}))).array
    assert np.abs(force).max() == 0.0
    leg.system.set_parameters({**VALUES, "fascia.membrane.compressibility": compressibility})
    force = fem.assemble_vector(fem.form(term.residual(body, {}))).array.copy()
    trace, area2 = face_strain(body)
    J = free_volume_ratio(trace, area2, compressibility)
    density = J ** (-2 / 3) * (trace + J**2 / area2)
    if compressibility:
        density += (J - 1) ** 2 / compressibility
    energy = fem.form(0.5 * STIFFNESS * density * body.hull)
    rng, step = np.random.default_rng(0), 1e-4
    direction = np.zeros_like(state)
    direction[leg.spaces.displacement_dofs] = rng.standard_normal(len(leg.spaces.displacement_dofs))
    both = []
    for sign in (1, -1):
        leg.system.unknown.x.array[:] = state + sign * step * direction
        both.append(fem.assemble_scalar(energy))
    leg.system.set_parameters(dict.fromkeys(VALUES, 0.0))
    assert force @ direction == pytest.approx((both[0] - both[1]) / (2 * step), rel=1e-5)


def test_tangent_is_the_force_s_derivative(leg):
    body, term = leg.system.body.domain, Fascia()
    leg.system.set_parameters(VALUES)
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
    leg.system.set_parameters(dict.fromkeys(VALUES, 0.0))
    expected = (sides[0] - sides[1]) / (2 * step)
    found = tangent.to_scipy() @ direction
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
