"""Errors of the pressures at the veins against equilibria that are found anew."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from making_stocking import COARSE, laws, short_leg

from legfem.common.progress import Silent
from legfem.geometry.slices import calf_levels
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.equilibrium import PARAMETERS, EquilibriumSettings, EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import fitted_stocking
from legfem.stockings.identification import identify_in_stocking
from legfem.stockings.leg import StockingLeg, default_veins
from legfem.stockings.pressures import MESH_ERROR, PressureProbe, vein_pressure_sd

KPA = (2.6, 6.0)


@pytest.fixture(scope="module")
def leg():
    bare = short_leg()
    return EquilibriumSolver(
        LegModel3D(bare, laws(*KPA), COARSE),
        fitted_stocking(bare, "2"),
        EquilibriumSettings(tolerance=2e-4, max_states=20),
    )


@pytest.mark.slow
def test_they_are_those_of_the_leg_solved_anew(leg):
    """With muscle 20 % stiffer and softer, and with a pressure 5 % higher all round."""
    values = dict(zip(PARAMETERS, (1e-3 * k for k in KPA), strict=True))
    probe = PressureProbe(leg.model.compression)
    veins = default_veins(leg.model.shape, 80.0)
    points = np.array([vein.position for vein in veins])

    worn = leg.solve(values)

    def at_veins(muscle: float, error: float = 0.0):
        other = {**values, PARAMETERS[0]: muscle * values[PARAMETERS[0]]}
        return probe.at(points, leg.solve(other, start=worn, error=error).state)

    middle = at_veins(1.0)

    def known_to(covariance, pressure_sd):
        near = leg.solve(values, PARAMETERS, worn)
        sd = vein_pressure_sd(leg, near, probe, veins, values, covariance, pressure_sd)
        return np.sqrt(np.maximum(sd**2 - (MESH_ERROR * middle) ** 2, 0.0))

    stiffness = np.abs(at_veins(math.exp(0.2)) - at_veins(math.exp(-0.2))) / 0.4
    got = known_to(np.diag([1.0, 0.0]), 0.0)
    # An equilibrium is found to 0.02 % of its pressure.
    assert got == pytest.approx(stiffness, rel=0.1, abs=2e-3 * middle.max())
    # Sectors sum to one, so that their pressures' slopes sum to that of the whole.
    whole = np.abs(at_veins(1.0, 0.05) - middle) / 0.05
    sd = known_to(np.zeros((2, 2)), 1.0)
    assert (sd > 0.9 * whole / math.sqrt(8)).all() and (sd < 1.1 * whole).all()
    both = known_to(np.diag([1.0, 0.0]), 1.0)
    np.testing.assert_allclose(both, np.hypot(got, sd), rtol=0.01)


@pytest.mark.slow
def test_the_fabrics_error_is_in_the_intervals_of_a_leg_whose_stiffness_was_given():
    """Against a run with a fabric that is 5 % stiffer, which pulls that much more."""
    bare = short_leg()
    fabric = fitted_stocking(bare, "2")
    exact, stated = ContourAccuracy(), replace(ContourAccuracy(), tension_sd=0.1)

    def run(accuracy, stocking):
        leg = StockingLeg(
            "short", "a leg", "simulated", bare, bare, None, None, stocking, accuracy, laws(*KPA), True, "held",
            calf_levels(bare), default_veins(bare, 80.0),
        )  # fmt: skip
        return identify_in_stocking(leg, Silent(), mesh=COARSE).details.pressures

    without, known, more = run(exact, fabric), run(stated, fabric), run(exact, replace(fabric, stiffness=1.05 * 0.3))
    got = np.sqrt(np.square(known.at_veins_sd) - np.square(without.at_veins_sd))
    assert fabric.stiffness == 0.3
    assert got == pytest.approx(0.1 * (np.array(more.at_veins) - without.at_veins) / 0.05, rel=0.1)


def test_no_veins_have_no_errors(leg):
    assert len(vein_pressure_sd(leg, None, None, (), {}, np.zeros((2, 2)), 0.01)) == 0
