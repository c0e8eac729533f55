"""Values on triangulated surfaces."""

from __future__ import annotations

import numpy as np

from legfem.geometry.leg_shape import TriangleSurface, tube


def _tube(levels: int = 9, around: int = 40) -> TriangleSurface:
    t, z = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, 30, levels))
    points = np.stack([20 * np.cos(t), 20 * np.sin(t), z], axis=-1).reshape(-1, 3)
    return TriangleSurface(points, tube(levels, around))


def test_a_closed_tube_has_outward_triangles_of_its_area():
    surface = _tube(around=200)
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    np.testing.assert_allclose(0.5 * np.linalg.norm(normal, axis=1).sum(), 2 * np.pi * 20 * 30, rtol=1e-3)
    assert (np.einsum("ij,ij->i", normal[:, :2], (a + b + c)[:, :2]) > 0).all()


def test_linear_fields_are_exact_at_points_of_the_surface():
    surface = _tube()
    rng = np.random.default_rng(1)
    chosen = surface.points[surface.triangles[rng.integers(0, len(surface.triangles), 50)]]
    points = np.einsum("kc,kcx->kx", rng.dirichlet([1, 1, 1], 50), chosen)
    values = surface.weights(points) @ surface.points
    np.testing.assert_allclose(values, points, atol=1e-9)


def test_points_off_the_surface_take_the_nearest_point_s_value():
    surface = _tube()
    weights = surface.weights(np.array([[30.0, 0.0, 15.0], [20.0, 0.0, 33.0], [20.0, 0.0, -9.0]]))
    nearest = weights @ surface.points
    np.testing.assert_allclose(nearest, [[20, 0, 15], [20, 0, 30], [20, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
