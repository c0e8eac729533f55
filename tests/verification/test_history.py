"""What contact remembers: steps, unloading, lifting off, and a smooth curve."""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import COARSE, block, fixed_steps, press, pressed_block, subject_3

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.mechanics.contact import ContactSettings
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol

WINDOWS = ((0.0, 5.0), (5.0, 20.0), (20.0, 30.0))


def test_unloading_returns_along_loading_and_ends_without_force():
    """Elastic tissue under rough contact: what touched stays where it touched until it lifts."""
    settings = PlaneStrainSettings(mesh=COARSE, steps=fixed_steps(1.0))
    solved = PlaneStrainIndentation(*subject_3(), settings).solve(
        None, Protocol.through((8.0, 6.0, 4.0, 2.0, 1.0, -0.5), rate=1.0)
    )
    at, force = solved.path.displacement, solved.path.force
    top = int(np.argmax(at))
    for depth in (6.0, 4.0, 2.0, 1.0):
        up, down = (np.flatnonzero(np.abs(part - depth) < 1e-9)[0] for part in (at[: top + 1], at[top:]))
        print(depth, force[top + down] / force[up] - 1)
        assert force[top + down] == pytest.approx(force[up], rel=1e-6)
    assert at[-1] == -0.5
    assert force[-1] == 0.0


def test_friction_dissipates():
    """Coulomb friction does not return the work: the second cycle meets the moved anchors."""
    contact = ContactSettings("exponential", "coulomb", onset=0.02, friction=0.1)
    system = pressed_block("mixed", contact, direction=(0.28, -0.96))
    at, force = [0.0], [0.0]

    def record(displacement: float) -> None:
        at.append(displacement)
        force.append(system.force())

    assert press(system, NewtonSolver(system), [1.5, 0.0], fixed_steps(0.1), record).complete
    loop = float(np.trapezoid(force, at))
    work = float(np.trapezoid(np.array(force)[: np.argmax(at) + 1], at[: np.argmax(at) + 1]))
    assert 0.005 * work < loop < 0.5 * work


@pytest.mark.slow
def test_the_anchors_converge_with_the_step():
    """At first order: a point slides freely from its touch to the end of that step."""
    fine = block(np.linspace(-20, 20, 121), np.linspace(-20, 0, 31))
    system = pressed_block("mixed", ContactSettings(onset=0.02), meshed=fine)
    solver, curves = NewtonSolver(system), []
    for size in (1.0, 0.5, 0.25, 0.125):
        force = {}
        press(
            system,
            solver,
            [1.0, 2.0, 3.0],
            fixed_steps(size),
            lambda at, force=force: force.setdefault(round(at, 6), system.force()),
        )
        curves.append([force[at] for at in (1.0, 2.0, 3.0)])
    changes = np.abs(np.diff(curves, axis=0)) / curves[-1]
    orders = np.log2(changes[:-1] / changes[1:])
    print(changes, orders)
    assert 0.9 < orders.mean() < 2.0
    assert (orders > 0.5).all()


@pytest.mark.slow
def test_steps_of_the_default_size_are_small_enough_on_a_leg():
    depths = (3.0, 6.0, 9.0, 12.0)
    curves = []
    for steps in (PlaneStrainSettings().steps, fixed_steps(0.1)):
        test = PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(steps=steps))
        path = test.solve(None, Protocol.through(depths, rate=1.0)).path
        nearest = [np.argmin(np.abs(path.displacement - depth)) for depth in depths]
        curves.append(path.force[nearest])
    change = np.array(curves[0]) / curves[1] - 1
    print("default against 0.1 mm", change)
    assert np.abs(change).max() < 5e-4


@pytest.mark.slow
def test_mean_curvature_is_smooth_under_refinement():
    curves = [
        PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(mesh=mesh)).solve(depth=30.0).curve
        for mesh in (SectionMeshSettings(), SectionMeshSettings().refined(1.5))
    ]
    for window in WINDOWS:
        default, finer = (curve.mean_curvature(*window) for curve in curves)
        print(window, default, finer, finer / default - 1)
        assert finer == pytest.approx(default, rel=0.02)


@pytest.mark.slow
def test_the_default_mesh_is_within_half_a_percent_of_a_finer_one():
    depths = np.arange(2.0, 30.01, 0.5)
    forces = [
        PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(mesh=mesh)).solve().curve(depths)
        for mesh in (SectionMeshSettings(), SectionMeshSettings().refined(2.0))
    ]
    change = forces[1] / forces[0] - 1
    print("largest change", np.abs(change).max())
    assert np.abs(change).max() < 5e-3
