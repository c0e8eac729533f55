"""Fibres against closed forms of sheared and stretched cubes, and linear elasticity's moduli."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import fem, mesh
from making_mechanics import block, one_tissue, pressed_block
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.model import LegModel
from legfem.mechanics.terms import Fibres, SkinPressure, Tissue
from legfem.meshing.section import BONE, DEEP, SKIN
from legfem.study.correction.cases import solve_case
from studies.fibres.bare import case_of

C10, D1 = 1e-3, 0.02
MU_T = 2 * C10
SHEAR, EXTENSION = 3e-3, 7e-3


def cube(*fibres: Fibres) -> System:
    made = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    cells = mesh.meshtags(made, 3, np.arange(6, dtype=np.int32), np.full(6, DEEP, np.int32))
    ends = [mesh.locate_entities_boundary(made, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (0, 1)]
    facets = np.concatenate(ends)
    tags = np.repeat([BONE, SKIN], [len(end) for end in ends]).astype(np.int32)
    order = np.argsort(facets)
    marked = mesh.meshtags(made, 2, facets[order], tags[order])
    spaces = build_spaces(made, cells, marked, "displacement", 1, {"deep": DEEP})
    return System(spaces, LegModel((Tissue("deep", NeoHookean(C10, D1)), SkinPressure(), *fibres)))


def stress(system: System, F: np.ndarray, term: str) -> np.ndarray:
    """Return a term's mean first Piola-Kirchhoff stress (MPa) at a deformation gradient."""
    body = system.body.domain
    body.unknown.interpolate(lambda x: (F - np.eye(3)) @ x)
    nominal = system.model.term(term).nominal_stress(body)
    measure = body.regions["deep"]
    return np.array([[fem.assemble_scalar(fem.form(nominal[i, j] * measure)) for j in range(3)] for i in range(3)])


@pytest.fixture(scope="module")
def fibrous() -> System:
    return cube(Fibres("deep", SHEAR, EXTENSION))


def test_shear_along_the_fibres_is_resisted_by_the_shear_modulus(fibrous):
    """The fibres slide past each other: I5 - I4^2 = g^2."""
    for g in (0.1, 0.6):
        F = np.eye(3)
        F[2, 0] = g
        found = stress(fibrous, F, "deep.fibres")
        assert found[2, 0] == pytest.approx(SHEAR * g, rel=1e-9)


def test_stretched_fibres_pull_by_young_s_modulus(fibrous):
    for stretch in (0.8, 1.4):
        found = stress(fibrous, np.diag([1.1, 0.9, stretch]), "deep.fibres")
        expected = np.zeros((3, 3))
        expected[2, 2] = EXTENSION / 2 * stretch * (stretch**2 - 1)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_what_happens_across_the_fibres_is_none_of_theirs(fibrous):
    across = np.array([[1.2, 0.4, 0.0], [-0.1, 0.7, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(stress(fibrous, across, "deep.fibres"), 0.0, atol=1e-14)


def test_small_strains_find_the_three_moduli(fibrous):
    """Compliance by inverting the stiffness of both terms; incompressible but for 1 in 10,000."""
    step, rows = 1e-5, []
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    for i, j in pairs:
        strain = np.zeros((3, 3))
        strain[i, j] += 0.5 * step
        strain[j, i] += 0.5 * step
        ends = [
            sum(stress(fibrous, np.eye(3) + sign * strain, term) for term in ("deep", "deep.fibres"))
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        rows.append([slope[k, m] for k, m in pairs])
    stiffness = np.array(rows)
    np.testing.assert_allclose(stiffness, stiffness.T, rtol=1e-5, atol=1e-7)
    compliance = np.linalg.inv(stiffness)
    assert 1 / compliance[2, 2] == pytest.approx(3 * MU_T + EXTENSION, rel=1e-3)
    np.testing.assert_allclose(1 / np.diag(compliance)[3:], [MU_T + SHEAR, MU_T + SHEAR, MU_T], rtol=1e-5)


def test_fibres_along_the_leg_change_nothing_in_plane_strain():
    tissues = one_tissue(1e-3, 28.0)
    meshed = block(np.linspace(-20, 20, 11), np.linspace(-20, 0, 6))
    system = pressed_block(
        "mixed", None, tissues, direction=(0.0, -1.0), meshed=meshed, mechanisms=[Fibres("deep", SHEAR, EXTENSION)]
    )
    body = system.body.domain
    rng = np.random.default_rng(1)
    body.unknown.x.array[:] = 0.1 * rng.normal(size=len(body.unknown.x.array))
    form = fem.form(system.model.term("deep.fibres").residual(body, {}))
    vector = fem.assemble_vector(form).array
    assert np.abs(vector).max() < 1e-15


def test_wrong_numbers_are_told_in_one_line():
    with pytest.raises(InputError, match="unit length"):
        Fibres("deep", axis=(1.0, 1.0, 0.0))
    with pytest.raises(InputError, match="shear"):
        Fibres("deep", shear=-1.0)
    assert Fibres.of_ratio("deep", C10, 3.0).parameters == pytest.approx(
        {"deep.fibres.shear": 2 * MU_T, "deep.fibres.extension": 8 * MU_T}
    )


def test_a_short_cylinder_on_fibrous_muscle_meets_more_force_and_plane_strain_the_same():
    without, fibrous = (solve_case(replace(case_of(ratio, coarse=True), depth=15.0)) for ratio in (1.0, 3.0))
    at = np.array([2.0, 5.0, 10.0, 15.0])
    np.testing.assert_allclose(fibrous.plane(at), without.plane(at), rtol=1e-9)
    rise = fibrous.spatial(at) / without.spatial(at)
    assert (np.diff(rise) > 0).all()
    assert 1.2 < rise[-1] < 1.4
    assert fibrous.balance < 1e-8
