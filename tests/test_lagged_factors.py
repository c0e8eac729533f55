"""Factors of an earlier tangent serve later ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from making_legs_3d import round_leg

from legfem.experiments.compression import CompressionSettings, LegCompression
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.solid_leg import mesh_solid_leg
from legfem.solve.linear import LinearSettings
from legfem.solve.settings import NewtonSettings


def test_lagged_factors_lead_to_the_same_state_with_fewer_factorisations():
    mesh = mesh_solid_leg(
        round_leg(50, 42, 14, 40, n_levels=5, n_points=60),
        SolidMeshSettings(skin_size=12, inside_size=14, bone_size=10),
    )
    laws = {"deep": NeoHookean(3e-3, 2.0), "superficial": NeoHookean(8e-3, 2.0)}
    direct = CompressionSettings(
        newton=NewtonSettings(relative_tolerance=1e-10), linear=LinearSettings(solver="direct")
    )
    kept = replace(direct, linear=LinearSettings(solver="direct", tolerance=1e-6, kept_iterations=15))
    states = {}
    for name, settings in (("direct", direct), ("kept", kept)):
        leg = LegCompression(mesh, laws, settings)
        pressure = np.full(len(leg.skin_points), 3e-3)
        first = leg.solve(None, pressure)
        between = leg.solve(None, 1.03 * pressure, (), first)
        # A new stiffness asks for new factors, and so do derivatives.
        second = leg.solve({"deep.C10": 3.1e-3}, 1.05 * pressure, ("deep.C10",), between)
        assert second.report.complete
        states[name] = second
        if name == "kept":
            tangents = sum(s.report.factorisations for s in (first, between, second))
            factors = leg.solver.linear_solver.getPC().getPythonContext().factorisations
            assert factors < tangents
    scale = np.abs(states["direct"].unknown).max()
    np.testing.assert_allclose(states["kept"].unknown, states["direct"].unknown, atol=1e-6 * scale)
    slopes = [states[name].sensitivities["deep.C10"] for name in ("direct", "kept")]
    np.testing.assert_allclose(slopes[1], slopes[0], atol=1e-4 * np.abs(slopes[0]).max())
