"""The dermis against closed forms of a stretched sheet, and what every mechanism has to hold."""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem, mesh
from making_derivatives import forces, taylor_orders, worst_error
from making_mechanics import block, fixed_steps, one_tissue, pressed_block, ring
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.model import LegModel
from legfem.mechanics.terms import SkinPressure, Tissue
from legfem.mechanics.terms.membranes import Dermis
from legfem.meshing.section import BONE, DEEP, SKIN
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.stepping import follow

TISSUES = one_tissue(1e-3, 28.0, C20=0.5e-3)
SMALL = block(np.linspace(-20, 20, 11), np.linspace(-20, 0, 6))
CYCLE = Protocol.through((2.0, 0.5), rate=1.0)
STIFFNESS = 0.03
"""N/mm."""


def pressed(*mechanisms: Dermis) -> System:
    return pressed_block("mixed", None, TISSUES, direction=(0.28, -0.96), meshed=SMALL, mechanisms=mechanisms)


def sheet(meshed: tuple, symmetry: str, regions: dict[str, int], *more: SkinPressure) -> System:
    """A dermis on a solid's skin; the solid is a neo-Hookean one without contact."""
    spaces = build_spaces(*meshed, "displacement", 1, regions, symmetry=symmetry)
    model = LegModel((Tissue("deep", NeoHookean(1e-3, 5.0)), Dermis(STIFFNESS), *more))
    return System(spaces, model)


def stretched(system: System, stretches: tuple[float, ...]) -> None:
    """Move every point of the skin by its coordinates times the stretches less one."""
    by = np.array(stretches)[:, None] - 1
    system.skin.domain.unknown.interpolate(lambda x: by * x[: len(by)])


def energy(system: System) -> float:
    """Return the dermis' energy (N mm, in a section N)."""
    skin = system.skin.domain
    return float(fem.assemble_scalar(fem.form(Dermis().energy_density(skin) * skin.measure)))


def cube() -> tuple:
    """A unit cube with its skin above."""
    made = mesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 2)
    top = mesh.locate_entities_boundary(made, 2, lambda x: np.isclose(x[2], 1))
    low = mesh.locate_entities_boundary(made, 2, lambda x: np.isclose(x[2], 0))
    facets, tags = np.concatenate([top, low]), np.repeat([SKIN, BONE], [len(top), len(low)])
    order = np.argsort(facets)
    cells = np.arange(made.topology.index_map(3).size_local, dtype=np.int32)
    return (
        made,
        mesh.meshtags(made, 3, cells, np.full(len(cells), DEEP, dtype=np.int32)),
        mesh.meshtags(made, 2, facets[order], tags[order].astype(np.int32)),
    )


def unit(x: float, y: float) -> tuple:
    """A square with its skin above."""
    return block(np.linspace(0, x, 5), np.linspace(0, y, 5))


@pytest.mark.parametrize(
    ("meshed", "symmetry", "stretches", "area", "around"),
    [
        (unit(3.0, 2.0), "plane", (1.2, 1.0), 3.0, (1.2, 1.0)),
        (unit(3.0, 2.0), "axial", (1.2, 1.0), np.pi * 9, (1.2, 1.2)),
        (cube(), "plane", (1.2, 0.9, 1.0), 1.0, (1.2, 0.9)),
    ],
    ids=["strip", "disc", "sheet in 3D"],
)
def test_energy_is_that_of_a_stretched_sheet(meshed, symmetry, stretches, area, around):
    system = sheet(meshed, symmetry, {"deep": DEEP})
    stretched(system, stretches)
    first, second = around
    expected = first**2 + second**2 + 1 / (first * second) ** 2 - 3
    assert energy(system) == pytest.approx(0.5 * STIFFNESS * expected * area, rel=1e-12)


def test_a_stretched_strip_bears_the_tension_of_the_closed_form():
    system = sheet(unit(3.0, 2.0), "plane", {"deep": DEEP})
    stretched(system, (1.2, 1.0))
    skin = system.skin.domain
    work = fem.assemble_vector(fem.form(Dermis().residual(skin, {}))).array.reshape(-1, 2)
    x = skin.unknown.function_space.tabulate_dof_coordinates()[:, 0]
    ends = work[np.argsort(x)[[0, -1]], 0]
    tension = STIFFNESS * (1.2 - 1.2**-3)
    np.testing.assert_allclose(ends, [-tension, tension], rtol=1e-12)
    assert np.abs(np.sort(x) - np.linspace(0, 3, 5)).max() < 1e-12
    np.testing.assert_allclose(np.sort(np.abs(work[:, 0]))[:-2], 0.0, atol=1e-15)


def test_a_pressed_ring_obeys_laplace():
    """Pressure times radius is the tension: the nodal forces of both cancel on a widened ring."""
    system = sheet(ring(10.0, 12.0, 120, 2), "plane", {"deep": DEEP}, SkinPressure())
    widened = 1.15
    stretched(system, (widened, widened))
    skin = system.skin.domain
    points = skin.unknown.function_space.tabulate_dof_coordinates()[:, :2]
    radius = widened * np.linalg.norm(points, axis=1).mean()
    system.set_time(1.0, 1.0)

    def radial(pressure: float) -> np.ndarray:
        system.applied_pressure.x.array[:] = pressure
        force = fem.assemble_vector(system.skin.residual).array.reshape(-1, 2)
        return np.sum(force * points, axis=1) / np.linalg.norm(points, axis=1)

    tension = STIFFNESS * (widened - widened**-3)
    scale = np.abs(radial(0.0)).max()
    assert scale == pytest.approx(2 * np.pi / 120 * tension, rel=1e-3)
    assert np.abs(radial(-tension / radius)).max() < 1e-3 * scale


def test_it_vanishes_at_its_null_and_is_felt_beyond():
    base, system = pressed(), pressed(Dermis())
    without = forces(base, base.model.parameters, CYCLE, 0.5)
    null = forces(system, system.model.parameters, CYCLE, 0.5)
    np.testing.assert_allclose(null, without, rtol=1e-10, atol=1e-14)
    felt = forces(system, {**system.model.parameters, "dermis.stiffness": STIFFNESS}, CYCLE, 0.5)
    print(felt.max() / without.max() - 1)
    assert felt.max() > 1.01 * without.max()


def test_the_tangent_is_the_residual_s_derivative():
    system = pressed(Dermis(STIFFNESS))
    ramp = Protocol.ramp(1.5, rate=1.0)
    system.set_parameters(system.model.parameters)
    assert follow(system, NewtonSolver(system), ramp, fixed_steps(0.5)).complete
    system.set_displacement(1.9)
    np.testing.assert_allclose(taylor_orders(system), 2.0, atol=0.05)


@pytest.mark.parametrize("stiffness", [0.0, STIFFNESS])
def test_the_force_s_derivative_is_exact_at_the_null_and_beyond(stiffness):
    system = pressed(Dermis())
    values = {**system.model.parameters, "dermis.stiffness": stiffness}
    assert worst_error(system, values, ["dermis.stiffness"], CYCLE, 0.25, 4e-6) < 1e-5


def test_a_negative_stiffness_is_refused():
    with pytest.raises(InputError, match="stiffness"):
        Dermis(-0.1)
