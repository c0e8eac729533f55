"""Manufactured solution at finite strain: the orders of convergence that the elements promise.

The body force that makes a chosen displacement the solution is -Div P, with P derived by hand and
its divergence taken by complex steps: nothing of it is legfem's.
"""

from __future__ import annotations

from itertools import pairwise

import basix
import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import fem, la
from making_mechanics import boundary_pinned, free_of_contact, one_tissue, solid, solve_with_boundary

from legfem.fem.system import System
from legfem.mechanics.terms import PressureStabilisation

C10, D1, C20 = 1e-3, 60.0, 0.5e-3
AMPLITUDE = 0.08


def _displacement(x: np.ndarray) -> np.ndarray:
    s, t = np.pi * x[..., 0], np.pi * x[..., 1]
    return AMPLITUDE * np.stack([np.sin(s) * np.cos(t + 0.3), np.cos(s) * np.sin(2 * t)], axis=-1)


def _gradient(x: np.ndarray) -> np.ndarray:
    s, t = np.pi * x[..., 0], np.pi * x[..., 1]
    rows = [
        [np.cos(s) * np.cos(t + 0.3), -np.sin(s) * np.sin(t + 0.3)],
        [-np.sin(s) * np.sin(2 * t), 2 * np.cos(s) * np.cos(2 * t)],
    ]
    return np.pi * AMPLITUDE * np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _stress(x: np.ndarray) -> np.ndarray:
    """The first Piola-Kirchhoff stress in the plane, (..., 2, 2), also for complex x."""
    F = np.eye(2) + _gradient(x)
    J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    cofactor = np.stack(
        [np.stack([F[..., 1, 1], -F[..., 1, 0]], axis=-1), np.stack([-F[..., 0, 1], F[..., 0, 0]], axis=-1)], axis=-2
    )
    I1 = (F**2).sum(axis=(-2, -1)) + 1
    slope = C10 + 2 * C20 * (J ** (-2 / 3) * I1 - 3)
    isochoric = F - (I1 / 3 / J)[..., None, None] * cofactor
    pressure = 2 * (J - 1) / D1
    return (2 * slope * J ** (-2 / 3))[..., None, None] * isochoric + pressure[..., None, None] * cofactor


def _body_force(x: np.ndarray) -> np.ndarray:
    step = 1e-30
    along = [_stress(x + 1j * step * np.eye(2)[axis])[..., axis].imag / step for axis in range(2)]
    return -(along[0] + along[1])


class LoadedSystem(System):
    """A system under a dead body force."""

    def load(self, force, degree: int = 6) -> None:
        mesh = self.spaces.mesh
        element = basix.ufl.quadrature_element("triangle", value_shape=(2,), degree=degree)
        density = fem.Function(fem.functionspace(mesh, element))
        points = fem.Expression(ufl.SpatialCoordinate(mesh), element.custom_quadrature()[0])
        cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        at = np.asarray(points.eval(mesh, cells)).reshape(-1, 2)
        density.x.array[:] = force(at).ravel()
        dx = ufl.dx(domain=mesh, metadata={"quadrature_degree": degree})
        work = fem.form(ufl.dot(density, self.body.domain.variation) * dx)
        self._load = fem.assemble_vector(work)
        self._load.scatter_reverse(la.InsertMode.add)

    def assemble_residual(self):
        residual = super().assemble_residual()
        residual.x.array[:] -= self._load.array
        residual.x.array[self.spaces.pinned] = 0.0
        return residual


def _solved(formulation: str, n: int, degree: int = 2) -> LoadedSystem:
    edges = np.linspace(0, 1, n + 1)
    skew = 0.06

    def skewed(p: np.ndarray) -> np.ndarray:
        wave = np.sin(np.pi * p[:, :1]) * np.sin(np.pi * p[:, 1:])
        return p + skew * wave * [1.0, -0.7]

    meshed = solid(
        edges, edges, skin=lambda m: np.isclose(m[:, 1], 1), bone=lambda m: np.isclose(m[:, 1], 0), form=skewed
    )
    tissues = one_tissue(C10, D1, C20)
    stabilised = [PressureStabilisation("deep", tissues.deep)] if degree == 1 else []
    free = free_of_contact(meshed, tissues, formulation, stabilised, degree)
    system = LoadedSystem(boundary_pinned(free.spaces), free.model, np.array([0.0, 1e3]), free.direction)
    system.load(_body_force)
    outcome = solve_with_boundary(system, lambda x, share: share * _displacement(x))
    assert outcome.converged, outcome
    return system


def _errors(system: LoadedSystem) -> dict[str, float]:
    """Return the errors in L2, and in H1's seminorm, by quadrature of high degree."""
    mesh = system.spaces.mesh
    points, weights = basix.make_quadrature(basix.CellType.triangle, 8)
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    domain = system.body.domain
    volume = ufl.JacobianDeterminant(mesh)
    size = abs(np.asarray(fem.Expression(volume, points).eval(mesh, cells)).reshape(-1))
    measure = np.tile(weights, len(cells)) * size

    def values(expression, shape):
        return np.asarray(fem.Expression(expression, points).eval(mesh, cells)).reshape(-1, *shape)

    x = values(ufl.SpatialCoordinate(mesh), (2,))
    u = values(domain.displacement, (2,)) - _displacement(x)
    slope = values(ufl.grad(domain.displacement), (2, 2)) - _gradient(x)
    errors = {"L2": np.sqrt(measure @ (u**2).sum(axis=1)), "H1": np.sqrt(measure @ (slope**2).sum(axis=(1, 2)))}
    if "deep" in domain.pressures:
        exact = 2 * (np.linalg.det(np.eye(2) + _gradient(x)) - 1) / D1
        errors["pressure"] = np.sqrt(measure @ (values(domain.pressures["deep"], ()) - exact) ** 2)
    return errors


@pytest.mark.parametrize(
    "formulation, degree, coarser, promised",
    [
        ("displacement", 2, 16, {"L2": 3.0, "H1": 2.0}),
        ("mixed", 2, 16, {"L2": 3.0, "H1": 2.0, "pressure": 2.0}),
        pytest.param("continuous", 2, 32, {"L2": 3.0, "H1": 2.0, "pressure": 2.0}, marks=pytest.mark.slow),
        # Of pressures with linear displacements, order 1 is promised.
        ("continuous", 1, 64, {"L2": 2.0, "H1": 1.0, "pressure": 2.0}),
    ],
)
def test_orders_of_convergence(formulation, degree, coarser, promised):
    coarse, fine = (_errors(_solved(formulation, n, degree)) for n in (coarser, 2 * coarser))
    for norm, order in promised.items():
        assert np.log2(coarse[norm] / fine[norm]) == pytest.approx(order, abs=0.1), norm


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["displacement", "mixed"])
def test_orders_on_finer_meshes(formulation):
    sizes = [16, 32, 64]
    errors = [_errors(_solved(formulation, n)) for n in sizes]
    for norm in errors[0]:
        measured = np.log2([a[norm] / b[norm] for a, b in pairwise(errors)])
        order = 3.0 if norm == "L2" else 2.0
        print(formulation, norm, measured)
        np.testing.assert_allclose(measured, order, atol=0.1)
