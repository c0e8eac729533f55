"""A muscle that isn't alike everywhere: against a uniform one, its derivatives, its table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import coarse_leg, observations, ramps

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import rounded
from legfem.inverse.responses import PLAIN, SolvedResponses
from legfem.mechanics.terms.muscle import StiffLump, UnevenStiffness
from legfem.mechanisms import Solution, mechanism_named

DEPTH = 6.0
MUSCLE = (0.8e-3, 0.9e-3)
"""C10 and C20, kPa."""
EVERYWHERE_MM = 1e5
EXCESS = "deep.uneven_stiffness.excess1"


@pytest.fixture(scope="module")
def variants():
    return coarse_leg()


@pytest.fixture(scope="module")
def solved(variants, tmp_path_factory):
    return SolvedResponses(variants, DEPTH, tmp_path_factory.mktemp("uneven"), {"test": 1})


@pytest.fixture(scope="module")
def mechanism():
    return mechanism_named("uneven-muscle")


@pytest.mark.slow
def test_an_excess_everywhere_is_a_stiffer_muscle(variants):
    """But for the contact, whose penalty follows the muscle's C10 and not its excess (0.08 %)."""
    deep = {"deep.C10": MUSCLE[0], "deep.C20": MUSCLE[1]}
    excess = 0.4

    def force(values, *terms):
        return replace(variants.base, mechanisms=terms).solve(values, DEPTH).curve(np.linspace(0.5, DEPTH, 12))

    everywhere = UnevenStiffness("deep", variants.base.tissues.deep, ((0.0, 0.0),), (EVERYWHERE_MM,))
    uneven = force({**deep, EXCESS: excess}, everywhere)
    stiffer = force({name: (1 + excess) * value for name, value in deep.items()})
    np.testing.assert_allclose(uneven, stiffer, rtol=1e-3)


@pytest.mark.slow
def test_at_its_null_it_leaves_the_force_of_the_model_without_it(solved, mechanism):
    values = {"factor": 1.0, "depth": 11.0, "side": -3.0, "radius": 7.0}
    without = solved.ramp(MUSCLE, PLAIN)
    np.testing.assert_allclose(solved.ramp(MUSCLE, mechanism.solution(values)), without, rtol=1e-9)


@pytest.mark.slow
def test_its_derivatives_are_those_of_the_force(solved, mechanism):
    """Central differences of the excess at two of the places."""
    rows = solved.by_derivatives(mechanism, None, MUSCLE)["force"]
    assert rows.shape == (18, len(solved.grid))
    assert np.all(rows > 0), "stiffer anywhere is a greater force"
    step, far = 1e-3, slice(3, None)
    for k in (1, 13):
        name = mechanism.derivatives[k]
        up, down = (solved.ramp(MUSCLE, Solution("uneven", {name: sign * step})) for sign in (1, -1))
        slope = (up - down) / (2 * step) / solved.ramp(MUSCLE, PLAIN)
        np.testing.assert_allclose(rows[k][far], slope[far], rtol=2e-3)


@pytest.mark.slow
def test_its_table_is_near_full_solutions_between_the_places(solved, mechanism):
    """Between places and radii it is an average: within a fifth of one lump there, so that a full solution finds it."""
    observed, _ = observations(ramps(1))
    library = build_library(solved, observed, [mechanism], 1, Silent(), rounded(MUSCLE[0]), 0.8)
    assert library.missing == {}
    at = library.middle, library.middle * float(np.expm1(0.8))
    deep = (observed.displacement > 0.3 * DEPTH) & (observed.displacement < DEPTH)
    for factor, depth, side, radius in (
        (0.5, 8.0, 0.0, 11.0),
        (1.7, 12.0, 7.0, 10.0),
        (3.0, 22.0, -6.0, 11.0),
        (10.0, 15.0, 3.0, 8.0),
        (10.0, 8.0, 4.0, 5.5),
    ):
        values = {"factor": factor, "depth": depth, "side": side, "radius": radius}
        tabulated = library.relative_change((mechanism, values), at, observed)[deep]
        true = solved.relative_change((mechanism, values), at, observed)[deep]
        assert np.abs(true).min() > 0.02
        np.testing.assert_allclose(tabulated, true, rtol=0.2)


@pytest.mark.slow
def test_a_lump_that_is_placed_is_the_lattices_own_there(solved, mechanism):
    for k in (4, 13):
        node = mechanism.nodes[k]
        of_lattice = solved.ramp(MUSCLE, Solution("uneven", {mechanism.derivatives[k]: node["factor"] - 1}))
        np.testing.assert_allclose(solved.ramp(MUSCLE, mechanism.solution(node)), of_lattice, rtol=1e-6)


def test_a_lump_is_shared_out_among_its_neighbours_of_both_radii(mechanism):
    for depth, side, radius in ((0.0, -20.0, 5.5), (6.0, 0.0, 11.0), (21.0, 9.0, 7.0), (36.0, 20.0, 9.0)):
        values = {"factor": 1.5, "depth": depth, "side": side, "radius": radius}
        of_places, of_hard = np.split(mechanism.shares(values), 2)
        assert np.all(of_places >= 0) and np.all(of_hard >= 0)
        assert of_places.sum() == pytest.approx(mechanism.shares({**values, "radius": 11.0})[:18].sum())
        small = of_places[:9].sum() / of_places.sum()
        assert small == pytest.approx(np.log(11.0 / radius) / np.log(2.0))


def test_a_lump_without_a_radius_is_refused(variants):
    muscle = variants.base.tissues.deep
    with pytest.raises(InputError, match="radii"):
        UnevenStiffness("deep", muscle, ((0.0, 0.0), (1.0, 0.0)), (4.0, 0.0))
    with pytest.raises(InputError, match="radius"):
        StiffLump("deep", muscle, (0.0, 0.0), (1.0, 0.0), radius=-1.0)
