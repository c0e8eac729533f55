"""The leg in 3D by a second code: felupe's hexahedra with a contact of their own."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.experiments.indenter_pose import Cylinder
from legfem.legs.loading import load_subject
from legfem.solve.path import ForceCurve
from studies.leg3d import other_code
from studies.leg3d.fascia import SHOWN, layer
from studies.leg3d.other_code import OtherLeg, PlantedByFelupe, nearness
from studies.leg3d.planted import CYLINDER, LEG, TRIALS, Planted


@pytest.fixture(scope="module")
def coarse():
    leg = OtherLeg(Planted(), finer=0.3)
    return leg, leg.solve(0.6, 0.3)


def off_surface(cylinder: Cylinder, distance: float) -> np.ndarray:
    """Return points so far off a cylinder's side, its rounded edge and its end."""
    edge, far = cylinder.edge_radius, cylinder.edge_radius + distance
    turn = np.linspace(0.1, 6.0, 7)
    slant = np.array([0.0, 0.3, 0.8, 1.3, np.pi / 2])[:, None]
    s = cylinder.radius - edge + far * np.cos(slant) - 0.2 * (slant == np.pi / 2)
    z = cylinder.length / 2 - edge + far * np.sin(slant) - 0.2 * (slant == 0.0)
    ring = [s * np.cos(turn), s * np.sin(turn), z + 0 * turn]
    return np.stack(np.broadcast_arrays(*ring), axis=-1)


@pytest.mark.parametrize("distance", [-1.0, 0.5])
def test_points_off_a_cylinder_with_rounded_edges_are_as_far_from_it_as_they_were_put(distance):
    y = off_surface(CYLINDER, distance)
    near = nearness(CYLINDER, y)
    np.testing.assert_allclose(near.gap, distance, atol=1e-12)
    below = y * np.array([1.0, 1.0, -1.0])
    np.testing.assert_allclose(nearness(CYLINDER, below).gap, distance, atol=1e-12)
    np.testing.assert_allclose(nearness(CYLINDER, y - distance * near.normal).gap, 0, atol=1e-12)
    for k, by in enumerate(1e-6 * np.eye(3)):
        over, under = nearness(CYLINDER, y + by), nearness(CYLINDER, y - by)
        np.testing.assert_allclose((over.gap - under.gap) / 2e-6, near.normal[..., k], atol=1e-7)
        change = (over.normal - under.normal) / 2e-6
        # At the corners' ends the second derivative jumps.
        np.testing.assert_allclose(change[1:-1], near.bend[1:-1, ..., k], atol=1e-6)


def test_the_contacts_tangent_is_the_derivative_of_its_force(coarse):
    leg, _ = coarse
    generator = np.random.default_rng(2)
    before = leg._untouched()
    before.anchor[:] = before.place + 0.01 * generator.normal(size=before.place.shape)
    u, way = generator.normal(size=(2, leg.mesh.points.size))
    at = [leg._contact(1e-3 * u + by * way, 0.8, before) for by in (-1e-7, 0.0, 1e-7)]
    slope = at[1][1] @ way
    assert np.abs(slope).max() > 1
    np.testing.assert_allclose((at[0][0] - at[2][0]) / 2e-7, slope, atol=1e-6 * np.abs(slope).max())


def test_the_mesh_has_the_legs_skin_and_layers():
    mesh = OtherLeg(Planted(), finer=0.5).mesh
    assert 4 * mesh.skin_weights.sum() == pytest.approx(2 * np.pi * LEG.radius * LEG.length, 1e-3)
    assert set(mesh.cells) == {"deep", "fascia", "superficial"}
    radii = np.hypot(*mesh.points[np.unique(mesh.cells["fascia"]), :2].T)
    assert radii.min() == pytest.approx(30.4) and radii.max() == pytest.approx(31.0)


def test_the_bone_bears_what_the_cylinder_presses_with(coarse):
    leg, curve = coarse
    assert curve.reached and curve.force[-1] > 2 * curve.force[1] > 0
    inner = leg._tissue(curve.moved)[0].reshape(-1, 3)
    on_bone = np.hypot(*leg.mesh.points[:, :2].T) < LEG.bone_radius + 1e-6
    pressed = curve.force[-1] / leg.whole
    assert inner[on_bone, 1].sum() == pytest.approx(-pressed, rel=1e-4)


def test_fibres_along_the_leg_stiffen_it_under_the_second_codes_cylinder_too(coarse):
    fibrous = OtherLeg(Planted(fibres=3.0), finer=0.3).solve(0.6, 0.3)
    assert fibrous.reached
    # At 2 mm, of a table's leg of ratio 2.5: 1.107.
    assert 1.02 < fibrous.force[-1] / coarse[1].force[-1] < 1.107


def test_what_felupe_records_is_kept_and_written_beside_what_legfem_does(tmp_path, monkeypatch):
    curve = ForceCurve(np.linspace(0, 7, 8), np.linspace(0, 3, 8) ** 1.5)
    monkeypatch.setattr(other_code, "other_curve", lambda planted, kept: curve)
    planted = PlantedByFelupe(1.2)
    assert planted.name != Planted(1.2).name
    folder = planted.written(tmp_path / planted.name, 1, tmp_path / "planted")
    subject = load_subject(folder)
    assert subject.origin == "simulated" and len(subject.recordings) == TRIALS
    assert subject.recordings[0].force.max() == pytest.approx(curve.force[-1], rel=0.1)


@pytest.mark.slow
def test_two_codes_hexahedra_press_a_leg_with_one_force_within_one_percent():
    other, own = OtherLeg(Planted()).solve(SHOWN[-1]), layer(finer=1.5).solve(depth=SHOWN[-1])
    assert other.reached
    # Before, legfem's flat facets, 0.02 mm within the round skin, count for more.
    deep = other.displacement > 2.9
    expected = own.curve(other.displacement[deep])
    np.testing.assert_allclose(other.force[deep], expected, rtol=0.01)
